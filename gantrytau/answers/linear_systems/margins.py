"""Margins of a loop under unity feedback: how much gain, phase and delay it bears, and its sensitivity peaks."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gantrytau.answers.linear_systems.closed_loop import SisoSystem, loop_frequencies
from gantrytau.describing.record import Record

REAL = 1e-7  # |Im L| / |L| below which the phase is that of a real number, and no sign is sure
ROUNDING = 1e-13  # of z - 1, of which little is left at low frequencies
NEAR = 1e-6  # |Im L| / |L| at a crossing that was found; at a pole on the axis L only jumps


@dataclass(frozen=True, eq=False)
class Margins(Record):
    """Margins of L = output over input with u = w - y, S = 1 / (1 + L), T = L / (1 + L); frequencies in Hz.

    stable: of the closed loop; if False, the margins tell what separates it from stability. gain: the next factors of L
    below and above 1 at which the closed loop is on the edge of stability, 0 and inf where there are none, with
    gain_frequencies. phase: deg, the smallest of all gain crossings, with phase_frequency. delay: s that the closed loop
    bears, 0 if it is unstable. disk: size alpha of the balanced disk, 1 / max |(S - T) / 2|, so that gain (2 - alpha) /
    (2 + alpha) to its inverse and phase 2 atan(alpha / 2) may change together (Seiler, Packard, Gahinet, An introduction
    to disk margins, 2020). M_s, M_t: peaks of |S| and |T| with their frequencies. bandwidth: where |T| first falls below
    |T(0)| / sqrt(2), inf if never, nan for T(0) = 0.
    """

    stable: bool
    gain: tuple[float, float]
    gain_frequencies: tuple[float, float]
    phase: float
    phase_frequency: float
    delay: float
    disk: float
    M_s: float
    M_s_frequency: float
    M_t: float
    M_t_frequency: float
    bandwidth: float


def margins_of(loop: SisoSystem) -> Margins:
    """All margins of an open loop."""
    closed = loop.closed()
    hertz = loop_frequencies(loop, closed)
    values = loop.response(hertz)
    low, high = _gains(loop, hertz, values)
    phase, at, delay = _phases(loop, hertz, values)
    peaks = [
        _peak(lambda f, of=of: np.abs(of(loop.response(f))), hertz)
        for of in (_S, _T, lambda L: (_S(L) - _T(L)) / 2)
    ]
    (M_s, at_s), (M_t, at_t), (skew, _) = peaks
    return Margins(
        closed.stable, (low[0], high[0]), (low[1], high[1]), phase, at, delay if closed.stable else 0.0,
        1 / skew, M_s, at_s, M_t, at_t, _bandwidth(loop, hertz),
    )  # fmt: skip


def _S(L: np.ndarray) -> np.ndarray:
    """1 / (1 + L), 0 where L is infinite."""
    return np.where(np.isfinite(L), 1 / (1 + np.where(np.isfinite(L), L, 1.0)), 0.0)


def _T(L: np.ndarray) -> np.ndarray:
    return 1 - _S(L)


def _gains(
    loop: SisoSystem, hertz: np.ndarray, values: np.ndarray
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Factors with their frequencies, below and above 1, at which L passes through -1."""
    sizes = np.abs(values)
    with np.errstate(invalid="ignore"):
        sine = np.imag(values) / np.where(sizes > 0, sizes, 1.0)
    unsure = REAL + (0.0 if loop.period is None else ROUNDING / (hertz * loop.period))
    known = np.flatnonzero(np.isfinite(sizes) & (np.abs(sine) > unsure))
    found = _crossings(lambda f: float(np.imag(loop.response(np.array([f]))[0])), hertz[known], sine[known])
    rests = [] if np.any(loop.poles == (1 if loop.period else 0)) else [0.0]
    # at 0 and at half of the sampling frequency L is real anyhow
    places = np.array([*rests, *found, *([0.5 / loop.period] if loop.period else [])])
    at = loop.response(places)
    crosses = np.isfinite(at) & (np.real(at) < 0) & (np.abs(np.imag(at)) < NEAR * np.abs(at))
    factors = [(float(-1 / L.real), float(f)) for f, L in zip(places[crosses], at[crosses], strict=True)]
    below = [one for one in factors if one[0] < 1]
    return max(below, default=(0.0, np.nan)), min(set(factors) - set(below), default=(np.inf, np.nan))


def _phases(loop: SisoSystem, hertz: np.ndarray, values: np.ndarray) -> tuple[float, float, float]:
    """The smallest phase margin in deg, where it is, in Hz, and the shortest delay in s that uses one up."""
    with np.errstate(divide="ignore"):
        levels = np.nan_to_num(np.log(np.abs(values)), posinf=700.0, neginf=-700.0)

    def level(f: float) -> float:
        return float(np.log(np.abs(loop.response(np.array([f]))[0])))

    found = np.array(_crossings(level, hertz, levels))
    if not found.size:
        return np.inf, np.nan, np.inf
    turned = np.angle(-loop.response(found), deg=True)
    k = int(np.argmin(np.abs(turned)))
    return float(turned[k]), float(found[k]), float(np.min((turned % 360) / (360 * found)))


def _crossings(of: Callable[[float], float], hertz: np.ndarray, values: np.ndarray) -> list[float]:
    """Frequencies at which a function passes through zero, between those (N,) at which its values (N,) are known."""
    from scipy.optimize import brentq

    places = np.flatnonzero(np.sign(values[1:]) * np.sign(values[:-1]) < 0)
    exact = hertz[values == 0].tolist()
    return exact + [brentq(of, hertz[k], hertz[k + 1], xtol=1e-300, rtol=1e-13) for k in places]


def _peak(size: Callable[[np.ndarray], np.ndarray], hertz: np.ndarray) -> tuple[float, float]:
    """The largest value of a function, and its frequency."""
    from scipy.optimize import minimize_scalar

    places = np.append(0.0, hertz)
    sizes = size(places)
    k = int(np.argmax(sizes))
    if 1 < k < len(places) - 1:
        ends = np.log(places[[k - 1, k + 1]])
        found = minimize_scalar(
            lambda x: -size(np.exp([x]))[0], bounds=ends, method="bounded", options=dict(xatol=1e-10)
        )
        if -float(found.fun) > sizes[k]:
            return -float(found.fun), float(np.exp(found.x).item())
    return float(sizes[k]), float(places[k])


def _bandwidth(loop: SisoSystem, hertz: np.ndarray) -> float:
    from scipy.optimize import brentq

    def size(f: np.ndarray) -> np.ndarray:
        return np.abs(_T(loop.response(f)))

    least = float(size(np.zeros(1))[0]) / np.sqrt(2)
    if least < REAL:
        return np.nan
    below = np.flatnonzero(size(hertz) < least)
    if not below.size:
        return np.inf
    k = int(below[0])
    start = hertz[k - 1] if k else 0.0
    return brentq(lambda f: size(np.array([f]))[0] - least, start, hertz[k], xtol=1e-300, rtol=1e-12)
