"""Groups of links brought to their minima: truncation of what data do not hold, priors, robust weights."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gantrytau import ModelError
from gantrytau.border.refusal import did_you_mean
from gantrytau.describing.record import Record
from gantrytau_optimica.calibration.fitting.gauss_newton import RELATIVE, Minimum
from gantrytau_optimica.calibration.fitting.least_squares import Problem, Taped, minimise, problem
from gantrytau_optimica.calibration.links.groups import Group
from gantrytau_optimica.fitting.robust import robust_deviation, without_strays

FAR = 0.5  # m, from the start values; fits that data do not hold may run off further
NOISES, SETTLED = 10, 0.01  # rounds of estimating the noise with a tape measure, until it changes by less
CLEARLY = 10.0  # times better than a tape measure, from which on its pull would be negligible
ROUNDS = 60  # of reweighting
MANY = 6000  # closure errors, which show the noise well enough
STRAYS = 3.0  # times the robust deviation, from which on strays make the mean of the squares
HUBER, TUKEY = 1.345, 4.685  # of the standard deviation, 95 % efficient for normal noise (Huber, 1981)


@dataclass(frozen=True)
class Fit(Record):
    """A group at its minimum. smallest: singular value below which directions were left alone; weights (N,) or None."""

    group: Group
    minimum: Minimum
    smallest: float
    weights: np.ndarray | None = None

    @property
    def x(self) -> np.ndarray:
        """The numbers of the group."""
        return self.minimum.x

    @property
    def values(self) -> dict[str, float]:
        """All numbers by name."""
        return dict(zip(self.group.names, self.x.tolist(), strict=True))

    @property
    def free_names(self) -> tuple[str, ...]:
        """Names of the identified numbers."""
        return tuple(n for n, free in zip(self.group.names, self.group.free, strict=True) if free)

    @property
    def count(self) -> int:
        """Closure errors that were used."""
        return sum(len(c.q) for c in self.group.chains)

    def distances(self) -> np.ndarray:
        """Closure errors as differences of lengths, about e / 2L, (N, chains) in m."""
        return self.group.distances(self.x)


def fit_group(
    group: Group,
    weights: np.ndarray | None = None,
    *,
    begin: np.ndarray | None = None,
    smallest: float | None = None,
) -> Fit:
    """The minimum of a group; what data hold worse than a tape measure stays near the start values.

    weights: of the poses, (N,), or None; begin: where the search begins, instead of the start values; smallest: singular
    value below which directions are known not to be held.

    Where noise is known, steps of least norm leave what data hold worse than a tape measure at the start values. Where it
    has to be found and data do not hold everything, closure errors curve so much along what they do not hold that steps
    without it end in wrong places. So all numbers are first held by a tape measure, which has one minimum; what is held is
    decided there, and moves on without the tape.
    """
    x = group.x if begin is None else begin
    found = problem(group, weights)
    if group.noise is not None and smallest is None:
        limit = group.noise / group.tape * (1 - 1e-6)  # a prior as wide as a tape measure counts
        return Fit(group, minimise(replace(found, noise=group.noise), x, limit), limit, weights)
    if smallest is None:
        minimum = minimise(found, x)
        for _ in range(2 if group.prior else 0):  # its weight follows from the noise that is left without it
            found = replace(found, noise=noise_of(minimum, group))
            minimum = minimise(found, x)
        noise = noise_of(minimum, group)
        if minimum.singular.min(initial=np.inf) <= CLEARLY * noise / group.tape:
            noise = _without_strays(group, minimum.x, weights, noise)
        near = np.abs(minimum.x - x).max(initial=0.0) < FAR
        if minimum.success and near and minimum.singular.min(initial=np.inf) > CLEARLY * noise / group.tape:
            return Fit(group, minimum, 0.0, weights)
    else:
        noise = smallest * group.tape
    found, x, limit = _by_tape(found, noise, smallest, weights)
    _, singular, directions = np.linalg.svd(found.slopes(x)[:, group.free], full_matrices=False)
    held = int((singular > max(limit, RELATIVE * singular.max(initial=0.0))).sum())
    minimum = minimise(found, x, directions=directions, movable=held)
    return Fit(group, minimum, limit, weights)


def _by_tape(
    found: Problem, noise: float, smallest: float | None, weights: np.ndarray | None
) -> tuple[Problem, np.ndarray, float]:
    """The problem, its numbers where a TAPE holds all about the start values, and `smallest`; from a guess of the noise,
    which is found anew from what is left.
    """
    group, rounds = found.group, 0
    while True:
        limit = noise / group.tape if smallest is None else smallest
        tape = Taped(replace(found, noise=noise), limit)
        minimum = minimise(tape, group.x)
        left, J = tape.problem.errors(minimum.x), tape.problem.slopes(minimum.x)[:, group.free]
        squares = np.linalg.svd(J, compute_uv=False) ** 2
        told = float(np.sum(squares / np.maximum(squares + limit**2, 1e-300)))  # how many numbers data tell
        before, noise = noise, float(np.sqrt(left @ left / max(1.0, _count(group) - told)))
        noise = _without_strays(group, minimum.x, weights, noise)
        rounds += 1
        if smallest is not None or abs(noise - before) <= SETTLED * before or rounds == NOISES:
            return tape.problem, minimum.x, limit


def _without_strays(group: Group, x: np.ndarray, weights: np.ndarray | None, noise: float) -> float:
    """The noise of a closure error as a fit that strays do not lead would leave it, where these make the mean of the squares
    far larger: what data hold does not depend on one wrong pose.
    """
    few = slice(None, None, max(1, _count(group) // MANY))
    sure = np.ones(len(group.chains[0].q)) if weights is None else weights
    rows = np.flatnonzero(sure > 0)[few]
    left = (group.errors(x)[rows] * sure[rows, None]).T.ravel()
    J = np.concatenate([group.slopes(x, k)[rows] * sure[rows, None] for k in range(len(group.chains))])
    rank = int(np.linalg.matrix_rank(J))
    if len(left) < 4 * rank:  # few errors do not show which of them are strays
        return noise
    usual = robust_deviation(without_strays(left, J), rank)
    return usual if STRAYS * usual < noise else noise


def not_held(fit: Fit) -> float:
    """The singular value below which directions of a like group are held worse than a tape measure."""
    return noise_of(fit.minimum, fit.group) / fit.group.tape


def noise_of(minimum: Minimum, group: Group) -> float:
    """Standard deviation of a closure error, as it is known or as it is left."""
    if group.noise is not None:
        return group.noise
    return float(np.sqrt(minimum.cost / max(1, _count(group) - minimum.rank)))


def _count(group: Group) -> int:
    return sum(len(c.q) for c in group.chains)


def fit_robust(groups: Sequence[Group], certainty: np.ndarray | None = None) -> list[Fit]:
    """All groups with one weight for each pose: Huber's until it settles, then Tukey's, which drops gross errors.

    certainty: (N,), how much surer poses are than others, by which their errors and weights are multiplied.
    """
    fits = [fit_group(group, certainty) for group in groups]
    weights = sure = np.ones(len(groups[0].chains[0].q)) if certainty is None else certainty
    for tukey in (False, True):
        for _ in range(ROUNDS):
            size = relative_size(fits, sure)
            if tukey:
                square = np.where(size < TUKEY, (1 - (size / TUKEY) ** 2) ** 2, 0.0)
            else:
                square = np.minimum(1.0, HUBER / np.maximum(size, 1e-12))
            old, weights = weights, sure * np.sqrt(square)
            fits = [fit_group(fit.group, weights, begin=_onwards(fit)) for fit in fits]
            if np.abs(weights - old).max() < 1e-6:
                break
    return fits


def _onwards(fit: Fit) -> np.ndarray | None:
    """Where a fit with other weights begins: where it ended, unless gross errors may have moved what data do not hold."""
    return None if fit.group.noise is not None else fit.x


def relative_size(fits: Sequence[Fit], sure: np.ndarray | float = 1.0) -> np.ndarray:
    """The largest closure error of each pose in robust standard deviations of its link, (N,); sure: (N,) as above."""
    distances = np.abs(np.hstack([fit.distances() for fit in fits]).T * sure).T
    scale = 1.4826 * np.median(distances, axis=0)
    return (distances / np.maximum(scale, 1e-12)).max(axis=1)


@dataclass(frozen=True)
class Prior:
    """What is expected of numbers: given, as in `calibrate`; nominal: values by name, about which deviations hold them."""

    given: Mapping[str, Any] | None
    nominal: Mapping[str, float]


def with_prior(groups: Sequence[Group], expected: Prior) -> list[Group]:
    """The groups with deviations of numbers about what is expected of them.

    given: by name of a number, of a vector, or of the last part of these for all links: a deviation, or (value,
    deviation). Raises ModelError for names that are not identified and deviations that are not above 0.
    """
    free = {n: float(x) for g in groups for n, x, each in zip(g.names, g.x, g.free, strict=True) if each}
    found = read_prior(expected.given, free | {n: x for n, x in expected.nominal.items() if n in free})
    return [
        replace(g, prior=dict(g.prior) | {i: found[n] for i, n in enumerate(g.names) if n in found})
        for g in groups
    ]


def read_prior(prior: Mapping[str, Any] | None, start: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """Value and deviation by name of a number; start: of all that are free, where a prior holds those without a value."""
    if not isinstance(prior, Mapping | None):
        raise ModelError(
            f"calibrate: found prior={prior!r}, expected a dict as {{'arms[1].links[0].plate_offset': 0.001}}, deviations "
            "in m by name",
            argument="prior",
        )
    found: dict[str, tuple[float, float]] = {}
    for name, given in (prior or {}).items():
        matches = [n for n in start if _is_called(n, name)]
        if not matches:
            raise ModelError(
                f"calibrate: prior for '{name}', which is not identified{did_you_mean(name, sorted(start))}",
                argument="prior",
            )
        value, deviation = given if isinstance(given, tuple) else (None, given)
        for n in matches:
            k = [m for m in matches if _vector(m) == _vector(n)].index(n)
            found[n] = start[n] if value is None else _element(value, k), _positive(name, deviation, k)
    return found


def _is_called(element: str, name: str) -> bool:
    return name in (element, _vector(element), _vector(element).rsplit(".", 1)[-1])


def _vector(element: str) -> str:
    return element.rsplit("[", 1)[0] if element.endswith("]") else element


def _element(value: Any, k: int) -> float:
    array = np.atleast_1d(np.asarray(value, dtype=float))
    return float(array[k] if array.size > 1 else array[0])


def _positive(name: str, deviation: Any, k: int) -> float:
    found = _element(deviation, k)
    if not found > 0:
        raise ModelError(
            f"calibrate: found the deviation {found:g} for '{name}' in prior, expected one above 0",
            argument="prior",
        )
    return found
