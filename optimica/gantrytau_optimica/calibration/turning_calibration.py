"""Calibration of robots with turntables, as the F1, arm by arm. Dressler (2012), section 5.4."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from gantrytau import Model, ModelError
from gantrytau_optimica.calibration.calibration import Calibration
from gantrytau_optimica.calibration.data.findings import CalibrationError, Finding, rows_in_words
from gantrytau_optimica.calibration.data.measurements import Measurements
from gantrytau_optimica.calibration.fitting.arm_covariance import arms_covariance, held_directions
from gantrytau_optimica.calibration.fitting.arm_fit import NOISE, TAPE, ArmFit, scales
from gantrytau_optimica.calibration.fitting.arm_policy import Policy, check_constraints, fit_arms, full_prior
from gantrytau_optimica.calibration.fitting.covariance import MOVED
from gantrytau_optimica.calibration.judging.plausibility import NEAR, Misses, check_robot, miss
from gantrytau_optimica.calibration.judging.suspicion import (
    KEPT,
    LEAST,
    OUTLIER,
    Suspicion,
    far_rows,
    limit,
    standardised,
)
from gantrytau_optimica.calibration.judging.verdicts import check_count, in_words, judged
from gantrytau_optimica.calibration.rods.arm_frames import frame_of, moved_arms
from gantrytau_optimica.calibration.rods.arm_poses import poses_of
from gantrytau_optimica.calibration.rods.arms import Arm, Orientation, read_arms
from gantrytau_optimica.calibration.rods.named_parameters import Named
from gantrytau_optimica.calibration.rods.nominal_geometry import Geometry

CLEANINGS = 5  # rounds of fitting without gross errors
KEPT_AT_ALL = 0.4  # of the poses, that a robust fit must leave
STEP = 1e-5  # m or rad, of differences by an actuator


class ArmKinematics:
    """Forward kinematics of calibrated arms, also of quaternions that are not unit: `fk(q, near)` by Newton."""

    def __init__(self, arms: Sequence[Arm], r: np.ndarray, R: np.ndarray):
        self.arms = tuple(arms)
        self._r, self._R = r, R

    def fk(self, q: Any, near: Any = None) -> tuple[np.ndarray, np.ndarray]:
        """Positions (N, 3) and orientations (N, 3, 3) for actuator positions (N, 6), from poses (r, R) near by.

        near: by default a measured pose. NaN where links do not close.
        """
        q = np.asarray(q, dtype=float)
        single, q = q.ndim == 1, np.atleast_2d(q)
        r, R = near if near is not None else (self._r, self._R)
        r, R = np.broadcast_to(r, (len(q), 3)), np.broadcast_to(R, (len(q), 3, 3))
        found, turned = poses_of(self.arms, q, r, R, all_of_them=False)
        turned = np.asarray(turned)
        return (found[0], turned[0]) if single else (found, turned)


@dataclass(frozen=True, eq=False)
class TurningCalibration(Calibration):
    """A calibrated robot with turntables; `fits` are those of its arms.

    orientation: how quaternions were free. Rotations `turntables[k].rotation` of "local" have deviations in rad, and
    parameters hold the quaternion `turntables[k].orientation`, scalar first.
    """

    arm_fits: tuple[ArmFit, ...] = ()
    orientation: Orientation = "local"
    prior: Mapping[str, float] = field(default_factory=dict)
    used: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))  # rows that a robust loss left
    start: tuple[Arm, ...] = ()  # in the frame of the measurements

    @property
    def arms(self) -> tuple[Arm, ...]:
        """The arms with their identified numbers."""
        return tuple(fit.arm for fit in self.arm_fits)

    @cached_property
    def parameters(self) -> Mapping[str, Any]:
        """Values by name, of arms, links and turntables: `turntables[k].orientation` is a quaternion, scalar first."""
        found = {}
        for arm in self.arms:
            for name in arm.free:
                value = arm.values[name]
                found[name] = float(value) if np.ndim(value) == 0 else np.array(value)
        return Named(found)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the identified numbers, scalars."""
        return tuple(name for arm in self.arms for name in arm.names)

    @cached_property
    def undetermined(self) -> tuple[str, ...]:
        """Names of numbers that data do not hold: they stayed near their start values."""
        data = self.measurements.select(self.used)
        found: list[str] = []
        for arm in self.arms:
            _, directions, held = held_directions(arm, data, self.prior)
            part = np.abs(directions[~held]).max(axis=0, initial=0.0)
            found += [n for n, share in zip(arm.names, part, strict=True) if share > MOVED]
        return tuple(found)

    @property
    def rank(self) -> int:
        """How many combinations of the identified numbers data hold."""
        return sum(fit.rank for fit in self.arm_fits)

    @property
    def success(self) -> bool:
        """Whether the last step of every arm was negligible."""
        return all(fit.success for fit in self.arm_fits)

    @property
    def iterations(self) -> int:
        """Steps, the most of any arm."""
        return max(fit.iterations for fit in self.arm_fits)

    @property
    def cost(self) -> float:
        """Sum of the squares of all closure errors |y|^2 - L^2 of the fitted poses, m4."""
        return float(sum(np.sum((2 * fit.arm.lengths * fit.residuals) ** 2) for fit in self.arm_fits))

    @cached_property
    def noise(self) -> float:
        """Standard deviation of a closure error, about that of one measured coordinate, m."""
        return float(np.sqrt(np.mean([fit.deviation**2 for fit in self.arm_fits])))

    @cached_property
    def _covariance(self) -> np.ndarray:
        return arms_covariance(self.arms, self.measurements.select(self.used), self.prior)

    @cached_property
    def chains(self) -> Any:
        """Forward kinematics of the calibrated arms."""
        R = self.measurements.R
        assert R is not None
        middle = self.rows[len(self.rows) // 2]
        return ArmKinematics(self.arms, self.measurements.r[middle], R[middle])

    @cached_property
    def kinematics(self) -> Any:
        """`Kinematics` of the calibrated robot; with orientation="free" `chains`, which has `.fk` only."""
        if self.orientation == "free":
            return self.chains
        return super().kinematics

    @cached_property
    def robot(self) -> Model:
        """The robot with the identified parameters. Raises ModelError for quaternions that are not unit."""
        if self.orientation == "free":
            raise ModelError(
                "robot: found orientation='free', whose quaternions turn no rigid turntable, expected 'local' or 'unit'; "
                "calibrate with one of these, or use .kinematics"
            )
        values = {name: value for arm in self.arms for name, value in arm.values.items()}
        arms = []
        for arm, nominal in zip(self.arms, self.geometry.arms, strict=True):
            links = [
                {key: _plain(values[f"{link}.{key}"]) for key in ("length", "offset", "plate_offset")}
                for link in (one.name for one in nominal.links)
            ]
            own = {key: _plain(values[f"{arm.name}.{key}"]) for key in ("offset", "direction")}
            arms.append(dict(own, links=links))
        turntables = []
        for k in range(self.geometry.turntables):
            u = values[f"turntables[{k}].orientation"]
            turntables.append(
                dict(
                    offset=_plain(values[f"turntables[{k}].offset"]), orientation=list(u / np.linalg.norm(u))
                )
            )
        return self.geometry.robot.modified(dict(arms=arms, turntables=turntables))

    @cached_property
    def _predicted(self) -> tuple[np.ndarray, np.ndarray]:
        data = self._held_out
        return self.chains.fk(data.q, (data.r, data.R))

    @property
    def plate_turns(self) -> bool:
        """Whether the links hold the orientation of the plate."""
        return True

    def link_errors(self) -> list[tuple[str, np.ndarray, np.ndarray]]:
        """Of each link its name, positions of its cart (N,) in m, and its closure error (N,) in m."""
        data = self.measurements.select(self.rows)
        return [
            (name, data.q[:, arm.cart], e)
            for arm in self.arms
            for name, e in zip(arm.links, arm.closure(data.q, data.r, data.R)[0].T, strict=True)
        ]

    @cached_property
    def suspicion(self) -> Suspicion:
        """Rows that close worse than noise explains, seen by a fit without them."""
        mask = np.zeros(len(self.measurements), dtype=bool)
        mask[self.rows] = mask[self.held_out] = True
        every = np.flatnonzero(mask)
        data, arms, used, bad, typical = (
            self.measurements.select(every),
            self.arms,
            self.used,
            every[:0],
            np.inf,
        )
        if (coarse := far_rows(self, every)).size:
            used = np.setdiff1d(used, coarse)
            clean = self.measurements.select(used)
            arms = tuple(fit.arm for fit in fit_arms(self.start, clean, Policy(prior=self.prior)))
        for _ in range(CLEANINGS):
            sizes, typical = relative_size(arms, data, np.isin(every, used), self.prior)
            fresh = every[sizes > _limit(arms, used)]
            if np.array_equal(fresh, bad):
                break
            bad, good = fresh, np.setdiff1d(self.rows, fresh)
            if len(good) < KEPT * len(self.rows):
                break
            if not np.array_equal(good, used):
                used, clean = good, self.measurements.select(good)
                arms = tuple(fit.arm for fit in fit_arms(arms, clean, Policy(prior=self.prior)))
        return Suspicion(bad, misses_of_arms(arms), typical)

    def systems(self, few: np.ndarray) -> Iterator[tuple[int, np.ndarray, np.ndarray, np.ndarray]]:
        """As of a Calibration, of carts and turntables."""
        rows = self.rows[few]
        data = self.measurements.select(rows)
        weights = np.isin(rows, self.used).astype(float)[:, None]
        for arm in self.arms:
            errors, jacobian = arm.closure(data.q, data.r, data.R)
            _, directions, held = held_directions(arm, data, self.prior)
            jacobian = (jacobian * scales(arm)) @ directions[held].T
            for column in (arm.cart, *(table.column for table in arm.turntables)):
                step = STEP * (np.arange(data.q.shape[1]) == column)
                ends = [arm.closure(data.q + s * step, data.r, data.R)[0] for s in (1.0, -1.0)]
                slopes = (ends[0] - ends[1]) / (2 * STEP)
                yield column, weights * errors, weights[:, :, None] * jacobian, weights * slopes


def misses_of_arms(arms: Sequence[Arm]) -> Misses:
    """How far links of arms are from their lengths."""

    def misses(q: np.ndarray, r: np.ndarray, R: np.ndarray | None) -> np.ndarray:
        return np.abs(np.hstack([arm.closure(q, r, R)[0] for arm in arms])).max(axis=1)

    return misses


def _limit(arms: Sequence[Arm], used: np.ndarray) -> float:
    return limit(len(used) - max(arm.count / len(arm.links) for arm in arms))


def relative_size(
    arms: Sequence[Arm], data: Measurements, fitted: np.ndarray, prior: Mapping[str, float]
) -> tuple[np.ndarray, float]:
    """The largest closure error of each pose in robust standard deviations of its link, (N,), and the worst of these.

    fitted: which of the poses were, (N,); the others may be worse, as `suspicion.py` says.
    """
    errors, spread = [], []
    there = data.select(np.flatnonzero(fitted))
    for arm in arms:
        e, J = arm.closure(data.q, data.r, data.R)
        singular, directions, held = held_directions(arm, there, prior)
        along = (J * scales(arm)) @ directions.T
        h = np.sum((along[:, :, held] / singular[held]) ** 2, axis=2)
        other = np.sum((along[:, :, ~held] * (TAPE / NOISE)) ** 2, axis=2)
        squares = np.where(fitted[:, None], np.maximum(1 - h, LEAST), 1 + h + other)
        errors.append(e)
        spread.append(np.sqrt(squares))
    return standardised(np.hstack(errors).T, np.hstack(spread).T)


def _plain(value: np.ndarray) -> Any:
    return float(value) if np.ndim(value) == 0 else list(map(float, value))


def calibrate_turning(
    geometry: Geometry,
    measurements: Measurements,
    rows: np.ndarray,
    split: tuple[np.ndarray, np.ndarray],
    *,
    method: str,
    start: str,
    orientation: Any,
    prior: Mapping[str, Any] | None,
    loss: str,
    constraints: Mapping[str, Any] | None,
) -> TurningCalibration:
    """`calibrate` for a robot with turntables; rows: usable ones; split: those to be fitted, and those held out."""
    if start == "linear":
        raise ModelError(
            f"calibrate: found start='linear' for {geometry.name}, expected 'nominal'; closure is linear in the "
            "parameters of linear guideways only",
            argument="start",
        )
    arms = read_arms(geometry.robot, orientation, values=geometry.values)
    fitted, held_out = split
    findings = list(measurements.findings)
    check_count(max(arm.count for arm in arms) // 3, fitted, findings)
    data = measurements.select(fitted)

    check_robot(geometry, misses_of_arms(arms), data.q, data.r, data.R, rows)
    arms, more = _in_frame(geometry, arms, data, rows)
    own = full_prior(arms, prior)
    policy = Policy(method, own, loss, constraints)
    check_constraints(arms, constraints)
    used = _plausible(arms, data, fitted) if loss == "robust" else fitted
    fits = fit_arms(arms, measurements.select(used), policy)
    if loss == "robust":  # what Huber's weights leave of gross errors still pulls at what data hardly hold
        for _ in range(CLEANINGS):
            now = tuple(fit.arm for fit in fits)
            sizes, _ = relative_size(now, data, np.isin(fitted, used), own)
            good = fitted[sizes < _limit(now, used)]
            if np.array_equal(good, used) or len(good) < KEPT_AT_ALL * len(fitted):
                break
            used, fits = good, fit_arms(arms, measurements.select(good), policy)
    found = TurningCalibration(
        geometry,
        measurements,
        None,
        (),
        fitted,
        held_out,
        method,
        loss,
        (),
        misses_of_arms(arms),
        fits,
        orientation,
        own,
        used,
        arms,
    )
    return found.with_findings([*findings, *more, *judged(found)])


def _in_frame(
    geometry: Geometry, arms: tuple[Arm, ...], data: Measurements, rows: np.ndarray
) -> tuple[tuple[Arm, ...], list[Finding]]:
    """Arms in the frame of the measurements; CalibrationError for another robot."""
    missed = miss(misses_of_arms(arms), data.q, data.r, data.R)
    if missed < NEAR:
        return arms, []
    fitting = frame_of(geometry.robot, misses_of_arms(arms), data)
    if fitting is not None:
        there = moved_arms(arms, fitting.turn, fitting.shift)
        if (left := miss(misses_of_arms(there), data.q, data.r, data.R)) < NEAR:
            return there, [in_words(fitting, rows)]
        missed = min(missed, left)
    raise CalibrationError(
        f"Measurements: found {rows_in_words(rows)} in which links miss their nominal lengths by {missed:.3g} m in the "
        f"median however the frame is placed, expected {NEAR:g} m at most; these are measurements of another robot, or its "
        "nominal values are wrong",
        kind="another robot",
        rows=rows,
    )


def _plausible(arms: Sequence[Arm], data: Measurements, fitted: np.ndarray) -> np.ndarray:
    """The rows that nominal values miss no worse than some times the median: where a robust fit begins."""
    missed = misses_of_arms(arms)(data.q, data.r, data.R)
    return fitted[missed < max(OUTLIER * float(np.median(missed)), OUTLIER * NOISE)]
