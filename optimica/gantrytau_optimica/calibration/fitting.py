"""Groups of links brought to their minima: truncation of what data do not hold, priors, robust weights."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gantrytau import ModelError
from gantrytau.errors import did_you_mean
from gantrytau_optimica.calibration.gauss_newton import Minimum
from gantrytau_optimica.calibration.groups import Group, minimise, problem

TAPE = 0.01  # m; combinations of numbers that data hold worse than a tape measure stay where they started
ROUNDS = 60  # of reweighting
HUBER, TUKEY = 1.345, 4.685  # of the standard deviation, 95 % efficient for normal noise (Huber, 1981)


@dataclass(frozen=True)
class Fit:
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
        lengths = np.array([self.x[places[0]] for places in self.group.places])
        return self.group.errors(self.x) / (2 * lengths)


def fit_group(group: Group, weights: np.ndarray | None = None, truncated: float = 0.0) -> Fit:
    """The minimum from the start values of the group; what data hold worse than TAPE stays there.

    weights: of the poses, (N,), or None; truncated: singular value below which directions are known not to be held.
    """
    all_weights = None if weights is None else [weights] * len(group.chains)
    noise = 0.0
    if group.prior:  # the weight of the prior follows from the noise that is left without it
        noise = _noise(minimise(group, problem(group, all_weights)), group)
    found = problem(group, all_weights, noise)
    minimum = minimise(group, found, truncated)
    if group.prior:
        found = problem(group, all_weights, _noise(minimum, group))
        minimum = minimise(group, found, truncated)
    smallest = _noise(minimum, group) / TAPE
    if truncated or (minimum.success and minimum.singular.min(initial=np.inf) > smallest):
        return Fit(group, minimum, truncated, weights)
    again = minimise(group, found, smallest)
    if again.success or not minimum.success:
        return Fit(group, again, smallest, weights)
    return Fit(group, minimum, 0.0, weights)


def not_held(fit: Fit) -> float:
    """The singular value below which directions of a like group are held worse than TAPE."""
    return _noise(fit.minimum, fit.group) / TAPE


def _noise(minimum: Minimum, group: Group) -> float:
    """Standard deviation of a closure error, m2."""
    count = sum(len(c.q) for c in group.chains)
    return float(np.sqrt(minimum.cost / max(1, count - minimum.rank)))


def fit_robust(groups: Sequence[Group]) -> list[Fit]:
    """All groups with one weight for each pose: Huber's until it settles, then Tukey's, which drops gross errors."""
    fits = [fit_group(group) for group in groups]
    weights = np.ones(len(groups[0].chains[0].q))
    for tukey in (False, True):
        for _ in range(ROUNDS):
            size = relative_size(fits)
            if tukey:
                square = np.where(size < TUKEY, (1 - (size / TUKEY) ** 2) ** 2, 0.0)
            else:
                square = np.minimum(1.0, HUBER / np.maximum(size, 1e-12))
            old, weights = weights, np.sqrt(square)
            fits = [fit_group(replace(g, x=f.x.copy()), weights) for g, f in zip(groups, fits, strict=True)]
            if np.abs(weights - old).max() < 1e-6:
                break
    return fits


def relative_size(fits: Sequence[Fit]) -> np.ndarray:
    """The largest closure error of each pose in robust standard deviations of its link, (N,)."""
    distances = np.abs(np.hstack([fit.distances() for fit in fits]))
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
    prior = expected.given
    if prior is None:
        return list(groups)
    if not isinstance(prior, Mapping):
        raise ModelError(
            f"calibrate: found prior={prior!r}, expected a dict as {{'arms[1].links[0].plate_offset': 0.001}}, deviations "
            "in m by name"
        )
    known = {n for g in groups for n, free in zip(g.names, g.free, strict=True) if free}
    found = [dict(g.prior) for g in groups]
    for name, given in prior.items():
        matches = [n for n in known if _is_called(n, name)]
        if not matches:
            raise ModelError(
                f"calibrate: prior for '{name}', which is not identified{did_you_mean(name, sorted(known))}"
            )
        value, deviation = given if isinstance(given, tuple) else (None, given)
        for group, mine in zip(groups, found, strict=True):
            for i, n in enumerate(group.names):
                if n in matches:
                    k = int(n[-2]) if n.endswith("]") else 0
                    mine[i] = (
                        expected.nominal.get(n, group.x[i]) if value is None else _element(value, k),
                        _positive(name, deviation, k),
                    )
    return [replace(g, prior=mine) for g, mine in zip(groups, found, strict=True)]


def _is_called(element: str, name: str) -> bool:
    vector = element.rsplit("[", 1)[0] if element.endswith("]") else element
    return name in (element, vector, vector.rsplit(".", 1)[-1])


def _element(value: Any, k: int) -> float:
    array = np.atleast_1d(np.asarray(value, dtype=float))
    return float(array[k] if array.size > 1 else array[0])


def _positive(name: str, deviation: Any, k: int) -> float:
    found = _element(deviation, k)
    if not found > 0:
        raise ModelError(
            f"calibrate: found the deviation {found:g} for '{name}' in prior, expected one above 0"
        )
    return found
