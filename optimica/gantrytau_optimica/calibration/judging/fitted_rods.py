"""What a fit of rods found: parameters, how sure they are, and how well they predict poses that were held out."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from gantrytau import ModelError
from gantrytau.describing.record import Record
from gantrytau.errors import did_you_mean
from gantrytau.kinematics.rotations import mean_rotation, rotation_vector
from gantrytau_optimica.calibration.data.measurements import Measurements, thinned
from gantrytau_optimica.calibration.data.row_sets import rows_of
from gantrytau_optimica.calibration.fitting.constraints import ParameterConstraint
from gantrytau_optimica.calibration.fitting.covariance import joint_covariance, link_noise, undetermined
from gantrytau_optimica.calibration.fitting.named_parameters import (
    Named,
    calibrated_arms,
    named_parameters,
    rod_links,
)
from gantrytau_optimica.calibration.fitting.rod_fit import Fit
from gantrytau_optimica.calibration.judging.device_frames import Motion
from gantrytau_optimica.calibration.judging.link_systems import LinkSystem, link_systems
from gantrytau_optimica.calibration.judging.order_effects import ENDS
from gantrytau_optimica.calibration.judging.plausibility import Misses
from gantrytau_optimica.calibration.judging.suspicion import Suspicion, suspicion
from gantrytau_optimica.calibration.rods.arm_closure import ArmClosure
from gantrytau_optimica.calibration.rods.arm_kinematics import ArmKinematics
from gantrytau_optimica.calibration.rods.error_models import COMMON
from gantrytau_optimica.calibration.rods.forward import CalibratedKinematics
from gantrytau_optimica.calibration.rods.nominal_rods import NominalRods
from gantrytau_optimica.fitting.finding import Finding


@dataclass(frozen=True, eq=False)
class FittedRods(Record):
    """Rods of a robot at their minima.

    nominal_rods: the robot as it was given; model, method, loss, orientation: as they were asked for; fits: links that share
    numbers, at their minima; rows: those of the measurements that were fitted; held_out: those that validate; findings:
    what was noticed on the way; nominal: how nominal values in the frame of the measurements miss them, None if they were
    not used; frame: as it was asked for; motion: from the frame of the measurements to the base of the robot, None where
    they are the same or nothing is known of it; constraints: that numbers keep.
    """

    nominal_rods: NominalRods
    measurements: Measurements
    model: Any
    fits: tuple[Fit, ...]
    rows: np.ndarray
    held_out: np.ndarray
    method: str
    loss: str
    orientation: str = "local"
    findings: tuple[Finding, ...] = ()
    nominal: Misses | None = None
    frame: str = "fitted"
    motion: Motion | None = None
    constraints: tuple[ParameterConstraint, ...] = ()

    def __repr__(self) -> str:
        return (
            f"<Calibration of {self.nominal_rods.name}, model {self.model}: {len(self.names)} numbers from "
            f"{len(self.rows)} poses, {self.error * 1e6:.3g} um in the mean of {len(self.held_out)} held out>"
        )

    def without_strays(self) -> Self:
        """The same by the rows that close as others do, for what is judged beside wrong ones; with all where these are so
        many that they may have a cause.
        """
        bad = self.suspicion.rows
        if not 0 < bad.size < ENDS or self.loss == "robust":
            return self
        rows, held_out = (np.setdiff1d(each, bad) for each in (self.rows, self.held_out))
        return replace(self, fits=self.suspicion.fits, rows=rows, held_out=held_out)

    def with_findings(self, findings: Sequence[Finding]) -> Self:
        """The same with other findings, without working anything out anew."""
        return self._kept(replace(self, findings=tuple(findings)), "findings")

    def measured_by(self, motion: Motion) -> Self:
        """The same of measurements that a motion laid into their frame."""
        return self._kept(replace(self, motion=motion), "motion", "parameters")

    def _kept(self, found: Self, *others: str) -> Self:
        """What was worked out already, but for some names, is that of another record too."""
        found.__dict__.update({name: value for name, value in self.__dict__.items() if name not in others})
        return found

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
        """What the robot is called."""
        return self.nominal_rods.name

    @property
    def nominal_values(self) -> Mapping[str, Any]:
        """What parameters were before."""
        return self.nominal_rods.values

    @property
    def arms(self) -> tuple[ArmClosure, ...]:
        """Arms on turntables with their identified numbers."""
        return tuple(calibrated_arms(self.fits))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the identified numbers, scalars."""
        return tuple(name for fit in self.fits for name in fit.free_names)

    @cached_property
    def undetermined(self) -> tuple[str, ...]:
        """Names of numbers that data do not hold: they stayed near their start values."""
        return tuple(name for fit in self.fits for name in undetermined(fit))

    @property
    def rank(self) -> int:
        """How many combinations of the identified numbers data hold."""
        return sum(fit.minimum.rank for fit in self.fits)

    def undetermined_part(self, name: str) -> bool:
        """Whether data do not hold a number, or an element of a vector."""
        return any(lost == name or lost.rpartition("[")[0] == name for lost in self.undetermined)

    @property
    def success(self) -> bool:
        """Whether the last step of every group of links was negligible."""
        return all(fit.minimum.success for fit in self.fits)

    @property
    def iterations(self) -> int:
        """Steps, the most of any group of links."""
        return max(fit.minimum.iterations for fit in self.fits)

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

    def covariance(self, names: Sequence[str] | None = None) -> np.ndarray:
        """Covariance (k, k) of parameters in their order; a vector's name stands for its three elements.

        names: default all that data hold. Links share the noise of a position, so that numbers of different arms vary
        together. Raises ModelError for unknown names and for numbers that data do not hold.
        """
        if isinstance(names, str):
            raise ModelError(f"covariance: found '{names}', expected a list of names; write ['{names}']")
        wanted = [n for n in self.names if n not in self.undetermined] if names is None else names
        places = [k for name in wanted for k in self._places(name)]
        return self._covariance[np.ix_(places, places)]

    def _places(self, name: str) -> list[int]:
        aliases = [name, *self._common(name)]
        for alias in aliases:
            wanted = [n for n in self.names if n == alias or n.rpartition("[")[0] == alias]
            if wanted:
                lost = [n for n in wanted if n in self.undetermined]
                if lost:
                    advice = "turn the plate more between" if self.plate_turns else "measure more"
                    raise ModelError(
                        f"covariance: data do not hold {', '.join(lost)}, which stayed near the start value; {advice} "
                        "poses, or give a prior"
                    )
                return [self.names.index(n) for n in wanted]
        if name in self._frame():
            raise ModelError(f"covariance: {name} follows from nominal values alone; leave it out")
        if name in self.parameters:
            raise ModelError(f"covariance: {name} was not identified but held at its value; leave it out")
        raise ModelError(f"covariance: there is no parameter '{name}'{did_you_mean(name, self.parameters)}")

    def _common(self, name: str) -> list[str]:
        """What a direction of an arm is called that is that of all."""
        found = [
            COMMON + name[len(a.direction) :] for a in self.nominal_rods.arms if name.startswith(a.direction)
        ]
        return found[:1]

    @property
    def deviations(self) -> dict[str, float]:
        """Standard deviations of the identified numbers by name; inf for what data do not hold."""
        found = np.sqrt(np.diag(self._covariance))
        lost = set(self.undetermined)
        return {n: float("inf") if n in lost else float(d) for n, d in zip(self.names, found, strict=True)}

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
        """Measured less predicted positions of the held-out poses, (N, 3) in m."""
        return self._held_out.r - self._predicted[0]

    @cached_property
    def _held_out(self) -> Measurements:
        return self.measurements.select(self.held_out)

    @cached_property
    def _predicted(self) -> tuple[np.ndarray, np.ndarray]:
        q, r, R = self._held_out.q, self._held_out.r, self._held_out.R
        return self.chains.fk(q, (r, R) if self.chains.turns and R is not None else r)

    @cached_property
    def errors(self) -> np.ndarray:
        """Distances of measured and predicted positions of the held-out poses (5.5), (N,) in m."""
        return np.sqrt(np.einsum("ij,ij->i", self.error_vectors, self.error_vectors))

    @cached_property
    def left_out(self) -> np.ndarray:
        """Rows that a robust loss leaves without weight, as findings say: `.error` and `.angle_error` leave them out too."""
        return self.suspicion.rows if self.loss == "robust" else self.held_out[:0]

    @property
    def error(self) -> np.float64:
        """Mean of `errors`, m, without `left_out`: the error to expect of a pose that was not fitted. Poses that were told
        to be surer count by the squares of their certainty.
        """
        return self._mean(self.errors)

    @cached_property
    def angle_errors(self) -> np.ndarray:
        """Angles between measured and predicted orientations of the held-out poses, (N,) in rad; NaN without R."""
        R = self.measurements.R
        if R is None:
            return np.full(len(self.held_out), np.nan)
        turned = np.einsum("nji,njk->nik", self._predicted[1], R[self.held_out])
        return np.linalg.norm(rotation_vector(turned), axis=1)

    @property
    def angle_error(self) -> np.float64:
        """Mean of `angle_errors`, rad, without `left_out`; NaN where no orientations were measured."""
        return self._mean(self.angle_errors)

    def _mean(self, values: np.ndarray) -> np.float64:
        good = ~np.isin(self.held_out, self.left_out)
        return mean_by_worth(values[good], self._held_out.select(good).certainty)

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


def mean_by_worth(values: np.ndarray, certainty: np.ndarray | None) -> np.float64:
    """The mean of what is finite, NaN of nothing, by the squares of the certainty of each where it is known."""
    finite = np.isfinite(values)
    if not finite.any():
        return np.float64(np.nan)
    if certainty is None:
        return np.float64(values[finite].mean())
    return np.float64(np.average(values[finite], weights=certainty[finite] ** 2))
