"""Rows of a regression from filtered motion, and the minimum over parameters, linear or not.

Where forces are not linear in some parameters, each step linearises them with exact slopes (Gauss-Newton) and is halved
while it does not descend; where they are, one step is the answer.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from gantrytau_optimica.identification.least_squares.factors import Factors
from gantrytau_optimica.identification.least_squares.parameter_limits import Condition, ParameterLimits
from gantrytau_optimica.identification.least_squares.regression import LimitedFit, fit
from gantrytau_optimica.identification.rigid.body_parameters import BodyParameters, pseudo_inertia
from gantrytau_optimica.identification.rigid.friction_columns import FrictionColumns
from gantrytau_optimica.identification.rigid.parallel_filter import FilteredMotion
from gantrytau_optimica.identification.rigid.residual_covariance import LogRows
from gantrytau_optimica.identification.rigid.robot_dynamics import IdentificationError, RobotDynamics

STEPS = 30
SETTLED = 1e-9  # of the parameters, by which the last step may still change them
LOOKED_AT = 60  # rows on which it is looked whether forces are linear


@dataclass(frozen=True, eq=False)
class RigidRegression:
    """A robot, its friction and what it was measured with; parameters are those of the robot, then of friction."""

    dynamics: RobotDynamics
    friction: FrictionColumns | None
    motions: Sequence[FilteredMotion]
    minimum_speed: float

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, (k,)."""
        return (*self.dynamics.names, *(self.friction.names if self.friction else ()))

    @property
    def nominal(self) -> np.ndarray:
        """Values to begin with, (k,): the robot's own, no friction."""
        return np.concatenate([self.dynamics.nominal, np.zeros(len(self.names) - len(self.dynamics.names))])

    @property
    def least(self) -> np.ndarray:
        """Lower limits, (k,): what the model declares, and frictions that brake."""
        return np.concatenate([self.dynamics.least, np.zeros(len(self.names) - len(self.dynamics.names))])

    @property
    def limits(self) -> ParameterLimits:
        """Limits of masses, inertias and frictions."""
        return ParameterLimits(self.least, tuple(self._condition(body) for body in self.dynamics.bodies))

    def _condition(self, body: BodyParameters) -> Condition:
        columns = np.eye(len(self.dynamics.names))

        def at(p: np.ndarray) -> np.ndarray:
            return pseudo_inertia(self.dynamics.ten(body, p))

        constant = at(np.zeros(len(columns)))
        places = np.array([j for j, n in enumerate(self.dynamics.names) if n in body.names])
        return Condition(body.path, constant, places, np.array([at(columns[j]) - constant for j in places]))

    def _some_rows(self) -> np.ndarray:
        rows = np.concatenate([m.motion for m in self.motions])
        return rows[:: max(1, len(rows) // LOOKED_AT)]

    def without_silent(self) -> "RigidRegression":
        """This regression without the parameters of the robot that move no force."""
        A, _ = self.dynamics.slopes(self._some_rows(), self.dynamics.nominal)
        moved = np.nanmax(np.abs(A), axis=(0, 1), initial=0.0) > 0
        names = tuple(n for n, moves in zip(self.dynamics.names, moved, strict=True) if moves)
        if np.all(moved):
            return self
        return replace(self, dynamics=replace(self.dynamics, names=names))

    def nonlinear(self) -> tuple[str, ...]:
        """Parameters in which forces are not linear, as seen along the motion."""
        return self.dynamics.not_linear(self._some_rows())

    def rows(self, p: np.ndarray) -> list[LogRows]:
        """Forces linearised at parameters p, filtered, one record for each motion.

        Raises IdentificationError where the model has no forces: outside of its workspace.
        """
        k = len(self.dynamics.names)
        found = []
        for number, motion in enumerate(self.motions):
            A, y = self.dynamics.slopes(motion.motion, p[:k])
            bad = np.flatnonzero(~np.isfinite(y).all(axis=1))
            if len(bad):
                first = motion.motion[bad[0], : y.shape[1]]
                raise IdentificationError(
                    f"identify: {self.dynamics.dae.name} has no forces in {len(bad)} of {len(y)} rows of log {number}, "
                    f"first at {bad[0] * motion.period:.4g} s, q = {np.round(first, 4).tolist()}: outside of its workspace, "
                    "or in a singular pose. Expected q in m and rad, in the order of the model's drives "
                    f"{', '.join(self.dynamics.coordinates)}; mend the log or the robot's geometry"
                )
            known = y - A @ p[:k]
            if self.friction:
                known = known + motion.thin(self.friction.given(motion.v, motion.speed))
                A = np.concatenate([A, motion.thin(self.friction.columns(motion.v, motion.speed))], axis=2)
            moving = motion.moving(self.minimum_speed)
            A, b = motion.filtered(A), motion.filtered(motion.f - known)
            found.append(LogRows(A, b, moving, motion.period, motion.cutoff, motion.thinned))
        return found


def factors_of(rows: Sequence[LogRows]) -> Factors:
    """Triangular factors of all rows that count. IdentificationError where none does."""
    if not any(np.any(r.moving) for r in rows):
        raise IdentificationError(
            "identify: no joint is ever faster than minimum_speed, where friction has no direction; move faster, or lower it"
        )
    return reduce(Factors.__add__, (Factors.of(r.A[r.moving], r.b[r.moving]) for r in rows))


def minimum(
    problem: RigidRegression, limits: ParameterLimits, nonlinear: Sequence[str]
) -> tuple[LimitedFit, list[LogRows]]:
    """The least squares and the rows at it. Raises IdentificationError where Gauss-Newton does not settle."""
    nominal = problem.nominal
    rows = problem.rows(nominal)
    factors = factors_of(rows)
    if not nonlinear:
        return fit(factors, nominal, limits), rows
    p, left = nominal, factors.squares(nominal)
    for _ in range(STEPS):
        found = fit(factors, p, limits)
        step = found.p - p
        share = 1.0
        while True:
            tried = problem.rows(p + share * step)
            new = factors_of(tried)
            if new.squares(p + share * step) <= left * (1 + 1e-12) or share < 1e-3:
                break
            share /= 2
        p, rows, factors, left = p + share * step, tried, new, new.squares(p + share * step)
        if np.linalg.norm(step) <= SETTLED * max(1.0, np.linalg.norm(p)):
            return fit(factors, p, limits), rows
    raise IdentificationError(
        f"identify: {', '.join(nonlinear)} did not settle in {STEPS} steps of Gauss-Newton, as forces are not linear in "
        "them; fix some, or start from a robot whose parameters are closer"
    )
