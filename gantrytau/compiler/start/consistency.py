"""Consistent values: weighted minimum-norm Newton steps, level by level.

Positions first, then velocities, then accelerations and forces: a joint solve over all levels would move
positions that are already consistent. Values with a start move a hundred times less gladly than others.
"""

from collections.abc import Callable, Mapping, Sequence

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
NOTHING = float(np.finfo(float).tiny / np.finfo(float).eps)  # what is smaller loses its digits in products
POLISHED = 3  # times that steps relative to each unknown follow, where rounding of the largest is left
ATTEMPTS = 6  # with other values, where the given ones do not lead to a solution
SPREAD = 0.3  # of the first of them
MOST_PIECES = 60  # that are tried
MOST_NAMES = 8  # unknowns that a failure names


def solve_levels(
    levels: Sequence[Level],
    values: Mapping[str, float],
    *,
    held: frozenset[str],
    started: frozenset[str],
    title: str,
    chosen: frozenset[str] = frozenset(),
    thorough: bool = False,
    anew: bool = False,
) -> dict[str, float]:
    """Values that satisfy all levels, nearest to the given ones.

    values: a number for every symbol that occurs; held: names that must not move; started: names whose
    number somebody gave; chosen: of these those that are kept before the others; thorough: if they do not lead to a
    solution, try others around them; anew: begin again from what follows equation by equation. Raises
    InitializationError with the worst residuals by name.
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
                if not (
                    _follows(level, moving, values, chosen)
                    or _solve_switching(level, moving, values, started, title)
                    or (anew and _follows(level, moving, values, chosen, started, title))
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


def _follows(
    level: Level,
    moving: Sequence[str],
    values: dict[str, float],
    chosen: frozenset[str],
    started: frozenset[str] | None = None,
    title: str = "",
) -> bool:
    """Whether values follow from one another, equation by equation, once the starts of the model give way, as signals do.

    Steps of all at once go to and fro through what switches on what was just computed, and lead nowhere from the length 0
    of a spring, by which its direction is divided. started: steps follow where equations are left, from the values found.
    """
    place = level.place
    given = np.array([values[n] for n in level.leaves])
    found = propagated(level, given, {place[n] for n in moving if n in place and n not in chosen})
    if not np.all(np.isfinite(found)):
        return False
    followed = {**values, **{n: float(found[place[n]]) for n in moving if n in place}}
    f, _ = level.look(found)
    if not np.all(np.abs(f) <= SOLVED * level.sizes(list(range(len(f))), found)):
        if started is None:
            return False
        try:
            _solve(level, moving, followed, started, title, propagate=False)
        except InitializationError:
            return False
    values.update(followed)
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
    given = np.array([n in started for n in moving], dtype=bool)
    weights = np.where(given, STIFFNESS, 1.0)
    matrix = level.moving(columns)

    def at(point: np.ndarray) -> tuple[np.ndarray, Matrix]:
        around[columns] = point
        f, nonzeros = level.look(around)
        return f, matrix(np.where(np.isfinite(nonzeros), nonzeros, 0.0))  # sqrt(u) at u = 0 says nothing of u

    if propagate:
        missing = {column for k, column in enumerate(columns) if moving[k] not in started}
        around = propagated(level, around, missing)
    start = around[columns]

    def led(start: np.ndarray, factors: np.ndarray | float, sizes: np.ndarray | float) -> np.ndarray:
        """Where steps of these sizes lead."""
        return newton(lambda x: _scaled_rows(factors, *at(x)), start, weights * sizes)[0]

    def left_at(point: np.ndarray) -> tuple[np.ndarray, np.ndarray, Matrix]:
        """Residuals at a point, which equations do not hold, and the derivatives."""
        f, jacobian = at(point)
        off = ~(np.abs(f) <= NOTHING + SOLVED * (abs(jacobian) @ np.abs(point)))
        left = np.flatnonzero(off)
        if left.size and np.all(np.isfinite(f)):
            off[left] = ~(np.abs(f[left]) <= SOLVED * level.sizes(left.tolist(), around))
        return f, off, jacobian

    def settled(point: np.ndarray, sizes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return _without_rounding(left_at, led, np.where(given, start, 0.0), point, sizes)

    point, f, bad = settled(led(start, 1.0, 1.0), np.ones(len(start)))  # sizes of metres, radians and newtons
    if np.any(bad):
        jacobian = at(start)[1]
        rows, sizes = balance(jacobian, matrix(level.certainty(around)))
        if np.any(rows != 1) or np.any(sizes != 1):
            point, f, bad = settled(led(start, rows, sizes), sizes)
    if np.any(bad):
        raise _failure(level, f, bad, title)
    values.update(zip(moving, point.tolist(), strict=True))


def _without_rounding(
    left_at: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, Matrix]],
    led: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray],
    given: np.ndarray,
    point: np.ndarray,
    sizes: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The solution next to a point that is right but for rounding, its residuals, and the equations that do not hold.

    Unknowns that are zero have the rounding of larger ones, by which their equations do not hold. given: start values
    that somebody gave, else 0.
    """
    f, off, jacobian = left_at(point)
    # unknowns that are solved together have the rounding of the largest, in their sizes
    noise = ROUNDING * sizes * np.max(np.abs(point / sizes), initial=1.0)
    bad = off & ~(np.abs(f) <= abs(scaled(jacobian, 1.0, noise)).sum(axis=1))
    if np.any(bad):
        return point, f, bad
    for _ in range(POLISHED):
        if not np.any(off):
            break
        zero = (np.abs(point) <= noise) & ((given == 0) | (np.abs(given) > noise))
        while np.any(zero):
            zeroed = np.where(zero, 0.0, point)
            f_zeroed, still, _ = left_at(zeroed)
            if not np.any(still):
                return zeroed, f_zeroed, still
            needed = zero & (abs(jacobian).T @ still.astype(float) > 0)
            if not np.any(needed):
                break
            zero &= ~needed
        noise = ROUNDING * noise
        terms = (abs(jacobian) @ np.abs(point))[:, None]
        point = led(point, 1 / np.where(terms > 0, terms, 1.0), np.maximum(np.abs(point), noise))
        f, off, jacobian = left_at(point)
    return point, f, off


def _scaled_rows(rows: np.ndarray | float, f: np.ndarray, jacobian: Matrix) -> tuple[np.ndarray, Matrix]:
    return np.ravel(rows) * f, scaled(jacobian, rows, 1.0)


def _failure(level: Level, f: np.ndarray, bad: np.ndarray, title: str) -> InitializationError:
    order = sorted(np.flatnonzero(bad), key=lambda i: -abs(f[i]) if np.isfinite(f[i]) else -np.inf)
    worst = "; ".join(f"{level.names[i]} is off by {f[i]:.3g}" for i in order[:5])
    rows, columns = level.entries
    inside = {level.leaves[c] for r, c in zip(rows, columns, strict=True) if r in order[:5]}
    names = [n for n in level.unknowns if n in inside]
    unknowns = ", ".join(names[:MOST_NAMES]) + (
        f" and {len(names) - MOST_NAMES} more" if names[MOST_NAMES:] else ""
    )
    return InitializationError(
        f"{title}: no consistent start found. Worst residuals: {worst}. Unknowns there: {unknowns}. Expected 0: change "
        "the start values or the parameters (is a length out of reach?), or release a fixed start",
        residuals={level.names[i]: float(f[i]) for i in order},
    )
