"""How `gantrytau optimize` and `pareto` are to solve: mesh, solver, first guesses."""

from pathlib import Path
from typing import Annotated, Any

import typer

MESH, SOLVER, GUESSES = "Mesh", "Solver", "First guesses"  # headings of the help
NAMES = {"parameters": "--set"}


def _option(words: str, panel: str, **more: Any) -> Any:
    return typer.Option(help=words, rich_help_panel=panel, **more)


OPTIONS = dict(
    elements=_option("Elements of the mesh.", MESH),
    points=_option("Collocation points in each element.", MESH),
    scheme=_option("Kind of points.", MESH),
    tolerance=_option("Of the solver.", SOLVER),
    max_iterations=_option("After which the solver gives up.", SOLVER),
    max_time=_option("In s, of the whole work: what was found until then is kept.", SOLVER),
)
REFINE = _option("Relative accuracy to refine the mesh to.", MESH, show_default=False)
COMPILE = _option("Whether large functions become machine code, kept for later solves.", SOLVER)
STARTS = _option("Number of first guesses to try.", GUESSES, show_default=False)

Guess = Annotated[
    Path | None,
    _option("Where the search starts: a result that was saved.", GUESSES, show_default=False),
]
