"""Motion and forces of a log, brought to the rows of a regression.

    H f = H y(q, q', q''; p)          the same zero-phase filter H on both sides ("parallel filtering")

Encoders are differentiated behind a wider filter, so that what H lets pass is not bent. Khalil, Dombre (2002),
Modeling, identification and control of robots, section 12.6.
"""

from dataclasses import dataclass, replace

import numpy as np

from gantrytau import ModelError
from gantrytau.border.refusal import Given
from gantrytau_optimica.identification.logs.motion_log import MotionLog

ORDER = 4
WIDER = 4.0  # times the cutoff, of the filter before encoders are differentiated
SAMPLES = 10.0  # kept for each period of the cutoff
JITTER = 0.02  # of a period, by which steps of time may differ before they are made even
ENDS = 2.0  # periods of the cutoff at either end, in which the filter knows one side only


@dataclass(frozen=True, eq=False)
class FilteredMotion:
    """Rows of one log at equal steps, thinned: motion (N, 3 n) of q, q', q'' and forces f (N, n), not yet filtered by H.

    log_period: s, of the log, of whose rows each `thinned`th is kept; v, speed (all rows of the log, n): the second filtered
    by H, for the sign of friction and the dead zone. That sign jumps, so friction is filtered before it is thinned.
    origin: number of the log, and of its rows.
    """

    log_period: float
    cutoff: float
    thinned: int
    motion: np.ndarray
    v: np.ndarray
    speed: np.ndarray
    f: np.ndarray
    origin: tuple[int, np.ndarray] = (0, np.zeros(1, dtype=int))

    @property
    def period(self) -> float:
        """Time from row to row, s."""
        return self.log_period * self.thinned

    def thin(self, y: np.ndarray) -> np.ndarray:
        """Series (rows of the log, ...) as rows."""
        return low_pass(y, self.log_period, _wide(self.log_period, self.cutoff))[:: self.thinned]

    def filtered(self, y: np.ndarray) -> np.ndarray:
        """Rows filtered by H, without the ends."""
        return self._inner(low_pass(y, self.period, self.cutoff))

    def moving(self, minimum_speed: float) -> np.ndarray:
        """Where a joint is faster than the dead zone, (N, n), without the ends."""
        return self._inner(np.abs(self.speed[:: self.thinned]) >= minimum_speed)

    @property
    def inner(self) -> np.ndarray:
        """Rows of the log that the ends leave."""
        own = self._inner(np.arange(len(self.motion))) * self.thinned
        return self.origin[1][np.minimum(own, len(self.origin[1]) - 1)]

    def _inner(self, y: np.ndarray) -> np.ndarray:
        ends = round(ENDS / self.cutoff / self.period)
        return y[ends : len(y) - ends]


def low_pass(y: np.ndarray, period: float, cutoff: float) -> np.ndarray:
    """Zero-phase Butterworth low-pass along the first axis; period in s, cutoff in Hz."""
    from scipy.signal import butter, sosfiltfilt

    return sosfiltfilt(butter(ORDER, cutoff, fs=1 / period, output="sos"), y, axis=0)


def filtered_motion(log: MotionLog, cutoff: float) -> FilteredMotion:
    """A log without gaps, thinned to what the cutoff (Hz) leaves of it, with speeds and accelerations.

    Raises ModelError for a cutoff that the rate of the log does not bear.
    """
    from scipy.interpolate import make_interp_spline

    period = log.period
    t, q, f = log.t - log.t[0], log.q, log.f
    if np.any(np.abs(np.diff(t) - period) > JITTER * period):  # filters know one period only
        even = np.arange(int(t[-1] / period) + 1) * period
        q, f, t = (*(make_interp_spline(t, x, k=3)(even) for x in (q, f)), even)
    rate = 1 / period
    if not 0 < cutoff < rate / 5:
        raise ModelError(
            f"expected less than a fifth of the log's rate of {rate:g} Hz; lower it, or log faster",
            place="identify",
            found=Given("cutoff", cutoff),
        )
    thinned = max(1, int(rate / (SAMPLES * cutoff)))
    spline = make_interp_spline(t, low_pass(q, period, _wide(period, cutoff)), k=5)
    q, v, a = spline(t[::thinned]), spline.derivative(1)(t), spline.derivative(2)(t[::thinned])
    rows = np.hstack([q, v[::thinned], a])
    found = FilteredMotion(period, cutoff, thinned, rows, v, low_pass(v, period, cutoff), f)
    return replace(found, f=found.thin(f))


def _wide(period: float, cutoff: float) -> float:
    return min(WIDER * cutoff, 0.4 / period)
