"""Consistent values: weighted minimum-norm Newton steps, level by level.

Positions first, then velocities, then accelerations and forces: a joint solve over all levels would move
positions that are already consistent. Values with a start move a hundred times less gladly than others.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from gantrytau.errors import InitializationError

STIFFNESS = 1e-2  # how far a value with a start moves, compared with one without
TOLERANCE = (
    1e-15  # of the residual, relative to the terms of its equation; rounding may stop the steps before
)
ITERATIONS = 60


@dataclass(frozen=True, eq=False)
class Level:
    """Equations that are solved together: residuals, and symbols that may move."""

    residuals: tuple[ca.SX, ...]
    names: tuple[str, ...]  # of the residuals, for messages
    unknowns: tuple[str, ...]


def solve_levels(
    levels: Sequence[Level],
    symbols: Mapping[str, ca.SX],
    values: Mapping[str, float],
    *,
    held: frozenset[str],
    started: frozenset[str],
    title: str,
) -> dict[str, float]:
    """Values that satisfy all levels, nearest to the given ones.

    values: a number for every symbol that occurs; held: names that must not move; started: names whose
    number somebody gave. Raises InitializationError with the worst residuals by name.
    """
    values = dict(values)
    for level in levels:
        moving = [n for n in level.unknowns if n not in held]
        if level.residuals:
            free = [n for n in moving if n not in started]
            try:  # starts that fit together are held
                _solve(level, free, symbols, values, started, title)
            except InitializationError:
                _solve(level, moving, symbols, values, started, title)
    return values


def _solve(level: Level, moving: list[str], symbols, values: dict[str, float], started, title: str) -> None:
    residual = ca.vertcat(*level.residuals)
    x = ca.vertcat(*(symbols[n] for n in moving)) if moving else ca.SX(0, 1)
    others = [leaf for leaf in ca.symvar(residual) if leaf.name() not in set(moving)]
    given = ca.DM([values[leaf.name()] for leaf in others])
    here = ca.substitute(residual, ca.vertcat(*others), given) if others else residual
    slopes = ca.jacobian(here, x)
    evaluate = ca.Function("level", [x], [ca.densify(here), ca.densify(slopes)])
    weights = np.array([STIFFNESS if n in started else 1.0 for n in moving])
    point = np.array([values[n] for n in moving])

    def at(point: np.ndarray):
        f, jacobian = evaluate(point)
        return np.array(f).ravel(), np.array(jacobian).reshape(len(level.residuals), len(moving))

    point = _propagated(at, point, slopes.sparsity(), {k for k, n in enumerate(moving) if n not in started})
    f, jacobian = at(point)
    for _ in range(ITERATIONS):
        if not np.all(np.isfinite(f)):
            break
        # a residual is judged against the size of the terms it is the difference of
        scale = np.maximum(np.abs(jacobian) @ np.abs(point) if moving else 0.0, 1.0)
        if np.all(np.abs(f) <= TOLERANCE * scale):
            break
        rows = np.maximum(np.linalg.norm(jacobian * weights, axis=1), 1e-30)
        step = weights * np.linalg.lstsq(jacobian * weights / rows[:, None], -f / rows, rcond=1e-11)[0]
        point, f, jacobian, moved = _line_search(at, point, step, f, rows, jacobian)
        if not moved:
            break
    scale = np.maximum(np.abs(jacobian) @ np.abs(point) if moving else 0.0, 1.0)
    bad = ~(np.abs(f) <= 1e-9 * scale)
    if np.any(bad):
        raise InitializationError(_failure(level, f, bad, title))
    values.update(zip(moving, point.tolist(), strict=True))


def _propagated(at, point: np.ndarray, pattern: ca.Sparsity, missing: set[int]) -> np.ndarray:
    """Values without a start computed from those with one, as far as single equations give them outright."""
    rows: dict[int, set[int]] = {}
    for i, j in zip(*pattern.get_triplet(), strict=True):
        if j in missing:
            rows.setdefault(i, set()).add(j)
    while True:
        single = {next(iter(left)): i for i, left in rows.items() if len(left) == 1}
        if not single:
            return point
        f, jacobian = at(point)
        new = point.copy()
        for j, i in single.items():
            slope = jacobian[i, j]
            if np.isfinite(f[i]) and abs(slope) > 1e-3 * np.abs(jacobian[i]).max() > 0:
                new[j] -= f[i] / slope
        after, _ = at(new)
        for j, i in single.items():
            if not abs(after[i]) <= 1e-9 * max(1.0, abs(f[i])):  # not linear in it
                new[j] = point[j]
        point = new
        rows = {i: left - single.keys() for i, left in rows.items()}


def _line_search(at, point, step, f, rows, jacobian):
    """Halve the step until the residual falls; near the end, where rounding rules, accept standing still."""
    merit = np.linalg.norm(f / rows)
    length = 1.0
    for _ in range(25):
        new = point + length * step
        f_new, jacobian_new = at(new)
        if np.all(np.isfinite(f_new)) and np.linalg.norm(f_new / rows) < merit * (1 - 1e-4 * length):
            return new, f_new, jacobian_new, True
        length /= 2
    return point, f, jacobian, False


def _failure(level: Level, f: np.ndarray, bad: np.ndarray, title: str) -> str:
    order = sorted(np.flatnonzero(bad), key=lambda i: -abs(f[i]) if np.isfinite(f[i]) else -np.inf)
    worst = "; ".join(f"{level.names[i]} is off by {f[i]:.3g}" for i in order[:5])
    return (
        f"{title}: no consistent start found. Worst residuals: {worst}. Expected 0: change the start values "
        "or the parameters (is a length out of reach?), or release a fixed start"
    )
