"""One passage of a model that samples, from a place to the next: a step of its motion, then new values of what is due."""

from dataclasses import dataclass

import casadi as ca

from gantrytau.language.symbols import time
from gantrytau.simulation.full_coordinates import Coordinates
from gantrytau.simulation.sampling.runge_kutta import one_step


@dataclass(frozen=True, eq=False)
class Passage:
    """The function of a passage: (y, u) -> (y behind it, e3, e5).

    y: states, what is held, modes; u: time and step, s, the start of the interval in which the step lies, which held
    variables are due behind it (1 or 0), and the values and slopes of the sampled inputs in it, and behind it; e3, e5:
    estimates of the error of the states, divided by the step.
    by_held: modes that follow from what is held, so that they change at instants only.
    """

    function: ca.Function
    by_held: tuple[int, ...]


def passage(coordinates: Coordinates) -> Passage:
    """The passage of a model without algebraic unknowns."""
    sampled, held = 2 * len(coordinates.sampled), len(coordinates.held)
    turns = coordinates.switches.turns
    x = ca.SX.sym("x", len(coordinates.states))
    own = ca.SX.sym("held", held + len(turns))
    t, h, begin = (ca.SX.sym(name) for name in ("t", "h", "begin"))
    due = ca.SX.sym("due", held)
    inputs, later = ca.SX.sym("inputs", sampled), ca.SX.sym("later", sampled)
    symbols = [coordinates.x, time, coordinates.t0, coordinates.w]

    rates = ca.Function("rates", symbols, [ca.densify(coordinates.ode)], {"cse": True})

    def rate(at: ca.SX, state: ca.SX) -> ca.SX:
        return rates(state, at, begin, ca.vertcat(inputs, own))

    far, e3, e5 = one_step(rate, t, x, h)
    (renewed,) = ca.substitute([coordinates.renewal], symbols, [far, t + h, t + h, ca.vertcat(later, own)])
    new = ca.if_else(due, renewed, own[:held, :])
    by_held = _following_held(coordinates)
    known = ca.vertcat(later, new, own[held:, :])
    for k in by_held:
        (mode,) = ca.substitute([turns[k].value], [coordinates.w], [known])
        known[sampled + held + k] = mode
    y = ca.vertcat(x, own)
    u = ca.vertcat(t, h, begin, due, inputs, later)
    found = [ca.densify(e) for e in (ca.vertcat(far, known[sampled:, :]), e3, e5)]
    return Passage(ca.Function("passage", [y, u], found, {"cse": True}), by_held)


def _following_held(coordinates: Coordinates) -> tuple[int, ...]:
    """The turns whose margins depend on what is held, and on modes of the same kind, alone."""
    sampled, held = 2 * len(coordinates.sampled), len(coordinates.held)
    moving = ca.vertcat(coordinates.x, coordinates.z, time, coordinates.t0, coordinates.w[:sampled, :])
    found: list[int] = []
    for k, turn in enumerate(coordinates.switches.turns):
        before = [m for m in range(len(coordinates.switches)) if m not in found]
        others = ca.vertcat(moving, *(coordinates.w[sampled + held + m] for m in before))
        if not ca.depends_on(turn.margin, others):
            found.append(k)
    return tuple(found)
