"""What PROBLEM says on the command line."""

from typing import Annotated

import typer

from gantrytau.commands.arguments import shell_offers

ProblemName = Annotated[
    str,
    typer.Argument(
        metavar="PROBLEM",
        help="A class that inherits from gantrytau_optimica.Optimization, as move.py:Fastest, "
        "'move.py:Fastest(weight=0.01)' or package.module:Fastest; the file alone where it holds only one.",
        show_default=False,
        autocompletion=shell_offers.classes,
    ),
]
