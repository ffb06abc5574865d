"""How sure identified numbers are, from the noise of measured positions.

    e_ik = |y_ik|^2 - L_i^2,    de_ik = 2 y_ik . dT_k,    cov(e_ik, e_jk) = 4 s_i s_j y_ik . y_jk
    p = -(J'J)^-1 J'e           cov p = (J'J)^-1 J' cov(e) J (J'J)^-1

Links share the noise of a position, so that numbers of different links vary together. For one link alone this is
4 s^2 L^2 (J'J)^-1, the Cramer-Rao bound of its closure errors.
"""

from collections.abc import Sequence

import numpy as np

from gantrytau_optimica.calibration.fitting import Fit

ALIKE = 4.0  # standard deviations by which estimated noises may differ and count as one
MOVED = 0.1  # share of a number in a direction that data do not hold, from which on it is undetermined


def link_noise(fits: Sequence[Fit], loss: str) -> list[np.ndarray]:
    """Standard deviations of a measured coordinate, in m, one for each link of each fit; pooled where they are alike.

    Of a robust fit from the median of the amounts.
    """
    found, counts = [], []
    for fit in fits:
        distances = fit.distances()
        share = fit.minimum.rank / distances.shape[1]
        freedom = max(1.0, len(distances) - share)
        if loss == "robust":
            squares = (1.4826 * np.median(np.abs(distances), axis=0)) ** 2
        else:
            squares = np.sum(distances**2, axis=0) / freedom
        found.append(squares)
        counts.append(np.full(len(squares), freedom))
    squares, weights = np.concatenate(found), np.concatenate(counts)
    pooled = float(squares @ weights / weights.sum())
    # a variance from n errors has the relative deviation sqrt(2 / n)
    if np.all(np.abs(squares / pooled - 1) < ALIKE * np.sqrt(2 / weights)):
        found = [np.full(len(one), pooled) for one in found]
    return [np.sqrt(one) for one in found]


def joint_covariance(fits: Sequence[Fit], loss: str) -> np.ndarray:
    """Covariance of the free numbers of all fits one after another, (n, n); zero in directions that data do not hold."""
    noises = link_noise(fits, loss)
    parts = [
        (f, k, s)
        for f, fit in enumerate(fits)
        for k, s in zip(range(len(fit.group.chains)), noises[f], strict=True)
    ]
    starts = np.cumsum([0, *(int(fit.group.free.sum()) for fit in fits)])
    middle = np.zeros((starts[-1], starts[-1]))
    rows = [_rows(fits[f], k, s) for f, k, s in parts]
    for a, (f, _, _) in enumerate(parts):
        for b, (g, _, _) in enumerate(parts[: a + 1]):
            (J, y), (K, z) = rows[a], rows[b]
            block = (np.einsum("ij,ij->i", y, z)[:, None] * J).T @ K
            middle[starts[f] : starts[f + 1], starts[g] : starts[g + 1]] += block
            if a != b:
                middle[starts[g] : starts[g + 1], starts[f] : starts[f + 1]] += block.T
    outer = np.zeros_like(middle)
    for f, fit in enumerate(fits):
        part = slice(starts[f], starts[f + 1])
        outer[part, part] = _inverse(fit)
        middle[part, part] += _of_prior(fit)
    return outer @ middle @ outer


def _rows(fit: Fit, k: int, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """Weighted slopes (N, free) of a link, and its vectors (N, 3) times twice the noise."""
    J = fit.group.slopes(fit.x, k)
    if fit.weights is not None:
        J = J * (fit.weights**2)[:, None]
    return J, 2 * noise * fit.group.chains[k].vector(fit.x[fit.group.places[k]])


def _inverse(fit: Fit) -> np.ndarray:
    """(J'J)^-1 in the directions that were moved."""
    minimum = fit.minimum
    held = minimum.directions[: minimum.rank] / minimum.singular[: minimum.rank, None]
    return held.T @ held


def _of_prior(fit: Fit) -> np.ndarray:
    """What the rows of the prior, the last of the slopes, add to the middle."""
    count = len(fit.group.prior)
    rows = fit.minimum.slopes[len(fit.minimum.slopes) - count :]
    freedom = max(1, fit.count - fit.minimum.rank)
    return rows.T @ rows * (fit.minimum.cost / freedom)


def undetermined(fit: Fit) -> tuple[str, ...]:
    """Names of the numbers that take part in directions that data do not hold."""
    lost = fit.minimum.directions[fit.minimum.rank :]
    part = np.abs(lost).max(axis=0, initial=0.0)
    return tuple(n for n, share in zip(fit.free_names, part, strict=True) if share > MOVED)
