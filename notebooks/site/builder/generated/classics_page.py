"""The page of the classics: the problems by which the fields judge themselves, from `classics.toml`."""

import tomllib
from collections.abc import Mapping
from typing import Any

from notebooks.site.builder.generated.component_tables import table
from notebooks.site.builder.places import SOURCES
from notebooks.site.builder.reading.docstrings import escaped

SMALL = 1e-2  # below which a number is told by its power of ten
OPENING = """# The classics

Published problems by which each field judges its programs, written in the words of this toolkit and run by `make classics`,
which also writes this page: `make classics ONLY=Hires` runs one anew, `ONLY=initial_values` a family. Lines are those of the
model without docstrings, comments and tables of data. Times are processor time of one run, of which small ones vary.
**Not held** marks what misses the aim that its section states.
"""
FAMILIES = {  # family -> heading, what is compared, columns: key -> heading
    "initial_values": (
        "Initial value and differential-algebraic problems",
        """Test set for IVP solvers (Mazzia and Magherini, University of Bari), from equations as printed, the
squeezer from components. All run with `tolerance=1e-10` and are compared at the end of the run with the values that
the test set prints. Digits are minus the decimal logarithm of the worst error of all variables: *mixed* by 1 + its
size, *own* by its size alone (mescd and scd of the test set). Wanted are 8 mixed digits. A step of the integrator
gets a hundredth or less of the tolerance of the result, whereas SciPy's Radau and IDA of scikit-SUNDAE apply their
`rtol=1e-10` to each step. These two integrate the same equations, with the index reduced by the toolkit and the
Jacobian by CasADi, as callbacks in Python, for 20 s at most.""",
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
    "mechanisms": (
        "Mechanisms from components",
        """IFToMM benchmark library (M. Gonzalez, D. Dopico, U. Lugris, J. Cuadrado, 2006), problems A01 to A05; A03
with the start of the test set above. Each is simulated from components and compared at 201 instants with its motion
by other equations and another integrator: in closed form (A01), as one pendulum (A02, 40 windows), by its energy
(A03), along the null vector of its loop (A04), by Lagrange's equations (A05). The library allows 1e-3 m. Energy is
relative to the largest kinetic energy. The column of exudyn has the error, m, of the first of its runs, each with four
times the steps, that holds 1e-3 m or takes a minute, and its processor time.""",
        {
            "bodies": "bodies",
            "lines": "lines",
            "stop": "time, s",
            "tolerance": "tolerance",
            "error": "error, m",
            "drift": "energy",
            "steps": "steps",
            "translate": "translate, s",
            "simulate": "simulate, s",
            "exudyn": "exudyn",
        },
    ),
    "optimal_control": (
        "Optimal control",
        """Problems of COPS 3, Betts, dymos and PSOPT with the data of their sources, solved as they are declared: no
guess but the start values of the models, 50 elements, all defaults. Wanted is the converged objective within 1e-4.
Converged: closed forms, or collocation on 200 to 800 elements by a program of its own. Printed objectives differ from
these where they are of a coarse mesh. Rockit (last table): direct collocation on 50 elements of three points, inputs
constant in each element, the same Ipopt.""",
        {
            "source": "source",
            "lines": "lines",
            "objective": "objective",
            "converged": "converged",
            "error": "error",
            "printed": "printed",
            "iterations": "iterations",
            "seconds": "build and solve, s",
        },
    ),
    "estimation": (
        "Parameter estimation",
        """Sums of squares of COPS 3 (Dolan, More and Munson, 2004), problems 3 to 5, with all defaults and the
starting values of the source, against least squares over another integrator. Wanted is the same sum within 1e-4.""",
        {
            "source": "source",
            "lines": "lines",
            "objective": "sum of squares",
            "converged": "other integrator",
            "error": "error",
            "printed": "printed",
            "iterations": "iterations",
            "seconds": "build and solve, s",
        },
    ),
}


def classics_page() -> str:
    """The page in Markdown."""
    families = tomllib.loads((SOURCES / "classics.toml").read_text(encoding="utf-8"))
    text = OPENING
    for family, (heading, opening, columns) in FAMILIES.items():
        rows = families.get(family, {})
        if not rows:
            continue
        cells = [
            (_name(name, row), *(_cell(row.get(key, "")) for key in columns)) for name, row in rows.items()
        ]
        text += f"\n## {heading}\n\n{opening}\n\n{table('', ('problem', *columns.values()), cells)}\n\n"
        peers = [
            (f"`{name}`", row["objective"], row["converged"], row["rockit"])
            for name, row in rows.items()
            if row.get("rockit")
        ]
        if peers:
            text += f"{table('', ('problem', 'objective', 'converged', 'rockit'), peers)}\n\n"
        text += "".join(f"- `{name}`: {told}\n" for name, row in rows.items() if (told := _remark(row)))
        text += "".join(f"\nRun on {date} with {packages}.\n" for date, packages in _runs(rows))
    return text


def _name(name: str, row: Mapping[str, Any]) -> str:
    return f"`{name}`" if row["held"] else f"`{name}`, **not held**"


def _cell(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.1e}" if 0 < abs(value) < SMALL else f"{value:.4g}"
    return escaped(str(value))


def _remark(row: Mapping[str, Any]) -> str:
    return escaped(str(row.get("failure", "") or row.get("note", "")))


def _runs(rows: Mapping[str, Mapping[str, Any]]) -> list[tuple[str, str]]:
    return sorted({(row["date"], row["with"]) for row in rows.values()})
