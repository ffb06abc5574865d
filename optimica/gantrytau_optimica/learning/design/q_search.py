"""The filters that are open widest while sigma stays within a margin: a low-pass of order two and notches for each axis.

    |q(f)| = 1 / (1 + (x / x_0)^4) prod_k ((1 - v_k^2)^2 + (2 z_k d_k v_k)^2) / ((1 - v_k^2)^2 + (2 z_k v_k)^2)
    x = tan(pi f period),  v_k = x / x_k,  z_k width and d_k depth of a notch

All axes are opened together by slopes, from notches where I - L T is largest. A penalty that begins a little inside keeps
sigma within the margin: closing by the cut-off instead costs up to a third of the mean gain.
"""

from dataclasses import dataclass

import numpy as np

LOW_PASS = (0.5, 100.0)  # Hz
LOWEST, WIDTHS, DEPTHS = 0.3, (0.02, 1.5), (0.02, 1.0)  # of notches; Hz
MIDDLE = 0.45  # of the sampling frequency, below which filters lie
INSIDE = 0.995  # of the margin, at which the penalty begins at first
ROUNDS = (10.0, 100.0, 1e3, 1e4)  # of the penalty
BACK = 0.999  # of the cut-off, by which filters are closed at least in each step until they hold
# times that the penalty is moved inside; times the margin, for what is between frequencies
HELD, BELOW = (5, 0.999)
CLOSED = 300  # such steps at most


def sizes_of(gains: np.ndarray, left: np.ndarray) -> np.ndarray:
    """The value of sigma (..., F) of filters with gains (m, F), by I - L T (..., F, m, m)."""
    return np.linalg.norm(gains.T[:, :, None] * left, ord=2, axis=(-2, -1))


@dataclass(frozen=True, eq=False)
class QProblem:
    """What is asked of filters. Parameters p: logarithms of cut-off, and of centre, width and depth of notches, by axis.

    hz (F,); left: I - L T of a family (members, F, m, m); most: what each gain may be besides, (m, F); limit: Hz, up to
    which filters are to be open.
    """

    hz: np.ndarray
    left: np.ndarray
    most: np.ndarray
    period: float
    limit: float
    margin: float
    notches: int

    @property
    def axes(self) -> int:
        """How many filters there are."""
        return self.left.shape[-1]

    @property
    def x(self) -> np.ndarray:
        """tan(pi f period), (F,)."""
        return np.tan(np.pi * np.minimum(self.hz, 0.5 / self.period * (1 - 1e-9)) * self.period)

    @property
    def bounds(self) -> np.ndarray:
        """Of the parameters of one axis, (1 + 3 notches, 2)."""
        top = MIDDLE / self.period
        low = [LOW_PASS[0], *[LOWEST, WIDTHS[0], DEPTHS[0]] * self.notches]
        high = [min(LOW_PASS[1], top), *[top, WIDTHS[1], DEPTHS[1]] * self.notches]
        return np.log(np.column_stack([low, high]))

    def gains(self, p: np.ndarray) -> np.ndarray:
        """|q| of each axis, (m, F)."""
        x = self.x
        return np.array([_gain(axis, x, self.period) for axis in np.exp(p).reshape(self.axes, -1)])

    def slopes(self, p: np.ndarray) -> np.ndarray:
        """Of |q| by the parameters of its axis, (m, 1 + 3 notches, F)."""
        x = self.x
        return np.array([_slopes(axis, x, self.period) for axis in np.exp(p).reshape(self.axes, -1)])

    def over(self, p: np.ndarray) -> np.ndarray:
        """Times the margin, and the most, that is reached, by member and frequency, (members + 1, F)."""
        q = self.gains(p)
        return np.vstack([sizes_of(q, self.left) / self.margin, (q / self.most).max(axis=0)])

    def open(self, p: np.ndarray) -> float:
        """The mean gain up to the limit."""
        return float(np.sum(self.weights * self.gains(p)))

    @property
    def weights(self) -> np.ndarray:
        """Of frequencies in the mean gain of all axes, (F,)."""
        found = np.gradient(self.hz) * (self.hz <= self.limit)
        return found / found.sum() / self.axes


def widest(problem: QProblem) -> np.ndarray:
    """The parameters with the largest mean gain for which all holds, (m (1 + 3 notches),), see `closed`."""
    rows = np.linalg.norm(problem.left, axis=-1).max(axis=0).T  # (m, F): the worst of the family
    start = np.array([_at_peaks(problem, each) for each in np.maximum(rows, 1 / problem.most)])
    return closed(problem, _held(problem, start.ravel()))


def _held(problem: QProblem, p: np.ndarray) -> np.ndarray:
    """Opened from a start, with the penalty beginning so far inside that little is left to close."""
    inside = INSIDE
    p = _opened(problem, p, ROUNDS, inside)
    for _ in range(HELD):
        over = problem.over(p).max()
        if over <= BELOW:
            break
        inside *= BELOW / over
        p = _opened(problem, p, ROUNDS[-1:], inside)
    return p


def closed(problem: QProblem, p: np.ndarray) -> np.ndarray:
    """The same with cut-offs so low that all holds; where it never does, as low as they become."""
    p = p.copy()
    for _ in range(CLOSED):
        over = problem.over(p)
        if over.max() <= 1:
            break
        member, k = np.unravel_index(np.argmax(over), over.shape)
        q = problem.gains(p)[:, k]
        share = (
            q / problem.most[:, k]
            if member == len(problem.left)
            else q * np.linalg.norm(problem.left[member, k], axis=1)
        )
        own = p.reshape(problem.axes, -1)[np.argmax(share)]
        # of a low-pass 1 / (1 + (x / x_0)^4), which is to be smaller there by this factor
        x, x_0 = problem.x[k], np.tan(np.pi * np.exp(own[0]) * problem.period)
        less = x / max((1 + (x / x_0) ** 4) * over.max() - 1, 1e-30) ** 0.25
        own[0] = min(own[0] + np.log(BACK), np.log(max(np.arctan(less), 1e-12) / np.pi / problem.period))
    return p


def _opened(problem: QProblem, p: np.ndarray, rounds: tuple[float, ...], inside: float) -> np.ndarray:
    """The mean gain, less a penalty for what is above, at its largest near a start."""
    from scipy.optimize import minimize

    x, weights, left, most = problem.x, problem.weights, problem.left, problem.most
    # sigma^2 is the largest eigenvalue of sum q_i^2 of these
    grams = np.einsum("kfij,kfil->kfijl", left.conj(), left)
    rows, limit = np.einsum("kfijj->kfi", grams).real, inside * problem.margin

    def cost(p: np.ndarray, stiffness: float) -> tuple[float, np.ndarray]:
        q = problem.gains(p)
        square = np.einsum("if,kfi->kf", q**2, rows)
        near = np.sqrt(square) > limit  # others cannot be above it
        k, f = np.nonzero(near)
        sizes, vectors = np.linalg.eigh(np.einsum("in,nijl->njl", q[:, f] ** 2, grams[k, f]))
        sigma, v = np.sqrt(np.maximum(sizes[:, -1], 1e-30)), vectors[:, :, -1]
        over = np.maximum(sigma - limit, 0.0)
        # d sigma / d q_i = q_i |(left v)_i|^2 / sigma
        turned = np.abs(np.einsum("nij,nj->ni", left[k, f], v)) ** 2
        rates = np.zeros((len(q), len(x)))
        for i in range(len(q)):
            rates[i] = np.bincount(f, over * q[i, f] * turned[:, i] / sigma, len(x))
        above = np.maximum(q - inside * most, 0.0)
        penalty = stiffness * (np.sum(over**2) + np.sum(above**2)) / near.size
        by_q = 2 * stiffness / near.size * (rates + above) - weights
        return float(penalty - np.sum(weights * q)), np.einsum("if,ikf->ik", by_q, problem.slopes(p)).ravel()

    bounds = np.tile(problem.bounds, (problem.axes, 1))
    p = np.clip(p, *bounds.T)
    for stiffness in rounds:
        p = minimize(
            cost, p, args=(stiffness,), jac=True, method="L-BFGS-B", bounds=bounds, options=dict(maxiter=80)
        ).x
    return p


def _gain(axis: np.ndarray, x: np.ndarray, period: float) -> np.ndarray:
    """|q| over x: |causal half|^2 of a Butterworth filter of order 2 and notches."""
    found = 1 / (1 + (x / np.tan(np.pi * axis[0] * period)) ** 4)
    for centre, width, depth in axis[1:].reshape(-1, 3):
        square = (x / np.tan(np.pi * centre * period)) ** 2
        off, beside = (1 - square) ** 2, (2 * width) ** 2 * square
        found = found * (off + depth**2 * beside) / (off + beside)
    return found


def _slopes(axis: np.ndarray, x: np.ndarray, period: float) -> np.ndarray:
    """Of |q| by the logarithms of the parameters of an axis, (1 + 3 notches, F)."""

    def by_hz(hz: float) -> float:  # d log tan(pi hz period) / d log hz
        angle = np.pi * hz * period
        return angle / (np.sin(angle) * np.cos(angle))

    fourth = (x / np.tan(np.pi * axis[0] * period)) ** 4
    rows = [4 * by_hz(axis[0]) * fourth / (1 + fourth)]
    for centre, width, depth in axis[1:].reshape(-1, 3):
        square = (x / np.tan(np.pi * centre * period)) ** 2
        off, beside = (1 - square) ** 2, (2 * width) ** 2 * square
        over, under = off + depth**2 * beside, off + beside
        by_square = (2 * square * (square - 1) + depth**2 * beside) / over - (
            2 * square * (square - 1) + beside
        ) / under
        rows.append(-2 * by_hz(centre) * by_square)
        rows.append(2 * depth**2 * beside / over - 2 * beside / under)
        rows.append(2 * depth**2 * beside / over)
    return np.array(rows) * _gain(axis, x, period)


def _at_peaks(problem: QProblem, peaks: np.ndarray) -> np.ndarray:
    """Logarithms of the parameters of an axis: notches where I - L T is largest, and the cut-off at the limit."""
    hz, limit = problem.hz, problem.limit
    found = [limit]
    left = np.where((hz > 0.5) & (hz < 2 * limit), peaks, 0.0)
    for _ in range(problem.notches):
        top = int(np.argmax(left))
        found += [max(hz[top], 0.5), 0.2, 1 / max(left[top], 1.1) ** 0.5]
        left = np.where(np.abs(hz - hz[top]) < 0.2 * hz[top], 0.0, left)
    return np.log(found)
