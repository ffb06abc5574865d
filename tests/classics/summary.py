"""The tables of classics: printed, and kept for the site in `notebooks/site/classics.toml`."""

import datetime
import json
import tomllib
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from tests.classics.row import Row

KEPT = Path(__file__).parents[2] / "notebooks" / "site" / "classics.toml"
HEAD = "# Written by `make classics`: what became of the problems by which the fields judge themselves, by family.\n"
PACKAGES = ("gantrytau", "casadi", "scipy", "scikit-sundae", "rockit-meco", "exudyn")


def print_family(family: str, rows: Mapping[str, Row]) -> None:
    """A table of what a family measured."""
    columns = list(dict.fromkeys(column for row in rows.values() for column in row))
    shown = Table("problem", *columns, title=family)
    for name, row in rows.items():
        shown.add_row(name, *(str(row.get(column, "")) for column in columns))
    Console(width=220).print(shown)


def write_families(found: Mapping[str, Mapping[str, Row]], kept: Path = KEPT) -> None:
    """The families in the file of the site anew; what was not run stays, with its date."""
    families: dict[str, dict[str, Any]] = {}
    if kept.is_file():
        families = tomllib.loads(kept.read_text(encoding="utf-8"))
    for family, rows in found.items():
        for name, row in rows.items():
            families.setdefault(family, {})[name] = {
                **row,
                "date": datetime.date.today().isoformat(),
                "with": _versions(),
            }
    text = HEAD
    for family, rows in families.items():
        text += f"\n[{family}]\n"
        text += "".join(
            f"{name} = {{ {', '.join(f'{key} = {json.dumps(value)}' for key, value in row.items())} }}\n"
            for name, row in rows.items()
        )
    kept.write_text(text, encoding="utf-8")


def _versions() -> str:
    found = []
    for name in PACKAGES:
        try:
            found.append(f"{name} {version(name)}")
        except ModuleNotFoundError:
            continue
    return ", ".join(found)
