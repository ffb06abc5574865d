"""Calibration of robots on rods: parameters, standard deviations, errors at held-out poses."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from gantrytau.kinematics.rotations import mean_rotation, rotation_vector
from gantrytau_optimica.calibration.data.measurements import Measurements, thinned
from gantrytau_optimica.calibration.data.row_sets import rows_of
from gantrytau_optimica.calibration.diagnostics.device_frames import Motion
from gantrytau_optimica.calibration.diagnostics.fitted_numbers import FittedNumbers
from gantrytau_optimica.calibration.diagnostics.link_systems import LinkSystem, closure_series, link_systems
from gantrytau_optimica.calibration.diagnostics.outliers import Suspicion, suspicion
from gantrytau_optimica.calibration.diagnostics.plausibility import Misses
from gantrytau_optimica.calibration.diagnostics.row_effects import ENDS
from gantrytau_optimica.calibration.fitting.constraints import ParameterConstraint
from gantrytau_optimica.calibration.fitting.covariance import as_told, joint_covariance, link_noise
from gantrytau_optimica.calibration.fitting.named_parameters import (
    Named,
    calibrated_arms,
    named_parameters,
    rod_links,
)
from gantrytau_optimica.calibration.fitting.rod_fit import Fit
from gantrytau_optimica.calibration.links.arm_closure import ArmClosure
from gantrytau_optimica.calibration.links.arm_poses import ArmKinematics
from gantrytau_optimica.calibration.links.forward import CalibratedKinematics
from gantrytau_optimica.calibration.links.nominal_rods import NominalRods
from gantrytau_optimica.fitting.diagnostics import ResidualSeries
from gantrytau_optimica.fitting.least_squares import Minimum


@dataclass(frozen=True, eq=False, kw_only=True)
class FittedRods(FittedNumbers):
    """Rods of a robot at their minima.

    nominal_rods: the robot as it was given; model, orientation: as they were asked for; fits: links that share numbers, at
    their minima; nominal: how nominal values in the frame of the measurements miss them, None if they were not used; motion:
    from the frame of the measurements to the base of the robot, None where they are the same or nothing is known of it;
    constraints: that numbers keep.
    """

    nominal_rods: NominalRods
    fits: tuple[Fit, ...]
    orientation: str = "local"
    nominal: Misses | None = None
    motion: Motion | None = None
    constraints: tuple[ParameterConstraint, ...] = ()

    __repr__ = FittedNumbers.__repr__

    def without_strays(self) -> Self:
        """The same by the rows that close as others do, for what is judged beside wrong ones; with all where these are so
        many that they may have a cause.
        """
        bad = self.stray_rows
        if not 0 < bad.size < ENDS or self.loss == "robust":
            return self
        rows, held_out = (np.setdiff1d(each, bad) for each in (self.rows, self.held_out))
        return replace(self, fits=self.suspicion.fits, rows=rows, held_out=held_out)

    def measured_by(self, motion: Motion) -> Self:
        """This calibration of measurements moved into their frame."""
        return self._kept(replace(self, motion=motion), "motion", "parameters")

    @cached_property
    def parameters(self) -> Mapping[str, Any]:
        """Values by name: `arms[i].length`, `.offset`, `.direction`; of six links `arms[i].links[j].length`, `.offset`,
        `.plate_offset`; of measured guideways `.frame_offset` and `.frame_rotation` (a rotation vector); of turntables
        `turntables[k].orientation`, a quaternion, scalar first, whose rotation has the deviations.

        Of a fitted frame also `frame.R`, (3, 3), and `frame.t`, (3,) in m, base = R measured + t, 1 and 0 where poses lie as
        nominal values say; they are no parameters of the robot, and not listed.
        """
        return Named(named_parameters(self.nominal_rods, self.fits), self._frame())

    def _frame(self) -> dict[str, np.ndarray]:
        if self.frame == "base":
            return {}
        motion = self.motion or Motion(np.eye(3), np.zeros(3))
        return {"frame.R": motion.rotation, "frame.t": motion.translation}

    @property
    def robot_name(self) -> str:
        return self.nominal_rods.name

    @property
    def nominal_values(self) -> Mapping[str, Any]:
        """Nominal values of the parameters."""
        return self.nominal_rods.values

    @property
    def arms(self) -> tuple[ArmClosure, ...]:
        """Arms on turntables with their identified numbers."""
        return tuple(calibrated_arms(self.fits))

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(name for fit in self.fits for name in fit.free_names)

    @cached_property
    def undetermined(self) -> tuple[str, ...]:
        lost = [fit.minimum.undetermined(fit.free_names, as_told(fit)) for fit in self.fits]
        return tuple(name for names in lost for name in names)

    @property
    def minima(self) -> tuple[Minimum, ...]:
        """Minima of the fits."""
        return tuple(fit.minimum for fit in self.fits)

    def undetermined_part(self, name: str) -> bool:
        """Whether data do not hold a number, or an element of a vector."""
        return any(lost == name or lost.rpartition("[")[0] == name for lost in self.undetermined)

    @property
    def cost(self) -> float:
        """Sum of the squares of all closure errors |y|^2 - L^2 of the fitted poses, m4."""
        return float(sum(np.sum(fit.group.squares(fit.x)) for fit in self.fits))

    @cached_property
    def noise(self) -> float:
        """Standard deviation of one coordinate of a measured position that explains what is left, m; of one of median
        covariance where measurements say how sure each is.
        """
        found = link_noise(self.fits, self.loss, self._fitted.spreads, self._fitted.shared)
        return float(np.sqrt(np.mean(np.concatenate(found) ** 2)))

    @property
    def _fitted(self) -> Measurements:
        return self.measurements.select(self.rows)

    @cached_property
    def _covariance(self) -> np.ndarray:
        return joint_covariance(self.fits, self.loss, self._fitted.spreads, self._fitted.shared)

    @property
    def advice(self) -> str:
        return (
            f"{'turn the plate more between' if self.plate_turns else 'measure more'} poses, or give a prior"
        )

    @cached_property
    def chains(self) -> CalibratedKinematics | ArmKinematics:
        """Kinematics of the calibrated links as they were fitted, of models 2 to 5 and quaternions of any length too."""
        few = self.rows[np.linspace(0, len(self.rows) - 1, min(len(self.rows), 500)).astype(int)]
        r, R = self.measurements.r[few], self.measurements.R
        middle = few[np.argmin(np.linalg.norm(r - np.median(r, axis=0), axis=1))]
        start = self.measurements.r[middle]
        if arms := self.arms:
            return ArmKinematics(arms, start, np.eye(3) if R is None else R[middle])
        turns = sum(len(fit.group.chains) for fit in self.fits) > 3
        pose = np.eye(3) if R is None else R[middle] if turns else mean_rotation(R[few])
        return CalibratedKinematics(rod_links(self.fits), start, pose)

    @cached_property
    def error_vectors(self) -> np.ndarray:
        return self._held_out.r - self._predicted[0]

    @cached_property
    def _held_out(self) -> Measurements:
        return self.measurements.select(self.held_out)

    @cached_property
    def _predicted(self) -> tuple[np.ndarray, np.ndarray]:
        q, r, R = self._held_out.q, self._held_out.r, self._held_out.R
        return self.chains.fk(q, (r, R) if self.chains.turns and R is not None else r)

    @cached_property
    def stray_rows(self) -> np.ndarray:
        return self.suspicion.rows

    @cached_property
    def angle_errors(self) -> np.ndarray:
        R = self.measurements.R
        if R is None:
            return np.full(len(self.held_out), np.nan)
        turned = np.einsum("nji,njk->nik", self._predicted[1], R[self.held_out])
        return np.linalg.norm(rotation_vector(turned), axis=1)

    @property
    def plate_turns(self) -> bool:
        """Whether the links hold the orientation of the plate."""
        return any(link.R is not None for fit in self.fits for link in fit.group.chains)

    def link_errors(self) -> list[tuple[str, np.ndarray, np.ndarray]]:
        """Of each link its name, positions of its cart (N,) in m, and how far it is from its length (N,) in m, of surer
        poses by as much more.
        """
        found, sure = [], self._fitted.certainty
        for fit in self.fits:
            for chain, e in zip(fit.group.chains, fit.distances().T, strict=True):
                found.append((chain.name, chain.q, e if sure is None else e * sure))
        return found

    def residual_series(self) -> list[ResidualSeries]:
        return closure_series(self.fits, self._fitted, self.rows)

    @cached_property
    def suspicion(self) -> Suspicion:
        """Rows that close worse than noise explains, seen by a fit without them."""
        return suspicion(self.fits, self.measurements, self.rows, self.held_out, self.nominal)

    def systems(self, most: int) -> tuple[np.ndarray, list[LinkSystem]]:
        """Rows that were fitted or held out, at most so many, evenly spread, and their closure errors with all derivatives;
        without those that a robust loss left without weight.
        """
        used = rows_of(self.rows, self.held_out, without=self.left_out)
        rows = used[thinned(len(used), most)]
        return rows, link_systems(self.fits, self.measurements.select(rows))
