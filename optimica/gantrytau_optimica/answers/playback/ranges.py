"""The range of limits and conditions: what is small for them.

    range = max(|bound|, |terms|, share of sum |d expression / d signal| nominal)

A difference that is well limited is close to its bound: its own values say nothing of its size, those of its terms do.
Where one term is compared with zero there is nothing else to compare it with but `nominal`.
"""

from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np

from gantrytau_optimica.control.control_problem import ControlProblem, Limit, PointValue, Signal
from gantrytau_optimica.transcription.trajectory import Trajectory

NOISE = 1e-7  # of `nominal`: terms that stay below are what solver and integrator leave of a zero
FLAT = 1e-6  # of the sum of its terms: below, an objective is what rounding leaves of a zero

Measured = list[tuple[Limit, np.ndarray, float]]
_SUMS = (ca.OP_ADD, ca.OP_SUB)
_SAME = (ca.OP_NEG, ca.OP_FABS)


def measured(trajectory: Trajectory, values: Callable[[ca.SX], np.ndarray]) -> Measured:
    """All limits along a phase, those of algebraics by themselves included, with values (n,) and range of each.

    values: expressions (m,) of the symbols of the phase -> (m, n), along a motion. Ranges are those of the solution, which
    a motion may have left by far.
    """
    phase = trajectory.phase
    own = [
        Limit(s.symbol, s.min, s.max, s.words or s.name)
        for s in phase.algebraics
        if np.isfinite(s.min) or np.isfinite(s.max)
    ]
    limits = [*phase.path_limits, *own]
    if not limits:
        return []
    parts = [terms(limit.expression) for limit in limits]
    changes = _ranges_to_first_order([limit.expression for limit in limits], phase.signals)
    rows = values(ca.vertcat(*(limit.expression for limit in limits)))
    inside = trajectory.values(ca.vertcat(*changes, *(t for part in parts for t in part)), trajectory.time)
    sizes = iter(_largest(inside))
    moves = [next(sizes) for _ in limits]
    largest = [max((next(sizes) for _ in part), default=0.0) for part in parts]
    return [
        (limit, row, _range(limit, size, move, alone=len(part) == 1))
        for limit, row, size, move, part in zip(limits, rows, largest, moves, parts, strict=True)
    ]


def _range(limit: Limit, size: float, move: float, alone: bool) -> float:
    """size: of the largest term; move: by how much typical changes of the signals change the expression."""
    if np.isfinite(limit.lower) and np.isfinite(limit.upper) and limit.upper > limit.lower:
        return limit.upper - limit.lower
    bound = abs(limit.lower if np.isfinite(limit.lower) else limit.upper)
    share = 1.0 if alone and bound == 0.0 and limit.lower == limit.upper else NOISE
    return float(max(bound, size, share * move)) or 1.0  # what is always zero holds in any unit


def condition_sizes(
    problem: ControlProblem, numbers: np.ndarray, values: Callable[[int, PointValue, ca.SX], np.ndarray]
) -> np.ndarray:
    """The size of what every condition at single times compares, (k,).

    numbers: free and held ones; values: (number of a phase, point, expressions (m,) of its signals) -> (m,), at the time
    of the point.
    """
    symbols, found, sizes = [problem.numbers], [ca.DM(numbers)], [np.abs(numbers)]
    for number, phase in enumerate(problem.phases):
        for point in phase.points:
            elements = point.expression.elements()
            parts = [terms(e) for e in elements]
            changes = _ranges_to_first_order(elements, phase.signals)
            asked = ca.vertcat(point.expression, *changes, *(t for part in parts for t in part))
            rows = values(number, point, asked)
            rest = iter(_largest(rows[:, None])[len(elements) :])
            moves = [next(rest) for _ in elements]
            symbols.append(point.symbol)
            found.append(ca.DM(rows[: len(elements)]))
            sizes.append(
                np.array([max(m, *(next(rest) for _ in p)) for m, p in zip(moves, parts, strict=True)])
            )
    for one in {s.symbol.element_hash(): s for s in problem.sums}.values():
        symbols.append(one.symbol)
        found.append(ca.DM(0.0))
        sizes.append(np.ones(1))
    typical = ca.DM(np.concatenate(sizes))
    rows = []
    for limit in problem.boundary:
        change = ca.fabs(ca.densify(ca.jacobian(limit.expression, ca.vertcat(*symbols)))) @ typical
        rows.append(ca.mmax(ca.vertcat(change, *(ca.fabs(t) for t in terms(limit.expression)))))
    inside = np.array(ca.Function("sizes", symbols, [ca.vertcat(ca.SX(0, 1), *rows)])(*found)).ravel()
    bounds = np.array([[limit.lower, limit.upper] for limit in problem.boundary]).reshape(-1, 2)
    bounds = np.max(np.abs(np.where(np.isfinite(bounds), bounds, 0.0)), axis=1)
    largest = np.maximum(bounds, np.where(np.isfinite(inside), inside, 0.0))
    return np.where(largest > 0.0, largest, 1.0)


def terms(expression: ca.SX) -> list[ca.SX]:
    """What is added up to a scalar, signs aside: `2 * (x - y) + z` has the terms 2 x, 2 y and z. Zeros are none."""
    found: dict[tuple[int, float], ca.SX] = {}
    seen: set[tuple[int, float]] = set()
    left = [(ca.SX(expression), 1.0)]
    while left:
        one, factor = left.pop()
        key = (one.element_hash(), factor)
        if key in seen:
            continue
        seen.add(key)
        if one.is_op(ca.OP_TWICE):
            left.append((one.dep(0), 2 * factor))
        elif any(one.is_op(op) for op in _SAME):
            left.append((one.dep(0), factor))
        elif any(one.is_op(op) for op in _SUMS):
            left += [(one.dep(1), factor), (one.dep(0), factor)]
        elif one.is_op(ca.OP_MUL) and one.dep(0).is_constant():
            left.append((one.dep(1), factor * abs(float(one.dep(0)))))
        elif one.is_op(ca.OP_MUL) and one.dep(1).is_constant():
            left.append((one.dep(0), factor * abs(float(one.dep(1)))))
        elif one.is_op(ca.OP_DIV) and one.dep(1).is_constant():
            left.append((one.dep(0), factor / abs(float(one.dep(1)))))
        elif not one.is_zero():
            found[key] = factor * one
    return list(found.values())


def magnitude(expression: ca.SX) -> ca.SX:
    """A scalar with all its sums taken of absolute values: what its value may have been the difference of."""
    known: dict[int, ca.SX] = {}
    left = [ca.SX(expression)]
    while left:
        one = left[-1]
        if one.element_hash() in known:
            left.pop()
            continue
        inner = _summed(one)
        missing = [e for e in inner if e.element_hash() not in known]
        left += missing
        if not missing:
            known[one.element_hash()] = _combined(one, [known[e.element_hash()] for e in inner])
            left.pop()
    return known[ca.SX(expression).element_hash()]


def _summed(one: ca.SX) -> list[ca.SX]:
    """The operands of a scalar whose magnitudes make up its own."""
    through = (*_SUMS, *_SAME, ca.OP_TWICE, ca.OP_SQ, ca.OP_SQRT, ca.OP_MUL)
    if any(one.is_op(op) for op in through):
        return [one.dep(k) for k in range(one.n_dep())]
    return [one.dep(0)] if one.is_op(ca.OP_DIV) else []


def _combined(one: ca.SX, inner: Sequence[ca.SX]) -> ca.SX:
    if any(one.is_op(op) for op in _SUMS):
        return inner[0] + inner[1]
    if one.is_op(ca.OP_MUL):
        return inner[0] * inner[1]
    if one.is_op(ca.OP_DIV):
        return inner[0] / ca.fabs(one.dep(1))
    for op, same in ((ca.OP_TWICE, lambda x: 2 * x), (ca.OP_SQ, lambda x: x * x), (ca.OP_SQRT, ca.sqrt)):
        if one.is_op(op):
            return same(inner[0])
    return inner[0] if inner else ca.fabs(one)


def _ranges_to_first_order(expressions: Sequence[ca.SX], signals: Sequence[Signal]) -> list[ca.SX]:
    """For each scalar, by how much it changes at most when every signal changes by its typical size."""
    symbols = ca.vertcat(ca.SX(0, 1), *(s.symbol for s in signals))
    sizes = ca.DM([s.nominal for s in signals])
    if not symbols.numel():
        return [ca.SX(0) for _ in expressions]
    changes = ca.fabs(ca.densify(ca.jacobian(ca.vertcat(*expressions), symbols)))
    return (changes @ sizes).elements()


def _largest(rows: np.ndarray) -> np.ndarray:
    """The largest absolute value of every row that is finite, else 0, (m,)."""
    return np.max(np.where(np.isfinite(rows), np.abs(rows), 0.0), axis=1, initial=0.0)
