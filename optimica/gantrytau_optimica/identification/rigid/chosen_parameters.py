"""What a call of `identify` asks for: names of parameters, and values that are fixed, with refusals."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gantrytau import ModelError
from gantrytau.dae import Dae
from gantrytau_optimica.identification.logs.motion_log import MotionLog
from gantrytau_optimica.identification.rigid.body_parameters import BodyParameters
from gantrytau_optimica.identification.rigid.friction_columns import SIDES, Law, words
from gantrytau_optimica.identification.rigid.robot_dynamics import (
    bodies_of,
    candidates,
    expanded,
    frictions,
    public_name,
)


def check_logs(dae: Dae, logs: Sequence[MotionLog], coordinates: Sequence[str]) -> None:
    """ModelError unless there are logs of all drives of the robot."""
    if not logs:
        raise ModelError("identify: found no log, expected one or more; give a MotionLog")
    for number, log in enumerate(logs):
        if not isinstance(log, MotionLog):
            raise ModelError(
                f"identify: log {number} is {type(log).__name__}, expected a MotionLog; make one of t, q, f"
            )
        if log.q.shape[1] != len(coordinates):
            raise ModelError(
                f"identify: log {number} has {log.q.shape[1]} actuators, expected {len(coordinates)}, as {dae.name} is "
                f"driven at {', '.join(coordinates)}; log them all"
            )


def is_friction(name: str) -> bool:
    """Whether it names a friction that is identified apart from the model."""
    return name.partition("[")[0] in words("stribeck")


def asked_parameters(
    dae: Dae, parameters: Sequence[str] | str | None, given: Mapping[str, Any], friction: Law | None
) -> tuple[str, ...]:
    """Public names of the robot's own parameters to be identified, without those that are fixed.

    Where its own friction is kept, the parameters of that are among those by default.
    """
    if parameters is None:
        own = candidates(dae) if friction else (*candidates(dae), *frictions(dae))
        return tuple(n for n in own if n not in given)
    known = dict.fromkeys((*candidates(dae), *(public_name(n) for n in dae.adjustable)))
    bodies = {body.path: body for body in bodies_of(dae)}
    wanted = [parameters] if isinstance(parameters, str) else list(parameters)
    found: tuple[str, ...] = ()
    for name in (n for n in wanted if not is_friction(n)):
        if name in bodies:
            _check_body(dae, bodies[name], wanted, given)
            found += tuple(n for n in bodies[name].names if n not in given)
        else:
            found += expanded(name, (*known, *bodies))
    found = tuple(dict.fromkeys(found))
    both = [n for n in found if n in given]
    if both:
        raise ModelError(
            f"identify: {', '.join(both)} stand in parameters= and in fixed=; leave them out of one"
        )
    return found


def _check_body(dae: Dae, body: BodyParameters, wanted: Sequence[str], given: Mapping[str, Any]) -> None:
    """ModelError where the ten parameters of a body would be set from elsewhere too, or have no mass to begin with."""
    own = [*body.elements[1:], f"{body.path}.r_cm", f"{body.path}.J"]
    twice = [n for n in own if n in wanted or n in given]
    if twice:
        raise ModelError(
            f"identify: {', '.join(twice)} and the body {body.path} stand together, whose ten parameters are identified; "
            "leave out one. Only its mass can be fixed"
        )
    mass = given.get(body.mass, dae.parameter_values[body.elements[0]])
    if not mass > 0:
        raise ModelError(
            f"identify: the body {body.path} has a mass of {mass:g} kg, expected more than 0 to begin with; "
            f"give {body.elements[0]} a value"
        )


def fixed_values(dae: Dae, fixed: Mapping[str, Any], n: int, friction: Law | None) -> dict[str, Any]:
    """Values by scalar name; of frictions a number, or a pair at positive and at negative speed."""
    theirs = frictions(dae) if friction else ()  # zero beside the law that is identified
    own = tuple(dict.fromkeys(public_name(p) for p in dae.adjustable if p not in theirs))
    laws = [f"{word}[{i}]" for word in words(friction or "symmetric") for i in range(n)] if friction else []
    sides = [name + side for name in laws for side in SIDES] if friction == "asymmetric" else []
    found: dict[str, Any] = {}
    for name, value in fixed.items():
        exact = name in own or name in laws or name in sides
        members = (name,) if exact else expanded(name, (*own, *laws))
        try:
            values = np.asarray(value, dtype=float)
        except (TypeError, ValueError):
            values = np.array(np.nan)
        whole = not exact and values.ndim > 0
        pairs = is_friction(name) and values.ndim == 1 + whole and values.shape[-1:] == (2,)
        fits = (
            values.ndim == 0 or (whole and len(values) == len(members) and values.ndim == 1 + pairs) or pairs
        )
        if not fits or not np.all(np.isfinite(values)):
            raise ModelError(
                f"identify: fixed value of {name} is {value!r}, expected a number, or one for each of {', '.join(members)}"
                f"{', or pairs at positive and negative speed' if is_friction(name) else ''}"
            )
        for k, member in enumerate(members):
            one = values[k] if whole else values
            found[member] = tuple(one.tolist()) if np.ndim(one) else float(one)
    return found
