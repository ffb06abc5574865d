"""What a step response shows: final value, rise, overshoot, settling; and the same of an impulse response."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gantrytau.answers.linear_systems.closed_loop import SisoSystem
from gantrytau.answers.linear_systems.discretisation import held
from gantrytau.answers.linear_systems.poles_and_zeros import in_s
from gantrytau.answers.linear_systems.responses import driven, stepped
from gantrytau.border.refusal import ModelError
from gantrytau.describing.record import Record

OCTAVE = 200  # samples from one time to its double
LONGEST = 30.0  # time constants of the slowest pole that are simulated
REACHED = 1e-9  # relative: a value that is nearer to another is the same
MOST = 1_000_000  # samples of a sampled system


@dataclass(frozen=True, eq=False)
class StepInformation(Record):
    """A response to a step of one, or to an impulse of area one, from rest; times in s.

    final: value at the end, of an impulse response 0. peak, peak_time: the largest size with its sign, and when it is
    first reached to nine digits. settling: from when on the response stays within 2 % of the final value, of an impulse
    response within 2 % of the peak. rise: from 10 % to 90 % of the final value. overshoot, undershoot: beyond the final
    value, and to the other side of 0, as shares of it: 0.05 is 5 %. These three are nan where the final value is 0. A
    sampled system has them at its samples.
    """

    final: float
    peak: float
    peak_time: float
    settling: float
    rise: float
    overshoot: float
    undershoot: float


def response_information(system: SisoSystem, impulse: bool) -> StepInformation:
    """The information of a step or an impulse response; ModelError where it does not come to rest."""
    if not system.stable:
        pole = max(system.poles, key=lambda p: p.real if system.period is None else abs(p))
        raise ModelError(
            f"found a pole at {'s' if system.period is None else 'z'} = {pole:.4g} that {system.output} shows, expected a "
            "stable response: it comes to no final value; close a loop around it first",
            place=system.title,
        )
    if impulse and system.period is None and system.D.item():
        words = f"found a direct gain of {system.D.item():g} to {system.output}, expected none: its impulse response is "
        raise ModelError(f"{words}infinite at the start; filter the output", place=system.title)
    times, values, between = _response(system, impulse)
    size = float(np.abs(values).max(initial=0.0))
    final = 0.0 if impulse else system.at_rest
    final = final if abs(final) > REACHED * size else 0.0
    times, values = _with_peak(times, values, between, system.period is not None)
    k = int(np.argmax(np.abs(values) >= (1 - REACHED) * np.abs(values).max()))
    band = 0.02 * (abs(final) or size)
    settling = _last(times, np.abs(values - final) - band, lambda t: abs(between(t) - final) - band, system)
    shares = (np.nan, np.nan, np.nan)
    if final:
        share = values / final
        low, high = (
            _first(times, share - level, lambda t, level=level: between(t) / final - level, system)
            for level in (0.1, 0.9)
        )
        shares = (high - low, max(0.0, float(share.max()) - 1), max(0.0, -float(share.min())))
    return StepInformation(final, float(values[k]), float(times[k]), settling, *shares)


def _response(system: SisoSystem, impulse: bool) -> tuple[np.ndarray, np.ndarray, Callable[[float], float]]:
    """Times, values, and the value at any time; denser at the start, as fast poles act there."""
    A, B, C, D, period = system.A, system.B, system.C, system.D, system.period
    s = in_s(system.poles, period)
    s = s[np.isfinite(s)]
    last = LONGEST / float(np.min(-np.real(s))) if s.size else 0.0
    if period is not None:
        count = min(MOST, len(A) + 2 + int(np.ceil(last / period)))
        u = np.ones((count, 1))
        u[1:] = 0.0 if impulse else 1.0
        values = stepped(A, B, C, D, u, np.zeros(len(A)))[:, 0]
        times = period * np.arange(count)
        return times, values, lambda t: float(values[round(t / period)])
    first = 0.01 / float(np.abs(s).max(initial=1.0))
    octaves = max(1, int(np.ceil(np.log2(max(last, first) / first / OCTAVE))))
    steps = np.concatenate([np.full(OCTAVE, first * 2.0**k) for k in range(octaves + 1)])
    times = np.concatenate([[0.0], np.cumsum(steps)])
    start, push = (B[:, 0], 0.0) if impulse else (np.zeros(len(A)), 1.0)
    u = np.full((len(times), 1), push)
    states = driven(A, B, np.eye(len(A)), np.zeros((len(A), 1)), times, u, start)

    def between(t: float) -> float:
        k = int(np.searchsorted(times, t, side="right")) - 1
        Phi, Gamma = held(A, B, t - times[k])
        return float((C @ (Phi @ states[k] + Gamma[:, 0] * push) + D[:, 0] * push).item())

    return times, (states @ C.T + u @ D.T)[:, 0], between


def _with_peak(
    times: np.ndarray, values: np.ndarray, between: Callable[[float], float], sampled: bool
) -> tuple[np.ndarray, np.ndarray]:
    """The samples, and of a continuous system the top between them."""
    from scipy.optimize import minimize_scalar

    k = int(np.argmax(np.abs(values)))
    if not 0 < k < len(times) - 1 or sampled:
        return times, values
    sign = np.sign(values[k])
    found = minimize_scalar(
        lambda t: -sign * between(t),
        bounds=(times[k - 1], times[k + 1]),
        method="bounded",
        options=dict(xatol=1e-9 * times[k]),
    )
    at = int(np.searchsorted(times, float(found.x)))
    return np.insert(times, at, float(found.x)), np.insert(values, at, -sign * float(found.fun))


def _first(times: np.ndarray, off: np.ndarray, of: Callable[[float], float], system: SisoSystem) -> float:
    """When a function that is below zero at first, known as `off` at times, is no longer."""
    k = int(np.argmax(off >= 0))
    return float(times[k]) if k == 0 or system.period else _between(of, times[k - 1], times[k])


def _last(times: np.ndarray, off: np.ndarray, of: Callable[[float], float], system: SisoSystem) -> float:
    """From when on a function stays below zero."""
    above = np.flatnonzero(off >= 0)
    if not above.size or above[-1] == len(times) - 1:
        return np.inf if above.size else 0.0
    k = int(above[-1])
    return float(times[k + 1]) if system.period else _between(of, times[k], times[k + 1])


def _between(of: Callable[[float], float], start: float, end: float) -> float:
    from scipy.optimize import brentq

    return brentq(of, start, end, xtol=1e-12 * end) if of(start) * of(end) < 0 else end
