"""Calibration by named parameters: values, standard deviations, errors at held-out poses."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from gantrytau import Model
from gantrytau.kinematics import Kinematics
from gantrytau_optimica.calibration.diagnostics.device_frames import Motion
from gantrytau_optimica.calibration.diagnostics.fitted_numbers import FittedNumbers
from gantrytau_optimica.calibration.fitting.named_parameters import Named
from gantrytau_optimica.calibration.fitting.pose_residuals import PoseResiduals, strays
from gantrytau_optimica.calibration.links.nominal_rods import with_numbers
from gantrytau_optimica.calibration.report.report import Reported
from gantrytau_optimica.fitting.covariance import spread_by
from gantrytau_optimica.fitting.diagnostics import ResidualSeries
from gantrytau_optimica.fitting.least_squares import Minimum
from gantrytau_optimica.fitting.rank import BaseParameters, base_of_directions

Array = np.ndarray


@dataclass(frozen=True, eq=False, kw_only=True)
class NamedCalibration(Reported, FittedNumbers):
    """A robot whose named parameters were found. `found.parameters["upper.r"]`, in the units of the model.

    given: the robot as it was; residuals: of the fitted poses, at their minimum; noise: deviation of a coordinate of a
    measured position of median certainty, m.
    """

    given: Model
    residuals: PoseResiduals
    minimum: Minimum
    noise: float

    __repr__ = FittedNumbers.__repr__

    @property
    def robot_name(self) -> str:
        return self.residuals.tool.dae.name

    @property
    def names(self) -> tuple[str, ...]:
        return self.residuals.names

    @property
    def nominal_values(self) -> dict[str, float]:
        """Nominal values of the parameters."""
        tool = self.residuals.tool
        return dict(zip(tool.names, tool.nominal.tolist(), strict=True))

    @cached_property
    def parameters(self) -> Mapping[str, Any]:
        """Values by the names of the model, vectors whole; of a fitted frame `frame.R`, (3, 3), and `frame.t`, (3,) in m,
        base = R measured + t. `covariance` and `deviations` of `frame.R` are those of a rotation vector in the base.
        """
        R, t, p = self.residuals.frame(self.minimum.x)
        dae = self.residuals.tool.dae
        values = {**dae.parameter_values, **dict(zip(self.residuals.tool.names, p.tolist(), strict=True))}
        found: dict[str, Any] = {}
        for parameter in dae.flat.parameters:
            if set(parameter.elements) & set(self.residuals.tool.names):
                whole = np.array([values[name] for name in parameter.elements])
                found[parameter.name] = (
                    whole.reshape(parameter.shape, order="F") if parameter.shape else float(whole[0])
                )
        return Named(found, {} if self.frame == "base" else {"frame.R": R, "frame.t": t})

    @cached_property
    def robot(self) -> Model:
        """The robot with the parameters found."""
        return with_numbers(self.given, dict(self.parameters))

    @cached_property
    def kinematics(self) -> Kinematics:
        """`Kinematics` of the calibrated robot, in its base."""
        return Kinematics(self.robot, joints=self.residuals.tool.joints, tool=self.residuals.tool.tool)

    @property
    def motion(self) -> Motion | None:
        """From the frame of the measurements to the base of the robot."""
        return None if self.frame == "base" else Motion(*self.residuals.frame(self.minimum.x)[:2])

    @property
    def minima(self) -> tuple[Minimum, ...]:
        """Covariance of all parameters."""
        return (self.minimum,)

    @cached_property
    def undetermined(self) -> tuple[str, ...]:
        return self.minimum.undetermined(self.names)

    @cached_property
    def base(self) -> BaseParameters:
        """Determined combinations of indistinguishable parameters."""
        return base_of_directions(self.minimum.directions[self.rank :], self.residuals.scale)

    @cached_property
    def _covariance(self) -> Array:
        residuals, x, data = self.residuals, self.minimum.x, self.residuals.data
        J = np.swapaxes(residuals.jacobian(x) * residuals.weights[:, None, None] ** 2, 1, 2)
        R = residuals.frame(x)[0]
        roots = np.broadcast_to(np.eye(3), (len(J), 3, 3)) if data.spreads is None else R @ data.spreads
        worse = np.sqrt(np.sum(roots**2, axis=(1, 2)) / 3)[:, None, None]
        moved = self.noise * np.concatenate([J[:, :, :3] @ roots, J[:, :, 3:] * worse], axis=2)
        columns = [moved.transpose(1, 0, 2).reshape(len(x), -1)]
        if data.shared is not None:
            columns.append(np.einsum("nji,nik->jk", J[:, :, :3], R @ data.shared))
        pulled = self.minimum.jacobian[len(self.minimum.jacobian) - len(residuals.prior) :] / residuals.scale
        for row, (_, deviation) in zip(pulled, residuals.prior.values(), strict=True):
            columns.append((row * np.abs(row).max() * deviation)[:, None])
        return spread_by(self.minimum.inverse, *columns)

    @property
    def advice(self) -> str:
        framed = any("frame." in words for words in self.base.words(self.names))
        base = ", or measure in the base of the robot, frame='base'" if framed else ""
        return f"leave them out of parameters=, measure other poses, or give prior={{name: deviation}}{base}"

    @cached_property
    def _misses(self) -> Array:
        """Measured less predicted places and turns of the held-out poses, (N, 3 or 6), places in the frame measured."""
        data = self.measurements.select(self.held_out)
        missed = replace(self.residuals, data=data, lever=1.0).poses(self.minimum.x)
        missed[:, :3] = missed[:, :3] @ self.residuals.frame(self.minimum.x)[0]
        return missed

    @cached_property
    def error_vectors(self) -> Array:
        return self._misses[:, :3]

    @cached_property
    def angle_errors(self) -> Array:
        turns = self._misses[:, 3:]
        return np.linalg.norm(turns, axis=1) if turns.size else np.full(len(turns), np.nan)

    @cached_property
    def stray_rows(self) -> Array:
        known = np.union1d(self.rows, self.held_out)
        return known[strays(replace(self.residuals, data=self.measurements.select(known)), self.minimum.x)]

    @cached_property
    def expected(self) -> Array:
        """The error of the tool to be expected at the fitted poses, by how sure parameters are, (N,) in m."""
        J = self.residuals.jacobian(self.minimum.x)[:, :3]
        return np.sqrt(np.einsum("nij,jk,nik->n", J, self._covariance, J))

    def link_errors(self) -> list[tuple[str, Array, Array]]:
        """Of each coordinate its name, the first joint, and what is left of it, (N,) in m each."""
        left = self.residuals.poses(self.minimum.x)[:, :3] * self.residuals.weights[:, None]
        return [
            (f"tool {axis}", self.residuals.data.q[:, 0], e) for axis, e in zip("xyz", left.T, strict=True)
        ]

    def residual_series(self) -> list[ResidualSeries]:
        residuals, x, data = self.residuals, self.minimum.x, self.residuals.data
        weights = residuals.weights[:, None]
        left, J = residuals.poses(x) * weights, residuals.jacobian(x) * weights[..., None]
        noise: list[Any] = [None] * 3
        if data.spreads is not None and data.deviation is not None:
            R = residuals.frame(x)[0]
            squares = np.sum((data.deviation * weights[..., None] * (R @ data.spreads)) ** 2, axis=2)
            if data.shared is not None:  # numbers take up a part
                common = np.zeros((*left.shape, data.shared.shape[2]))
                common[:, :3] = weights[..., None] * (R @ data.shared)
                flat, Q = common.reshape(left.size, -1), np.linalg.qr(J.reshape(left.size, -1))[0]
                squares += np.sum((flat - Q @ (Q.T @ flat)).reshape(common.shape)[:, :3] ** 2, axis=2)
            noise = list(np.sqrt(squares).T)
        away = weights[:, 0] * data.distances
        signals = {f"q of {n}": q - q.mean() for n, q in zip(residuals.tool.joints, data.q.T, strict=True)}
        return [
            ResidualSeries(name, left[:, k], away, noise[k], J[:, k], signals, rows=self.rows)
            for k, name in enumerate("xyz")
        ]
