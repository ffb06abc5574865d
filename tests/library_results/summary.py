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
    tables = _tables(kept)
    for package, outcomes in by_package(found).items():
        tables["package"][package] = {
            "name": package,
            "date": datetime.date.today().isoformat(),
            "library": versions.get(package.partition(".")[0], ""),
            "sources": sources,
            "gantrytau": version("gantrytau"),
            "casadi": version("casadi"),
            "example": [_row(one) for one in outcomes],
        }
    _write(tables, kept)


def write_peer(name: str, peer: str, outcomes: Iterable[Outcome], kept: Path = KEPT) -> None:
    """The sample that another program of the name and version simulated, in the file of the site."""
    tables = _tables(kept)
    date = datetime.date.today().isoformat()
    tables["peer"][name] = {
        "name": name,
        "date": date,
        "version": peer,
        "example": [_row(one) for one in outcomes],
    }
    _write(tables, kept)


def _tables(kept: Path) -> dict[str, dict[str, dict[str, Any]]]:
    """Kind -> name -> table of the file."""
    read = tomllib.loads(kept.read_text(encoding="utf-8")) if kept.is_file() else {}
    return {kind: {table["name"]: table for table in read.get(kind, [])} for kind in ("package", "peer")}


def _write(tables: Mapping[str, Mapping[str, Mapping[str, Any]]], kept: Path) -> None:
    text = HEAD
    for kind, name in ((kind, name) for kind, named in tables.items() for name in sorted(named)):
        table = dict(tables[kind][name])
        examples = table.pop("example")
        text += f"\n[[{kind}]]\n" + "".join(f"{key} = {json.dumps(value)}\n" for key, value in table.items())
        rows = [", ".join(f"{key} = {json.dumps(value)}" for key, value in row.items()) for row in examples]
        text += "example = [\n" + "".join(f"  {{ {row} }},\n" for row in rows) + "]\n"
    kept.write_text(text, encoding="utf-8")


def _row(one: Outcome) -> dict[str, Any]:
    row = {"name": one.name, "word": one.word, "detail": one.detail}
    return {**row, "translate": one.translate, "simulate": one.simulate}
