"""`gantrytau fmu info`: what an FMU is, without loading anything of it."""

from pathlib import Path
from typing import Annotated

import typer

from gantrytau.commands.options import Json
from gantrytau.commands.reporting import CommandError, as_json, reporting

FmuFile = Annotated[Path, typer.Argument(metavar="FILE", help="An FMU, as robot.fmu.", show_default=False)]


def info(file: FmuFile, json: Json = False) -> None:
    """Describe an FMU of any tool: version, interfaces, platforms, inputs, outputs, parameters.

    Only its files are read, and only if they are harmless: its binaries are not loaded.
    """
    from gantrytau_fmu.reading.reading import read_fmu

    with reporting(json):
        present(file)
        found = read_fmu(file)
        typer.echo(as_json(found.as_dict()) if json else str(found))


def present(file: Path) -> None:
    """CommandError if there is no such file."""
    from gantrytau_fmu.reading.safety import no_file

    if not file.is_file():
        raise CommandError(no_file(file))


def counted(count: int, word: str) -> str:
    """`no errors`, `1 error`, `2 errors`."""
    return f"{count or 'no'} {word}{'' if count == 1 else 's'}"
