"""One passage of a model that samples, from a place to the next: a step of its motion, then new values of what is due."""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from gantrytau.language.symbols import time
from gantrytau.simulation.full_coordinates import Coordinates
from gantrytau.simulation.sampling.runge_kutta import TIMES, one_step


@dataclass(frozen=True, eq=False)
class Passage:
    """The function of a passage: (y, u) -> (y behind it, e3, e5).

    y: states, what is held, modes; u: time and step, s, the start of the interval in which the step lies, which held
    variables are due behind it (1 or 0), and the values and slopes of the sampled inputs in it, and behind it; e3, e5:
    estimates of the error of the states, divided by the step.
    instructions: of the rates of its stages; by_held: modes that follow from what is held, which change at instants only.
    """

    function: ca.Function
    instructions: int
    by_held: tuple[int, ...]


def passage(coordinates: Coordinates) -> Passage:
    """The passage of a model without algebraic unknowns."""
    sampled, held = 2 * len(coordinates.sampled), len(coordinates.held)
    x = ca.MX.sym("x", len(coordinates.states))
    own = ca.MX.sym("held", held + len(coordinates.switches))
    t, h, begin = (ca.MX.sym(name) for name in ("t", "h", "begin"))
    due = ca.MX.sym("due", held)
    inputs, later = ca.MX.sym("inputs", sampled), ca.MX.sym("later", sampled)
    symbols = [coordinates.x, time, coordinates.t0, coordinates.w]
    rates = ca.Function("rates", symbols, [ca.densify(coordinates.ode)], {"cse": True})
    w = ca.vertcat(inputs, own)
    far, e3, e5 = one_step(lambda at, state: rates(state, at, begin, w), t, x, h)
    by_held = _following_held(coordinates)
    renewal = _renewal(coordinates, by_held)(far, t + h, ca.vertcat(later, own), due)
    y = ca.vertcat(x, own)
    u = ca.vertcat(t, h, begin, due, inputs, later)
    function = ca.Function("passage", [y, u], [ca.vertcat(far, renewal), e3, e5])
    return Passage(function, len(TIMES) * rates.n_instructions(), by_held)


def _renewal(coordinates: Coordinates, by_held: Sequence[int]) -> ca.Function:
    """(x, t, w, due) -> what is held, and the modes, from t on."""
    sampled, held = 2 * len(coordinates.sampled), len(coordinates.held)
    due = ca.SX.sym("due", held)
    w = coordinates.w
    (renewed,) = ca.substitute([ca.densify(coordinates.renewal)], [coordinates.t0], [time])
    known = ca.vertcat(w[:sampled, :], ca.if_else(due, renewed, w[sampled : sampled + held, :]))
    known = ca.vertcat(known, w[sampled + held :, :])
    for k in by_held:
        (mode,) = ca.substitute([coordinates.switches.turns[k].value], [w], [known])
        known[sampled + held + k] = mode
    own = ca.densify(known[sampled:, :])
    return ca.Function("renewal", [coordinates.x, time, w, due], [own], {"cse": True})


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
