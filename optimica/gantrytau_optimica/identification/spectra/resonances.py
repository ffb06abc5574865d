"""Frequencies at which a motion rings."""

import numpy as np
from numpy.typing import ArrayLike

from gantrytau import ModelError
from gantrytau.border.checks import number

FINER = 16  # points of the spectrum for each that the samples tell
LEAST = 16  # samples
CHANCE = 1e-5  # that noise alone has a peak
ROUNDING = 1e-12  # of the values, below which there is no motion


def resonances(
    y: ArrayLike, period: float, *, band: tuple[float, float] | None = None, share: float = 0.05
) -> np.ndarray:
    """Resonances in Hz that free motion shows, the strongest first: peaks of its spectrum, as after a hit.

    y: (N,) or (N, k), whose powers are added, sampled every `period` s, from after the hit on. Means do not count. band:
    lowest and highest Hz; share: of the highest gain, by which a peak stands out at least. Peaks nearer than 1 / (N period)
    Hz are one; start later to see what is damped least. Empty where nothing rings more than
    white noise does. Dressler (2012), Table 6.4.
    Raises ModelError for what is too short or not finite, and for a band without frequencies.
    """
    from scipy.signal import find_peaks

    period = number("resonances", "period", period, unit="s", above=0)
    share = number("resonances", "share", share, above=0.0, below=1.0)
    y = np.asarray(y, dtype=float)
    columns = y[:, None] if y.ndim == 1 else y
    if columns.ndim != 2 or len(columns) < LEAST or not np.all(np.isfinite(columns)):
        raise ModelError(
            f"resonances: found y of shape {y.shape}, expected {LEAST} samples at least, (N,) or (N, k), all of them finite",
            argument="y",
        )
    low, high = (1 / (len(y) * period), 0.5 / period) if band is None else band
    if not 0 <= low < high:
        raise ModelError(
            f"resonances: found band={band!r}, expected (lowest, highest) in Hz", argument="band"
        )
    moving = columns - columns.mean(axis=0)
    if np.abs(moving).max() <= ROUNDING * np.abs(columns).max():
        return np.zeros(0)
    count = FINER * 2 ** int(np.ceil(np.log2(len(y))))
    hertz = np.fft.rfftfreq(count, period)
    gain = np.sqrt(np.sum(np.abs(np.fft.rfft(moving, count, axis=0)) ** 2, axis=1))
    inside = (hertz >= low) & (hertz <= high)
    if not np.any(inside):
        raise ModelError(
            f"resonances: found band={band!r}, expected one that begins below {0.5 / period:g} Hz, half of "
            "the sampling rate",
            argument="band",
        )
    peaks, _ = find_peaks(gain, prominence=share * gain[inside].max(), distance=FINER)
    peaks = peaks[inside[peaks] & (gain[peaks] ** 2 > _of_noise(moving))]
    # the summit of a parabola through three points of the logarithm
    left, top, right = (np.log(gain[peaks + k]) for k in (-1, 0, 1))
    summit = peaks + 0.5 * (left - right) / (left - 2 * top + right)
    return summit[np.argsort(-top)] * hertz[1]


def _of_noise(y: np.ndarray) -> float:
    """Power that a spectrum of white noise in y (N, k) does not reach by chance, from its lower quartile.

    Powers of k columns are distributed as chi square of 2 k degrees of freedom; rings leave the quartile far below them.
    """
    from scipy.special import chdtri

    power = np.sum(np.abs(np.fft.rfft(y, axis=0)[1:]) ** 2, axis=1)
    freedom = 2 * y.shape[1]
    # a finer spectrum has about twice as many independent summits
    return float(
        np.quantile(power, 0.25) / chdtri(freedom, 0.75) * chdtri(freedom, CHANCE / (2 * len(power)))
    )
