"""`gantrytau check`: what translation finds out about a model."""

from dataclasses import asdict
from typing import Any

import typer

from gantrytau.commands.models import build, source_of
from gantrytau.commands.options import Json, ModelName, PrototypeName, Settings
from gantrytau.commands.reporting import as_json, busy, reporting


def check(
    model: ModelName, prototype: PrototypeName = None, set_: Settings = None, json: Json = False
) -> None:
    """Examine a model without simulating it: do its equations determine its unknowns, and how?

    Prints the numbers of equations and unknowns, how many ways the mechanism can move, redundant constraints,
    the states and the systems of equations to be solved. A model with a fault gets a message that names it.
    """
    with reporting(json, source_of(model)):
        chosen = build(model, prototype, set_ or ())
        with busy(f"translating {chosen.name}"):
            diagnosis = _diagnosis(chosen.model)
        if json:
            typer.echo(as_json({**asdict(diagnosis), "prototype": chosen.prototype}))
        else:
            typer.echo(str(diagnosis))


def _diagnosis(model: Any) -> Any:
    import gantrytau

    if hasattr(gantrytau, "check"):
        return gantrytau.check(model)  # pyright: ignore[reportAttributeAccessIssue]
    return gantrytau.translate(model).diagnosis
