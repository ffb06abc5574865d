"""Covariance of parameters found by least squares, from the noise of the residuals.

cov p = (J'J)^-1 J' cov(e) J (J'J)^-1               white: s^2 (J'J)^-1
cov(x'e) = sum_f conj(X_f)' X_f S_f / N             noise whose neighbours are not independent; S: periodogram of e,
                                                    averaged over neighbouring frequencies
"""

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import uniform_filter1d

from gantrytau import ModelError


def spread_by(inverse: np.ndarray, *moved: np.ndarray) -> np.ndarray:
    """Covariance (n, n) of parameters; inverse: (J'J)^-1; moved: in columns, what each independent error adds to J'e."""
    half = inverse @ np.hstack(moved)
    return half @ half.T


def named_covariance(
    owner: str, known: Sequence[str], matrix: np.ndarray, names: Sequence[str] | None
) -> np.ndarray:
    """Covariance (k, k) of some of the known names in their order, None for all. ModelError for others, by their owner."""
    wanted = list(known if names is None else names)
    strange = [name for name in wanted if name not in known]
    if strange:
        raise ModelError(
            f"found {strange[0]!r}, expected names among {', '.join(known)}",
            place=f"{owner}.covariance", argument="names",
        )  # fmt: skip
    rows = [known.index(name) for name in wanted]
    return matrix[np.ix_(rows, rows)]


def averaged_spectrum(left: np.ndarray, width: int | None = None, used: float = 1.0) -> np.ndarray:
    """Power spectrum of residuals (N,) at the frequencies of rfft; width: frequencies in a mean; used: nonzero share."""
    power = np.abs(np.fft.rfft(left)) ** 2 / (len(left) * used)
    return uniform_filter1d(power, max(3, width or round(len(power) ** 0.5)), mode="reflect")


def product_covariance(x: np.ndarray, spectrum: np.ndarray) -> np.ndarray:
    """Covariance (k, k) of x'e for columns x (N, k) and noise e with this spectrum."""
    count = len(x)
    seen = np.fft.rfft(x, axis=0)
    twice = np.full(len(spectrum), 2.0)  # but the mean, and the last of an even count
    twice[0] = 1.0
    twice[-1] = 1.0 if count % 2 == 0 else 2.0
    return np.real(np.conj(seen).T @ (seen * (twice * spectrum)[:, None])) / count


def independent_share(spectrum: np.ndarray) -> float:
    """Effective share of independent rows in the variance of the noise (Bartlett, 1946)."""
    square = float(np.mean(spectrum**2))
    return min(1.0, float(np.mean(spectrum)) ** 2 / square) if square > 0 else 1.0
