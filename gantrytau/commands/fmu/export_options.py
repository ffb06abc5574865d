"""What `gantrytau fmu export` asks for, in groups: the file, its translation, its experiment, and about the model."""

from typing import Annotated

import typer

from gantrytau.commands.arguments.shell_offers import words
from gantrytau.commands.printing.spelling import Spelling

TRANSLATION, EXPERIMENT, ABOUT = "Translation", "Experiment", "About the model"  # headings of the help
INTERFACES = {
    "both": ("model-exchange", "co-simulation"),
    "me": ("model-exchange",),
    "cs": ("co-simulation",),
}
VERSIONS = {"2.0": "2.0", "2": "2.0", "3.0": "3.0", "3": "3.0"}
SPELLING = Spelling(
    ("export_fmu", "translate", "Build"),
    {name: f"--{name}" for name in ("platforms", "given", "find", "states", "tolerance", "solver", "fmi")},
)


def _text(name: str, words: str, default: str | bool = False) -> typer.models.OptionInfo:
    """A text about the model."""
    return typer.Option(f"--{name}", metavar="TEXT", help=words, show_default=default, rich_help_panel=ABOUT)


def _names(name: str, words: str, default: str | bool = False) -> typer.models.OptionInfo:
    """Names of variables."""
    return typer.Option(
        f"--{name}", metavar="NAMES", help=words, show_default=default, rich_help_panel=TRANSLATION
    )


Version = Annotated[
    str,
    typer.Option(
        "--fmi", metavar="2.0|3.0", autocompletion=words("2.0", "3.0"), help="Version of the standard."
    ),
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
    str,
    typer.Option(
        metavar="me|cs|both",
        autocompletion=words("me", "cs", "both"),
        help="Model Exchange, Co-Simulation, or both.",
    ),
]
NoSources = Annotated[bool, typer.Option("--no-sources", help="Leave the C sources out of the file.")]

Given = Annotated[
    list[str] | None,
    _names("given", "The inputs of the FMU, separated by commas, instead of the model's."),
]
Find = Annotated[list[str] | None, _names("find", "Its outputs, separated by commas.", "all variables")]
States = Annotated[
    list[str] | None, _names("states", "Preferred states, separated by commas.", "chosen by gantrytau")
]

SolverName = Annotated[
    str,
    typer.Option(
        metavar="dopri5|rodas4",
        autocompletion=words("dopri5", "rodas4"),
        help="Of Co-Simulation; rodas4 for stiff models.",
        rich_help_panel=EXPERIMENT,
    ),
]
Tolerance = Annotated[float, typer.Option(help="Relative, of Co-Simulation.", rich_help_panel=EXPERIMENT)]
Stop = Annotated[
    float | None,
    typer.Option(help="Default experiment: its end, in s.", show_default="1.0", rich_help_panel=EXPERIMENT),
]
Step = Annotated[
    float | None,
    typer.Option(
        help="Default experiment: step of Co-Simulation, in s.",
        show_default="0.004",
        rich_help_panel=EXPERIMENT,
    ),
]

Description = Annotated[str, _text("description", "What the file says of the model.", "the model's")]
Author = Annotated[str, _text("author", "Who wrote the model.")]
Copyright = Annotated[str, _text("copyright", "Whose the model is.")]
License = Annotated[str, _text("license", "Licence of the model, as BSD-3-Clause.")]
ModelVersion = Annotated[str, _text("model-version", "Version of the model.")]
