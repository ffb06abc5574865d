"""What is left of the forces, looked at as that of any fit: joint by joint, with the motion as known signals."""

from collections.abc import Sequence

import numpy as np

from gantrytau_optimica.fitting.diagnostics import Diagnostics, ResidualSeries, diagnose, repeated
from gantrytau_optimica.fitting.facts import Fact
from gantrytau_optimica.identification.least_squares.regression import LimitedFit
from gantrytau_optimica.identification.logs.motion_log import MotionLog
from gantrytau_optimica.identification.rigid.residual_covariance import LogRows, covariance
from gantrytau_optimica.identification.rigid.rigid_regression import RigidRegression, factors_of

PASSED = 0.89  # of the frequencies below the cutoff: the zero-phase filter leaves noise apart by as much uncorrelated
PULLED = 5.0  # deviations beyond a limit, from which on data contradict it


def force_diagnostics(
    problem: RigidRegression, found: LimitedFit, rows: Sequence[LogRows], logs: Sequence[MotionLog]
) -> Diagnostics:
    """Diagnostics of filtered forces; logs: as given, of which rows are told, and whether one comes twice."""
    free = found.base.independent[~found.active[found.base.independent]]
    series = []
    for run, (one, motion) in enumerate(zip(rows, problem.motions, strict=True)):
        signals = motion.filtered(motion.motion)
        signs = motion.filtered(motion.thin(np.sign(motion.speed)))
        n = signs.shape[1]
        for i, name in enumerate(problem.dynamics.coordinates):
            words = ("q", "v", "a")
            known = {f"{word} of {name}": signals[:, i + k * n] for k, word in enumerate(words)}
            known |= {f"sign v of {name}": signs[:, i], "1": np.ones(len(signs))}
            known["time"] = one.period * np.arange(len(signs))
            series.append(
                ResidualSeries(
                    f"the force at {name}",
                    np.where(one.moving[:, i], one.left(found.p)[:, i], np.nan),
                    measured=one.b[:, i],
                    jacobian=one.A[:, i, free],
                    signals=known,
                    groups={"part": np.full(len(signs), run)},
                    rows=motion.inner,
                    run=f"log {motion.origin[0]}",
                    band=min(1.0, PASSED * 2 * one.cutoff * one.period),
                )
            )
    courses = {f"log {k}": np.hstack([log.q, log.f]) for k, log in enumerate(logs)}
    return diagnose(series, known=[*repeated(courses), *_pulls(problem.names, found, rows, free)])


def _pulls(names: Sequence[str], found: LimitedFit, rows: Sequence[LogRows], free: np.ndarray) -> list[Fact]:
    """Limits that data contradict: where each parameter would go if it alone were free of them."""
    factors, facts = factors_of(rows), []
    for k in np.flatnonzero(found.active).tolist():
        places = np.sort(np.append(free, k))
        p = found.p.copy()
        others = np.setdiff1d(np.arange(len(p)), places)
        right = factors.d - factors.R[:, others] @ p[others]
        p[places] = np.linalg.lstsq(factors.R[:, places], right, rcond=None)[0]
        deviation = float(np.sqrt(covariance(rows, p, places)[k, k]))
        beyond = float((found.p[k] - p[k]) / deviation) if deviation > 0 else 0.0
        if beyond > PULLED:
            facts.append(
                Fact("limit", names[k], held=float(found.p[k]), wanted=float(p[k]), deviations=beyond)
            )
    return facts
