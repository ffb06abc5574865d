"""What `gantrytau fmu export` asks for, in groups: the file, its translation, its experiment, and about the model."""

from typing import Annotated, Any, Literal

import typer

TRANSLATION, EXPERIMENT, ABOUT = "Translation", "Experiment", "About the model"  # headings of the help
INTERFACES = {
    "both": ("model-exchange", "co-simulation"),
    "me": ("model-exchange",),
    "cs": ("co-simulation",),
}
VERSIONS = {"2": "2.0", "3": "3.0"}


def _about(words: str, default: str | bool = False, *names: str) -> Any:
    """A text about the model."""
    return typer.Option(*names, metavar="TEXT", help=words, show_default=default, rich_help_panel=ABOUT)


def _names(words: str, default: str | bool = False) -> Any:
    """Names of variables."""
    return typer.Option(metavar="NAMES", help=words, show_default=default, rich_help_panel=TRANSLATION)


def _time(words: str, default: str) -> Any:
    return typer.Option(help=words, show_default=default, rich_help_panel=EXPERIMENT)


OPTIONS = dict(
    solver=typer.Option(help="Of Co-Simulation; rodas4 for stiff models.", rich_help_panel=EXPERIMENT),
    tolerance=typer.Option(help="Relative, of Co-Simulation.", rich_help_panel=EXPERIMENT),
)
BUILD = dict(
    description=_about("What the file says of the model.", "the model's"),
    author=_about("Who wrote the model."),
    copyright=_about("Whose the model is."),
    license=_about("Licence of the model, as BSD-3-Clause."),
    version=_about("Version of the model.", False, "--model-version"),
)
Version = Annotated[
    Literal["2.0", "3.0", "2", "3"], typer.Option(metavar="[2.0|3.0]", help="Version of the standard.")
]
Platforms = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAMES",
        help="'native' for this machine, 'all', or x86_64-linux, aarch64-linux, x86_64-windows, aarch64-windows, "
        "x86_64-darwin, aarch64-darwin, separated by commas; others than this machine need the extra 'cross'.",
        show_default="native",
    ),
]
Interface = Annotated[
    Literal["me", "cs", "both"], typer.Option(help="Model Exchange, Co-Simulation, or both.")
]
NoSources = Annotated[bool, typer.Option("--no-sources", help="Leave the C sources out of the file.")]
Given = Annotated[
    list[str] | None, _names("The inputs of the FMU, separated by commas, instead of the model's.")
]
Find = Annotated[list[str] | None, _names("Its outputs, separated by commas.", "all variables")]
States = Annotated[list[str] | None, _names("Preferred states, separated by commas.", "chosen by gantrytau")]
Stop = Annotated[float | None, _time("Default experiment: its end, in s.", "1.0")]
Step = Annotated[float | None, _time("Default experiment: step of Co-Simulation, in s.", "0.004")]
Reference = Annotated[
    bool,
    typer.Option(
        "--reference",
        help="Put reference results until the end of the experiment into the file, by which 'check --run' judges it.",
        rich_help_panel=EXPERIMENT,
    ),
]
