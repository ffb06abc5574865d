"""What steps of a servo show beyond its law."""

from collections.abc import Iterator, Sequence

import numpy as np

from gantrytau_optimica.fitting.finding import Finding, agreeing
from gantrytau_optimica.fitting.robust import robust_deviation
from gantrytau_optimica.identification.servos.servo_fit import ServoFit, ServoRows, fit_servo

NOISY = 20.0  # deviations of noise that a step should have
ALIKE = 0.01  # of its size, by which steps of one size may differ
SURE = 3.0  # deviations, and
CHANGED = 0.02  # of the lag, by which the lags of small and large steps differ for a reason
FAST = 1e-6  # pole of what follows within a sample
SETTLED = 3.0  # time constants, that a step should be followed for
FOLLOWED = 90.0  # % of the motion, that the law should explain
UNIT = 2.0  # to either side: servos bring actuators to their references

Told = Iterator[tuple[str, np.ndarray | None, str]]  # kind, some of the steps or None for all, sentence


def servo_findings(i: int, rows: Sequence[ServoRows], fit: ServoFit, period: float) -> tuple[Finding, ...]:
    """Findings on one actuator.

    Kinds "delay", "fast", "unit", "sign", "fit", "noise", "not settled", "not at rest", "one size", "friction",
    "saturation".
    """
    steps = np.array([r.step for r in rows])
    told = [*_delay(fit), *_gain(fit), *_small(rows, fit, period), *_amplitudes(rows, period)]
    return tuple(
        Finding(kind, steps if some is None else steps[some], f"actuator {i}: {words}")
        for kind, some, words in told
    )


def explained(rows: Sequence[ServoRows], fit: ServoFit) -> float:
    """Fit in %: what the law does not leave of the motion about its mean, by norms."""
    motion = sum(float(np.sum((r.y - r.y.mean()) ** 2)) for r in rows)
    return 100 * (1 - float(np.sqrt(fit.squares / motion)))


def _delay(fit: ServoFit) -> Told:
    if fit.delay == 0:
        words = "positions follow their references within the same sample, which no servo does"
        yield "delay", None, f"{words}; look at the clocks of both"
    elif fit.delay == fit.latest:
        words = f"the best delay is the longest looked at, {fit.latest} samples"
        yield "delay", None, f"{words}; log for longer, or take samples less often"
    # the squares of two laws differ by SURE^2 variances of a residual without colour
    clear = 1 + SURE**2 / _independent(fit.residuals)
    near = [
        str(d) for d, squares in sorted(fit.left.items()) if d != fit.delay and squares <= clear * fit.squares
    ]
    if near:
        words = f"a delay of {', '.join(near)} fits nearly as well as {fit.delay} samples"
        yield "delay", None, f"{words}; step farther or more often"


def _gain(fit: ServoFit) -> Told:
    if fit.pole < FAST:
        yield "fast", None, "its pole is at 0, faster than samples show; take samples more often"
    static = fit.gain / (1 - fit.pole)
    if static < 0:
        yield "sign", None, "it moves against its reference; change the sign of one of them"
    elif not 1 / UNIT < static < UNIT:
        words = f"it comes to {static:.4g} times its reference, expected about 1"
        yield "unit", None, f"{words}; look at the units of both"


def _small(rows: Sequence[ServoRows], fit: ServoFit, period: float) -> Told:
    """Steps that are small beside noise, not followed to their end, not from rest, or not explained."""
    share = explained(rows, fit)
    if share < FOLLOWED:
        yield "fit", None, f"a delay and one pole explain {share:.1f} % of the motion only; look at `plot()`"
    noise = float(np.median([_noise(r.y) for r in rows]))
    sizes = np.array([np.ptp(r.u) for r in rows])
    small = np.flatnonzero(sizes < NOISY * noise)
    if small.size:
        words = (
            f"{_steps(rows, small)} of {_metres(sizes[small])} {agreeing(small, 'are')} small beside noise"
        )
        yield "noise", small, f"{words} of {noise:.2g}; step farther"
    constant = -1 / np.log(fit.pole) if fit.pole > 0 else 0.0
    left = np.array([len(r.u) - 1 - int(np.argmax(r.u != 0)) - fit.delay for r in rows])
    short = np.flatnonzero(left < SETTLED * constant)
    if short.size:
        seconds = SETTLED * constant * period
        words = f"{_steps(rows, short)} {agreeing(short, 'end')} before the motion does"
        yield "not settled", short, f"{words}; log for {seconds:.2g} s from the step on"
    moving = np.flatnonzero([_moves(r, noise) for r in rows])
    if moving.size:
        words = (
            f"it moves before {_steps(rows, moving)} {agreeing(moving, 'begin')}, which counts as response"
        )
        yield "not at rest", moving, f"{words}; wait for longer"


def _amplitudes(rows: Sequence[ServoRows], period: float) -> Told:
    """Lags of small and of large steps, each fitted alone."""
    order = sorted(range(len(rows)), key=lambda k: float(np.ptp(rows[k].u)))
    sizes = np.array([np.ptp(rows[k].u) for k in order])
    ends = np.flatnonzero(np.diff(sizes) > ALIKE * sizes[:-1]) + 1
    groups = np.split(np.array(order), ends)
    if len(groups) < 2:
        words = f"all steps are of {_metres(sizes[:1])}"
        yield "one size", None, f"{words}; friction and saturation only show in steps of several sizes"
        return
    small, large = (fit_servo([rows[k] for k in groups[g]], period) for g in (0, -1))
    if not (0 < small.pole < 1 and 0 < large.pole < 1):
        return
    lags, deviations = (np.array(pair) for pair in zip(*(_lag(f) for f in (small, large)), strict=True))
    change = float(lags[1] - lags[0])
    if abs(change) < max(SURE * float(np.hypot(*deviations)), CHANGED * float(lags.mean())):
        return
    words = (
        f"it lags by {lags[0] * period:.3g} s in steps of {_metres(sizes[:1])}, by {lags[1] * period:.3g} s in steps of "
        f"{_metres(sizes[-1:])}"
    )
    if change < 0:
        yield (
            "friction",
            groups[0],
            f"{words}: friction holds back small steps; take steps of the size of the work",
        )
    else:
        yield (
            "saturation",
            groups[-1],
            f"{words}: a limit of force or speed holds back large steps; leave them out",
        )


def _lag(fit: ServoFit) -> tuple[float, float]:
    """Time in samples until 1 - 1/e of a step is done, d - 1 / log(a), and its deviation."""
    log = float(np.log(fit.pole))
    return fit.delay - 1 / log, float(np.sqrt(fit.covariance[0, 0])) / (fit.pole * log**2)


def _independent(residuals: Sequence[np.ndarray]) -> float:
    """Samples without colour that say as much as the residuals, by the correlation r of neighbours: N (1 - r) / (1 + r)."""
    square = sum(float(left @ left) for left in residuals)
    both = sum(float(left[1:] @ left[:-1]) for left in residuals)
    r = float(np.clip(both / square, 0.0, 0.999)) if square else 0.0
    return sum(len(left) for left in residuals) * (1 - r) / (1 + r)


def _noise(y: np.ndarray) -> float:
    """Deviation of white noise by second differences, whose variance is six times as large."""
    return robust_deviation(np.diff(y, 2)) / np.sqrt(6) if len(y) > 2 else 0.0


def _moves(r: ServoRows, noise: float) -> bool:
    """Whether the mean of the last quarter before the step is another than that of the first."""
    before = r.y[: int(np.argmax(r.u != 0))]
    quarter = len(before) // 4
    if quarter == 0:
        return False
    change = abs(before[-quarter:].mean() - before[:quarter].mean())
    return bool(change > max(0.01 * np.ptp(r.u), 4 * noise * np.sqrt(2 / quarter)))


def _steps(rows: Sequence[ServoRows], some: np.ndarray) -> str:
    numbers = ", ".join(str(rows[k].step) for k in some)
    return f"{'step' if len(some) == 1 else 'steps'} {numbers}"


def _metres(sizes: np.ndarray) -> str:
    return ", ".join(f"{size:g}" for size in np.unique(np.round(sizes, 12)))
