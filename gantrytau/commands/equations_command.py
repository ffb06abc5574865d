"""`gantrytau equations`: the equations of a model to read, or a function of them as C code."""

from pathlib import Path
from typing import Annotated, Any

import typer

from gantrytau import Dae, c_source, flatten, translate
from gantrytau.border import listed, source_of
from gantrytau.commands.arguments.model_choice import build
from gantrytau.commands.arguments.option import serves
from gantrytau.commands.arguments.options import Json, ModelName, PrototypeName, Settings
from gantrytau.commands.arguments.values import check_names
from gantrytau.commands.printing.reporting import (
    CommandError,
    as_json,
    busy,
    note,
    reporting,
    write_text,
)


@serves(Dae.equations, format="How to write them.")
@serves(
    c_source,
    jacobian=typer.Option("--jacobian", help="With --c: its Jacobian, too."),
    forward="With --c: derivatives in this many directions, too.",
    reverse="With --c: adjoint derivatives of this many weights, too.",
)
def equations(
    model: ModelName,
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
    prototype: PrototypeName = None,
    set_: Settings = None,
    json: Json = False,
    format: Any = "text",
    **derivatives: Any,
) -> None:
    """Write the equations of a model, sorted in the order in which they are solved.

    Which way they are solved is your choice: given the tool and finding the carts, as in the example below, they
    are inverse kinematics. With --find, only what it needs is written (base-modelica: always all). Derivatives are called
    der(x). With --c the same becomes a C function.
    """
    with reporting(json, source_of(model)):
        known, wanted = listed(given), listed(find)
        if not c and any(derivatives.values()):
            raise CommandError("--jacobian, --forward and --reverse are derivatives of C code; add --c")
        if c and not (known and wanted):
            raise CommandError(
                "--c: a function needs arguments and results, as --given tool.r --find carts[0].s"
            )
        chosen = build(model, prototype, set_ or ())
        flat = flatten(chosen.model)
        check_names("--given", known, flat.expand)
        check_names("--find", wanted, flat.expand)
        with busy(f"translating {chosen.name}"):
            if c:
                origin = f" of prototype {chosen.prototype}" if chosen.prototype else ""
                sides = f"{', '.join(wanted)} from {', '.join(known)}"
                header = f"{chosen.name}{origin}: {sides}; parameters are numbers."
                function = translate(flat, events=True).function(list(known), list(wanted))
                text = c_source(
                    function, name=chosen.name, given=known, find=wanted, header=header, **derivatives
                )
            else:
                text = translate(flat, given=known, find=wanted, events=True).equations(format)
        if output is not None:
            write_text(text, output)
        if json:
            record = {
                **chosen.record("model"),
                "format": "c" if c else format,
                "given": known,
                "find": wanted,
            }
            typer.echo(as_json({**record, "file": output, **({} if output else {"text": text})}))
        elif output is not None:
            note(f"The equations of {chosen.name} are in {output}")
        else:
            typer.echo(text.rstrip("\n"))
