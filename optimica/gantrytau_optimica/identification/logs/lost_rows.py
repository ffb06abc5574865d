"""Rows that a log has lost while its times go on evenly: from one row to the next positions go twice as far.

d = q_(k+1) - q_k,  m: median of the two d before and the two behind,  r = d.m / m.m

All actuators count in deviations of d - m; r is a whole number where rows are lost, and 1 elsewhere.
"""

import numpy as np

from gantrytau_optimica.fitting.robust import OUTLIER, robust_deviation

EVEN = 0.02  # of a period, by which times may differ
WHOLE = 0.25  # by which r may differ from a whole number
STEADY = 0.5  # of m, by which the steps beside may differ
FEW = 20  # rows


def lost_rows(t: np.ndarray, q: np.ndarray) -> np.ndarray:
    """How many rows are missing before each row, (N,), of times (N,) that are even and positions (N, n), finite ones."""
    found = np.zeros(len(t), dtype=int)
    if len(t) < FEW or np.ptp(np.diff(t)) > EVEN * np.median(np.diff(t)):
        return found
    d = np.diff(q, axis=0)
    around = np.sort([d[:-4], d[1:-3], d[3:-1], d[4:]], axis=0)
    m, beside, own = (around[1] + around[2]) / 2, around[2] - around[1], d[2:-2]
    still = np.where(d == 0, np.inf, np.abs(d)).min(axis=0)  # encoders on a grid do not tell less
    sizes = np.array([max(robust_deviation(x), least) for x, least in zip((own - m).T, still, strict=True)])
    if not np.all(np.isfinite(sizes)):  # an actuator that never moves
        moves = np.isfinite(sizes)
        return lost_rows(t, q[:, moves]) if moves.any() else found
    m, beside, own = m / sizes, beside / sizes, own / sizes
    square = np.sum(m**2, axis=1)
    ratio = np.sum(own * m, axis=1) / np.maximum(square, 1e-300)
    whole = np.round(ratio)
    sure = (ratio - 1) * np.sqrt(square) > OUTLIER
    steady = np.sum(beside**2, axis=1) < STEADY**2 * square
    lost = sure & steady & (whole >= 2) & (np.abs(ratio - whole) < WHOLE)
    found[3:-2][lost] = whole[lost].astype(int) - 1
    return found
