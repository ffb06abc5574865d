"""`gantrytau check`: what translation finds out about a model."""

from dataclasses import asdict

import gantrytau
from gantrytau.border import source_of
from gantrytau.commands.arguments.model_choice import build
from gantrytau.commands.arguments.options import Json, ModelName, PrototypeName, Settings
from gantrytau.commands.printing.reporting import FAULT, answered, busy, fail, reporting


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
            diagnosis = gantrytau.check(chosen.model)
        record = {**asdict(diagnosis), "prototype": chosen.prototype}
        if diagnosis.missing:
            fail(diagnosis.missing if json else str(diagnosis), FAULT, json, **record)
        answered(json, record, str(diagnosis))
