"""The table of outcomes by package: printed, and kept for the site in `notebooks/site/library_results.toml`."""

import datetime
import json
import statistics
import tomllib
from collections.abc import Iterable, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from tests.library_results.example import LEFT, NO_REFERENCE, NOT_RUN, PASSED, RAN, REFUSED, Outcome
from tests.library_results.references import Reference

KEPT = Path(__file__).parents[2] / "notebooks" / "site" / "library_results.toml"
WORDS = (PASSED, LEFT, REFUSED, NOT_RUN, NO_REFERENCE, RAN)
HEAD = (
    "# Written by `make library-results`: what became of the examples of the Modelica library, by package.\n"
)


def by_package(found: Mapping[Reference, Outcome]) -> dict[str, list[Outcome]]:
    """Package -> outcomes of its examples."""
    packages: dict[str, list[Outcome]] = {}
    for reference, outcome in found.items():
        packages.setdefault(reference.package, []).append(outcome)
    return packages


def print_summary(found: Mapping[Reference, Outcome]) -> None:
    """A row for each package: counts of the words, and medians of the processor time of those that passed."""
    shown = Table("package", "of", *WORDS, "translate, s", "simulate, s")
    for package, outcomes in by_package(found).items():
        held = [one for one in outcomes if one.word in (PASSED, RAN)]
        counts = (str(sum(one.word == word for one in outcomes)) for word in WORDS)
        times = (_median(one.translate for one in held), _median(one.simulate for one in held))
        shown.add_row(package, str(len(outcomes)), *counts, *times)
    Console(width=120).print(shown)


def _median(seconds: Iterable[float]) -> str:
    values = list(seconds)
    return f"{statistics.median(values):.3g}" if values else ""


def write_summary(
    found: Mapping[Reference, Outcome], versions: Mapping[str, str], sources: str, kept: Path = KEPT
) -> None:
    """The packages in the file of the site anew; those that were not run stay."""
    tables: list[dict[str, Any]] = []
    if kept.is_file():
        tables = tomllib.loads(kept.read_text(encoding="utf-8")).get("package", [])
    packages = {table["name"]: table for table in tables}
    for package, outcomes in by_package(found).items():
        packages[package] = {
            "name": package,
            "date": datetime.date.today().isoformat(),
            "library": versions.get(package.partition(".")[0], ""),
            "sources": sources,
            "gantrytau": version("gantrytau"),
            "casadi": version("casadi"),
            "example": [_row(one) for one in outcomes],
        }
    text = HEAD
    for name in sorted(packages):
        table = dict(packages[name])
        examples = table.pop("example")
        text += "\n[[package]]\n" + "".join(f"{key} = {json.dumps(value)}\n" for key, value in table.items())
        rows = [", ".join(f"{key} = {json.dumps(value)}" for key, value in row.items()) for row in examples]
        text += "example = [\n" + "".join(f"  {{ {row} }},\n" for row in rows) + "]\n"
    kept.write_text(text, encoding="utf-8")


def _row(one: Outcome) -> dict[str, Any]:
    row = {"name": one.name, "word": one.word, "detail": one.detail}
    return {**row, "translate": one.translate, "simulate": one.simulate}
