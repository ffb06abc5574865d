"""Delay, pole and gain of one actuator by output error.

    y[k] = a y[k - 1] + b u[k - d],   q_m = y + c,   u = q_r - q_r[0]

The sum of squares of q_m - y - c is least over a, b and the rest c of each step. Its terms are the simulated response: the
measured one on the right hand side (equation error) would draw the pole to zero by its noise. For given a and d the rest
is linear; a is looked for on a grid, for all d at once, then by Gauss-Newton steps. Dressler (2012), (6.11).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gantrytau_optimica.fitting.linear import linear_least_squares
from gantrytau_optimica.identification.rigid.residual_covariance import BAND, LogRows, covariance

LATEST = 100  # samples of delay that are looked at
POLES = 120  # on the grid
SLOWEST = 1e4  # samples, the longest time constant on the grid
NEAR = 2  # samples to either side of the best delay, that are looked at closely
STEPS = 50  # of Gauss and Newton
DONE = 1e-13  # change of the pole


@dataclass(frozen=True, eq=False)
class ServoRows:
    """One actuator in one step: reference less its first value u, position y, (N,) each; number of the step."""

    step: int
    u: np.ndarray
    y: np.ndarray


@dataclass(frozen=True, eq=False)
class ServoFit:
    """Best fit of one actuator. covariance: (2, 2) of pole and gain; rest: c of each step; latest: longest delay looked at.

    left: sums of squares by delay, of those that were looked at closely; residuals: by step.
    """

    delay: int
    pole: float
    gain: float
    covariance: np.ndarray
    rest: np.ndarray
    latest: int
    left: dict[int, float]
    residuals: tuple[np.ndarray, ...]

    @property
    def squares(self) -> float:
        """Sum of squares that it leaves."""
        return self.left[self.delay]


def fit_servo(rows: Sequence[ServoRows], period: float) -> ServoFit:
    """The best delay, pole and gain for some steps of one actuator."""
    latest = min(LATEST, min(len(r.u) - int(np.argmax(r.u != 0)) for r in rows) - 4)
    grid = 1 - np.geomspace(1 / SLOWEST, 1.0, POLES)
    left = _on_grid(rows, grid, latest)
    best, pole = (int(k) for k in np.unravel_index(np.argmin(left), left.shape))
    fits: dict[int, tuple[np.ndarray, float]] = {}
    delay, start = best, float(grid[pole])
    while missing := [d for d in range(delay - NEAR, delay + NEAR + 1) if 0 <= d <= latest and d not in fits]:
        # a pole between those of the grid may make another delay the best, so its neighbours are looked at in turn
        fits |= {d: _refined(rows, d, start) for d in missing}
        delay = min(fits, key=lambda d: fits[d][1])
        start = float(fits[delay][0][0])
    p = fits[delay][0]
    residuals = tuple(_left(rows, p, delay))
    return ServoFit(
        delay,
        float(p[0]),
        float(p[1]),
        _covariance(rows, p, delay, residuals, period),
        p[2:],
        latest,
        {d: squares for d, (_, squares) in fits.items()},
        residuals,
    )


def response(u: np.ndarray, delay: int, pole: float, gain: float) -> np.ndarray:
    """The response y (N,) from rest to u (N,)."""
    from scipy.signal import lfilter

    return lfilter([gain], [1.0, -pole], _late(u, delay))


def _late(x: np.ndarray, delay: int) -> np.ndarray:
    return np.concatenate([np.zeros(min(delay, len(x))), x[: max(len(x) - delay, 0)]])


def _on_grid(rows: Sequence[ServoRows], poles: np.ndarray, latest: int) -> np.ndarray:
    """Sums of squares (latest + 1, poles) that the best gain and rests leave, positive gains only."""
    product, square, total = 0.0, 0.0, 0.0
    for r in rows:
        count = len(r.u)
        x = np.column_stack([response(r.u, 0, pole, 1.0) for pole in poles])
        y = r.y - r.y.mean()
        # the response that comes d samples late meets y[d:]; later than the end it is cut off
        later = np.lib.stride_tricks.sliding_window_view(np.append(y, np.zeros(latest)), count)
        ends = count - 1 - np.arange(latest + 1)
        product = product + later @ x
        square = square + (np.cumsum(x**2, axis=0) - np.cumsum(x, axis=0) ** 2 / count)[ends]
        total += float(y @ y)
    return total - np.maximum(product, 0.0) ** 2 / np.maximum(square, np.finfo(float).tiny)


def _refined(rows: Sequence[ServoRows], delay: int, pole: float) -> tuple[np.ndarray, float]:
    """Pole, gain and rests (2 + steps,), and the sum of squares, from a start of the pole."""
    p = _linear(rows, delay, pole)
    squares = _squares(rows, p, delay)
    for _ in range(STEPS):
        J, left = np.vstack(_slopes(rows, p, delay)), np.concatenate(_left(rows, p, delay))
        change = linear_least_squares(J, left)
        share = 1.0
        while share > 1e-6:
            trial = _linear(rows, delay, float(np.clip(p[0] + share * change[0], 0.0, 1.0 - 1e-9)))
            found = _squares(rows, trial, delay)
            if found <= squares:
                break
            share /= 2
        else:
            break
        moved = abs(trial[0] - p[0])
        p, squares = trial, found
        if moved < DONE:
            break
    return p, squares


def _linear(rows: Sequence[ServoRows], delay: int, pole: float) -> np.ndarray:
    """The best gain and rests for a pole."""
    x = [response(r.u, delay, pole, 1.0) for r in rows]
    product = sum(float((one - one.mean()) @ r.y) for one, r in zip(x, rows, strict=True))
    square = sum(float((one - one.mean()) @ one) for one in x)
    gain = product / square if square > 0 else 0.0
    return np.array([pole, gain, *(float(np.mean(r.y - gain * one)) for one, r in zip(x, rows, strict=True))])


def _left(rows: Sequence[ServoRows], p: np.ndarray, delay: int) -> list[np.ndarray]:
    return [r.y - response(r.u, delay, p[0], p[1]) - p[2 + k] for k, r in enumerate(rows)]


def _squares(rows: Sequence[ServoRows], p: np.ndarray, delay: int) -> float:
    return sum(float(left @ left) for left in _left(rows, p, delay))


def _slopes(rows: Sequence[ServoRows], p: np.ndarray, delay: int) -> list[np.ndarray]:
    """Derivatives of the responses by the parameters, (N, 2 + steps) for each step."""
    found = []
    for k, r in enumerate(rows):
        J = np.zeros((len(r.u), len(p)))
        by_gain = response(r.u, delay, p[0], 1.0)
        J[:, 0] = response(p[1] * by_gain, 1, p[0], 1.0)
        J[:, 1] = by_gain
        J[:, 2 + k] = 1.0
        found.append(J)
    return found


def _covariance(
    rows: Sequence[ServoRows], p: np.ndarray, delay: int, residuals: Sequence[np.ndarray], period: float
) -> np.ndarray:
    """Of pole and gain, (2, 2), by the spectrum of what is left where the servo answers."""
    band = min(corner(p[0], period), 0.5 / period)
    slopes = _slopes(rows, p, delay)
    logs = [
        LogRows(
            J[:, None], (left + J @ p)[:, None], np.ones((len(left), 1), dtype=bool), period, BAND * band, 1
        )
        for J, left in zip(slopes, residuals, strict=True)
    ]
    return covariance(logs, p, np.arange(len(p)))[:2, :2]


def corner(pole: float, period: float) -> float:
    """Frequency in Hz at which the gain is 1 / sqrt(2) of that at rest; infinite where half of the sampling comes first.

    |1 - a exp(-j w)|^2 = 2 (1 - a)^2, so that sin^2(w / 2) = (1 - a)^2 / (4 a).
    """
    square = (1 - pole) ** 2 / (4 * pole) if pole > 0 else np.inf
    return float(2 * np.arcsin(np.sqrt(square)) / (2 * np.pi * period)) if square <= 1 else np.inf
