"""Q of learning control: open as far as robust convergence allows.

Of a family of responses T and filters q of all axes, learning converges in each run where, over all frequencies,

    sigma(f) = |diag(q(f)) (I - L(f) T(f))| <= margin < 1,   L = gain e^(2 pi i f period shift)

with all axes coupled: Dressler (2012), (7.16) and Figures 7.14 and 7.17. q is a low-pass filter with notches; the area
below it up to a limit is maximised by its slopes.
"""

from collections.abc import Sequence

import numpy as np

from gantrytau import ModelError
from gantrytau_optimica.learning.design.uncertain_modes import Uncertain, resonant, uncertain
from gantrytau_optimica.learning.filters.zero_phase import ZeroPhase
from gantrytau_optimica.learning.laws.correction_laws import Shifted
from gantrytau_optimica.learning.laws.learning import Learning
from gantrytau_optimica.learning.laws.lifted import axes_of, norm, period_of
from gantrytau_optimica.learning.runs.estimated_response import EstimatedResponse

POINTS = 500  # frequencies from zero to half the sampling frequency, without those at resonances
AROUND = np.linspace(-4, 4, 17)  # damping ratios off a resonance, where there are frequencies too
LOW_PASS = (0.5, 100.0)  # Hz
WIDTHS, DEPTHS = (0.02, 1.5), (0.02, 1.0)
ROUNDS = (10.0, 100.0, 1e3, 1e4)  # of the penalty for sigma above the margin
BACK = 0.995  # of the cut-off, by which filters are closed until they hold
CLOSED = 2000  # such steps at most


def design_q(
    responses: Uncertain | Sequence[Uncertain],
    *,
    limit: float = 30.0,
    margin: float = 0.95,
    notches: int = 2,
    learning: Learning | None = None,
    samples: int = 825,
) -> ZeroPhase:
    """The zero-phase filters, one for each axis, that are most open up to `limit` Hz and keep sigma within the margin.

    responses: from corrections to what is learnt from, sampled systems or what `estimated_response` found; of one alone the
    family is `uncertain(response)`. learning: gain and shift, by default those of `Learning()`; samples: of the window in
    which the worst of the family is checked over a whole run.
    Raises ModelError for responses of different periods or axes, for a law that goes by a model, and where no filter holds.
    """
    family, law = members_of(responses, learning)
    period = period_of(family[0])
    _check(period, limit, margin, notches)
    hz = frequencies(family)
    left = np.array([rest(member, law, hz) for member in family])  # (members, F, m, m)
    found = _best(left, hz, period, limit, margin, notches)
    q = ZeroPhase(())
    for axis in found:
        own = ZeroPhase.butterworth(2, float(axis[0]))
        for centre, width, depth in axis[1:].reshape(-1, 3):
            own = own.notched(float(centre), float(width), float(depth))
        q = q.joined(own)
    worst = family[int(np.argmax(sizes_of(q.magnitude(hz, period), left).max(axis=1)))]
    sigma = norm(Learning(law=law, q=q).matrix(worst, samples))
    if not sigma < 1:
        raise ModelError(
            f"design_q: found sigma {sigma:.4f} over a whole run, expected less than 1; take a smaller margin",
            argument="margin",
        )
    return q


def members_of(
    responses: Uncertain | Sequence[Uncertain], learning: Learning | None
) -> tuple[tuple[Uncertain, ...], Shifted]:
    """The family, and the law by gain and shift. Raises ModelError where these do not fit."""
    members = (responses,) if isinstance(responses, Uncertain) else tuple(responses)
    if not members or not all(isinstance(member, Uncertain) for member in members):
        raise ModelError(
            "design_q: found responses of another kind, expected sampled linear systems, or what estimated_response found",
            argument="responses",
        )
    periods, axes = {period_of(member) for member in members}, {axes_of(member) for member in members}
    if len(periods) > 1 or len(axes) > 1:
        raise ModelError(
            f"design_q: found responses with periods of {sorted(periods)} s and {sorted(axes)} axes, expected one of both",
            argument="responses",
        )
    law = (learning or Learning()).corrections_of
    if not isinstance(law, Shifted):
        raise ModelError(
            f"design_q: found the law {type(law).__name__}, expected a gain and a shift; laws that go by a model need a "
            "low-pass filter alone",
            argument="learning",
        )
    return (uncertain(members[0]) if len(members) == 1 else members), law


def frequencies(family: Sequence[Uncertain]) -> np.ndarray:
    """Where sigma is looked at, (F,) in Hz: evenly, and closely around resonances of all of a family."""
    period = period_of(family[0])
    found = [np.linspace(0.0, 0.5 / period, POINTS)]
    for member in family:
        system = member.system if isinstance(member, EstimatedResponse) else member
        poles = np.linalg.eigvals(system.A)
        s = np.log(poles[resonant(poles, period)].astype(complex)) / period
        s = s[s.imag > 0]
        found.append(np.ravel(np.abs(s) / 2 / np.pi * (1 + np.outer(AROUND, -s.real / np.abs(s)))))
    hz = np.unique(np.concatenate(found))
    return hz[(hz >= 0) & (hz <= 0.5 / period)]


def sizes_of(gains: np.ndarray, left: np.ndarray) -> np.ndarray:
    """The value of sigma (..., F) of filters with gains (m, F), by I - L T (..., F, m, m)."""
    return np.linalg.norm(gains.T[:, :, None] * left, ord=2, axis=(-2, -1))


def rest(member: Uncertain, law: Shifted, hz: np.ndarray) -> np.ndarray:
    """I - L T over frequencies, (F, m, m)."""
    T = np.moveaxis(member.response(hz), -1, 0)
    if not np.all(np.isfinite(T)):
        raise ModelError(
            "design_q: found a response that is not finite, expected numbers", argument="responses"
        )
    L = law.gain * np.exp(2j * np.pi * hz * period_of(member) * law.shift)
    return np.eye(T.shape[-1]) - L[:, None, None] * T


def _best(
    left: np.ndarray, hz: np.ndarray, period: float, limit: float, margin: float, notches: int
) -> np.ndarray:
    """Cut-off, and centre, width and depth of notches, by axis, (m, 1 + 3 notches); left: I - L T of a family."""
    from scipy.optimize import minimize

    axes = left.shape[-1]
    x = np.tan(np.pi * np.minimum(hz, 0.5 / period * (1 - 1e-9)) * period)
    weights = np.gradient(hz) * (hz <= limit)
    weights = weights / weights.sum() / axes

    def gains(p: np.ndarray) -> np.ndarray:
        return np.array([_gain(axis, x, period) for axis in np.exp(p).reshape(axes, -1)])

    def cost(p: np.ndarray, stiffness: float) -> tuple[float, np.ndarray]:
        q = gains(p)
        slope = np.empty((axes, len(p) // axes, len(hz)))  # of q by its own parameters
        for i, axis in enumerate(p.reshape(axes, -1)):
            for k in range(len(axis)):
                step = axis + 1e-6 * np.eye(len(axis))[k]
                slope[i, k] = (_gain(np.exp(step), x, period) - q[i]) / 1e-6
        rows = q.T[None, :, :, None] * left
        near = np.sqrt(np.sum(np.abs(rows) ** 2, axis=(2, 3))) > 0.995 * margin  # others cannot be above it
        U, sizes, V = np.linalg.svd(rows[near])
        over = np.maximum(sizes[:, 0] - 0.995 * margin, 0.0)
        # d sigma / d q_i = Re(conj(u_i) (A v)_i)
        turned = np.einsum("nij,nj->ni", left[near], V[:, 0].conj())
        rates = np.zeros((*near.shape, axes))
        rates[near] = over[:, None] * np.real(U[:, :, 0].conj() * turned)
        penalty = stiffness * np.sum(over**2) / near.size
        by_q = 2 * stiffness / near.size * rates.sum(axis=0).T - weights
        return float(penalty - np.sum(weights * q)), np.einsum("if,ikf->ik", by_q, slope).ravel()

    peaks = np.linalg.norm(left, axis=-1).max(axis=0)  # (F, m): rows, the worst of the family
    start = np.array([_start(peaks[:, i], hz, limit, notches) for i in range(axes)])
    low = np.log([LOW_PASS[0], *[0.3, WIDTHS[0], DEPTHS[0]] * notches])
    high = np.log([min(LOW_PASS[1], 0.45 / period), *[0.45 / period, WIDTHS[1], DEPTHS[1]] * notches])
    p = np.clip(np.log(start), low, high).ravel()
    bounds = list(zip(np.tile(low, axes), np.tile(high, axes), strict=True))
    for stiffness in ROUNDS:
        p = minimize(
            cost, p, args=(stiffness,), jac=True, method="L-BFGS-B", bounds=bounds, options=dict(maxiter=80)
        ).x
    for _ in range(CLOSED):
        sizes = sizes_of(gains(p), left)
        if sizes.max() <= margin:
            return np.exp(p).reshape(axes, -1)
        _, row = np.unravel_index(np.argmax(sizes), sizes.shape)
        member = np.argmax(sizes[:, row])
        axis = int(np.argmax(np.linalg.norm(gains(p).T[row][:, None] * left[member, row], axis=1)))
        p.reshape(axes, -1)[axis, 0] += np.log(BACK)
    raise ModelError(
        f"design_q: found sigma {sizes.max():.3g} at {hz[row]:.3g} Hz however far filters close, expected {margin:g}; what "
        "is learnt from turns its sign there: take a larger shift, a smaller gain, or another sensor",
        argument="responses",
    )


def _gain(axis: np.ndarray, x: np.ndarray, period: float) -> np.ndarray:
    """|q| over x = tan(pi f period): |causal half|^2 of a Butterworth filter of order 2 and notches."""
    found = 1 / (1 + (x / np.tan(np.pi * axis[0] * period)) ** 4)
    for centre, width, depth in axis[1:].reshape(-1, 3):
        square = (x / np.tan(np.pi * centre * period)) ** 2
        off, beside = (1 - square) ** 2, (2 * width) ** 2 * square
        found = found * (off + depth**2 * beside) / (off + beside)
    return found


def _start(peaks: np.ndarray, hz: np.ndarray, limit: float, notches: int) -> np.ndarray:
    """Notches where I - L T is largest, and the cut-off at the limit."""
    found = [limit]
    left = np.where((hz > 0.5) & (hz < 2 * limit), peaks, 0.0)
    for _ in range(notches):
        top = int(np.argmax(left))
        found += [max(hz[top], 0.5), 0.2, 1 / max(left[top], 1.1) ** 0.5]
        left = np.where(np.abs(hz - hz[top]) < 0.2 * hz[top], 0.0, left)
    return np.array(found)


def _check(period: float, limit: float, margin: float, notches: int) -> None:
    if not 0 < limit < 0.5 / period:
        raise ModelError(
            f"design_q: found limit={limit!r}, expected Hz below half the sampling frequency, {0.5 / period:g}",
            argument="limit",
        )
    if not 0 < margin < 1:
        raise ModelError(
            f"design_q: found margin={margin!r}, expected a number between 0 and 1", argument="margin"
        )
    if isinstance(notches, bool) or not isinstance(notches, (int, np.integer)) or not 0 <= notches <= 6:
        raise ModelError(
            f"design_q: found notches={notches!r}, expected a whole number from 0 to 6", argument="notches"
        )
