"""Conditions at the end that follow from others there along every motion, as the norm of a quaternion is kept.

A sum l . x(T) that inputs u and the duration T do not move decides one of its states from the others,

    l . dx(T)/d(u, T) = 0 along a motion that leads to the demanded end

Equations on a mesh keep such sums to its accuracy only, so that their rank says nothing; rank is that of a motion here.
"""

from collections.abc import Iterable
from dataclasses import replace

import casadi as ca
import numpy as np

from gantrytau_optimica.control.built import Built
from gantrytau_optimica.control.control_problem import ControlProblem, Limit, Phase, Signal
from gantrytau_optimica.control.first_guesses.guesses import horizon
from gantrytau_optimica.control.limits import known_states
from gantrytau_optimica.failures.end_equilibrium import speeds
from gantrytau_optimica.transcription.trajectory import Trajectory

STEPS = 25  # of Runge-Kutta's method while inputs are constant
RANK = 1e-6  # of the largest singular value: below are directions in which no input moves the end
CLEAR = 0.1  # of the largest share: a smaller one in a sum that is kept would decide its state badly
MET = 1e-4  # of its size: by how much a mesh may miss a condition that follows from others
SHORTER = (1.0, 0.1, 0.01)  # parts of the guessed duration, until a motion stays finite

Ends = list[tuple[Limit, Signal]]


def following_ends(built: Built) -> Ends:
    """Conditions on single states at the end of a phase that others there decide, with these states."""
    found: Ends = []
    for (number, when), known in known_states(built.problem).items():
        phase = built.problem.phases[number]
        ends = {k: known[h] for k, s in enumerate(phase.states) if (h := s.symbol.element_hash()) in known}
        closed = all(a.name in built.closed for a in phase.algebraics) and not phase.courses
        # each input moves the end of a chain of rates, and so all of it
        moved = sum(speeds(phase)) <= len(phase.inputs)
        if when == "final" and len(ends) > 1 and closed and phase.inputs and not moved:
            dependent = _dependent(built, phase, {k: limit.lower for k, limit in ends.items()})
            found += [(ends[k], phase.states[k]) for k in dependent]
    return found


def without_following(built: Built, ends: Ends | None = None) -> ControlProblem:
    """The problem without conditions at the end that follow from others there; itself where none do."""
    left_out = {limit.name for limit, _ in (following_ends(built) if ends is None else ends)}
    boundary = tuple(limit for limit in built.problem.boundary if limit.name not in left_out)
    following = (*built.problem.following, *sorted(left_out))
    return replace(built.problem, boundary=boundary, following=following) if left_out else built.problem


def contradicted(phases: Iterable[Trajectory], ends: Ends) -> str:
    """The first dependent end condition missed by a motion without dependent conditions, in words; "" if none."""
    for limit, state in ends:
        for phase in phases:
            if any(s.symbol.element_hash() == state.symbol.element_hash() for s in phase.phase.states):
                value = float(phase.values(state.symbol, phase.time[-1:])[0, 0])
                if abs(value - limit.lower) > MET * state.nominal:
                    return f"`{limit.name}` follows from the others at the end, which make it {value:.6g}"
    return ""


def _dependent(built: Built, phase: Phase, ends: dict[int, float]) -> list[int]:
    """Numbers among states with demanded ends, by number, of those that follow from the others."""
    x, u = (ca.vertcat(*(s.symbol for s in part)) for part in (phase.states, phase.inputs))
    start, stop = horizon(built.problem, phase)
    known = ca.vertcat(built.problem.time, built.problem.numbers)
    guess = ca.DM([start, *(n.guess for n in built.problem.free)])
    (rates,) = ca.substitute(built.in_closed_form(phase, [phase.ode]), [known], [guess])
    sizes, widths = (np.array([s.nominal for s in part]) for part in (phase.states, phase.inputs))
    random, segments = np.random.default_rng(0), 2 * sizes.size + 2
    end = np.array([ends.get(k, float(s.guess(np.ones(1))[0])) for k, s in enumerate(phase.states)])
    middle = np.array([float(s.guess(np.full(1, 0.5))[0]) for s in phase.inputs])
    inputs = middle[:, None] + widths[:, None] * random.uniform(-1, 1, (widths.size, segments))
    step = ca.simpleRK(ca.Function("rates", [x, u], [ca.densify(rates)]), STEPS, 4)
    begun, held, span = (ca.MX.sym(name, n) for name, n in (("x", sizes.size), ("u", widths.size), ("h", 1)))
    reached = step(begun, held, span)
    moves = ca.Function("moves", [begun, held, span], [ca.jacobian(reached, ca.vertcat(begun, held, span))])
    for share in SHORTER:
        place, length = end, share * (stop - start) / segments
        for now in inputs[:, ::-1].T:
            place = step(place, now, -length)
        if not np.all(np.abs(np.array(place).ravel() - end) < 1e3 * sizes):
            continue
        columns = np.zeros((sizes.size, 0))
        for now in inputs.T:
            jacobian = np.array(moves(place, now, length))
            columns = np.hstack([jacobian[:, : sizes.size] @ columns, jacobian[:, sizes.size :]])
            place = step(place, now, length)
        scaled = columns * np.tile([*widths, length], segments) / sizes[:, None]
        return [sorted(ends)[k] for k in _decided(_unmoved(scaled[sorted(ends)]))]
    return []


def _unmoved(matrix: np.ndarray) -> np.ndarray:
    """Left null space (n, k) of a matrix with n rows; empty for a matrix that is not finite."""
    if not np.all(np.isfinite(matrix)):
        return np.zeros((len(matrix), 0))
    left, values, _ = np.linalg.svd(matrix)
    return left[:, np.append(values, np.zeros(len(left) - values.size)) <= RANK * values[0]]


def _decided(flat: np.ndarray) -> list[int]:
    """One dependent row for each direction of the null space: the last one without a turning point."""
    found: list[int] = []
    for _ in range(flat.shape[1]):
        share = np.linalg.norm(flat, axis=1)
        found.append(int(np.flatnonzero(share >= CLEAR * share.max())[-1]))
        direction = flat[found[-1]] / share[found[-1]]
        flat = flat - np.outer(flat @ direction, direction)
    return found
