"""How `gantrytau optimize` is to solve: mesh, solver, first guesses."""

from pathlib import Path
from typing import Annotated

import typer

from gantrytau.commands.arguments.shell_offers import words
from gantrytau.commands.printing.spelling import Spelling

MESH, SOLVER, GUESSES = "Mesh", "Solver", "First guesses"  # headings of the help
SPELLING = Spelling(
    ("optimize",),
    {name: f"--{name}" for name in ("elements", "points", "scheme", "tolerance", "refine", "starts", "guess")}
    | {"max_iterations": "--max-iterations", "max_time": "--max-time"},
    exactly={
        ", or write guess={'component': solution} with the component that it is of": "",
        "What was reached so far is in .optimum.": "",
        "look at .optimum": "look at what --save keeps",
    },
)

Elements = Annotated[int, typer.Option(min=1, help="Elements of the mesh.", rich_help_panel=MESH)]
Points = Annotated[
    int, typer.Option(min=1, max=9, help="Collocation points in each element.", rich_help_panel=MESH)
]
Scheme = Annotated[
    str,
    typer.Option(
        metavar="radau|gauss|lobatto",
        autocompletion=words("radau", "gauss", "lobatto"),
        help="Kind of points.",
        rich_help_panel=MESH,
    ),
]
Refine = Annotated[
    float | None,
    typer.Option(help="Relative accuracy to refine the mesh to.", show_default=False, rich_help_panel=MESH),
]
Tolerance = Annotated[float, typer.Option(help="Of the solver.", rich_help_panel=SOLVER)]
MaxIterations = Annotated[
    int, typer.Option(min=1, help="After which the solver gives up.", rich_help_panel=SOLVER)
]
MaxTime = Annotated[
    float,
    typer.Option(help="In s, of the whole work: what was found until then is kept.", rich_help_panel=SOLVER),
]
Starts = Annotated[
    int | None,
    typer.Option(min=1, help="Number of first guesses to try.", show_default=False, rich_help_panel=GUESSES),
]
Guess = Annotated[
    Path | None,
    typer.Option(
        help="Where the search starts: a result saved as .csv or .nc.",
        show_default=False,
        rich_help_panel=GUESSES,
    ),
]
