"""Exchanging poses between those that are chosen and those that are not, as long as a criterion grows.

    D-optimal: sum_i log det A_i        tool: - sum_i tr (W_i A_i^-1)        A_i = least I + sum_k J_ik' J_ik

What pose k adds or takes follows by Woodbury's identity from J_k A^-1, with matrices as large as there are links. This is
kept for all candidates and follows the exchanges, each of which costs one product with the rows of a pose. At first many
poses are exchanged at once, half as many whenever that is no gain; then one by one (Fedorov, 1972).
"""

from collections.abc import Sequence

import numpy as np

from gantrytau_optimica.calibration.links.arm_factors import NOISE
from gantrytau_optimica.calibration.links.groups import TAPE

LEAST = (NOISE / TAPE) ** 2  # what a tape measure knows
EXCHANGES = 1000  # one by one, at most
TRIED = 400  # of the poses outside, the best ones, where too much must not be given away
RENEWED = 50  # exchanges, after which rounding is taken out of what is kept
GAIN = 1e-5  # of each unknown's deviation, that an exchange must be worth: of thousands of poses each is worth less


def exchanged(
    blocks: Sequence[np.ndarray], chosen: np.ndarray, weights: Sequence[np.ndarray], slack: float | None
) -> np.ndarray:
    """Rows, ascending, better than the chosen ones, as many.

    blocks: J of each arm, (N, m, p); weights: W of each, (p, p). slack: None for the criterion "tool"; else D-optimal, and
    then for the tool as long as no more than slack of log det is lost for each unknown.
    """
    count = len(blocks[0])
    if len(chosen) == count:
        return np.sort(chosen)
    tool = [_Choice(J, W) for J, W in zip(blocks, weights, strict=True)]
    if slack is None:
        return _one_by_one(tool, _many_at_once(tool, chosen), -np.inf)
    optimal = [_Choice(J, None) for J in blocks]
    best = _one_by_one(optimal, _many_at_once(optimal, chosen), -np.inf)
    lowest = _information(tool, best) - slack * sum(J.shape[2] for J in blocks)
    return _one_by_one(tool, best, lowest)


class _Choice:
    """Poses chosen for one arm: the inverse of A and J_k A^-1 of all candidates, for a criterion with W or without."""

    def __init__(self, J: np.ndarray, W: np.ndarray | None):
        self.J, self.W, self.rows = J, W, J.reshape(-1, J.shape[2])
        self.inverse, self.half, self.value = np.empty(0), np.empty(0), 0.0

    def matrix(self, inside: np.ndarray) -> np.ndarray:
        """A of the poses inside."""
        rows = self.J[inside].reshape(-1, self.J.shape[2])
        return rows.T @ rows + LEAST * np.eye(self.J.shape[2])

    def renew(self, inside: np.ndarray) -> float:
        """Start from the poses inside; the value of the criterion."""
        A = self.matrix(inside)
        self.inverse = np.linalg.inv(A)
        self.half = (self.rows @ self.inverse).reshape(self.J.shape)
        return float(np.linalg.slogdet(A)[1]) if self.W is None else -float(np.trace(self.W @ self.inverse))

    def scale(self, value: float) -> float:
        """What the value of the criterion grows by for each part of the deviations of the unknowns that is won."""
        return 2.0 * self.J.shape[2] if self.W is None else 2.0 * abs(value)

    def growth(self, sign: float, asked: np.ndarray) -> np.ndarray:
        """How much the criterion grows when each of the poses asked for comes (1) or goes (-1)."""
        half = self.half[asked]
        small = np.eye(half.shape[1]) + sign * half @ np.swapaxes(self.J[asked], 1, 2)
        if self.W is None:
            return np.log(np.maximum(np.linalg.det(small), 1e-300))
        weighted = (half.reshape(-1, half.shape[2]) @ self.W).reshape(half.shape) @ np.swapaxes(half, 1, 2)
        return sign * np.trace(np.linalg.solve(small, weighted), axis1=1, axis2=2)

    def move(self, k: int, sign: float) -> None:
        """Pose k comes or goes."""
        half = self.half[k]  # (m, p)
        small = np.linalg.solve(np.eye(len(half)) + sign * half @ self.J[k].T, half)
        self.inverse = self.inverse - sign * half.T @ small
        self.half -= (sign * (self.rows @ half.T) @ small).reshape(self.J.shape)


def _information(choices: Sequence[_Choice], inside: np.ndarray) -> float:
    return sum(float(np.linalg.slogdet(each.matrix(inside))[1]) for each in choices)


def _many_at_once(choices: Sequence[_Choice], chosen: np.ndarray) -> np.ndarray:
    """Exchange the worst of the chosen poses for the best of the others, half as many whenever that is no gain."""
    everything, inside = np.arange(len(choices[0].J)), np.sort(chosen)
    value, at_once = sum(each.renew(inside) for each in choices), len(chosen) // 2
    while at_once > 1:
        outside = np.setdiff1d(everything, inside)
        come = sum(each.growth(1.0, outside) for each in choices)
        go = sum(each.growth(-1.0, inside) for each in choices)
        at_once = min(at_once, len(outside))
        new, old = outside[np.argsort(-come)[:at_once]], inside[np.argsort(-go)[:at_once]]
        trial = np.sort(np.concatenate([np.setdiff1d(inside, old), new]))
        found = sum(each.renew(trial) for each in choices)
        if found > value:
            inside, value = trial, found
        else:
            at_once //= 2
            for each in choices:
                each.renew(inside)
    return inside


def _one_by_one(choices: Sequence[_Choice], chosen: np.ndarray, lowest: float) -> np.ndarray:
    """Exchange the best one outside for the least one inside, while that is a gain and log det is not below `lowest`."""
    everything, inside = np.arange(len(choices[0].J)), np.zeros(len(choices[0].J), dtype=bool)
    inside[chosen] = True
    least = 0.0
    # too few poses leave directions to the first term of A, and rounding grows by a million
    well_known = all(len(chosen) * each.J.shape[1] > 2 * each.J.shape[2] for each in choices)
    for k in range(EXCHANGES):
        if k % RENEWED == 0 or not well_known:
            least = GAIN * sum(each.scale(each.renew(np.flatnonzero(inside))) for each in choices)
        gain = np.where(inside, -np.inf, sum(each.growth(1.0, everything) for each in choices))
        pair = _allowed_pair(choices, np.flatnonzero(inside), gain, (least, lowest))
        if pair is None:
            break
        new, old = pair
        inside[new], inside[old] = True, False
        for each in choices:
            each.move(new, 1.0)
            each.move(old, -1.0)
    return np.flatnonzero(inside)


def _allowed_pair(
    choices: Sequence[_Choice], inside: np.ndarray, gain: np.ndarray, limits: tuple[float, float]
) -> tuple[int, int] | None:
    """The pose that comes and the one that goes: the best of the others whose exchange does not give too much away."""
    least, lowest = limits
    for new in map(int, np.argsort(-gain)[: min(TRIED, len(gain) - len(inside))]):
        after = np.append(inside, new)
        some = [_Choice(each.J[after], each.W) for each in choices]
        for each in some:
            each.renew(np.arange(len(after)))
        loss = sum(each.growth(-1.0, np.arange(len(after))) for each in some)
        old = int(after[np.argmax(loss)])
        if old == new or np.max(loss) + gain[new] < max(least, 1e-9 * abs(gain[new])):
            if np.isinf(lowest):
                return None
            continue
        if np.isinf(lowest) or _information(choices, after[after != old]) >= lowest:
            return new, old
    return None
