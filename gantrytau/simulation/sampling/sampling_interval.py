"""One passage of a model that samples, from a place to the next: a step of its motion, then new values of what is due."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from gantrytau.language.symbols import time
from gantrytau.simulation.full_coordinates import Coordinates
from gantrytau.simulation.sampling.runge_kutta import TIMES, one_step


@dataclass(frozen=True, eq=False)
class Passage:
    """The function of a passage: (y, u) -> (y behind it, e3, e5), and the algebraics just before what is due, if any.

    y: states, what is held, discretes, modes; u: time and step, s, the start of the interval in which the step lies, which
    held variables are due behind it (1 or 0), the values and slopes of the sampled inputs in it, and behind it, and whether
    they jump there; e3, e5: estimates of the error of the states, divided by the step.
    instructions: of the rates of its stages; by_held: modes that follow from what is held, which change at instants only.
    """

    function: ca.Function
    instructions: int
    by_held: tuple[int, ...]


def passage(coordinates: Coordinates) -> Passage:
    """The passage of a model whose algebraic unknowns, if any, follow from linear equations; no when acts in it."""
    sampled, held = 2 * len(coordinates.sampled), len(coordinates.held)
    x = ca.MX.sym("x", len(coordinates.states))
    own = ca.MX.sym("held", coordinates.w.numel() - sampled)
    t, h, begin = (ca.MX.sym(name) for name in ("t", "h", "begin"))
    due = ca.MX.sym("due", held)
    inputs, later = ca.MX.sym("inputs", sampled), ca.MX.sym("later", sampled)
    equations = Equations(coordinates)
    w = ca.vertcat(inputs, own)
    far, e3, e5 = one_step(lambda at, state: equations.rates(state, at, begin, w), t, x, h)
    by_held = _following_held(coordinates)
    jump, before = ca.MX.sym("jump"), ca.vertcat(later, own)
    z = equations.algebraics(far, t + h, t + h, before)
    behind = _behind_jumps(coordinates, by_held)
    if behind is not None:
        before = ca.if_else(jump, behind(far, z, t + h, before), before)
        z = equations.algebraics(far, t + h, t + h, before)
        # whether modes and unknowns lead to others again
        led_on = ca.norm_inf(behind(far, z, t + h, before) - before) > 0
        far = far + ca.if_else(ca.logic_and(jump, led_on), math.nan, 0.0)
    renewal = _renewal(coordinates, by_held)(far, z, t + h, before, due)
    y = ca.vertcat(x, own)
    u = ca.vertcat(t, h, begin, due, inputs, later, jump)
    found = [ca.vertcat(far, renewal), e3, e5, *([z] if coordinates.algebraics else [])]
    instructions = len(TIMES) * equations.instructions
    return Passage(ca.Function("passage", [y, u], found), instructions, by_held)


def linear(coordinates: Coordinates) -> bool:
    """Whether the algebraic unknowns follow from linear equations."""
    z = coordinates.z
    return not ca.depends_on(ca.jacobian(coordinates.algebraic, z), z)


class Equations:
    """Rates x' and algebraics z at (x, t, t0, w), as expressions; instructions: of both."""

    def __init__(self, coordinates: Coordinates):
        symbols = [coordinates.x, time, coordinates.t0, coordinates.w]
        z, algebraic = coordinates.z, coordinates.algebraic
        self._none = not coordinates.algebraics
        matrix = ca.jacobian(algebraic, z)
        (rest,) = ca.substitute([algebraic], [z], [ca.SX.zeros(*z.shape)])
        self._parts = ca.Function("parts", symbols, [matrix, ca.densify(rest)], {"cse": True})
        self._rates = ca.Function("rates", [z, *symbols], [ca.densify(coordinates.ode)], {"cse": True})
        counts = self._parts.n_instructions(), self._rates.n_instructions(), z.numel() ** 3
        self.instructions = sum(counts)

    def algebraics(self, *point: ca.MX) -> ca.MX:
        """What solves the linear equations, by their factors of Householder."""
        if self._none:
            return ca.MX(0, 1)
        matrix, rest = self._parts(*point)
        return -ca.solve(matrix, rest, "qr")

    def rates(self, *point: ca.MX) -> ca.MX:
        """The rates of the states."""
        return self._rates(self.algebraics(*point), *point)


def _renewal(coordinates: Coordinates, by_held: Sequence[int]) -> ca.Function:
    """(x, z, t, w, due) -> what is held, and the modes, from t on."""
    sampled, held = 2 * len(coordinates.sampled), len(coordinates.held)
    modes = coordinates.w.numel() - len(coordinates.switches)
    due = ca.SX.sym("due", held)
    w = coordinates.w
    (renewed,) = ca.substitute([ca.densify(coordinates.renewal)], [coordinates.t0], [time])
    known = ca.vertcat(w[:sampled, :], ca.if_else(due, renewed, w[sampled : sampled + held, :]))
    known = ca.vertcat(known, w[sampled + held :, :])
    for k in by_held:
        (mode,) = ca.substitute([coordinates.switches.turns[k].value], [w], [known])
        known[modes + k] = mode
    own = ca.densify(known[sampled:, :])
    return ca.Function("renewal", [coordinates.x, coordinates.z, time, w, due], [own], {"cse": True})


def _behind_jumps(coordinates: Coordinates, by_held: Sequence[int]) -> ca.Function | None:
    """(x, z, t, w) -> w with the modes that follow from inputs which have jumped, as samples see them; None without such."""
    sampled, first = 2 * len(coordinates.sampled), coordinates.w.numel() - len(coordinates.switches)
    w, jumping = ca.SX(coordinates.w), ca.vertcat(coordinates.w[:sampled, :], coordinates.z)
    for k, turn in enumerate(coordinates.switches.turns):
        if k not in by_held and ca.depends_on(turn.margin, jumping):
            (w[first + k],) = ca.substitute([turn.value], [coordinates.w, coordinates.t0], [w, time])
            jumping = ca.vertcat(jumping, coordinates.w[first + k])
    if jumping.numel() == sampled + coordinates.z.numel():
        return None
    return ca.Function(
        "behind", [coordinates.x, coordinates.z, time, coordinates.w], [ca.densify(w)], {"cse": True}
    )


def _following_held(coordinates: Coordinates) -> tuple[int, ...]:
    """The turns whose margins depend on what is held, and on modes of the same kind, alone, and that no when asks for."""
    sampled, modes = 2 * len(coordinates.sampled), coordinates.w.numel() - len(coordinates.switches)
    moving = ca.vertcat(coordinates.x, coordinates.z, time, coordinates.t0, coordinates.w[:sampled, :])
    asked = {k for own in coordinates.rounds.of for k in own}
    found: list[int] = []
    for k, turn in enumerate(coordinates.switches.turns):
        before = [m for m in range(len(coordinates.switches)) if m not in found]
        others = ca.vertcat(moving, *(coordinates.w[modes + m] for m in before))
        if k not in asked and not ca.depends_on(turn.margin, others):
            found.append(k)
    return tuple(found)
