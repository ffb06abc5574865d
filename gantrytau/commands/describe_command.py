"""`gantrytau describe`: all that is said of a component, a model, or a part of one, with units."""

from pathlib import Path
from typing import Annotated, Any

import typer

from gantrytau import describe as described
from gantrytau.border import similar, source_of
from gantrytau.commands.arguments import model_choice
from gantrytau.commands.arguments.options import Json
from gantrytau.commands.library_command import component_classes
from gantrytau.commands.printing.reporting import CommandError, as_json, note, reporting


def describe(
    what: Annotated[
        str,
        typer.Argument(
            metavar="WHAT",
            help="a component or a model of the library, as Revolute, or multibody.Fixed where others have "
            "its name; one of your own, as robot.py:Robot; with values, as 'GantryTau(L1)'.",
        ),
    ],
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME", help="of a part or a quantity in it, as tool.r; without it, all of it."
        ),
    ] = "",
    json: Json = False,
) -> None:
    """Tell what a component or a model is: its parameters, connectors, variables and components, with units."""
    with reporting(json, source_of(what)):
        said = described(_found(what), name)
        typer.echo(as_json(said.as_mapping()) if json else str(said))
        if others := _others(what):
            note(f"Of the same name: {', '.join(others)}")


def _found(what: str) -> Any:
    """The class of a name of the library, with its module or without, or a model as other commands take it."""
    held = component_classes()
    known = {name: cls for classes in held.values() for name, cls in classes.items()} | model_choice.library()
    module, _, last = what.rpartition(".")
    for path, classes in held.items():
        if module and last in classes and f".{path}".endswith(f".{module}"):
            return classes[last]
    if last in known and (not module or module.startswith("gantrytau")):
        return known[last]
    if what.replace(".", "_").isidentifier() and not Path(what).exists():
        raise CommandError(
            f"{what}: the library has nothing of this name{similar(what, known)}\n`gantrytau library` lists what it holds; "
            "a model of your own is named by its file, as robot.py:Robot"
        )
    return model_choice.build(what).model


def _others(what: str) -> list[str]:
    """All components of one name, each with its module; none if the name is unique."""
    found = [
        f"{path.rpartition('.')[2]}.{what}"
        for path, classes in component_classes().items()
        if what in classes
    ]
    return found if len(found) > 1 else []
