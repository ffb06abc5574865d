"""Square roots kept off zero where equations divide by them.

Where a link stands across its guideway, its cart has a lever without end: speeds and forces go with 1 / root, and a
motion in least time may be drawn there, between points that no mesh resolves. So such a root keeps a margin,

    root >= NEAREST max(root along the first guess),  or half of what the first guess comes down to, if that is less.

Where a solution rests on its margin, what it would gain without is looked at: see `scaled_margins` and its callers.
"""

from collections.abc import Callable
from dataclasses import replace

import casadi as ca
import numpy as np

from gantrytau_optimica.control.control_problem import ControlProblem, Phase
from gantrytau_optimica.control.first_guesses.guesses import horizon
from gantrytau_optimica.control.sizes import BESIDE, SHARES

NEAREST = 0.1  # of its largest value on the guess, as the guess itself keeps off zero
FLOOR = 0.1  # of that margin: it is not made smaller for what a guess passes by, only for where it begins and ends
POLE = 1e-9  # of its largest value: where a root is taken to be zero
GROWS = 1e4  # times: what dividing by a root makes of an equation at least, from its margin to its pole
Look = Callable[[np.ndarray], np.ndarray]


def with_margins(problem: ControlProblem) -> ControlProblem:
    """The problem with margins by its first guesses for the square roots that its equations divide by."""
    phases = (replace(phase, algebraics=_kept_off(problem, phase)) for phase in problem.phases)
    return replace(problem, phases=tuple(phases))


def scaled_margins(problem: ControlProblem, factor: float) -> ControlProblem:
    """The problem with all margins times a factor."""
    return problem.with_signals(
        lambda phase, s: replace(s, min=factor * s.min) if s in phase.algebraics and s.min > 0 else s
    )


def _kept_off(problem: ControlProblem, phase: Phase):
    """The algebraics of a phase, those that are square roots with their margins."""
    first = len(phase.states)
    roots = [k for k, a in enumerate(phase.algebraics) if a.is_root]
    if not roots:
        return phase.algebraics
    guesses = np.array([s.guess(SHARES) for s in phase.signals])
    rows = _look(problem, phase)
    residuals = slice(first, first + len(phase.algebraics))
    # the equation of a root is root^2 - radicand = 0
    radicands = guesses[first:][: len(phase.algebraics)] ** 2 - rows(guesses)[residuals]
    found = list(phase.algebraics)
    for k in roots:
        top = float(np.max(guesses[first + k]))
        pole = _pole(rows, guesses, np.array([s.nominal for s in phase.signals]), first + k, top)
        found[k] = replace(found[k], min=_margin(radicands[k], top) if pole else 0.0)
    return tuple(found)


def _look(problem: ControlProblem, phase: Phase) -> Look:
    """Values of all equations and path limits for signals (n, SHARES), what is no number as 0 where it has no value."""
    start, stop = horizon(problem, phase)
    times = start + (stop - start) * SHARES
    rows = ca.vertcat(phase.ode, phase.residuals, *(limit.expression for limit in phase.path_limits))
    courses = ca.vertcat(ca.SX(0, 1), *(c.symbol for c in phase.courses))
    function = ca.Function(
        "rows",
        [problem.time, ca.vertcat(*(s.symbol for s in phase.signals)), courses, problem.numbers],
        [ca.densify(rows)],
    )
    known = np.array([c.value(times) for c in phase.courses]).reshape(-1, times.size)
    numbers = np.tile(np.array([n.guess for n in problem.free]).reshape(-1, 1), times.size)
    return lambda signals: np.array(function(times[None, :], signals, known, numbers))


def _pole(rows: Look, guesses: np.ndarray, sizes: np.ndarray, root: int, top: float) -> bool:
    """Whether an equation or limit grows without end when a root goes to zero, all else beside the first guess."""
    waves = np.sin(1.0 + 7.3 * np.arange(guesses.size)).reshape(guesses.shape)
    beside = guesses + BESIDE * sizes[:, None] * waves

    def largest(value: float) -> np.ndarray:
        beside[root] = value
        return np.max(np.nan_to_num(np.abs(rows(beside)), nan=np.inf), axis=1, initial=0.0)

    far, near = largest(NEAREST * top), largest(POLE * top)
    return bool(np.any(np.isfinite(far) & (near > GROWS * far)))


def _margin(radicand: np.ndarray, top: float) -> float:
    """How far a root is kept off zero by its square along the first guess."""
    margin = NEAREST * top
    values = np.sqrt(np.maximum(np.nan_to_num(radicand), 0.0))
    ends, least = np.min(values[[0, -1]]), np.min(values)
    if least < margin:
        margin = max(0.5 * least, FLOOR * margin)
    return float(min(margin, 0.5 * ends)) if ends < 1.1 * margin else float(margin)
