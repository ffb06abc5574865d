"""Least squares of groups of links: truncation of undetermined directions, robust weights."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gantrytau.describing.record import Record
from gantrytau_optimica.calibration.links.groups import Group, tape_limit
from gantrytau_optimica.fitting.least_squares import Minimum, Prior, limit_of
from gantrytau_optimica.fitting.robust import (
    huber_weights,
    robust_deviation,
    robust_deviations,
    tukey_roots,
    without_strays,
)

FAR = 0.5  # m, from the start values; fits that data do not hold may run off further
NOISES, SETTLED = 10, 0.01  # rounds of estimating the noise with a tape measure, until it changes by less
CLEARLY = 10.0  # times better than a tape measure, from which on its pull would be negligible
ROUNDS = 60  # of reweighting
MANY = 6000  # closure errors, which show the noise well enough
STRAYS = 3.0  # times the robust deviation, from which on strays make the mean of the squares
EXACT = 1e-12  # m, the least deviation of closure errors: rounding of lengths


@dataclass(frozen=True)
class Fit(Record):
    """A group at its minimum; weights: of the poses (N,), or None for 1."""

    group: Group
    minimum: Minimum
    weights: np.ndarray | None = None

    @property
    def x(self) -> np.ndarray:
        """The parameters of the group."""
        return self.minimum.x

    @property
    def values(self) -> dict[str, float]:
        """All parameters by name."""
        return dict(zip(self.group.names, self.x.tolist(), strict=True))

    @property
    def free_names(self) -> tuple[str, ...]:
        """Names of the identified parameters."""
        return tuple(n for n, free in zip(self.group.names, self.group.free, strict=True) if free)

    @property
    def count(self) -> int:
        """Closure errors that were used."""
        return self.group.count

    @property
    def noise(self) -> float:
        """Standard deviation of a closure error, as it is known or as it is left."""
        return self.minimum.noise(self.count) if self.group.noise is None else self.group.noise

    @property
    def smallest(self) -> float:
        """Singular value below which a direction is known worse than by a tape measure."""
        return self.noise / self.group.tape

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
    """Minimum of a group; directions known worse than by a tape measure stay near the start values.

    weights: of the poses, (N,), or None; begin: where the search begins, instead of the start values; smallest: singular
    value below which directions are known not to be held.

    Where noise is known, steps of least norm leave what data hold worse than a tape measure at the start values. Where it
    has to be found and data do not hold everything, closure errors curve so much along what they do not hold that steps
    without it end in wrong places. So all parameters are first held by a tape measure, which has one minimum; what is held
    is decided there, and moves on without the tape.
    """
    x, rows = group.x if begin is None else begin, group.condensed(weights)
    if group.noise is not None and smallest is None:
        limit = tape_limit(group.noise, group.tape)
        return Fit(group, rows.minimum(x, group.noise, smallest=limit), weights)
    if smallest is None:
        minimum, noise = rows.minimum(x, 0.0), 0.0
        for _ in range(2 if group.prior else 0):  # its weight follows from the noise that is left without it
            noise = Fit(group, minimum).noise
            minimum = rows.minimum(x, noise)
        noise, least = Fit(group, minimum).noise, minimum.singular.min(initial=np.inf)
        if least <= CLEARLY * noise / group.tape:
            noise = _without_strays(group, minimum.x, weights, noise)
        near = np.abs(minimum.x - x).max(initial=0.0) < FAR
        if minimum.success and near and least > CLEARLY * noise / group.tape:
            return Fit(group, minimum, weights)
    else:
        noise = smallest * group.tape
    taped, noise, limit = _by_tape(group, rows, noise, smallest, weights)
    _, singular, directions = np.linalg.svd(taped.jacobian[: -len(taped.scale)], full_matrices=False)
    held = int((singular > limit_of(singular, limit)).sum())
    minimum = rows.minimum(taped.x, noise, along=directions[:held])
    return Fit(group, minimum.beside(directions[held:]), weights)


def _by_tape(
    group: Group, rows: Group, noise: float, smallest: float | None, weights: np.ndarray | None
) -> tuple[Minimum, float, float]:
    """The minimum where a tape measure, in the last rows, holds all parameters about the start values; the noise that
    weighs its prior, and `smallest`; from a guess of the noise, which is found anew from what is left.
    """
    free, rounds = np.flatnonzero(group.free), 0
    while True:
        rounds += 1
        limit = noise / group.tape if smallest is None else smallest
        tape = Prior(free, group.x[free], limit / group.scale[free])
        minimum, before = rows.minimum(group.x, noise, [tape]), noise
        left, J = minimum.residuals[: -len(free)], minimum.jacobian[: -len(free)]
        squares = np.linalg.svd(J, compute_uv=False) ** 2
        # how many parameters data tell
        told = float(np.sum(squares / np.maximum(squares + limit**2, 1e-300)))
        noise = float(np.sqrt(left @ left / max(1.0, group.count - told)))
        noise = _without_strays(group, minimum.x, weights, noise)
        if smallest is not None or abs(noise - before) <= SETTLED * before or rounds == NOISES:
            return minimum, before, limit


def _without_strays(group: Group, x: np.ndarray, weights: np.ndarray | None, noise: float) -> float:
    """The noise of a closure error as a fit that strays do not lead would leave it, where these make the mean of the squares
    far larger: what data hold does not depend on one wrong pose.
    """
    few = slice(None, None, max(1, group.count // MANY))
    sure = np.ones(len(group.chains[0].q)) if weights is None else weights
    rows = np.flatnonzero(sure > 0)[few]
    left = (group.errors(x)[rows] * sure[rows, None]).T.ravel()
    J = np.concatenate([group.link_jacobian(x, k)[rows] * sure[rows, None] for k in range(len(group.chains))])
    rank = int(np.linalg.matrix_rank(J))
    if len(left) < 4 * rank:  # few errors do not show which of them are strays
        return noise
    usual = robust_deviation(without_strays(left, J), rank)
    return usual if STRAYS * usual < noise else noise


def fit_groups(groups: Sequence[Group], loss: str, certainty: np.ndarray | None = None) -> list[Fit]:
    """All groups; of a robust loss with one weight for each pose: Huber's until it settles, then Tukey's, which drops
    gross errors.

    certainty: (N,), how much surer poses are than others, by which their errors and weights are multiplied.
    """
    fits = [fit_group(group, certainty) for group in groups]
    if loss != "robust":
        return fits
    weights = sure = np.ones(len(groups[0].chains[0].q)) if certainty is None else certainty
    for tukey in (False, True):
        for _ in range(ROUNDS):
            sizes, old = relative_sizes(fits, sure), weights
            weights = sure * (tukey_roots(sizes) if tukey else np.sqrt(huber_weights(sizes)))
            # from where a fit ended, unless gross errors may have moved what data do not hold
            fits = [
                fit_group(fit.group, weights, begin=fit.x if fit.group.noise is None else None)
                for fit in fits
            ]
            if np.abs(weights - old).max() < 1e-6:
                break
    return fits


def relative_sizes(fits: Sequence[Fit], sure: np.ndarray | float = 1.0) -> np.ndarray:
    """The largest closure error of each pose in robust standard deviations of its link, (N,); sure: (N,) as above."""
    distances = np.abs(np.hstack([fit.distances() for fit in fits]).T * sure).T
    return (distances / np.maximum(robust_deviations(distances), EXACT)).max(axis=1)
