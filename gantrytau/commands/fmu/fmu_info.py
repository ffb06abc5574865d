"""`gantrytau fmu info`: what an FMU is, without loading anything of it."""

from pathlib import Path
from typing import Annotated

import typer

from gantrytau.commands.arguments.options import Json
from gantrytau.commands.printing.reporting import CommandError, as_json, reporting
from gantrytau_fmu import no_file, read_fmu, read_system

FmuFile = Annotated[
    Path,
    typer.Argument(
        metavar="FILE", help="An FMU, as robot.fmu, or a system of FMUs (.ssp).", show_default=False
    ),
]


def info(
    file: FmuFile,
    every: Annotated[
        bool, typer.Option("--all", help="List all variables, not only the first of a kind.")
    ] = False,
    json: Json = False,
) -> None:
    """Describe an FMU of any tool: version, interfaces, platforms, inputs, outputs, parameters. Or a system (.ssp).

    Only its files are read, and only if they are harmless: its binaries are not loaded.
    """
    with reporting(json):
        present(file)
        found = (read_system if is_system(file) else read_fmu)(file)
        words = found.table(None) if every else str(found)
        more = "\n\n--all lists all of them" if "\n  ... and " in words else ""
        typer.echo(as_json(found.as_dict()) if json else f"{words}{more}")


def is_system(file: Path) -> bool:
    """Whether a file is a system of FMUs, by its name."""
    return file.suffix.lower() == ".ssp"


def present(file: Path) -> None:
    """CommandError if there is no such file."""
    if not file.is_file():
        raise CommandError(no_file(file))


def counted(count: int, word: str) -> str:
    """`no errors`, `1 error`, `2 errors`."""
    return f"{count or 'no'} {word}{'' if count == 1 else 's'}"
