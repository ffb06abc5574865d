"""`controls=`: how inputs are made, read and checked."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from gantrytau import ModelError
from gantrytau.border.refusal import did_you_mean
from gantrytau.language.symbols import split_derivative
from gantrytau_optimica.control.control_problem import Pieces
from gantrytau_optimica.problem.symbolic_problem import SymbolicProblem

KEYS = ("kind", "elements", "max_step", "step_penalty")


def read_controls(read: SymbolicProblem, controls: Any) -> dict[str, Pieces]:
    """Pieces by scalar name from `{name: dict(kind=..., elements=..., max_step=..., step_penalty=...)}`."""
    if not isinstance(controls, Mapping):
        raise ModelError(
            f"controls={controls!r}: expected {{name of an input: dict(kind='constant' | 'linear' | 'ramps', ...)}}"
        )
    found: dict[str, Pieces] = {}
    for name, wanted in controls.items():
        for element in read.dae.expand(name):
            base = split_derivative(element)[0]  # the rate of an input may be what is chosen
            if base not in read.dae.inputs or base in read.courses:
                chosen = [n for n in read.dae.inputs if n not in read.courses]
                raise ModelError(
                    f"controls: {element} is no input that the optimiser chooses, expected one of "
                    f"{', '.join(chosen) or 'none (there is no input)'}"
                )
            found[element] = _pieces(name, wanted)
    return found


def _pieces(name: str, wanted: Any) -> Pieces:
    if isinstance(wanted, str):
        wanted = dict(kind=wanted)
    if not isinstance(wanted, Mapping):
        raise ModelError(
            f"controls {name}: found {wanted!r}, expected dict(kind='constant' | 'linear' | 'ramps', ...)"
        )
    for key in wanted:
        if key not in KEYS:
            raise ModelError(f"controls {name}: there is no '{key}'{did_you_mean(str(key), KEYS)}")
    kind = wanted.get("kind", "constant")
    if kind not in ("constant", "linear", "ramps"):
        raise ModelError(f"controls {name}: found kind={kind!r}, expected 'constant', 'linear' or 'ramps'")
    if kind == "ramps" and len(wanted) > 1:
        raise ModelError(
            f"controls {name}: ramps jump at every border, expected no other setting beside kind='ramps'"
        )
    elements = wanted.get("elements", 1)
    if isinstance(elements, bool) or not isinstance(elements, (int, np.integer)) or elements < 1:
        raise ModelError(
            f"controls {name}: found elements={elements!r}, expected a whole number of at least 1"
        )
    step, penalty = wanted.get("max_step"), wanted.get("step_penalty", 0.0)
    for key, value, none in (("max_step", step, True), ("step_penalty", penalty, False)):
        if none and value is None:
            continue
        if (
            not isinstance(value, (int, float, np.number))
            or isinstance(value, bool)
            or not np.isfinite(value)
            or value < 0
        ):
            raise ModelError(
                f"controls {name}: found {key}={value!r}, expected a number that is not negative"
            )
    step = None if step is None else float(step)
    return Pieces(kind, int(elements), max_step=step, step_penalty=float(penalty))
