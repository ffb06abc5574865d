"""Wrong rows that are so many that a fit follows them, and hides them: the rows apart from those that agree with each other.

The least sum of distances (Huber, 1981) follows the larger part of the rows. The best AGREEING of them are fitted again and
again until they stay the same (concentration steps, Rousseeuw and Van Driessen, 1999); then rows join that noise explains.
"""

from collections.abc import Sequence

import numpy as np

from gantrytau_optimica.calibration.diagnostics.link_systems import (
    SMOOTHER,
    LinkSystem,
    freedom,
    variance,
    with_smooth,
)

AGREEING = 0.6  # of the rows, which must be right
ROUNDS = 15  # of weights, of concentration, and of rows that join
FEWEST = 4  # errors more than numbers for each link, by which noise is known
EXPLAINED = 4.0  # times the variance that the other rows have, which all together must have


def masked_rows(systems: Sequence[LinkSystem], r: np.ndarray, limit: float) -> np.ndarray:
    """Which of N rows are wrong, (N,); r: positions (N, 3) in m; limit: standard deviations beyond which a row is."""
    count = len(r)
    none, most = np.zeros(count, dtype=bool), int(np.ceil(AGREEING * count))
    links = sum(one.errors.shape[1] for one in systems)
    numbers = sum(one.known.shape[1] for one in systems)
    if most - numbers / links < FEWEST:
        return none
    sizes = _least_distances(systems)
    kept = none
    for _ in range(ROUNDS):
        before, kept = kept, sizes <= np.sort(sizes)[most - 1]
        if np.array_equal(before, kept):
            break
        sizes = _sizes(systems, kept)[0]
    for _ in range(ROUNDS):
        before, kept = kept, _sizes(systems, kept)[0] < limit
        if np.array_equal(before, kept):
            break
    bad, spread = ~kept, _sizes(systems, kept)[1]
    if not bad.any() or kept.sum() < most or variance(systems) < EXPLAINED * spread:
        return none
    wide = with_smooth(systems, r)
    if freedom(wide) >= FEWEST * links and variance(wide) < SMOOTHER * spread:
        return none  # what depends on the pose that much is the model
    return bad


def _least_distances(systems: Sequence[LinkSystem]) -> np.ndarray:
    """Sizes of the rows, (N,), where the sum of them is least."""
    weights = np.ones(len(systems[0].errors))
    sizes = weights
    for _ in range(ROUNDS):
        sizes = np.sqrt(sum(np.sum(_left(one, weights) ** 2, axis=1) for one in systems))
        weights = 1 / np.sqrt(np.maximum(sizes, 1e-3 * np.median(sizes) + 1e-300))
    return sizes


def _left(one: LinkSystem, weights: np.ndarray) -> np.ndarray:
    """What numbers leave of errors, (N, m), fitted with weights (N,)."""
    J, e = one.known.reshape(*one.errors.shape, -1), one.left
    return e - J @ (_inverse(J, weights) @ np.einsum("n,nmk,nm->k", weights**2, J, e))


def _inverse(J: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Of squares of J (N, m, p), orthonormal columns: weights leave some of these hardly or not at all."""
    rows = (weights[:, None, None] * J).reshape(-1, J.shape[2])
    return np.linalg.inv(rows.T @ rows + 1e-12 * np.max(weights) ** 2 * np.eye(J.shape[2]))


def _sizes(systems: Sequence[LinkSystem], kept: np.ndarray) -> tuple[np.ndarray, float]:
    """The largest error of each row in standard deviations of its link, by a fit to some rows, and the variance of these."""
    sizes, squares, remaining = np.zeros(len(kept)), 0.0, 0.0
    for one in systems:
        J, left = one.known.reshape(*one.errors.shape, -1), _left(one, kept.astype(float))
        lever = np.einsum("nmk,nmk->nm", J @ _inverse(J, kept.astype(float)), J)
        free = max(1.0, kept.sum() - J.shape[2] / left.shape[1])
        own = np.sum(left[kept] ** 2, axis=0)
        spread = np.where(kept[:, None], 1.0, 1.0 + lever)
        sizes = np.maximum(
            sizes, (np.abs(left) / np.sqrt(spread * np.maximum(own / free, 1e-300))).max(axis=1)
        )
        squares, remaining = squares + float(own.sum()), remaining + free * left.shape[1]
    return sizes, squares / remaining
