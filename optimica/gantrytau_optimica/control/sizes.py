"""Typical sizes of unknowns and of equations: what makes a problem the same in micrometres and in kilometres.

    |row_r|  is of the size of its largest term:  max(known_r, max_j J_rj size_j)

J_rj: largest derivative of a row by an unknown along the first guess; known_r: what stands in it beside the unknowns, as a
bound. A row of a state is T x' over the horizon T, in which the state itself has the derivative 1. Sizes are those declared,
else those of limits, else those of the guess, where the elements of a vector share the largest; what is zero there has the
size that balances its rows.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from gantrytau.compiler.symbol_spaces import called
from gantrytau_optimica.control.control_problem import ControlProblem, Limit, Phase, PointValue
from gantrytau_optimica.control.first_guesses.guesses import horizon
from gantrytau_optimica.control.limits import signal_limits

LOOSE = 1e4  # times the size that the rest tells: a limit that is farther away says nothing of the size
NOISE = 1e-13  # of the largest guess of a kind: what rounding leaves of a zero
ACCIDENT = 1e5  # times apart: the size of an algebraic at the guess, and of the terms of its equation
BESIDE = 0.1  # of its size: how far from the guess derivatives are looked at as well, which may vanish there by accident
FINE = 1e-4  # of the terms of a condition: its bounds are no finer measure than this
# times outside of the range of all known sizes: what a derivative tells that is left by rounding
BEYOND = 1e8
SHARES = np.linspace(0.0, 1.0, 11)  # of the horizon, at which guesses are looked at


def with_sizes(problem: ControlProblem) -> ControlProblem:
    """The problem with typical sizes of signals, free numbers and equations, by its limits and first guesses."""
    bounds = {
        name: ends for phase in problem.phases for name, ends in signal_limits(phase, problem.name).items()
    }
    declared, limits, guesses = said = _said(problem, bounds)
    known = np.where(np.isnan(declared), np.where(np.isnan(guesses), limits, guesses), declared)
    balance = _balance(problem, _like_siblings(problem, known))
    sizes = _sizes(problem, said, balance)
    of_signals = dict(zip((s.name for s in problem.signals), sizes, strict=False))
    problem = problem.with_signals(lambda _, s: replace(s, nominal=float(of_signals[s.name])))
    numbers = sizes[len(of_signals) :]
    free = tuple(replace(n, nominal=float(x)) for n, x in zip(problem.free, numbers, strict=True))
    rows = iter(balance.rows(sizes))
    phases = []
    for phase in problem.phases:
        _ = [next(rows) for _ in phase.states]
        residuals = tuple(float(next(rows)) for _ in phase.residual_names)
        limits = tuple(replace(limit, size=_told_size(limit, next(rows))) for limit in phase.path_limits)
        phases.append(replace(phase, residual_sizes=residuals, path_limits=limits))
    boundary = tuple(replace(limit, size=_told_size(limit, next(rows))) for limit in problem.boundary)
    return replace(problem, phases=tuple(phases), free=free, boundary=boundary)


@dataclass(frozen=True, eq=False)
class Balance:
    """Largest derivatives (r, n) of rows by all signals and free numbers, and what else is known of their size, (r,)."""

    jacobian: np.ndarray
    known: np.ndarray

    def rows(self, sizes: np.ndarray) -> np.ndarray:
        """The size of every row by its largest term, 1 where it has none."""
        found = np.max(self.jacobian * sizes, axis=1, initial=0.0)
        found = np.where(found > 0, found, self.known)
        return np.where(found > 0, found, 1.0)

    def told(
        self,
        sizes: np.ndarray,
        unknown: np.ndarray,
        strict: bool = True,
        likely: tuple[float, float] = (0.0, np.inf),
    ) -> np.ndarray:
        """For each of `unknown` the least likely size that balances a row in which all others are known, or NaN.

        strict: False where those that are not known count as nothing.
        """
        missing = np.isnan(sizes) & (self.jacobian > 0)
        terms = self.jacobian * np.nan_to_num(sizes)
        found = np.full(unknown.size, np.nan)
        for k, j in enumerate(unknown):
            rows = np.flatnonzero(self.jacobian[:, j] > 0)
            others, gaps = np.delete(terms[rows], j, axis=1), np.delete(missing[rows], j, axis=1)
            top = np.maximum(self.known[rows], np.max(others, axis=1, initial=0.0))
            alone = (top > 0) & ~(strict & np.any(gaps, axis=1))
            told = top[alone] / self.jacobian[rows[alone], j]
            found[k] = np.min(told[(told > likely[0]) & (told < likely[1])], initial=np.inf)
        found[np.isinf(found)] = np.nan
        return found


def _sizes(problem: ControlProblem, said: Sequence[np.ndarray], balance: Balance) -> np.ndarray:
    """Sizes of all signals and free numbers, (n,); said: by declaration, by limits, and by the guess."""
    declared, limits, guesses = said
    sizes = np.where(np.isnan(declared), np.where(np.isnan(limits), guesses, limits), declared)
    if np.any(np.isnan(sizes)):
        sizes = np.where(np.isnan(sizes), _aims(problem), sizes)
    sizes = _completed(problem, balance, sizes)
    # what the rest says may show that a limit is none, and that a value at the guess is an accident
    told = balance.told(sizes, np.arange(sizes.size))
    inner = np.where(np.isnan(guesses), told, guesses)
    loose = np.isnan(declared) & (limits > LOOSE * inner)
    sizes = np.where(loose, inner, sizes)
    algebraics = {a.name for phase in problem.phases for a in phase.algebraics}
    own = np.array([*(s.name in algebraics for s in problem.signals), *(False for _ in problem.free)], bool)
    accident = (
        own & np.isnan(declared) & np.isnan(limits) & (np.abs(np.log(guesses / told)) > np.log(ACCIDENT))
    )
    return np.where(accident, told, sizes)


def _said(
    problem: ControlProblem, bounds: Mapping[str, tuple[float, float]]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sizes by declaration, by limits, and by the guess, each (n,), NaN where there is none."""
    rows = [
        (s.nominal, _largest(bounds[s.name]), float(np.max(np.abs(s.guess(SHARES))))) for s in problem.signals
    ]
    signals = np.array(rows, dtype=float).reshape(-1, 3)
    noise = NOISE * np.max(signals[:, 2], initial=0.0)
    signals[~(signals[:, 2] > noise), 2] = np.nan
    signals[:, 2] = _largest_of_vectors([_vector(s.name) for s in problem.signals], signals[:, 2])
    numbers = [
        (n.nominal or np.nan, np.nan if n.guess else _largest((n.min, n.max)), abs(n.guess) or np.nan)
        for n in problem.free
    ]
    declared, limits, guesses = np.vstack([signals, np.array(numbers, dtype=float).reshape(-1, 3)]).T
    return declared, limits, np.fmax(guesses, _measured(problem))


def _vector(name: str) -> str:
    """The vector of which this is an element, or its rate."""
    return re.sub(r"\[\d+\](\)*)$", r"\1", name)


def _largest_of_vectors(vectors: Sequence[str], sizes: np.ndarray) -> np.ndarray:
    """For each element the largest size of its vector: where it is zero along one axis the others tell how it moves."""
    largest: dict[str, float] = {}
    for vector, size in zip(vectors, sizes, strict=True):
        largest[vector] = float(np.fmax(largest.get(vector, np.nan), size))
    return np.array([largest[vector] for vector in vectors], dtype=float)


def _largest(bounds: Sequence[float]) -> float:
    return max((abs(b) for b in bounds if np.isfinite(b) and b != 0.0), default=np.nan)


def _completed(problem: ControlProblem, balance: Balance, sizes: np.ndarray) -> np.ndarray:
    """Sizes with those that are missing from the rows in which they stand; what stands in none like the others, or 1."""
    sizes = sizes.copy()
    spans = [abs(stop - start) for start, stop in (horizon(problem, phase) for phase in problem.phases)]
    beyond = BEYOND * max(max(span, 1 / span) for span in spans)
    while np.any(np.isnan(sizes)):
        given = sizes[~np.isnan(sizes)]
        unknown = np.flatnonzero(np.isnan(sizes))
        low, high = min(given, default=0.0) / beyond, max(given, default=np.inf) * beyond
        for found in _ways(problem, balance, sizes, unknown, (low, high)):
            if not np.all(np.isnan(found)):
                sizes[unknown] = found
                break
        else:
            sizes[unknown[0]] = float(np.exp(np.mean(np.log(given)))) if given.size else 1.0
    return sizes


def _ways(
    problem: ControlProblem,
    balance: Balance,
    sizes: np.ndarray,
    unknown: np.ndarray,
    likely: tuple[float, float],
) -> Iterator[np.ndarray]:
    """Sizes of what is unknown, or NaN, by one way after another, the most trustworthy first."""
    for strict in (True, False):
        yield balance.told(sizes, unknown, strict, likely)
    yield _like_siblings(problem, sizes)[unknown]
    yield balance.told(sizes, unknown, strict=False)


def _like_siblings(problem: ControlProblem, sizes: np.ndarray) -> np.ndarray:
    """Sizes with those that are missing like the largest of their vector, if one of it is known."""
    names = [*(s.name for s in problem.signals), *(n.name for n in problem.free)]
    return np.where(np.isnan(sizes), _largest_of_vectors([_vector(n) for n in names], sizes), sizes)


def _balance(problem: ControlProblem, around: np.ndarray) -> Balance:
    """All rows at the first guess: of every phase those of states, algebraics and limits; then the conditions."""
    width = len(problem.signals) + len(problem.free)
    jacobian, known = [np.zeros((0, width))], [np.zeros(0)]
    for phase, first in zip(problem.phases, _firsts(problem), strict=True):
        rates = phase.ode * (phase.final_time - phase.start_time)
        limits = phase.path_limits
        rows = ca.vertcat(rates, phase.residuals, *(limit.expression for limit in limits))
        value, derivatives = _along(problem, phase, rows, SHARES, around[first : first + len(phase.signals)])
        mine, nx = _placed(problem, phase, first, derivatives), len(phase.states)
        mine[np.arange(nx), first + np.arange(nx)] += 1.0
        jacobian.append(mine)
        known.append(np.append(value[: value.size - len(limits)], [_bound(limit) for limit in limits]))
    rows = ca.vertcat(ca.SX(0, 1), *(limit.expression for limit in problem.boundary))
    jacobian.append(_points(problem).jacobian_of(problem, rows))
    known.append(np.array([_bound(limit) for limit in problem.boundary]))
    return Balance(np.vstack(jacobian), np.concatenate(known))


def _measured(problem: ControlProblem) -> np.ndarray:
    """Sizes that signals and free numbers have by the samples that the objective compares them with, (n,), or NaN."""
    found = np.full(len(problem.signals) + len(problem.free), np.nan)
    for phase, first in zip(problem.phases, _firsts(problem), strict=True):
        for one in phase.sums:
            derivatives = _placed(problem, phase, first, _along(problem, phase, one.expression, SHARES)[1])[0]
            largest = float(np.max(np.abs(one.values), initial=0.0))
            told = (derivatives > 0) & (largest > 0)
            found[told] = np.fmax(found[told], largest / derivatives[told])
    return found


def _bound(limit: Limit) -> float:
    return max((abs(b) for b in (limit.lower, limit.upper) if np.isfinite(b)), default=0.0)


def _told_size(limit: Limit, terms: float) -> float:
    """The size of a condition whose terms have this size: that of its bounds where these are the finer measure."""
    bound = _bound(limit)
    return float(max(min(terms, bound), FINE * terms) if bound > 0 else terms)


def _firsts(problem: ControlProblem) -> list[int]:
    """Columns at which the signals of the phases begin."""
    return [0, *np.cumsum([len(phase.signals) for phase in problem.phases])[:-1].tolist()]


def _placed(problem: ControlProblem, phase: Phase, first: int, derivatives: np.ndarray) -> np.ndarray:
    """Derivatives by the signals of a phase and the free numbers in their columns among all."""
    count, numbers = len(phase.signals), len(problem.free)
    found = np.zeros((derivatives.shape[0], len(problem.signals) + numbers))
    found[:, first : first + count] = derivatives[:, :count]
    found[:, found.shape[1] - numbers :] = derivatives[:, count:]
    return found


def _along(
    problem: ControlProblem, phase: Phase, rows: ca.SX, shares: np.ndarray, around: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Largest values (r,) and largest derivatives (r, signals + numbers) of expressions along the first guess of a phase.

    around: sizes of the signals, by a part of which derivatives are looked at beside the guess as well.
    """
    start, stop = horizon(problem, phase)
    times = start + (stop - start) * shares
    signals = ca.vertcat(ca.SX(0, 1), *(s.symbol for s in phase.signals))
    courses = ca.vertcat(ca.SX(0, 1), *(c.symbol for c in phase.courses))
    derivatives = ca.jacobian(rows, ca.vertcat(signals, problem.numbers))
    function = ca.Function(
        "balance",
        [problem.time, signals, courses, problem.numbers],
        [ca.densify(ca.vertcat(rows, ca.vec(derivatives.nz[:])))],
    )
    guesses = np.array([s.guess(shares) for s in phase.signals]).reshape(-1, shares.size)
    known = np.array([c.value(times) for c in phase.courses]).reshape(-1, shares.size)
    numbers = np.array([n.guess for n in problem.free])
    values = _columns(function, times, guesses, known, numbers)
    beside = values[rows.numel() :]
    if around is not None:
        waves = np.sin(1.0 + 7.3 * np.arange(guesses.size)).reshape(guesses.shape)
        moved = BESIDE * np.nan_to_num(around)[:, None] * waves
        beside = np.hstack(
            [beside, _columns(function, times, guesses + moved, known, numbers)[rows.numel() :]]
        )
    value = values[: rows.numel()]
    jacobian = np.zeros(derivatives.shape)
    row, column = (np.array(part, dtype=int) for part in derivatives.sparsity().get_triplet())
    jacobian[row, column] = np.max(np.abs(beside), axis=1)
    return value[np.arange(len(value)), np.argmax(np.abs(value), axis=1)], jacobian


def _columns(function: ca.Function, times: np.ndarray, *rest: np.ndarray) -> np.ndarray:
    """A function at all times, one column each; what is not finite is zero."""
    signals, known, numbers = rest
    (found,) = called(function.map(times.size), times, signals.T, known.T, np.tile(numbers, times.size))
    return _finite(found.reshape(times.size, -1).T)


def _finite(values: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(values), values, 0.0)


@dataclass(frozen=True, eq=False)
class _Points:
    """Values at single times at the first guess: symbols and values (k,), largest derivatives (k, n) by all unknowns."""

    symbols: ca.SX
    values: np.ndarray
    jacobian: np.ndarray

    def jacobian_of(self, problem: ControlProblem, rows: ca.SX) -> np.ndarray:
        """Largest derivatives (r, n) of expressions of the points and the free numbers."""
        arguments = [self.symbols, problem.numbers]
        function = ca.Function("jacobian", arguments, [ca.densify(ca.jacobian(rows, x)) for x in arguments])
        found = function(self.values, [n.guess for n in problem.free])
        by_points, by_numbers = (np.abs(_finite(np.array(x))) for x in found)
        total = by_points @ self.jacobian
        total[:, total.shape[1] - len(problem.free) :] += by_numbers
        return total


def _points(problem: ControlProblem) -> _Points:
    symbols, values = [ca.SX(0, 1)], [np.zeros(0)]
    jacobian = [np.zeros((0, len(problem.signals) + len(problem.free)))]
    for phase, first in zip(problem.phases, _firsts(problem), strict=True):
        points: dict[float, list[PointValue]] = {}
        for point in phase.points:
            share = float(point.time == "final") if isinstance(point.time, str) else 0.5
            points.setdefault(share, []).append(point)
        for share, here in points.items():
            together = ca.vertcat(*(point.expression for point in here))
            value, derivatives = _along(problem, phase, together, np.array([share]))
            symbols += [point.symbol for point in here]
            values.append(value)
            jacobian.append(_placed(problem, phase, first, derivatives))
    return _Points(ca.vertcat(*symbols), np.concatenate(values), np.vstack(jacobian))


def _aims(problem: ControlProblem) -> np.ndarray:
    """How far a step of Newton's method for the costs alone goes in every unknown, (n,), NaN where they do not tell."""
    found = np.full(len(problem.signals) + len(problem.free), np.nan)
    for phase, first in zip(problem.phases, _firsts(problem), strict=True):
        signals = ca.vertcat(ca.SX(0, 1), *(s.symbol for s in phase.signals))
        gradient, curvature = _steepness(phase.integrand, signals)
        value, _ = _along(problem, phase, ca.vertcat(gradient, curvature), SHARES)
        found[first : first + len(phase.signals)] = _steps(*np.split(value, 2))
    points = _points(problem)
    # of a vector they share one symbol
    sums = {one.symbol.element_hash(): one.symbol for one in problem.sums}
    arguments = [points.symbols, problem.numbers, *sums.values()]
    function = ca.Function(
        "steepness", arguments, list(map(ca.densify, _steepness(problem.objective, points.symbols)))
    )
    values = function(points.values, [n.guess for n in problem.free], *(0.0 for _ in sums))
    steps = _steps(*(_finite(np.array(x).ravel()) for x in values))
    with np.errstate(divide="ignore"):
        each = np.where(points.jacobian > 0, steps[:, None] / points.jacobian, np.nan)
    return np.fmax(found, np.fmax.reduce(each, axis=0, initial=np.nan))


def _steepness(cost: ca.SX, unknowns: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Gradient and curvatures of a cost by each unknown."""
    curved, gradient = ca.hessian(cost, unknowns)
    return gradient, ca.diag(curved)


def _steps(gradient: np.ndarray, curvature: np.ndarray) -> np.ndarray:
    known = (gradient != 0) & (curvature != 0)
    return np.abs(np.divide(gradient, curvature, out=np.full(gradient.size, np.nan), where=known))
