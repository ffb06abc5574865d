"""Conditions at the end that follow from others there along every motion, as the norm of a quaternion is kept.

    x(T; u, T) from a start that leads to the demanded end;  l . dx(T)/d(u, T) = 0 : only one of the states in l is free

Equations on a mesh keep such sums to its accuracy only, so that their rank says nothing; rank is that of a motion here.
"""

from dataclasses import replace

import casadi as ca
import numpy as np

from gantrytau_optimica.control.built import Built, with_values
from gantrytau_optimica.control.control_problem import ControlProblem, Limit, Phase, Signal
from gantrytau_optimica.control.first_guesses.guesses import horizon
from gantrytau_optimica.control.limits import signal_limits, values_demanded

STEPS = 25  # of Runge-Kutta's method while inputs are constant
RANK = 1e-6  # of the largest singular value: below are directions in which no input moves the end
CLEAR = 0.1  # of the largest share: what has less in a sum that is kept would be decided badly
SHORTER = (1.0, 0.1, 0.01)  # parts of the guessed duration, until a motion stays finite

Ends = list[tuple[Limit, Signal]]


def following_ends(built: Built) -> Ends:
    """Conditions on single states at the end of a phase that others there decide, with these states."""
    found: Ends = []
    for (number, when), demanded in values_demanded(built.problem).items():
        phase = built.problem.phases[number]
        rows = {value.element_hash(): row for value, row in demanded}
        states = [k for k, s in enumerate(phase.states) if s.symbol.element_hash() in rows]
        if when == "final" and len(states) > 1 and not phase.courses:
            limits = [rows[phase.states[k].symbol.element_hash()] for k in states]
            dependent = _dependent(built, phase, states, np.array([limit.lower for limit in limits]))
            found += [(limits[k], phase.states[states[k]]) for k in dependent]
    return found


def without_following(built: Built, ends: Ends | None = None) -> ControlProblem:
    """The problem without conditions at the end that follow from others there; itself where none do."""
    left_out = {limit.name for limit, _ in (following_ends(built) if ends is None else ends)}
    boundary = tuple(limit for limit in built.problem.boundary if limit.name not in left_out)
    return (
        replace(built.problem, boundary=boundary, following=tuple(sorted(left_out)))
        if left_out
        else built.problem
    )


def _dependent(built: Built, phase: Phase, states: list[int], target: np.ndarray) -> list[int]:
    """Numbers among the states (k,) with demanded ends (k,) of those that follow from the others."""
    rates = _rates(built, phase)
    if rates is None or not phase.inputs:
        return []
    sizes = np.array([s.nominal for s in phase.states])
    end = np.array([float(s.guess(np.ones(1))[0]) for s in phase.states])
    end[states] = target
    segments, count = 2 * sizes.size + 2, len(phase.inputs)
    start, stop = horizon(built.problem, phase)
    inputs = _inputs(built, phase, segments)
    moved = _motion(rates, sizes.size, count, segments)
    for share in SHORTER:
        span = share * (stop - start)
        begin = np.array(moved(end, inputs[:, ::-1], -span)).ravel()
        if np.all(np.isfinite(begin)) and np.all(np.abs(begin - end) < 1e3 * sizes):
            x, u, t = ca.MX.sym("x", sizes.size), ca.MX.sym("u", count, segments), ca.MX.sym("t")
            slopes = ca.jacobian(moved(x, u, t), ca.vertcat(ca.vec(u), t))
            matrix = np.array(ca.Function("slopes", [x, u, t], [slopes])(begin, inputs, span))
            break
    else:
        return []
    widths = np.append([s.nominal for s in phase.inputs] * segments, span)
    left, values, _ = np.linalg.svd((matrix * widths / sizes[:, None])[states])
    if not np.all(np.isfinite(values)):
        return []
    flat = left[:, np.append(values, np.zeros(left.shape[0] - values.size)) < RANK * values[0]]
    found: list[int] = []
    for _ in range(
        flat.shape[1]
    ):  # the last that moves with the others, but not where it has a turning point
        share = np.linalg.norm(flat, axis=1)
        found.append(int(np.flatnonzero(share >= CLEAR * share.max())[-1]))
        direction = flat[found[-1]] / share[found[-1]]
        flat = flat - np.outer(flat @ direction, direction)
    return found


def _rates(built: Built, phase: Phase) -> ca.Function | None:
    """(x, u) -> dx/dt at the guessed start and numbers; None where algebraics have no closed form."""
    if any(a.name not in built.closed for a in phase.algebraics):
        return None
    rates, problem = phase.ode, built.problem
    if phase.algebraics:
        forms = with_values([built.closed[a.name] for a in phase.algebraics], built.read, built.numbers)
        symbols = [a.symbol for a in phase.algebraics]
        _, (rates,) = ca.substitute_inplace(symbols, [ca.densify(f) for f in forms], [rates], False)
    known = ca.vertcat(problem.time, problem.numbers)
    start, _ = horizon(problem, phase)
    rates = ca.substitute(rates, known, ca.DM([start, *(n.guess for n in problem.free)]))
    signals = [ca.vertcat(*(s.symbol for s in part)) for part in (phase.states, phase.inputs)]
    return ca.Function("rates", signals, [ca.densify(rates)])


def _inputs(built: Built, phase: Phase, segments: int) -> np.ndarray:
    """Inputs (m, segments) that are different all the time, within their limits."""
    limits = signal_limits(phase, built.problem.name)
    random, rows = np.random.default_rng(0), []
    for s in phase.inputs:
        low, high = limits[s.name]
        low = low if np.isfinite(low) else (high if np.isfinite(high) else 0.0) - s.nominal
        high = high if np.isfinite(high) else low + 2 * s.nominal
        rows.append(random.uniform(low, high, segments))
    return np.array(rows)


def _motion(rates: ca.Function, states: int, inputs: int, segments: int) -> ca.Function:
    """(x, u (m, segments), duration) -> x at its end, by Runge and Kutta's method of order 4."""
    x, u, h = ca.MX.sym("x", states), ca.MX.sym("u", inputs), ca.MX.sym("h")
    k1 = rates(x, u)
    k2 = rates(x + h / 2 * k1, u)
    k3 = rates(x + h / 2 * k2, u)
    k4 = rates(x + h * k3, u)
    step = ca.Function("step", [x, u, h], [x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)])
    every, span = ca.MX.sym("u", inputs, segments), ca.MX.sym("span")
    several = step.mapaccum(STEPS * segments)
    short = ca.repmat(span / (STEPS * segments), 1, STEPS * segments)
    held = ca.horzcat(*(ca.repmat(every[:, k], 1, STEPS) for k in range(segments)))
    return ca.Function("motion", [x, every, span], [several(x, held, short)[:, -1]])
