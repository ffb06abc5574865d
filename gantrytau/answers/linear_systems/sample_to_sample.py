"""A continuous system and what samples it, as one system from sample to sample."""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from gantrytau.answers.linear_systems.discretisation import held
from gantrytau.border.refusal import ModelError

FINEST = 1000  # parts of the shortest period in which all instants must lie
SAME = 1e-9  # relative: periods that differ less are one
MOST = 100_000  # instants in one period of the whole


@dataclass(frozen=True, eq=False)
class DrivenRows:
    """Rows by the states x, the held values h and the inputs u: three matrices side by side."""

    x: np.ndarray
    h: np.ndarray
    u: np.ndarray


def from_sample_to_sample(
    name: str,
    rates: DrivenRows,
    samples: DrivenRows,
    outputs: DrivenRows,
    periods: Sequence[float],
    period: float | None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]:
    """A, B, C, D and the period, s, of (x, h) just before an instant at which all is sampled, u held until the next.

    rates: of x; samples: new values of h, which follow the periods (len(h),) in s; outputs: just after the instant.
    period: of the whole, a multiple of that of all samples, which it is if None. ModelError where there is none.
    """
    n, count, m = len(rates.x), len(periods), rates.u.shape[1]
    tick, every, whole = _common(name, np.array(periods), period)
    at = np.eye(n + count + m)  # x, h and u, by those at the first instant
    after = at
    instants = sorted({k for steps in set(every) for k in range(0, whole, steps)})
    if len(instants) > MOST:
        raise ModelError(
            f"{name}: found {len(instants)} instants until all sampling periods come together again, at most {MOST} are "
            "followed; choose periods that are multiples of each other"
        )
    for begin, end in zip(instants, [*instants[1:], whole], strict=True):
        due = [begin % steps == 0 for steps in every]
        renewed = np.hstack([samples.x, samples.h, samples.u]) @ at
        at = at.copy()
        at[n : n + count][due] = renewed[due]
        if begin == 0:
            after = at
        Phi, Gamma = held(rates.x, np.hstack([rates.h, rates.u]), (end - begin) * tick)
        at = np.vstack([np.hstack([Phi, Gamma]) @ at, at[n:]])
    C = np.hstack([outputs.x, outputs.h, outputs.u]) @ after
    keep = n + count
    return at[:keep, :keep], at[:keep, keep:], C[:, :keep], C[:, keep:], whole * tick


def _common(name: str, periods: np.ndarray, period: float | None) -> tuple[float, list[int], int]:
    """A time of which all periods are multiples, s, the multiples, and that of the whole."""
    shortest = float(periods.min())
    wanted = periods if period is None else np.append(periods, period)
    ratios = [Fraction(r).limit_denominator(FINEST) for r in (wanted / shortest).tolist()]
    for ratio, found in zip(ratios, wanted.tolist(), strict=True):
        if abs(float(ratio) * shortest - found) > SAME * found:
            raise ModelError(
                f"{name}: found periods of {shortest:g} s and {found:g} s, which never come together again; expected "
                "periods in the ratio of whole numbers"
            )
    parts = int(np.lcm.reduce([r.denominator for r in ratios]))
    multiples = [int(r * parts) for r in ratios]
    every = multiples[: len(periods)]
    whole = int(np.lcm.reduce(np.array(every, dtype=object)))
    tick = shortest / parts
    if period is not None:
        if multiples[-1] % whole:
            raise ModelError(
                f"{name}: found period={period:g} s, expected a multiple of {whole * tick:g} s, after which all that is "
                "sampled comes together again"
            )
        whole = multiples[-1]
    return tick, every, whole
