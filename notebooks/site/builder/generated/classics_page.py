"""The page of the classics: the problems by which the fields judge themselves, from `classics.toml`."""

import tomllib
from collections.abc import Mapping
from typing import Any

from notebooks.site.builder.generated.component_tables import table
from notebooks.site.builder.places import SOURCES
from notebooks.site.builder.reading.docstrings import escaped

OPENING = """# The classics

Published problems by which each field judges its programs, written in the words of this toolkit and run by `make classics`,
which also writes this page: `make classics ONLY=Hires` runs one anew, `ONLY=initial_values` a family. Lines are those of the
model without docstrings, comments and tables of data. Times are processor time of one run, from which small ones vary.
"""
FAMILIES = {  # family -> heading, what is compared, columns: key -> heading
    "initial_values": (
        "Initial value and differential-algebraic problems",
        """Test set for IVP solvers (Mazzia and Magherini, University of Bari), from equations as printed, the squeezer from
components. All run with `tolerance=1e-10` and are compared at the end of the run with the values that the test set prints.
Digits are minus the decimal logarithm of the worst error of all variables: *mixed* by 1 + its size, *own* by its size alone
(mescd and scd of the test set). Wanted are 8 mixed digits. A step of the integrator gets a hundredth or less of the
tolerance of the result, whereas SciPy's Radau and IDA of scikit-SUNDAE apply their `rtol=1e-10` to each step. These two
integrate the same equations, with the index reduced by the toolkit and the Jacobian by CasADi, as callbacks in Python, for
20 s at most.""",
        {
            "equations": "equations",
            "lines": "lines",
            "mescd": "mixed digits",
            "scd": "own digits",
            "steps": "steps",
            "translate": "translate, s",
            "simulate": "simulate, s",
            "radau": "Radau, digits",
            "ida": "IDA, digits",
        },
    ),
}


def classics_page() -> str:
    """The page in Markdown."""
    families = tomllib.loads((SOURCES / "classics.toml").read_text(encoding="utf-8"))
    text = OPENING
    for family, (heading, opening, columns) in FAMILIES.items():
        rows = families.get(family, {})
        cells = [
            (_name(name, row), *(_cell(row.get(key, "")) for key in columns), _remark(row))
            for name, row in rows.items()
        ]
        text += (
            f"\n## {heading}\n\n{opening}\n\n{table('', ('problem', *columns.values(), 'remark'), cells)}\n"
        )
        text += "".join(f"\nRun on {date} with {packages}.\n" for date, packages in _runs(rows))
    return text


def _name(name: str, row: Mapping[str, Any]) -> str:
    return f"`{name}`" if row["held"] else f"`{name}`, **not held**"


def _cell(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else escaped(str(value))


def _remark(row: Mapping[str, Any]) -> str:
    return escaped(str(row.get("failure", "") or row.get("note", "")))


def _runs(rows: Mapping[str, Mapping[str, Any]]) -> list[tuple[str, str]]:
    return sorted({(row["date"], row["with"]) for row in rows.values()})
