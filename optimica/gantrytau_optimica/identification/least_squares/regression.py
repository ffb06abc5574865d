"""Linear least squares of a robot's forces from their triangular factors, with and without limits."""

from dataclasses import dataclass

import numpy as np

from gantrytau_optimica.fitting.rank import BaseParameters, base_parameters
from gantrytau_optimica.identification.least_squares.factors import Factors
from gantrytau_optimica.identification.least_squares.parameter_limits import ParameterLimits, within

ROUNDING = 1e-9  # of a normed matrix, below zero
AT_LIMIT = 1e-6  # of the forces, which a parameter at its limit may explain


@dataclass(frozen=True, eq=False)
class LimitedFit:
    """Parameters p (k,), of those that are not determined the nominal value.

    active: at a limit; tight: of bodies that least squares alone make impossible, by path; cost: sum of squares over that
    without their condition; inflation: deviation of each over that if it were alone (inf where not determined);
    condition: of the normed columns that are determined.
    """

    p: np.ndarray
    base: BaseParameters
    active: np.ndarray
    inflation: np.ndarray
    condition: float
    tight: tuple[str, ...] = ()
    cost: float = 1.0


def fit(factors: Factors, nominal: np.ndarray, limits: ParameterLimits) -> LimitedFit:
    """Least squares within limits."""
    from scipy.optimize import lsq_linear

    base = base_parameters(factors.R)
    free, held, least = base.independent, base.dependent, limits.least
    p = np.array(nominal, dtype=float)
    p[held] = np.maximum(p[held], least[held])
    norms = np.linalg.norm(factors.R[:, free], axis=0)
    normed, right = factors.R[:, free] / norms, factors.d - factors.R[:, held] @ p[held]
    best = np.linalg.lstsq(normed, right, rcond=None)[0]
    lowest = least[free] * norms
    if np.any(best < lowest):
        found = lsq_linear(normed, right, bounds=(lowest, np.inf), method="bvls", tol=1e-14)
        best = np.maximum(found.x, lowest)
        at_limit = best <= lowest + 1e-12 * np.max(np.abs(best))
    else:
        at_limit = np.zeros(len(free), dtype=bool)
    p[free] = best / norms
    tight = tuple(c.name for c in limits.conditions if np.min(c.eigenvalues(p)) < -ROUNDING)
    cost = 1.0
    if tight:
        alone, of_bodies = factors.squares(p), np.concatenate([c.places for c in limits.conditions])
        p = within(factors, p, nominal, limits, np.union1d(free, of_bodies))
        cost = float(factors.squares(p) / alone) if alone > 0 else np.inf
        at_limit = (p[free] - least[free]) * norms <= AT_LIMIT * np.linalg.norm(right)
    active = np.zeros(len(p), dtype=bool)
    active[free] = at_limit
    p[active] = least[active]
    inflation = np.full(len(p), np.inf)
    if len(free):
        inverse = np.linalg.inv(np.linalg.qr(normed, mode="r"))
        inflation[free] = np.linalg.norm(inverse, axis=1)
    condition = float(np.linalg.cond(normed)) if len(free) else np.nan
    return LimitedFit(p, base, active, inflation, condition, tight, cost)
