"""Consistent values: weighted minimum-norm Newton steps, level by level.

Positions first, then velocities, then accelerations and forces: a joint solve over all levels would move
positions that are already consistent. Values with a start move a hundred times less gladly than others.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from gantrytau.border.refusal import InitializationError
from gantrytau.compiler.start.balance import balance
from gantrytau.compiler.symbol_spaces import column
from gantrytau.language.piecewise import switched, with_modes
from gantrytau.language.term_sizes import term_sizes

STIFFNESS = 1e-2  # how far a value with a start moves, compared with one without
TOLERANCE = 1e-15  # of the terms of an equation, what may be left; rounding may stop the steps before
SOLVED = 1e-9  # the same, for an equation to hold
ROUNDING = 1e-14  # of what unknowns of size one contribute, what is left of equations solved together
ITERATIONS = 100
ATTEMPTS = 6  # with other values, where the given ones do not lead to a solution
SPREAD = 0.3  # of the first of them
NOISE = 1e-9  # of the longest row, below which one says nothing: across the plane of a planar loop
MOST_PIECES = 60  # that are tried
LONGEST_STEP = 0.7  # of a value without a scale of its own: about what an angle may turn in one step, rad


@dataclass(frozen=True, eq=False)
class Level:
    """Equations that are solved together: residuals, and unknown symbols; exact: symbols whose numbers are given."""

    residuals: tuple[ca.SX, ...]
    names: tuple[str, ...]  # of the residuals, for messages
    unknowns: tuple[str, ...]
    exact: frozenset[str] = frozenset()

    @cached_property
    def leaves(self) -> tuple[str, ...]:
        """Names of all symbols in the residuals."""
        return tuple(leaf.name() for leaf in ca.symvar(ca.vertcat(*self.residuals)))

    def curved(self, moving: Sequence[str]) -> bool:
        """Whether the residuals are not linear in what moves."""
        wanted = set(moving)
        residual = ca.vertcat(*self.residuals)
        x = [leaf for leaf in ca.symvar(residual) if leaf.name() in wanted]
        return bool(x) and ca.depends_on(ca.jacobian(residual, ca.vertcat(*x)), ca.vertcat(*x))

    @cached_property
    def _symbolic(self) -> tuple[ca.SX, ca.SX, ca.SX]:
        residual = ca.vertcat(*self.residuals)
        x = ca.vertcat(*ca.symvar(residual))
        return x, ca.densify(residual), ca.jacobian(residual, x)

    @cached_property
    def entries(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows and columns of the derivatives that are not structurally zero."""
        rows, columns = self._symbolic[2].sparsity().get_triplet()
        return np.array(rows, dtype=int), np.array(columns, dtype=int)

    @cached_property
    def _exact_nonzeros(self) -> tuple[np.ndarray, ca.Function]:
        """Indices of the derivatives by exact numbers alone; the function of their values and term sizes."""
        x, _, jacobian = self._symbolic
        nonzeros = jacobian.nonzeros()
        others = column([leaf for leaf in x.elements() if leaf.name() not in self.exact])
        places = np.setdiff1d(range(len(nonzeros)), ca.jacobian_sparsity(column(nonzeros), others).row())
        exact = [nonzeros[k] for k in places]
        return places, ca.Function("exact", [x], [column(exact), column(term_sizes(exact) if exact else [])])

    def certainty(self, numbers: np.ndarray) -> np.ndarray:
        """Matrix (residuals, leaves): 1 where a derivative by exact numbers exceeds its rounding, -1 where not, else 0."""
        places, function = self._exact_nonzeros
        found = np.zeros((len(self.residuals), len(self.leaves)))
        nonzeros, sizes = (np.array(one).ravel() for one in function(numbers))
        rows, columns = (side[places] for side in self.entries)
        found[rows, columns] = np.where(np.abs(nonzeros) > ROUNDING * sizes, 1, -1)
        return found

    @cached_property
    def _function(self) -> ca.Function:
        x, residual, jacobian = self._symbolic
        entries = ca.vertcat(*jacobian.nonzeros()) if jacobian.nnz() else ca.SX(0, 1)
        return ca.Function("level", [x], [residual, ca.densify(entries)])

    def sizes(self, rows: Sequence[int], numbers: np.ndarray) -> np.ndarray:
        """How large the terms of some residuals are, at numbers of the leaves."""
        key = tuple(rows)
        if key not in self._sizes:
            x, _, _ = self._symbolic
            terms = ca.vertcat(*term_sizes([self.residuals[i] for i in rows]))
            self._sizes[key] = ca.Function("sizes", [x], [terms])
        return np.array(self._sizes[key](numbers)).ravel()

    @cached_property
    def _sizes(self) -> dict[tuple[int, ...], ca.Function]:
        return {}

    def look(self, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residuals, and the entries of their derivatives by the leaves, at numbers of the leaves."""
        residual, nonzeros = self._function(numbers)
        return np.array(residual).ravel(), np.array(nonzeros).ravel()

    def jacobian(self, nonzeros: np.ndarray) -> np.ndarray:
        """The derivatives by the leaves as a dense matrix."""
        found = np.zeros((len(self.residuals), len(self.leaves)))
        found[self.entries] = nonzeros
        return found


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
            try:  # starts that fit together are held, or else those that whoever uses the model chose
                try:
                    _solve(level, free, values, started, title)
                except InitializationError:
                    if not len(free) < len(looser) < len(moving):
                        raise
                    _solve(level, looser, values, started, title)
            except InitializationError:
                try:
                    (_solve_anyhow if thorough else _solve)(level, moving, values, started, title)
                except InitializationError:
                    if not _follows(level, moving, values, chosen) and not _solve_switching(
                        level, moving, values, started, title
                    ):
                        raise
    return values


def _follows(level: Level, moving: Sequence[str], values: dict[str, float], chosen: frozenset[str]) -> bool:
    """Whether all values follow from one another, equation by equation, once the starts of the model give way, as
    signals do: through what switches on what was just computed, steps of all at once go to and fro.
    """
    place = {n: k for k, n in enumerate(level.leaves)}
    given = np.array([values[n] for n in level.leaves])
    found = _propagated(level, given, {place[n] for n in moving if n in place and n not in chosen})
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
    place = {n: k for k, n in enumerate(level.leaves)}
    moving = [n for n in moving if n in place]
    columns = [place[n] for n in moving]
    around = np.array([values[n] for n in level.leaves])
    weights = np.array([STIFFNESS if n in started else 1.0 for n in moving])

    def at(point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        around[columns] = point
        f, nonzeros = level.look(around)
        return f, level.jacobian(nonzeros)[:, columns]

    if propagate:
        missing = {column for k, column in enumerate(columns) if moving[k] not in started}
        around = _propagated(level, around, missing)
    start = around[columns]

    def led(factors: np.ndarray | float, sizes: np.ndarray | float) -> np.ndarray:
        """Where steps of these sizes lead."""
        return newton(lambda x: _scaled_rows(factors, *at(x)), start, weights * sizes)[0]

    def left_at(point: np.ndarray, sizes: np.ndarray | float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What is left at a point, which equations do not hold, and which not even but for rounding."""
        f, jacobian = at(point)
        off = ~(np.abs(f) <= SOLVED * (np.abs(jacobian) @ np.abs(point)))
        left = np.flatnonzero(off)
        if left.size and np.all(np.isfinite(f)):
            off[left] = np.abs(f[left]) > SOLVED * level.sizes(left.tolist(), around)
        # unknowns that are solved together have the rounding of the largest, in their sizes
        rounding = np.abs(jacobian * sizes).sum(axis=1) * np.max(np.abs(point / sizes), initial=1.0)
        return f, off, off & ~(np.abs(f) <= ROUNDING * rounding)

    point = led(1.0, 1.0)  # sizes of metres, radians and newtons
    f, off, bad = left_at(point, 1.0)
    if np.any(off):
        jacobian = at(start)[1]
        rows, sizes = balance(jacobian, level.certainty(around)[:, columns])
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


def _scaled_rows(
    rows: np.ndarray | float, f: np.ndarray, jacobian: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    return np.ravel(rows) * f, rows * jacobian


def _terms(jacobian: np.ndarray, point: np.ndarray) -> np.ndarray:
    """The size of the terms that each residual is the difference of."""
    return np.maximum(np.abs(jacobian) @ np.abs(point), 1.0)


def newton(
    at: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]], point: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Solve at(point) = (f, jacobian) for f = 0 near a point; returns the last point, f and jacobian.

    Steps are damped as far as the residual asks for it (Levenberg and Marquardt), so that a nearly singular
    Jacobian on the way, as of a loop that is not yet closed, does not send them far away.
    """
    f, jacobian = at(point)
    damping = 0.0
    for _ in range(ITERATIONS):
        sound = np.all(np.isfinite(f)) and np.all(np.isfinite(jacobian))
        if not sound or np.all(np.abs(f) <= TOLERANCE * (np.abs(jacobian) @ np.abs(point))):
            break
        # where large terms could not be met better, small ones may still be, by steps that serve at once
        attempts, enough = 25, 0.1
        if np.all(np.abs(f) <= TOLERANCE * _terms(jacobian, point)):
            attempts, enough = 1, 0.5
        rows = np.linalg.norm(jacobian * weights, axis=1)
        rows = np.maximum(rows, NOISE * rows.max(initial=1e-30))
        scaled, target = jacobian * weights / rows[:, None], -f / rows
        merit = np.linalg.norm(target)
        left, sizes, right = np.linalg.svd(scaled, full_matrices=False)
        along = left.T @ target
        known = sizes > 1e-11 * sizes[:1]
        moved = False
        for attempt in range(attempts):
            shares = np.where(known, sizes / np.maximum(sizes**2 + damping, 1e-300), 0.0)
            step = weights * (right.T @ (shares * along))
            share = min(1.0, _longest(point, step)) if attempt else 1.0
            step *= share
            f_new, jacobian_new = at(point + step)
            sound = np.all(np.isfinite(f_new)) and np.all(np.isfinite(jacobian_new))
            size = np.linalg.norm(f_new / rows) if sound else np.inf
            # at once only where the equations are as good as linear; a large step may reach another branch
            if size < (1 - 1e-4 * share if attempt else enough) * merit:
                point, f, jacobian, moved = point + step, f_new, jacobian_new, True
                damping = 0.0 if size < 0.1 * merit else damping / 10
                break
            if attempt:
                damping = max(10 * damping, 1e-8)
        if not moved:
            break
    return point, f, jacobian


def _longest(point: np.ndarray, step: np.ndarray) -> float:
    """The share of a step that may be taken at once."""
    reach = np.maximum(LONGEST_STEP, np.abs(point))
    return float(1.0 / np.max(np.abs(step) / reach, initial=1.0))


def _propagated(level: Level, point: np.ndarray, missing: set[int]) -> np.ndarray:
    """Values without a start computed from those with one, as far as single equations give them outright.

    point: numbers of the leaves; missing: places of those without a start.
    """
    rows: dict[int, set[int]] = {}
    place: dict[tuple[int, int], int] = {}
    for k, (i, j) in enumerate(zip(*level.entries, strict=True)):
        place[int(i), int(j)] = k
        if j in missing:
            rows.setdefault(int(i), set()).add(int(j))
    f, nonzeros = level.look(point)
    while rows:
        single = {next(iter(left)): i for i, left in rows.items() if len(left) == 1}
        if not single:
            counts: dict[int, int] = {}
            for left in rows.values():
                counts.update((j, counts.get(j, 0) + 1) for j in left)
            # the coordinate of a joint is in several rows, each with another unknown: it stays as it is
            single = {max(counts, key=lambda j: (counts[j], -j)): -1}
        largest = np.zeros(len(f))
        np.maximum.at(largest, level.entries[0], np.nan_to_num(np.abs(nonzeros)))
        new = point.copy()
        for j, i in single.items():
            slope = nonzeros[place[i, j]] if i >= 0 else 0.0
            if i >= 0 and np.isfinite(f[i]) and abs(slope) > 1e-3 * largest[i] > 0:
                new[j] -= f[i] / slope
        if np.any(new != point):
            after, nonzeros_after = level.look(new)
            wrong = [j for j, i in single.items() if not abs(after[i]) <= 1e-9 * max(1.0, abs(f[i]))]
            if wrong:  # not linear in these
                new[wrong] = point[wrong]
                after, nonzeros_after = level.look(new)
            point, f, nonzeros = new, after, nonzeros_after
        rows = {i: left - single.keys() for i, left in rows.items() if left - single.keys()}
    return point


def _failure(level: Level, f: np.ndarray, bad: np.ndarray, title: str) -> InitializationError:
    order = sorted(np.flatnonzero(bad), key=lambda i: -abs(f[i]) if np.isfinite(f[i]) else -np.inf)
    worst = "; ".join(f"{level.names[i]} is off by {f[i]:.3g}" for i in order[:5])
    return InitializationError(
        f"{title}: no consistent start found. Worst residuals: {worst}. Expected 0: change the start values "
        "or the parameters (is a length out of reach?), or release a fixed start",
        residuals={level.names[i]: float(f[i]) for i in order},
    )
