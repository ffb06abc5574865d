"""`gantrytau new robot`: a folder with a robot, a problem, tests and a notebook, all of which run."""

import re
from importlib.resources import files
from pathlib import Path
from typing import Annotated

import typer

from gantrytau.commands.arguments.options import Json
from gantrytau.commands.printing.reporting import CommandError, answered, reporting, write_text

TEMPLATES = "five_bar"  # folder of this package with the files of the project
NAME = "MY_ROBOT"  # stands for the name of the project


def robot(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="FOLDER", help="Where to write; it is made, or must be empty.", show_default=False
        ),
    ],
    json: Json = False,
) -> None:
    """Write a project that runs: a robot, its fastest motion, tests, a notebook, and a page with commands.

    Files that are there are never changed: the folder must be new or empty.
    """
    with reporting(json):
        name = re.sub(r"[_-]+", " ", folder.absolute().name).strip() or "robot"
        _make(folder)
        written = []
        for template in sorted(
            files("gantrytau.commands.new").joinpath(TEMPLATES).iterdir(), key=lambda f: f.name
        ):
            target = folder / template.name.removesuffix(".txt")
            write_text(template.read_text(encoding="utf-8").replace(NAME, name), target)
            written.append(target)
        answered(json, {"folder": folder}, None, written)
        if not json:
            typer.echo(f"Next: cd {folder} && gantrytau check robot.py:FiveBar; README.md has more commands")


def _make(folder: Path) -> None:
    """The folder, new or empty; CommandError for another one."""
    if folder.exists() and not folder.is_dir():
        raise CommandError(f"{folder}: found a file, expected a new or an empty folder; take another name")
    try:
        there = sorted(path.name for path in folder.iterdir()) if folder.exists() else []
        if there:
            more = f" and {len(there) - 3} more" if len(there) > 3 else ""
            raise CommandError(
                f"{folder}: found {', '.join(there[:3])}{more} in it, expected a new or an empty folder; take another name"
            )
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CommandError(f"{folder}: cannot be made ({error.strerror}); name another place") from error
