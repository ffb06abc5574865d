"""Calibration of robots with turntables, as the F1, arm by arm. Dressler (2012), section 5.4."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from gantrytau import Model, ModelError
from gantrytau.errors import did_you_mean
from gantrytau_optimica.calibration.arm_fit import NOISE, TAPE, ArmFit, fit_arm, scales, triangle
from gantrytau_optimica.calibration.arm_poses import poses_of
from gantrytau_optimica.calibration.arms import Arm, Orientation, read_arms
from gantrytau_optimica.calibration.calibration import Calibration
from gantrytau_optimica.calibration.covariance import MOVED
from gantrytau_optimica.calibration.findings import CalibrationError, rows_in_words
from gantrytau_optimica.calibration.geometry import Geometry
from gantrytau_optimica.calibration.judging import OUTLIER, check_count, judged
from gantrytau_optimica.calibration.measurements import Measurements
from gantrytau_optimica.calibration.parameters import Named
from gantrytau_optimica.calibration.plausibility import NEAR, check_robot, miss

CLEANINGS = 2  # rounds of fitting without gross errors


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
    parameters hold the quaternion `turntables[k].orientation`, scalar first. Arms are fitted one by one: covariances
    between numbers of different arms are left out, as zeros.
    """

    arm_fits: tuple[ArmFit, ...] = ()
    orientation: Orientation = "local"
    prior: Mapping[str, float] = field(default_factory=dict)

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
        data = self.measurements.select(self.rows)
        found: list[str] = []
        for arm in self.arms:
            scale = scales(arm)
            pulls = [NOISE / _deviation(self.prior, name) for name in arm.names]
            factor = triangle(arm, data.q, data.r, data.R, scale)[:, :-1]
            _, singular, directions = np.linalg.svd(
                np.vstack([factor, np.diag(pulls * scale)]), full_matrices=False
            )
            lost = directions[singular < NOISE / TAPE * (1 - 1e-6)]
            part = np.abs(lost).max(axis=0, initial=0.0)
            found += [n for n, share in zip(arm.names, part, strict=True) if share > MOVED]
        return tuple(found)

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
        ends = np.cumsum([0, *(fit.arm.count for fit in self.arm_fits)])
        found = np.zeros((ends[-1], ends[-1]))
        for first, last, fit in zip(ends[:-1], ends[1:], self.arm_fits, strict=True):
            found[first:last, first:last] = fit.covariance
        return found

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

    def suspicious_rows(self, limit: float) -> np.ndarray:
        """Rows whose closure errors exceed `limit` robust standard deviations."""
        mask = np.zeros(len(self.measurements), dtype=bool)
        mask[self.rows] = mask[self.held_out] = True
        rows = np.flatnonzero(mask)
        data = self.measurements.select(rows)
        return rows[relative_size(self.arm_fits, data) > limit]


def relative_size(fits: Sequence[ArmFit], data: Measurements) -> np.ndarray:
    """The largest closure error of each pose in robust standard deviations of its link, (N,)."""
    sizes = np.abs(np.hstack([fit.arm.closure(data.q, data.r, data.R)[0] for fit in fits]))
    return (sizes / np.maximum(1.4826 * np.median(sizes, axis=0), 1e-12)).max(axis=1)


def _plain(value: np.ndarray) -> Any:
    return float(value) if np.ndim(value) == 0 else list(map(float, value))


def _deviation(prior: Mapping[str, float], name: str) -> float:
    return prior.get(name, prior.get(name.rpartition("[")[0], np.inf))


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
) -> TurningCalibration:
    """`calibrate` for a robot with turntables; rows: usable ones; split: those to be fitted, and those held out."""
    if start == "linear":
        raise ModelError(
            f"calibrate: found start='linear' for {geometry.name}, expected 'nominal'; closure is linear in the "
            "parameters of linear guideways only"
        )
    arms = read_arms(geometry.robot, orientation)
    fitted, held_out = split
    findings = list(measurements.findings)
    check_count(max(arm.count for arm in arms) // 3, fitted, findings)
    data = measurements.select(fitted)

    def misses(q: np.ndarray, r: np.ndarray, R: np.ndarray | None) -> np.ndarray:
        return np.abs(np.hstack([arm.closure(q, r, R)[0] for arm in arms])).max(axis=1)

    check_robot(misses, data.q, data.r, data.R, rows)
    missed = miss(misses, data.q, data.r, data.R)
    if missed > NEAR:
        raise CalibrationError(
            f"Measurements: found {rows_in_words(rows)} in which links miss their nominal lengths by {missed:.3g} m in the "
            f"median, expected {NEAR:g} m at most; give nominal values of this robot, in the frame of the measurements",
            kind="another robot",
            rows=rows,
        )
    own = _prior(arms, prior)
    fits = tuple(_fit(arm, data, own, method, loss) for arm in arms)
    if loss == "robust":  # what Huber's weights leave of gross errors still pulls at what data hardly hold
        for _ in range(CLEANINGS):
            good = relative_size(fits, data) < OUTLIER
            clean = measurements.select(fitted[good])
            fits = tuple(_fit(arm, clean, own, method, loss) for arm in arms)
    found = TurningCalibration(
        geometry, measurements, None, (), fitted, held_out, method, loss, (), fits, orientation, own
    )
    return replace(found, findings=(*findings, *judged(found, misses)))


def _prior(arms: Sequence[Arm], prior: Mapping[str, Any] | None) -> dict[str, float]:
    """Deviations by full names; a key may be the last part of names of all arms. ModelError for unknown names."""
    elements = [name for arm in arms for name in arm.names]
    vectors = list(dict.fromkeys(n.rpartition("[")[0] if n.endswith("]") else n for n in elements))
    found: dict[str, float] = {}
    for key, deviation in (prior or {}).items():
        matches = [n for n in (*vectors, *elements) if n == key or n.rpartition(".")[2] == key]
        if not matches:
            raise ModelError(
                f"calibrate: prior for '{key}', which is not identified{did_you_mean(key, vectors)}"
            )
        if not isinstance(deviation, (int, float)) or not deviation > 0:
            raise ModelError(
                f"calibrate: found the deviation {deviation!r} for '{key}' in prior, expected one number above 0, about the "
                "nominal value"
            )
        found |= dict.fromkeys(matches, float(deviation))
    return found


def _fit(arm: Arm, data: Measurements, prior: Mapping[str, float], method: str, loss: str) -> ArmFit:
    if method == "ipopt":
        if prior or loss != "linear":
            raise ModelError(
                "calibrate: found method='ipopt' with a prior or a robust loss for a robot with turntables, expected "
                "neither; take method='gauss-newton'"
            )
        from gantrytau_optimica.calibration.arm_ipopt import fit_arm_with_ipopt

        return fit_arm_with_ipopt(arm, data.q, data.r, data.R)
    names = {*arm.names, *(n.rpartition("[")[0] for n in arm.names)}
    own = {name: deviation for name, deviation in prior.items() if name in names}
    return fit_arm(arm, data.q, data.r, data.R, prior=own, loss=loss)
