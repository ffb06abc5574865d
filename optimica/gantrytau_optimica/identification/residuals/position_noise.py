"""Noise of positions, whose bias of least squares is taken out.

    M(s^2) = A'A / N,  g(s^2) = A'b / N          both linear in the variance s^2 of noise in q, to first order
    p = (2 M - M+)^-1 (2 g - g+)                 M+, g+: with as much noise again, n and -n, in the same positions

Noise in A makes M too large, and parameters too small by the share. Its size is in the log: the spectrum of positions
above what moves. Cook, Stefanski (1994), J. American Statistical Association 89, 1314 (simulation, extrapolation).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gantrytau_optimica.fitting.finding import Finding
from gantrytau_optimica.identification.least_squares.regression import LimitedFit
from gantrytau_optimica.identification.logs.motion_log import MotionLog
from gantrytau_optimica.identification.rigid.parallel_filter import WIDER, filtered_motion
from gantrytau_optimica.identification.rigid.residual_covariance import LogRows, covariance
from gantrytau_optimica.identification.rigid.rigid_regression import RigidRegression

MATTERS = 0.1  # deviations, from which on a bias is looked for
TOLD = 2.0  # deviations, from which on it is told
PAIRS = 2  # of noise and its opposite


@dataclass(frozen=True, eq=False)
class Unbiased:
    """A fit without the bias, the factor (k, k) of its errors beside those of least squares, and what is told."""

    fit: LimitedFit
    errors: np.ndarray
    findings: tuple[Finding, ...] = ()


def unbiased(
    problem: RigidRegression, found: LimitedFit, rows: Sequence[LogRows], parts: Sequence[MotionLog]
) -> Unbiased:
    """The fit where noise of the positions does not matter, else that without its bias."""
    k = len(found.p)
    free = found.base.independent[~found.active[found.base.independent]]
    noise = [position_noise(part, rows[0].cutoff) for part in parts]
    nothing = Unbiased(found, np.eye(k))
    if not len(free) or found.tight:
        return nothing
    deviations = np.sqrt(np.diag(covariance(rows, found.p, free)))[free]
    sure = np.max(np.abs(found.p[free]) / np.maximum(deviations, 1e-300))
    if not _weight(problem, noise) * sure > MATTERS:
        return nothing
    M, g = _normal(rows, free, found.p)
    more = [
        _normal(_with_noise(problem, parts, noise, seed, sign).rows(found.p), free, found.p)
        for seed in range(PAIRS)
        for sign in (1.0, -1.0)
    ]
    size = np.sqrt(np.diag(M))
    corrected = (2 * M - np.mean([m for m, _ in more], axis=0)) / np.outer(size, size)
    right = (2 * g - np.mean([d for _, d in more], axis=0)) / size
    if np.linalg.eigvalsh(corrected)[0] <= np.linalg.eigvalsh(M / np.outer(size, size))[0] / 2:
        return replace(nothing, findings=(_words(noise, "cannot be taken out: it hides what moves"),))
    p = found.p.copy()
    p[free] = np.linalg.solve(corrected, right) / size
    errors = np.eye(k)
    errors[np.ix_(free, free)] = np.linalg.solve(corrected, M / np.outer(size, size)) / size[:, None] * size
    off = np.abs(p - found.p)[free] / np.maximum(deviations, 1e-300)
    worst = int(np.argmax(off))
    name = problem.names[free[worst]]
    told = f"would move {name} by {off[worst]:.3g} of its deviations, and is taken out"
    return Unbiased(replace(found, p=p), errors, (_words(noise, told),) if off[worst] > TOLD else ())


def position_noise(log: MotionLog, cutoff: float) -> np.ndarray:
    """Standard deviation (n,) of white noise in positions, by the median of their spectrum above all motion."""
    q = log.q - log.q[0] - np.linspace(0, 1, len(log.q))[:, None] * (log.q[-1] - log.q[0])
    window = np.hanning(len(q))
    power = np.abs(np.fft.rfft(q * window[:, None], axis=0)) ** 2 / np.sum(window**2)
    frequency = np.fft.rfftfreq(len(q), log.period)
    above = power[frequency > min(WIDER * cutoff, 0.6 * frequency[-1])]
    return np.sqrt(np.median(above, axis=0) / np.log(2)) if len(above) else np.zeros(q.shape[1])


def _weight(problem: RigidRegression, noise: Sequence[np.ndarray]) -> float:
    """The largest share of the squares of speeds and accelerations, below the cutoff, that is noise."""
    shares = []
    for motion, sizes in zip(problem.motions, noise, strict=True):
        density = 2 * sizes**2 * motion.log_period
        n = len(sizes)
        for order in (1, 2):
            own = density * (2 * np.pi) ** (2 * order) * motion.cutoff ** (2 * order + 1) / (2 * order + 1)
            moved = np.mean(motion.motion[:, order * n : (order + 1) * n] ** 2, axis=0)
            shares.append(np.max(own / np.maximum(moved, 1e-300)))
    return float(max(shares, default=0.0))


def _with_noise(
    problem: RigidRegression, parts: Sequence[MotionLog], noise: Sequence[np.ndarray], seed: int, sign: float
) -> RigidRegression:
    draw, cutoff = np.random.default_rng(seed), problem.motions[0].cutoff
    noisy = [
        replace(part, q=part.q + sign * size * draw.normal(size=part.q.shape))
        for part, size in zip(parts, noise, strict=True)
    ]
    return replace(problem, motions=[filtered_motion(part, cutoff) for part in noisy])


def _normal(rows: Sequence[LogRows], free: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """M (k, k) and g (k,) of the parameters that are free, means over the rows that count."""
    others = np.setdiff1d(np.arange(len(p)), free)
    A = np.concatenate([r.A[r.moving] for r in rows])
    b = np.concatenate([r.b[r.moving] for r in rows]) - A[:, others] @ p[others]
    X = A[:, free]
    return X.T @ X / len(b), X.T @ b / len(b)


def _words(noise: Sequence[np.ndarray], told: str) -> Finding:
    sizes = np.max(noise, axis=0)
    message = (
        f"positions have noise of about {', '.join(f'{s:.2g}' for s in sizes)} m or rad, which {told}; a lower cutoff or "
        "finer encoders leave less to correct"
    )
    return Finding("noise of positions", np.arange(0), message)
