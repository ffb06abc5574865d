"""Arguments and options that several commands share."""

from pathlib import Path
from typing import Annotated

import typer

from gantrytau.commands.arguments import shell_offers

ModelName = Annotated[
    str,
    typer.Argument(
        metavar="MODEL",
        help="A model of the library (`gantrytau library` lists them), as Pendulum or 'GantryTau(D1)', "
        "or a class in a file of yours, as robot.py:Robot or robot.mo:Package.Model, "
        "or a robot.urdf, .xml of MuJoCo or .sdf.",
        autocompletion=shell_offers.models,
        show_default=False,
    ),
]
RobotName = Annotated[
    str,
    typer.Option(
        "--robot",
        metavar="MODEL",
        help="The robot with its nominal values, named as for the other commands: 'GantryTau(L1)', robot.py:Robot.",
        show_default=False,
        autocompletion=shell_offers.models,
    ),
]
PrototypeName = Annotated[
    str | None,
    typer.Option(
        "--prototype",
        metavar="NAME",
        help="The robot whose measures the model takes, for models that need one.",
        show_default="L1",
        autocompletion=shell_offers.prototypes,
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
        autocompletion=shell_offers.settings,
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
Picture = Annotated[
    str | None,
    typer.Option(
        "--plot",
        metavar="FILE|window",
        help="Draw it: a picture (.png, .pdf, .svg) or 'window'.",
        show_default=False,
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
Quiet = Annotated[bool, typer.Option("--quiet", help="Show no progress.")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON for programs, also for errors.")]
