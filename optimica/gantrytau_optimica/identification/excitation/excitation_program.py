"""The least variance of parameters over Fourier series that keep limits: a nonlinear program for Ipopt.

    minimise    log tr (S Y'Y S)^-1   ("a"),   -log det Y'Y   ("d"),   log (tr Y'Y tr (Y'Y)^-1)   ("condition")
    subject to  |q'|, |q''|, |f| and the tool's box at K times of one period
    unknown     coefficients of series that begin at rest

S holds typical sizes of the parameters, so that "a" sums squares of relative deviations. "condition" is the smooth bound
of the condition number by Frobenius norms. Gradients are exact, second derivatives gathered step by step.
"""

from dataclasses import dataclass
from typing import Literal

import casadi as ca
import numpy as np

from gantrytau_optimica.identification.excitation.excitation_limits import ExcitationLimits
from gantrytau_optimica.identification.excitation.fourier_series import FourierSeries, at_rest, series_columns
from gantrytau_optimica.identification.excitation.motion_regressor import MotionRegressor

Criterion = Literal["a", "d", "condition"]
ITERATIONS = 150
POINTS = 16  # of one period of the fastest harmonic
OPTIONS = {
    "print_time": False,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.hessian_approximation": "limited-memory",
    "ipopt.max_iter": ITERATIONS,
    "ipopt.tol": 1e-4,
    "ipopt.acceptable_tol": 1e-3,
}


@dataclass(frozen=True, eq=False)
class ExcitationProgram:
    """Regressor of a robot over the motion of its tool, limits, what is least; margin: share of limits used."""

    regressor: MotionRegressor
    limits: ExcitationLimits
    harmonics: int
    period: float
    criterion: Criterion
    scale: np.ndarray
    margin: float = 1.0

    def solve(self, start: np.ndarray) -> tuple[FourierSeries, float, str]:
        """The series nearest below a start (2 H - 1, m), what is least there, and Ipopt's status."""
        x = ca.MX.sym("x", *start.shape)
        basis = at_rest(self.harmonics)
        times = np.arange(POINTS * self.harmonics) * self.period / (POINTS * self.harmonics)
        coefficients = ca.DM(basis) @ x
        columns = series_columns(times, self.harmonics, self.period)
        motion = ca.vertcat(*[(ca.DM(part) @ coefficients).T for part in columns])
        found = self._at_points().map(len(times))(motion)
        normal = ca.sum2(found[1]) / len(times)
        problem = {"x": ca.vec(x), "f": self._least()(normal), "g": ca.vec(found[0])}
        solver = ca.nlpsol("excitation", "ipopt", problem, OPTIONS)
        done = solver(x0=start.T.ravel(), lbg=-self.margin, ubg=self.margin)
        chosen = np.asarray(done["x"]).reshape(start.shape[1], -1)
        return (
            FourierSeries(chosen @ basis.T, self.period),
            float(done["f"]),
            str(solver.stats()["return_status"]),
        )

    def _at_points(self) -> ca.Function:
        """Shares of the limits, and the sum of squares of scaled slopes, at one point."""
        kind = ca.SX if self.regressor.function.is_a("SXFunction") else ca.MX  # loops solved by a call
        x = kind.sym("x", self.regressor.function.numel_in(0))
        _q, v, a, f, Y = self.regressor.function.call([x])
        limits, m = self.limits, len(self.limits.low)
        centre, half = (limits.high + limits.low) / 2, (limits.high - limits.low) / 2
        shares = ca.vertcat(
            (x[:m] - centre) / half, v / limits.speed, a / limits.acceleration, f / limits.force
        )
        scaled = Y @ ca.diag(ca.DM(self.scale))
        return ca.Function("at", [x], [shares, ca.vec(scaled.T @ scaled)])

    def _least(self) -> ca.Function:
        k = len(self.scale)
        flat = ca.SX.sym("N", k * k)
        normal = ca.reshape(flat, k, k)
        R = ca.chol(normal)
        spread = ca.sumsqr(ca.solve(R, ca.SX.eye(k)))
        if self.criterion == "d":
            value = -2 * ca.sum1(ca.log(ca.diag(R)))
        elif self.criterion == "a":
            value = ca.log(spread)
        else:
            value = ca.log(spread * ca.trace(normal))
        return ca.Function("least", [flat], [value])
