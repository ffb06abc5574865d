"""Arguments and options that several commands share."""

from pathlib import Path
from typing import Annotated

import typer

ModelName = Annotated[
    str,
    typer.Argument(
        metavar="MODEL",
        help="A model of the library (`gantrytau library` lists them), as Pendulum or 'GantryTau(D1)', "
        "or a class in a file of yours, as robot.py:Robot.",
        show_default=False,
    ),
]
PrototypeName = Annotated[
    str | None,
    typer.Option(
        "--prototype",
        metavar="NAME",
        help="The robot whose measures the model takes, for models that need one.",
        show_default="L1",
    ),
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE|FILE",
        help="Set a parameter (m=2.5, 'offset=[1,2,3]'), a start value (x.start=0.1), or all values of a file "
        "(calibrated.toml). Repeatable.",
        show_default=False,
    ),
]
Plotted = Annotated[
    list[str] | None,
    typer.Option(
        "--plot", metavar="NAMES", help="Draw these variables, separated by commas.", show_default=False
    ),
]
To = Annotated[
    str | None,
    typer.Option(
        "--to", help="Where to draw: a picture (.png, .pdf, .svg) or 'window'.", show_default="window"
    ),
]
Kept = Annotated[
    list[str] | None,
    typer.Option(
        "--outputs",
        metavar="NAMES",
        help="Keep only these variables, separated by commas.",
        show_default="all",
    ),
]
Saved = Annotated[
    Path | None,
    typer.Option(help="Save all variables: .csv, .nc, .mat (Dymola) or .parquet.", show_default=False),
]
Inputs = Annotated[
    list[str] | None,
    typer.Option(
        "--input",
        metavar="NAME=VALUE",
        help="Value of an input: a number; a column of a CSV file with a column 'time', as f=forces.csv:f, or held "
        "between its times, f=forces.csv:f:constant; a signal, as 'f=prbs(bits=7, hold=0.1)' (white_noise, prbs, steps, "
        "chirp, multisine). Repeatable.",
        show_default=False,
    ),
]
Seed = Annotated[
    int | None,
    typer.Option(help="Of signals that have none: the same numbers for the same seed.", show_default=False),
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON for programs, also for errors.")]


def listed(texts: list[str] | None) -> tuple[str, ...]:
    """Names of a repeatable option, also several in one, separated by commas outside of brackets."""
    found: list[str] = []
    for text in texts or ():
        depth, begin = 0, 0
        for place, letter in enumerate(text):
            depth += (letter in "([") - (letter in ")]")
            if letter == "," and depth == 0:
                found.append(text[begin:place])
                begin = place + 1
        found.append(text[begin:])
    return tuple(name.strip() for name in found if name.strip())
