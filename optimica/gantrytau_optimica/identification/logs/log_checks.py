"""Checks of a log of motion that need no robot."""

from collections.abc import Iterator

import numpy as np

from gantrytau_optimica.fitting.finding import Finding, agreeing, rows_in_words
from gantrytau_optimica.identification.logs.lost_rows import lost_rows
from gantrytau_optimica.identification.logs.plain_friction import PlainFits, plain_fits

GAP = 1.5  # median periods: what is longer lacks a sample
LARGEST = 50.0  # m or rad, reach of robots; what is farther apart was not written in m
STILL = 0.005  # m/s or rad/s, below which friction has no law that can be told
STEADY = 0.05  # of speed squared by stroke, as a sine has 1.4: accelerations below it tell no mass
WINDOW = 0.1  # s, over which speeds are slopes
HELD = 5  # samples in a row at the largest force, which is a limit then
SAME = 1e-9  # of the span of a force, within which it is at its largest
MOST = 20_000  # rows that show how a log moves


def check_log(t: np.ndarray, q: np.ndarray, f: np.ndarray, finite: np.ndarray) -> tuple[Finding, ...]:
    """Findings in a log t (N,), q and f (N, n); finite: mask (N,) of the finite rows."""
    return (
        *_not_finite(finite),
        *_times(t, finite),
        *_lost(t, q, finite),
        *_units(q, finite),
        *_saturated(f, finite),
        *_motion(*_stretch(t, q, f, finite)),
    )


def _not_finite(finite: np.ndarray) -> Iterator[Finding]:
    bad = np.flatnonzero(~finite)
    if bad.size:
        hold, left = agreeing(bad, "hold"), agreeing(bad, "are")
        yield Finding("nan", bad, f"{rows_in_words(bad)} {hold} no finite numbers and {left} left out")


def _times(t: np.ndarray, finite: np.ndarray) -> Iterator[Finding]:
    rows = np.flatnonzero(finite)
    step = np.diff(t[rows])
    back = rows[1:][step <= 0]
    if back.size:
        words = (
            f"{rows_in_words(back)} {agreeing(back, 'repeat')} the time before or {agreeing(back, 'go')} back"
        )
        yield Finding(
            "time", back, f"{words}; the log is parted there; sort rows by time, and leave copies out"
        )
    if not np.any(step > 0):
        return
    period = np.median(step[step > 0])
    after = rows[1:][(step > GAP * period) & (np.diff(rows) == 1)]
    if after.size:
        words = f"{rows_in_words(after)} {agreeing(after, 'follow')} a gap, up to {np.max(step):.3g} s, of samples every "
        words += f"{period:.3g} s; the log is parted there, as slopes across gaps would be wrong"
        yield Finding("gaps", after, words)


def _lost(t: np.ndarray, q: np.ndarray, finite: np.ndarray) -> Iterator[Finding]:
    kept = np.flatnonzero(finite)
    rows = kept[lost_rows(t[kept], q[kept]) > 0]
    if rows.size:
        words = f"positions go twice as far before {rows_in_words(rows)} as beside {'them' if len(rows) > 1 else 'it'}, "
        words += "while times go on evenly: rows are lost there, and all times behind are early; write down the time of each"
        yield Finding("lost rows", rows, f"{words} sample")


def _units(q: np.ndarray, finite: np.ndarray) -> Iterator[Finding]:
    spans = np.ptp(q[finite], axis=0) if finite.any() else np.zeros(q.shape[1])
    for k in np.flatnonzero(spans > LARGEST):
        words = f"q{k + 1} covers {spans[k]:.4g}, expected m or rad; write its unit in the header, 'q{k + 1} [mm]'"
        yield Finding("millimetres", np.flatnonzero(finite), words)


def _saturated(f: np.ndarray, finite: np.ndarray) -> Iterator[Finding]:
    for k, column in enumerate(f.T):
        good = column[finite]
        span = np.ptp(good) if good.size else 0.0
        if span == 0:
            continue
        for side, limit in (("largest", good.max()), ("smallest", good.min())):
            at = finite & (np.abs(column - limit) <= SAME * span)
            edges = np.flatnonzero(np.diff(np.concatenate([[0], at.astype(np.int8), [0]])))
            longest = int(np.max(edges[1::2] - edges[::2]))
            if longest >= HELD and abs(limit) > 0.5 * np.max(np.abs(good)):
                rows = np.flatnonzero(at)
                words = f"f{k + 1} stays at its {side} value {limit:.6g} in {rows_in_words(rows)}: a limit, where the force "
                words += (
                    "that was logged may not be the one that acted; leave these rows out, or move more slowly"
                )
                yield Finding("saturated force", rows, words)


def _stretch(
    t: np.ndarray, q: np.ndarray, f: np.ndarray, finite: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Rows, times, positions and forces of the longest part without gaps and NaN, cut to so many rows as are looked at."""
    rows = np.flatnonzero(finite)
    step = np.diff(t[rows])
    rising = step[step > 0]
    period = np.median(rising) if rising.size else 0.0
    ends = np.flatnonzero((np.diff(rows) > 1) | (step <= 0) | (step > GAP * period)) + 1
    parts = np.split(rows, ends)
    kept = max(parts, key=len)[:MOST]
    return kept, t[kept], q[kept], f[kept]


def _motion(rows: np.ndarray, t: np.ndarray, q: np.ndarray, f: np.ndarray) -> Iterator[Finding]:
    """What the motion itself does not tell, and forces that do not belong to it."""
    width = max(int(WINDOW / (t[1] - t[0])) if len(t) > 1 else 2, 2)
    if len(t) < 5 * width:
        return
    v, a, noise, inner = slopes(t, q, width)
    fastest = np.max(np.abs(v), axis=0)
    slow = np.flatnonzero(fastest < STILL)
    for k in slow:
        words = (
            f"q{k + 1} never moves faster than {fastest[k]:.3g}, expected more than {STILL:g} m/s or rad/s"
        )
        yield Finding("slow", rows, f"{words}: friction has no direction there; log a faster motion")
    moving = np.abs(v) > STILL
    stroke = np.ptp(q, axis=0)
    rms = np.sqrt(np.mean(v**2, axis=0))
    # only rows in motion: at rest nothing accelerates, whatever comes after
    squares = np.array([np.mean(a[m, k] ** 2) if m.any() else 0.0 for k, m in enumerate(moving.T)])
    swing = np.sqrt(np.maximum(squares - 2 * noise**2, 0.0))
    if not slow.size and np.all(swing < STEADY * rms**2 / np.maximum(stroke, 1e-12)):
        words = "all actuators move at constant speed: masses cannot be told from such a log, only friction and weight"
        yield Finding(
            "constant velocity", rows, f"{words}; add motion that accelerates, or use identify_friction"
        )
        return
    if not slow.size:
        yield from _forces(rows, plain_fits(q[inner], v, a, f, inner), t[1] - t[0])


def slopes(t: np.ndarray, q: np.ndarray, width: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Speeds and accelerations by parabolas over about `width` samples, the noise of the latter (n,), and their rows.

    Savitzky and Golay (1964); t evenly spaced. Of n samples with white noise s, the second derivative of a parabola has
    the variance 720 s^2 / (n^5 dt^4) for large n.
    """
    from scipy.signal import savgol_filter

    count, step = 2 * max(width // 2, 1) + 1, float(np.mean(np.diff(t)))
    inner = np.arange(width, len(t) - width)
    smooth, v, a = (savgol_filter(q, count, 2, deriv=k, delta=step, axis=0)[inner] for k in range(3))
    noise = np.std(q[inner] - smooth, axis=0) * np.sqrt(720 / count**5) / step**2
    return v, a, noise, inner


def _forces(rows: np.ndarray, fits: PlainFits | None, period: float) -> Iterator[Finding]:
    if fits is None:
        return
    if fits.lag:
        late, ms = "late" if fits.lag > 0 else "early", abs(fits.lag) * period * 1e3
        words = f"forces are {abs(fits.lag)} samples {late} ({ms:.3g} ms): that fits the motion best"
        yield Finding("delay", rows, f"{words}; shift the columns of f by {-fits.lag:+d} rows")
    if fits.reversed:
        words = "forces take power out of the motion at all speeds, in all actuators: friction would drive the robot"
        yield Finding("sign of force", rows, f"{words}; change the sign of f")
