"""`gantrytau equations`: the equations of a model to read, or a function of them as C code."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gantrytau import did_you_mean
from gantrytau.border import listed, source_of
from gantrytau.commands.arguments.model_choice import Chosen, build
from gantrytau.commands.arguments.options import Json, ModelName, PrototypeName, Settings
from gantrytau.commands.arguments.shell_offers import words
from gantrytau.commands.arguments.values import check_names
from gantrytau.commands.printing.reporting import CommandError, as_json, busy, note, reporting, write_text
from gantrytau.commands.printing.spelling import Spelling

if TYPE_CHECKING:
    from gantrytau import Dae

FORMATS = ("text", "latex", "html", "modelica")
SPELLING = Spelling(("translate",), {"given": "--given", "find": "--find"})


def equations(
    model: ModelName,
    format: Annotated[
        str,
        typer.Option(
            "--format",
            metavar="|".join(FORMATS),
            autocompletion=words(*FORMATS),
            help="How to write them.",
        ),
    ] = "text",
    output: Annotated[
        Path | None, typer.Option(help="Write to this file, else to the terminal.", show_default=False)
    ] = None,
    given: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAMES",
            help="What is known, separated by commas, instead of the model's inputs.",
            show_default=False,
        ),
    ] = None,
    find: Annotated[
        list[str] | None,
        typer.Option(metavar="NAMES", help="What is wanted, separated by commas.", show_default=False),
    ] = None,
    c: Annotated[bool, typer.Option("--c", help="Write C code that computes --find from --given.")] = False,
    jacobian: Annotated[bool, typer.Option("--jacobian", help="With --c: its Jacobian, too.")] = False,
    forward: Annotated[
        int, typer.Option(min=0, help="With --c: derivatives in this many directions, too.")
    ] = 0,
    reverse: Annotated[
        int, typer.Option(min=0, help="With --c: adjoint derivatives of this many weights, too.")
    ] = 0,
    prototype: PrototypeName = None,
    set_: Settings = None,
    json: Json = False,
) -> None:
    """Write the equations of a model, sorted in the order in which they are solved.

    Which way they are solved is your choice: given the tool and finding the carts, as in the example below, they
    are inverse kinematics. With --find, only what it needs is written (modelica: always all). Derivatives are called
    der(x). With --c the same becomes a C function.
    """
    from gantrytau import flatten, translate

    with reporting(json, source_of(model), SPELLING):
        known, wanted = listed(given), listed(find)
        if not c and (jacobian or forward or reverse):
            raise CommandError("--jacobian, --forward and --reverse are derivatives of C code; add --c")
        if c and not (known and wanted):
            raise CommandError(
                "--c: a function needs arguments and results, as --given tool.r --find carts[0].s"
            )
        if format not in FORMATS:
            raise CommandError(f"--format {format}: found no such format{did_you_mean(format, FORMATS)}")
        chosen = build(model, prototype, set_ or ())
        flat = flatten(chosen.model)
        check_names("--given", known, flat.expand)
        check_names("--find", wanted, flat.expand)
        with busy(f"translating {chosen.name}"):
            if c:
                text = _c_code(chosen, known, wanted, jacobian, forward, reverse)
            else:
                text = _written(translate(chosen.model, given=known, find=wanted, events=True), format)
        if output is not None:
            write_text(text, output)
        report = {"model": chosen.name, "prototype": chosen.prototype, "format": "c" if c else format}
        if json:
            report |= {"given": known, "find": wanted, "file": output and str(output)}
            typer.echo(as_json(report if output else {**report, "text": text}))
        elif output is not None:
            note(f"The equations of {chosen.name} are in {output}")
        else:
            typer.echo(text.rstrip("\n"))


def _written(dae: "Dae", format: Any) -> str:
    return dae.equations(format)


def _c_code(
    chosen: Chosen,
    given: tuple[str, ...],
    find: tuple[str, ...],
    jacobian: bool,
    forward: int,
    reverse: int,
) -> str:
    """C code of the function from `given` to `find`, parameters at their values."""
    from gantrytau import c_source, translate

    function = translate(chosen.model, events=True).function(list(given), list(find))
    origin = f" of prototype {chosen.prototype}" if chosen.prototype else ""
    return c_source(
        function,
        name=chosen.name,
        given=given,
        find=find,
        jacobian=jacobian,
        forward=forward,
        reverse=reverse,
        header=f"{chosen.name}{origin}: {', '.join(find)} from {', '.join(given)}; parameters are numbers.",
    )
