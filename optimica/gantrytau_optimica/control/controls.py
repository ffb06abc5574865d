"""`controls=`: how inputs are made, read and checked."""

from collections.abc import Mapping
from typing import Any

from gantrytau import ModelError
from gantrytau.border.checks import instance, number, one_of, whole
from gantrytau.language.symbols import split_derivative
from gantrytau_optimica.control.control_problem import Pieces
from gantrytau_optimica.problem.symbolic_problem import SymbolicProblem

KEYS = ("kind", "elements", "max_step", "step_penalty")


def read_controls(read: SymbolicProblem, controls: Any) -> dict[str, Pieces]:
    """Pieces by scalar name from `{name: dict(kind=..., elements=..., max_step=..., step_penalty=...)}`."""
    expected = "{name of an input: dict(kind='constant' | 'linear' | 'ramps', ...)}"
    instance("", "controls", controls, Mapping, expected)
    found: dict[str, Pieces] = {}
    for name, wanted in controls.items():
        for element in read.dae.expand(name):
            base = split_derivative(element)[0]  # the rate of an input may be what is chosen
            if base not in read.dae.inputs or base in read.courses:
                chosen = [n for n in read.dae.inputs if n not in read.courses]
                expected = f"expected one of {', '.join(chosen) or 'none (there is no input)'}"
                why = f"{element} is no input that the optimiser chooses, {expected}"
                raise ModelError(why, place="controls", argument="controls")
            found[element] = _pieces(name, wanted)
    return found


def _pieces(name: str, wanted: Any) -> Pieces:
    place = f"controls {name}"
    wanted = dict(kind=wanted) if isinstance(wanted, str) else wanted
    instance(place, "controls", wanted, Mapping, "dict(kind='constant' | 'linear' | 'ramps', ...)")
    for key in wanted:
        one_of(place, "controls", key, KEYS)
    kind = one_of(place, "kind", wanted.get("kind", "constant"), ("constant", "linear", "ramps"))
    if kind == "ramps" and len(wanted) > 1:
        raise ModelError(
            "ramps jump at every border, expected no other setting beside kind='ramps'", place=place
        )
    step = wanted.get("max_step")
    return Pieces(
        kind,
        whole(place, "elements", wanted.get("elements", 1), least=1),
        max_step=None if step is None else number(place, "max_step", step, least=0.0),
        step_penalty=number(place, "step_penalty", wanted.get("step_penalty", 0.0), least=0.0),
    )
