"""One equation for one angle, a cos(y) + b sin(y) + c = 0, as of an arm between a motor and a ball joint, at many points.

It has two solutions, y = angle(a, b) -+ arccos(-c / |a, b|), which tell apart by the sign of its slope, or none: a pose out
of reach is known at once, and a branch without being followed.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from gantrytau.answers.many_points.array_program import ArrayProgram

PROBES = 32  # places at which the equation is held against its form
ALIKE = 1e-10  # of its terms, by which it may differ there: rounding
BEYOND = 1e-9  # of |a, b|, by which c may be larger: at a pose that is reached straight


@dataclass(frozen=True, eq=False)
class OneAngle:
    """An equation as coefficients: q (k, N) -> (a, b, c); side: 1 or -1, of the branch behind or before angle(a, b)."""

    coefficients: ArrayProgram
    side: float

    def near(self, q: np.ndarray, y: np.ndarray) -> np.ndarray:
        """The angles (1, N) on the side of the branch, at most half a turn from y (1, N); NaN out of reach."""
        ((a, b, c),) = self.coefficients(q)
        with np.errstate(all="ignore"):
            cosine = -c / np.hypot(a, b)
            found = np.arctan2(b, a) + self.side * np.arccos(np.clip(cosine, -1, 1))
        found[~(np.abs(cosine) <= 1 + BEYOND)] = np.nan
        return found - 2 * np.pi * np.round((found - y) / (2 * np.pi))


def one_angle(residual: ca.Function, start: np.ndarray, begin: np.ndarray) -> OneAngle | None:
    """The equation (y, q) -> f as one of this form, or None if it is none; start: y where q is `begin`."""
    if len(start) != 1:
        return None
    y, q = residual.sx_in()
    ahead, beside, behind = (residual(angle, q) for angle in (0.0, np.pi / 2, np.pi))
    c = (ahead + behind) / 2
    a, b = (ahead - behind) / 2, beside - c
    formed = ca.vertcat(a * ca.cos(y), b * ca.sin(y), c)
    both = ca.Function("both", [y, q], [residual(y, q), formed, ca.jacobian(residual(y, q), y)])
    random = np.random.default_rng(0)
    angles = np.append(random.uniform(-np.pi, np.pi, PROBES), start)
    places = begin[:, None] + np.maximum(1.0, np.abs(begin))[:, None] * random.uniform(
        -1, 1, (len(begin), PROBES)
    )
    f, terms, slopes = map(np.array, both.map(PROBES + 1)(angles[None], np.column_stack([places, begin])))
    if not np.all(np.abs(f[0] - terms.sum(axis=0)) <= ALIKE * np.abs(terms).max(axis=0)) or not slopes[0, -1]:
        return None
    return OneAngle(
        ArrayProgram(ca.Function("coefficients", [q], [ca.vertcat(a, b, c)], {"cse": True})),
        -float(np.sign(slopes[0, -1])),
    )
