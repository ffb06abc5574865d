"""What a fit of named parameters found: values, how sure they are, and how well they foretell poses that were held out."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np

from gantrytau import Description, Model, ModelError
from gantrytau.describing.record import Record
from gantrytau.errors import did_you_mean
from gantrytau.kinematics import Kinematics
from gantrytau_optimica.calibration.data.measurements import Measurements
from gantrytau_optimica.calibration.design.identifiability import dependencies
from gantrytau_optimica.calibration.fitting.covariance import MOVED
from gantrytau_optimica.calibration.fitting.gauss_newton import Minimum
from gantrytau_optimica.calibration.fitting.named_parameters import Named
from gantrytau_optimica.calibration.fitting.pose_residuals import FRAME, PoseResiduals, strays
from gantrytau_optimica.calibration.judging.device_frames import Motion
from gantrytau_optimica.calibration.judging.fitted_rods import mean_by_worth
from gantrytau_optimica.calibration.report.described_calibration import calibration_described
from gantrytau_optimica.calibration.report.report import write_report
from gantrytau_optimica.calibration.rods.nominal_rods import with_numbers
from gantrytau_optimica.fitting.finding import Finding

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class NamedCalibration(Record):
    """A robot whose named parameters were found. `found.parameters["upper.r"]`, in the units of the model.

    given: the robot as it was; residuals: of the fitted poses, at their minimum; noise: deviation of a coordinate of a
    measured position of median certainty, m; rows, held_out: of the measurements, fitted and kept to validate; loss, frame:
    as they were asked for; findings: what was noticed.
    """

    given: Model
    measurements: Measurements
    residuals: PoseResiduals
    minimum: Minimum
    noise: float
    rows: Array
    held_out: Array
    loss: str
    frame: str
    findings: tuple[Finding, ...] = ()
    model: None = None
    method: str = "gauss-newton"

    def __repr__(self) -> str:
        return (
            f"<Calibration of {self.robot_name}: {len(self.names)} numbers from {len(self.rows)} poses, "
            f"{self.error * 1e6:.3g} um in the mean of {len(self.held_out)} held out>"
        )

    def __describe__(self, name: str = "") -> Description:
        return calibration_described(self, name)

    @property
    def robot_name(self) -> str:
        """What the robot is called."""
        return self.residuals.tool.dae.name

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the identified numbers, scalars; those of a fitted frame first."""
        return self.residuals.names

    @property
    def nominal_values(self) -> dict[str, float]:
        """What the parameters were before."""
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
    def rank(self) -> int:
        """How many combinations of the identified numbers data hold."""
        return self.minimum.rank

    @property
    def success(self) -> bool:
        """Whether the last step was negligible."""
        return self.minimum.success

    @property
    def iterations(self) -> int:
        """Steps of the last fit."""
        return self.minimum.iterations

    @cached_property
    def undetermined(self) -> tuple[str, ...]:
        """Names of numbers that data do not hold: they stayed near their start values."""
        part = np.abs(self.minimum.directions[self.rank :]).max(axis=0, initial=0.0)
        return tuple(name for name, share in zip(self.names, part, strict=True) if share > MOVED)

    @property
    def dependent(self) -> dict[str, list[str]]:
        """Numbers that data do not tell apart from others: each with those that take up its change."""
        return dependencies(self.minimum.directions[self.rank :], self.residuals.scale, self.names)

    @cached_property
    def _covariance(self) -> Array:
        residuals, x = self.residuals, self.minimum.x
        J = residuals.slopes(x) * residuals.weights[:, None, None] ** 2
        held = (
            self.minimum.directions[: self.rank] / self.minimum.singular[: self.rank, None] * residuals.scale
        )
        spreads = residuals.data.spreads
        roots = (
            np.broadcast_to(np.eye(3), (len(J), 3, 3)) if spreads is None else residuals.frame(x)[0] @ spreads
        )
        parts = [np.swapaxes(J[:, :3], 1, 2) @ roots]
        if J.shape[1] == 6:
            worse = np.sqrt(np.sum(roots**2, axis=(1, 2)) / 3)
            parts.append(np.swapaxes(J[:, 3:], 1, 2) * worse[:, None, None])
        moved = self.noise * np.concatenate(
            [part.transpose(1, 0, 2).reshape(len(x), -1) for part in parts], axis=1
        )
        if residuals.data.shared is not None:
            shared = residuals.frame(x)[0] @ residuals.data.shared
            moved = np.hstack([moved, np.einsum("nij,nik->jk", J[:, :3], shared)])
        pulled = self.minimum.slopes[len(self.minimum.slopes) - len(residuals.prior) :] / residuals.scale
        for row, (_, deviation) in zip(pulled, residuals.prior.values(), strict=True):
            moved = np.hstack([moved, (row * np.abs(row).max() * deviation)[:, None]])
        half = held.T @ (held @ moved)
        return half @ half.T

    def covariance(self, names: Sequence[str] | None = None) -> Array:
        """Covariance (k, k) of parameters in their order; a vector's name stands for its elements. names: default all that
        data hold. Raises ModelError for unknown names and for numbers that data do not hold.
        """
        wanted = [n for n in self.names if n not in self.undetermined] if names is None else names
        if isinstance(names, str):
            raise ModelError(f"covariance: found '{names}', expected a list of names; write ['{names}']")
        places = []
        for name in wanted:
            those = [k for k, n in enumerate(self.names) if name in (n, n.rpartition("[")[0])]
            if not those:
                raise ModelError(
                    f"covariance: there is no parameter '{name}'{did_you_mean(name, self.names)}"
                )
            if lost := [self.names[k] for k in those if self.names[k] in self.undetermined]:
                raise ModelError(
                    f"covariance: data do not hold {', '.join(lost)}, which stayed near the start value; {self.advice}"
                )
            places += those
        return self._covariance[np.ix_(places, places)]

    @property
    def advice(self) -> str:
        """What to do about numbers that data do not hold."""
        framed = any(set(others) & set(FRAME) for others in self.dependent.values())
        base = ", or measure in the base of the robot, frame='base'" if framed else ""
        return f"leave them out of parameters=, measure other poses, or give prior={{name: deviation}}{base}"

    @property
    def deviations(self) -> dict[str, float]:
        """Standard deviations of the identified numbers by name; inf for what data do not hold."""
        found, lost = np.sqrt(np.diag(self._covariance)), set(self.undetermined)
        return {n: np.inf if n in lost else float(d) for n, d in zip(self.names, found, strict=True)}

    @cached_property
    def _misses(self) -> Array:
        """Measured less predicted places and turns of the held-out poses, (N, 3 or 6), places in the frame measured."""
        data = self.measurements.select(self.held_out)
        missed = replace(self.residuals, data=data, lever=1.0).poses(self.minimum.x)
        missed[:, :3] = missed[:, :3] @ self.residuals.frame(self.minimum.x)[0]
        return missed

    @property
    def error_vectors(self) -> Array:
        """Measured less predicted positions of the held-out poses, (N, 3) in m."""
        return self._misses[:, :3]

    @property
    def errors(self) -> Array:
        """Their lengths, (N,) in m."""
        return np.linalg.norm(self.error_vectors, axis=1)

    @property
    def angle_errors(self) -> Array:
        """Angles between measured and predicted orientations of the held-out poses, (N,) in rad; NaN without R."""
        turns = self._misses[:, 3:]
        return np.linalg.norm(turns, axis=1) if turns.size else np.full(len(turns), np.nan)

    @cached_property
    def stray_rows(self) -> Array:
        """Rows, fitted or held out, that are off by more than noise explains."""
        known = np.union1d(self.rows, self.held_out)
        return known[strays(replace(self.residuals, data=self.measurements.select(known)), self.minimum.x)]

    @property
    def left_out(self) -> Array:
        """Rows that a robust loss leaves without weight: `.error` leaves them out too."""
        return self.stray_rows if self.loss == "robust" else self.held_out[:0]

    @property
    def error(self) -> np.float64:
        """Mean of `errors`, m, without `left_out`, of surer poses by as much more: that to expect of a pose not fitted."""
        return self._mean(self.errors)

    @property
    def angle_error(self) -> np.float64:
        """Mean of `angle_errors`, rad, without `left_out`; NaN where no orientations were measured."""
        return self._mean(self.angle_errors)

    def _mean(self, values: Array) -> np.float64:
        good = ~np.isin(self.held_out, self.left_out)
        return mean_by_worth(values[good], self.measurements.select(self.held_out[good]).certainty)

    @cached_property
    def expected(self) -> Array:
        """The error of the tool to be expected at the fitted poses, by how sure parameters are, (N,) in m."""
        J = self.residuals.slopes(self.minimum.x)[:, :3]
        return np.sqrt(np.einsum("nij,jk,nik->n", J, self._covariance, J))

    def link_errors(self) -> list[tuple[str, Array, Array]]:
        """Of each coordinate its name, the first joint, and what is left of it, (N,) in m each."""
        left = self.residuals.poses(self.minimum.x)[:, :3] * self.residuals.weights[:, None]
        return [
            (f"tool {axis}", self.residuals.data.q[:, 0], e) for axis, e in zip("xyz", left.T, strict=True)
        ]

    def with_findings(self, findings: Sequence[Finding]) -> Self:
        """The same with other findings."""
        return replace(self, findings=tuple(findings))

    def report(self, path: str | Path) -> Path:
        """Write the report as one HTML page to path, and as JSON beside it (.json); returns the path of the page."""
        return write_report(self, Path(path))
