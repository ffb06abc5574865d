"""Consistent values: weighted minimum-norm Newton steps, level by level.

Positions first, then velocities, then accelerations and forces: a joint solve over all levels would move
positions that are already consistent. Values with a start move a hundred times less gladly than others.
"""

from collections.abc import Mapping, Sequence

import casadi as ca
import numpy as np

from gantrytau.border.refusal import InitializationError
from gantrytau.compiler.start.balance import balance
from gantrytau.compiler.start.level import ROUNDING, Level
from gantrytau.compiler.start.newton import Matrix, newton, scaled
from gantrytau.compiler.start.single_equations import propagated
from gantrytau.language.piecewise import switched, with_modes

STIFFNESS = 1e-2  # how far a value with a start moves, compared with one without
SOLVED = 1e-9  # the same, for an equation to hold
ATTEMPTS = 6  # with other values, where the given ones do not lead to a solution
SPREAD = 0.3  # of the first of them
MOST_PIECES = 60  # that are tried


def solve_levels(
    levels: Sequence[Level],
    values: Mapping[str, float],
    *,
    held: frozenset[str],
    started: frozenset[str],
    title: str,
    chosen: frozenset[str] = frozenset(),
    thorough: bool = False,
) -> dict[str, float]:
    """Values that satisfy all levels, nearest to the given ones.

    values: a number for every symbol that occurs; held: names that must not move; started: names whose
    number somebody gave; chosen: of these those that are kept before the others; thorough: if they do not lead to a
    solution, try others around them. Raises InitializationError with the worst residuals by name.
    """
    values = dict(values)
    for level in levels:
        moving = [n for n in level.unknowns if n not in held]
        if level.residuals:
            free = [n for n in moving if n not in started]
            looser = [n for n in moving if n not in chosen]
            # starts that fit together are held, or else those that whoever uses the model chose
            fewer = [free, looser] if len(free) < len(looser) < len(moving) else [free]
            if any(_solved(level, names, values, started, title) for names in fewer):
                continue
            try:
                (_solve_anyhow if thorough else _solve)(level, moving, values, started, title)
            except InitializationError:
                if not _follows(level, moving, values, chosen) and not _solve_switching(
                    level, moving, values, started, title
                ):
                    raise
    return values


def _solved(
    level: Level, moving: Sequence[str], values: dict[str, float], started: frozenset[str], title: str
) -> bool:
    """Solve for some names, the other values being held; False where these do not fit together."""
    place = level.place
    rows, columns = level.entries
    still = np.ones(len(level.residuals), dtype=bool)
    still[rows[np.isin(columns, [place[n] for n in moving if n in place])]] = False
    given = np.array([values[n] for n in level.leaves])
    f, _ = level.look(given)
    off = np.flatnonzero(still & (f != 0))  # equations without any of the names
    if off.size and np.any(np.abs(f[off]) > SOLVED * level.sizes(off.tolist(), given)):
        return False
    try:
        _solve(level, moving, values, started, title)
    except InitializationError:
        return False
    return True


def _follows(level: Level, moving: Sequence[str], values: dict[str, float], chosen: frozenset[str]) -> bool:
    """Whether all values follow from one another, equation by equation, once the starts of the model give way, as
    signals do: through what switches on what was just computed, steps of all at once go to and fro.
    """
    place = level.place
    given = np.array([values[n] for n in level.leaves])
    found = propagated(level, given, {place[n] for n in moving if n in place and n not in chosen})
    f, _ = level.look(found)
    if not np.all(np.abs(f) <= SOLVED * level.sizes(list(range(len(f))), found)):
        return False
    values.update((n, float(found[place[n]])) for n in moving if n in place)
    return True


def _solve_anyhow(level: Level, moving: Sequence[str], values: dict[str, float], started, title: str) -> None:
    """From the given values, and if that fails from others around them: bars in one line know no way to bend."""
    try:
        return _solve(level, moving, values, started, title)
    except InitializationError as error:
        first = error
    random = np.random.default_rng(0)
    for attempt in range(ATTEMPTS if level.curved(moving) else 0):
        size = SPREAD * (1 + attempt % 3)
        other = dict(values)
        for name in moving:
            other[name] += size * (STIFFNESS if name in started else 1.0) * random.uniform(-1, 1)
        try:
            _solve(level, moving, other, started, title, propagate=False)
        except InitializationError:
            continue
        values.update(other)
        return None
    raise first


def _solve_switching(
    level: Level, moving: Sequence[str], values: dict[str, float], started: frozenset[str], title: str
) -> bool:
    """Try the pieces of equations that switch on what moves, one after another: where steps go to and fro between them.

    A piece is left for the one in which its solution lies, or for one that differs in a single switch from it.
    """
    found = switched(level.residuals, set(moving))
    if not found.switches:
        return False
    names = [s.mode.name() for s in found.switches]
    leaves = ca.vertcat(*ca.symvar(ca.vertcat(*level.residuals)))
    modes = ca.Function("modes", [leaves], with_modes(found, [ca.vertcat(*(s.mode for s in found.switches))]))

    def read(numbers: Mapping[str, float]) -> tuple[float, ...]:
        return tuple(np.array(modes([numbers[n] for n in level.leaves])).ravel().tolist())

    smooth = Level(found.expressions, level.names, level.unknowns, level.exact)
    waiting, seen = [read(values)], set[tuple[float, ...]]()
    while waiting and len(seen) < MOST_PIECES:
        chosen = waiting.pop(0)
        if chosen in seen or not np.all(np.isfinite(chosen)):
            continue
        seen.add(chosen)
        trial = {**values, **dict(zip(names, chosen, strict=True))}
        try:
            _solve(smooth, moving, trial, started, title)
        except InitializationError:
            continue
        there = read(trial)
        if there == chosen:
            values.update((n, trial[n]) for n in moving)
            return True
        waiting.append(there)
        for k, (old, new) in enumerate(zip(chosen, there, strict=True)):
            if old != new:  # of what counts, the next number
                step = old + float(np.sign(new - old))
                waiting.append((*chosen[:k], step, *chosen[k + 1 :]))
    return False


def _solve(
    level: Level, moving: Sequence[str], values: dict[str, float], started, title: str, propagate: bool = True
) -> None:
    place = level.place
    moving = [n for n in moving if n in place]
    columns = [place[n] for n in moving]
    around = np.array([values[n] for n in level.leaves])
    weights = np.array([STIFFNESS if n in started else 1.0 for n in moving])

    matrix = level.moving(columns)

    def at(point: np.ndarray) -> tuple[np.ndarray, Matrix]:
        around[columns] = point
        f, nonzeros = level.look(around)
        return f, matrix(nonzeros)

    if propagate:
        missing = {column for k, column in enumerate(columns) if moving[k] not in started}
        around = propagated(level, around, missing)
    start = around[columns]

    def led(factors: np.ndarray | float, sizes: np.ndarray | float) -> np.ndarray:
        """Where steps of these sizes lead."""
        return newton(lambda x: _scaled_rows(factors, *at(x)), start, weights * sizes)[0]

    def left_at(point: np.ndarray, sizes: np.ndarray | float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What is left at a point, which equations do not hold, and which not even but for rounding."""
        f, jacobian = at(point)
        off = ~(np.abs(f) <= SOLVED * (abs(jacobian) @ np.abs(point)))
        left = np.flatnonzero(off)
        if left.size and np.all(np.isfinite(f)):
            off[left] = np.abs(f[left]) > SOLVED * level.sizes(left.tolist(), around)
        # unknowns that are solved together have the rounding of the largest, in their sizes
        rounding = abs(scaled(jacobian, 1.0, sizes)).sum(axis=1) * np.max(np.abs(point / sizes), initial=1.0)
        return f, off, off & ~(np.abs(f) <= ROUNDING * rounding)

    point = led(1.0, 1.0)  # sizes of metres, radians and newtons
    f, off, bad = left_at(point, 1.0)
    if np.any(off):
        jacobian = at(start)[1]
        rows, sizes = balance(jacobian, matrix(level.certainty(around)))
        if np.any(rows != 1) or np.any(sizes != 1):
            other = led(rows, sizes)
            f_other, off, bad_other = left_at(other, sizes)
            # where both hold but for rounding, the point where less is left
            less = np.linalg.norm(rows.ravel() * f_other) <= np.linalg.norm(rows.ravel() * f)
            if np.any(bad) or not np.any(off) or (less and not np.any(bad_other)):
                point, f, bad = other, f_other, bad_other
    if np.any(bad):
        raise _failure(level, f, bad, title)
    values.update(zip(moving, point.tolist(), strict=True))


def _scaled_rows(rows: np.ndarray | float, f: np.ndarray, jacobian: Matrix) -> tuple[np.ndarray, Matrix]:
    return np.ravel(rows) * f, scaled(jacobian, rows, 1.0)


def _failure(level: Level, f: np.ndarray, bad: np.ndarray, title: str) -> InitializationError:
    order = sorted(np.flatnonzero(bad), key=lambda i: -abs(f[i]) if np.isfinite(f[i]) else -np.inf)
    worst = "; ".join(f"{level.names[i]} is off by {f[i]:.3g}" for i in order[:5])
    return InitializationError(
        f"{title}: no consistent start found. Worst residuals: {worst}. Expected 0: change the start values "
        "or the parameters (is a length out of reach?), or release a fixed start",
        residuals={level.names[i]: float(f[i]) for i in order},
    )
