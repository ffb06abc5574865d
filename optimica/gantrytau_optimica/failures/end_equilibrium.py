"""Whether a mechanism can be, and be held at rest, where a problem begins and ends: told when no solution was found.

Where conditions give all states of an end, the model's own inverse dynamics say which inputs hold it there,

    u = inverse(positions, speeds = 0, accelerations = 0),

on the branch on which the model starts. They have no value where the loops cannot be closed.
"""

from collections.abc import Sequence

import casadi as ca
import numpy as np

from gantrytau import ModelError, StructureError
from gantrytau_optimica.control.built import Built
from gantrytau_optimica.control.control_problem import Phase
from gantrytau_optimica.control.first_guesses.ends import values_at_ends
from gantrytau_optimica.control.limits import signal_limits

WORDS = {"initial": "start", "final": "end"}
SLIGHT = 1e-6  # of a limit: what passes it by less is rounding
HALVINGS = 12  # of the line on which the last pose in reach is looked for


def held_ends(built: Built) -> list[str]:
    """What speaks against the start or the end of a problem, in words; nothing where that cannot be said.

    A motion may touch an end at which it cannot stay, so inputs that are too weak to hold it are a hint.
    """
    problem, dae = built.problem, built.read.dae
    phase, *others = problem.phases
    if others or phase.courses or ca.depends_on(ca.vertcat(phase.ode, phase.residuals), problem.numbers):
        return []
    inverse = _inverse(built, phase)
    if inverse is None:
        return []
    found: list[str] = []
    ends = values_at_ends(dae, built.points, built.constraints, {n.name: n.guess for n in problem.free})
    for when in WORDS:
        values = [ends.get(s.symbol.name(), {}).get(when) for s in phase.states]
        if any(value is None for value in values):
            continue
        x = np.array([value for value in values if value is not None])
        names = ", ".join(f"{s.name} = {value:.6g}" for s, value in zip(phase.states, x, strict=True))
        needed = _inputs(inverse, x)
        if np.all(np.isfinite(needed)):
            rests = all(value == 0.0 for value, own in zip(x, speeds(phase), strict=True) if own)
            found += _too_weak(built, phase, WORDS[when], needed) if rests else []
            continue
        start = np.array([dae.start.get(s.symbol.name(), 0.0) for s in phase.states])
        last = _last_in_reach(inverse, start, x)
        if last is not None:
            near = ", ".join(
                f"{s.name} = {value:.4g}"
                for s, value, wanted in zip(phase.states, last, x, strict=True)
                if value != wanted
            )
            found.append(
                f"The {WORDS[when]} is out of reach, or on another branch than the model's start: the loops of the "
                f"mechanism cannot be closed at {names}. On the straight line from where the model starts they open "
                f"behind {near}: a singular pose, or the end of its reach. "
                "Take another pose, or start values on the branch that is meant."
            )
    return found


def _inverse(built: Built, phase: Phase) -> ca.Function | None:
    """Inputs that hold states x at rest, of the model's parameters; None where states do not decide them."""
    names = [s.name for s in phase.states]
    rates = [n for n, own in zip(names, speeds(phase), strict=True) if own]
    inputs = [u.name for u in phase.inputs]
    if not names or len(rates) != len(inputs) or 2 * len(rates) != len(names):
        return None
    try:
        function = built.read.dae.function([*names, *(f"der({n})" for n in rates)], inputs)
    except (ModelError, StructureError):
        return None
    x = ca.MX.sym("x", len(names))
    found = function.call([*ca.vertsplit(x), *(ca.MX(0.0) for _ in rates)])
    return ca.Function("inverse", [x], [ca.vertcat(*found)])


def speeds(phase: Phase) -> list[bool]:
    """Of every state whether it is a speed: its derivative is no other state."""
    states = {s.symbol.element_hash() for s in phase.states}
    return [not (e.is_symbolic() and e.element_hash() in states) for e in phase.ode.elements()]


def _inputs(inverse: ca.Function, x: np.ndarray) -> np.ndarray:
    return np.array(inverse(x)).ravel()


def _last_in_reach(inverse: ca.Function, start: np.ndarray, end: np.ndarray) -> np.ndarray | None:
    """The last states on the line at which the loops can be closed; None if there are none at its beginning."""
    if not np.all(np.isfinite(_inputs(inverse, start))):
        return None
    low, high = 0.0, 1.0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        good = np.all(np.isfinite(_inputs(inverse, start + middle * (end - start))))
        low, high = (middle, high) if good else (low, middle)
    return start + low * (end - start)


def _too_weak(built: Built, phase: Phase, end: str, needed: np.ndarray) -> list[str]:
    """Inputs that would have to pass their limits to hold the mechanism at rest."""
    limits = signal_limits(phase, built.problem.name)
    units = {n: v.unit for v in built.read.dae.flat.variables for n in v.elements}
    lines: list[str] = []
    for signal, value in zip(phase.inputs, needed, strict=True):
        low, high = limits[signal.name]
        if low - SLIGHT * abs(low) <= value <= high + SLIGHT * abs(high):
            continue
        unit = units.get(signal.name, "")
        lines.append(
            f"{signal.name} = {value:.4g}{' ' + unit if unit else ''} (limits {low:.4g} and {high:.4g})"
        )
    return [_weak_text(end, lines)] if lines else []


def _weak_text(end: str, lines: Sequence[str]) -> str:
    return (
        f"At the {end} the mechanism cannot be held at rest, which needs {', '.join(lines)}. Allow more, or make lighter "
        "what is carried."
    )
