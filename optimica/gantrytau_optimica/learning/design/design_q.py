"""Q of learning control: open as far as robust convergence allows.

Of a family of responses T and filters q of all axes, learning converges in each run where, over all frequencies,

    sigma(f) = |diag(q(f)) (I - L(f) T(f))| <= margin < 1,   L = gain e^(2 pi i f period shift)

with all axes coupled: Dressler (2012), (7.16) and Figures 7.14 and 7.17.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from gantrytau import ModelError
from gantrytau.answers.linear_systems.linear_system import LinearSystem
from gantrytau.border.checks import number, whole
from gantrytau_optimica.learning.design.q_search import QProblem, closed, sizes_of, widest
from gantrytau_optimica.learning.design.uncertain_modes import OverFrequencies, Uncertain, resonant, uncertain
from gantrytau_optimica.learning.filters.zero_phase import ZeroPhase
from gantrytau_optimica.learning.laws.correction_laws import Shifted
from gantrytau_optimica.learning.laws.learning import Learning
from gantrytau_optimica.learning.laws.lifted import Liftable, norm
from gantrytau_optimica.learning.runs.estimated_response import EstimatedResponse

POINTS = 500  # frequencies from zero to half the sampling frequency, without those at resonances
HALVED, BENT = 10, 0.05  # times that steps are halved; relative change, above which they are
AROUND = np.linspace(-4, 4, 17)  # damping ratios off a resonance, where there are frequencies too
CLOSED, NEAR = 0.15, 0.08  # |Q| around a named resonance at most, and how far that is, relative


def design_q(
    responses: OverFrequencies | Sequence[OverFrequencies],
    *,
    tool: OverFrequencies | Sequence[OverFrequencies] | None = None,
    limit: float = 30.0,
    margin: float = 0.95,
    notches: int = 2,
    learning: Learning | None = None,
    at: Any = None,
    samples: int = 825,
) -> ZeroPhase:
    """The zero-phase filters, one for each axis, that are most open up to `limit` Hz and keep sigma within the margin.

    responses: from corrections to what is learnt from, sampled systems or what `estimated_response` found, or anything with
    `response(hz)` (m, m, K) and `period`; a system alone stands for `uncertain(response)`. tool: responses of the tool
    alike, where the others are of an estimate, which shows nothing of what its model does not know: Q then suits both.
    learning: gain and shift, by default those of `Learning()`; at: Hz of resonances around which |q| <= 0.15 within 8 % in
    any case, for each axis one, several or None; samples: of the window in which the worst of the family is checked
    over a whole run.
    Raises ModelError for responses of different periods or axes, for a law that goes by a model, and where no filter holds.
    """
    limit = number("design_q", "limit", limit, above=0.0)
    margin = number("design_q", "margin", margin, above=0.0, below=1.0)
    whole("design_q", "notches", notches, least=0, most=6)
    whole("design_q", "samples", samples, least=1)
    family, law = members_of(responses, learning)
    if tool is not None:
        family, law = members_of((*family, *members_of(tool, learning)[0]), learning)
    period = float(family[0].period or 0.0)
    limit = number("design_q", "limit", limit, below=0.5 / period)
    hz = frequencies(family)
    left = np.array([rest(member, law, hz) for member in family])  # (members, F, m, m)
    named = _named(at, left.shape[-1], 0.5 / period)
    p = widest(QProblem(hz, left, _most(named, hz), period, limit, margin, notches))
    between = np.sort(np.concatenate([hz, (hz[1:] + hz[:-1]) / 2]))
    finer = np.array([rest(member, law, between) for member in family])
    for tighter in (1.0, 0.97, 0.9, 0.8):
        problem = QProblem(between, finer, _most(named, between), period, limit, tighter * margin, notches)
        p = closed(problem, p)
        if problem.over(p).max() > 1:
            raise _refused(problem, p)
        q = _filters(p, len(named))
        sigma = _over_a_run(Learning(law=law, q=q), family, sizes_of(problem.gains(p), finer), samples)
        if sigma < 1:
            return q
    raise ModelError(
        f"design_q: found sigma {sigma:.4f} over a whole run, expected less than 1; take a smaller margin",
        argument="margin",
    )


def _over_a_run(
    learning: Learning, family: Sequence[OverFrequencies], sizes: np.ndarray, samples: int
) -> float:
    """Sigma over a whole run of the member that is worst over frequencies, of those that have one."""
    for k in np.argsort(-sizes.max(axis=1)):
        if isinstance(family[k], LinearSystem | Liftable):
            return norm(learning.matrix(family[k], samples))
    return float(sizes.max())


def _filters(p: np.ndarray, axes: int) -> ZeroPhase:
    q = ZeroPhase(())
    for axis in np.exp(p).reshape(axes, -1):
        own = ZeroPhase.butterworth(2, float(axis[0]))
        for centre, width, depth in axis[1:].reshape(-1, 3):
            own = own.notched(float(centre), float(width), float(depth))
        q = q.joined(own)
    return q


def _refused(problem: QProblem, p: np.ndarray) -> ModelError:
    sizes = sizes_of(problem.gains(p), problem.left)
    _, row = np.unravel_index(np.argmax(sizes), sizes.shape)
    return ModelError(
        f"design_q: found sigma {sizes.max():.3g} at {problem.hz[row]:.3g} Hz however far filters close, expected "
        f"{problem.margin:g}; what is learnt from turns its sign there: take a larger shift, a smaller gain, another sensor",
        argument="responses",
    )


def _most(named: Sequence[Sequence[float]], hz: np.ndarray) -> np.ndarray:
    """What gains may be around named resonances, (m, F)."""
    found = np.full((len(named), len(hz)), np.inf)
    for row, resonances in zip(found, named, strict=True):
        for f in resonances:
            row[np.abs(hz - f) <= NEAR * f] = CLOSED
    return found


def _named(at: Any, axes: int, half: float) -> list[tuple[float, ...]]:
    """Hz of resonances for each axis."""
    each = [None] * axes if at is None else [at] if np.ndim(at) == 0 else list(at)
    found = [tuple(float(f) for f in np.ravel([] if own is None else own)) for own in each]
    if len(found) != axes or not all(0 < f < half for own in found for f in own):
        raise ModelError(
            f"design_q: found at={at!r}, expected Hz below {half:g} for each of {axes} axes, one, several or None",
            argument="at",
        )
    return found


def members_of(
    responses: OverFrequencies | Sequence[OverFrequencies], learning: Learning | None
) -> tuple[tuple[OverFrequencies, ...], Shifted]:
    """The family, and the law by gain and shift. Raises ModelError where these do not fit."""
    members = tuple(responses) if isinstance(responses, Sequence) else (responses,)
    if not members or not all(
        hasattr(member, "response") and hasattr(member, "period") for member in members
    ):
        raise ModelError(
            "design_q: found responses of another kind, expected sampled linear systems, or what estimated_response found",
            argument="responses",
        )
    periods = {member.period for member in members}
    if None in periods:
        raise ModelError(
            "design_q: found a continuous response, expected a period, one of all; take system.discrete(period)",
            argument="responses",
        )
    axes = {np.shape(member.response(np.zeros(1)))[:2] for member in members}
    if len(periods) > 1 or len(axes) > 1:
        raise ModelError(
            f"design_q: found responses with periods of {sorted(map(float, filter(None, periods)))} s and "
            f"{sorted(m for m, _ in axes)} axes, expected one of both",
            argument="responses",
        )
    p, m = axes.pop()
    if p != m:
        raise ModelError(
            f"design_q: found responses from {m} corrections to {p} positions, expected as many of both",
            argument="responses",
        )
    law = (learning or Learning()).corrections_of
    if not isinstance(law, Shifted):
        raise ModelError(
            f"design_q: found the law {type(law).__name__}, expected a gain and a shift; laws that go by a model need a "
            "low-pass filter alone",
            argument="learning",
        )
    only = members[0]
    return (uncertain(only) if len(members) == 1 and isinstance(only, Uncertain) else members), law


def frequencies(family: Sequence[OverFrequencies]) -> np.ndarray:
    """Where sigma is looked at, (F,) in Hz: evenly, and closely around resonances of all of a family."""
    period = float(family[0].period or 0.0)
    found = [np.linspace(0.0, 0.5 / period, POINTS)]
    for member in family:
        system = member.system if isinstance(member, EstimatedResponse) else member
        if isinstance(system, LinearSystem):
            poles = np.linalg.eigvals(system.A)
            s = np.log(poles[resonant(poles, period)].astype(complex)) / period
            s = s[s.imag > 0]
            found.append(np.ravel(np.abs(s) / 2 / np.pi * (1 + np.outer(AROUND, -s.real / np.abs(s)))))
        else:
            found.append(_bends(member, found[0]))
    hz = np.unique(np.concatenate(found))
    return hz[(hz >= 0) & (hz <= 0.5 / period)]


def _bends(member: OverFrequencies, hz: np.ndarray) -> np.ndarray:
    """Frequencies between those (F,) where the size of a response is no straight line, whose poles are not known."""
    first = hz
    for _ in range(HALVED):
        sizes = np.linalg.norm(np.moveaxis(member.response(hz), -1, 0), axis=(1, 2))
        steps, scale = np.diff(hz), np.maximum(sizes, 1e-3 * sizes.max(initial=0.0))
        bent = (
            np.abs(np.diff(np.diff(sizes) / steps)) * np.maximum(steps[1:], steps[:-1]) > BENT * scale[1:-1]
        )
        wide = np.append(bent, False) | np.append(False, bent)
        if not wide.any():
            break
        hz = np.sort(np.concatenate([hz, (hz[1:] + hz[:-1])[wide] / 2]))
    return np.setdiff1d(hz, first)


def rest(member: OverFrequencies, law: Shifted, hz: np.ndarray) -> np.ndarray:
    """I - L T over frequencies, (F, m, m)."""
    T = np.moveaxis(member.response(hz), -1, 0)
    bad = np.flatnonzero(~np.isfinite(T).all(axis=(1, 2)))
    if bad.size:
        raise ModelError(
            f"design_q: found a response that is not finite at {hz[bad[0]]:.4g} Hz, expected numbers; it has a pole on the "
            "unit circle, or was not measured there",
            argument="responses",
        )
    L = law.gain * np.exp(2j * np.pi * hz * float(member.period or 0.0) * law.shift)
    return np.eye(T.shape[-1]) - L[:, None, None] * T
