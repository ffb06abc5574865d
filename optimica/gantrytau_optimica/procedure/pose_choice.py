"""Which candidates to measure, and what error of the tool is to be expected afterwards."""

from dataclasses import dataclass

import numpy as np

from gantrytau.describing.record import Record
from gantrytau_optimica.calibration.design.identifiability import PoseArrays
from gantrytau_optimica.calibration.design.pose_selection import Prediction, predict, select_poses
from gantrytau_optimica.calibration.devices.devices import Device
from gantrytau_optimica.calibration.links.arm_factors import scales
from gantrytau_optimica.procedure.candidates import Candidates
from gantrytau_optimica.procedure.plan_goal import PlanGoal
from gantrytau_optimica.procedure.robot_samples import Fleet

READINGS = 30  # of a device without a covariance of its own, from which its noise is estimated
CRITERION = (
    "D-optimal exchange; expected error from the covariance of the tool over the workspace. Observability index: Nahvi and "
    "Hollerbach's sigma_min / cond = sigma_min^2 / sigma_max of the scaled Jacobian (the larger the better), the reading of "
    "(5.14) in Dressler (2012) that is meant, as its printed form contradicts itself"
)


@dataclass(frozen=True, eq=False)
class PoseChoice(Record):
    """Chosen rows of the candidates (n,), and what they promise.

    position: expected standard deviations of the tool over the workspace, (k,) in m; angle: the same in rad; noise,
    noise_angle: of the device per axis at these poses, m and rad; condition, observability: of the identification
    Jacobian, scaled so that all unknowns move joints by metres, without the directions that the tape measure knows better.
    """

    rows: np.ndarray
    position: np.ndarray
    angle: np.ndarray
    noise: float
    noise_angle: float
    condition: float
    observability: float

    @property
    def error(self) -> float:
        """Mean of `position`, m."""
        return float(self.position.mean())


def choose(
    fleet: Fleet,
    candidates: Candidates,
    device: Device,
    allowed: np.ndarray,
    asked: PlanGoal,
) -> PoseChoice:
    """Choose as many poses as asked for among the rows `allowed` of the candidates, or all of these if they are fewer."""
    data = poses_of(fleet, candidates, allowed)
    found = allowed[select_poses(fleet.robot, data, min(asked.poses, len(allowed)), seed=asked.seed)]
    return judge(fleet, candidates, device, found, tape=asked.tape)


def judge(
    fleet: Fleet, candidates: Candidates, device: Device, rows: np.ndarray, *, tape: float
) -> PoseChoice:
    """What some rows of the candidates promise."""
    noise = device_noise(device, candidates.r[rows], candidates.R[rows])
    expected = expected_error(fleet, candidates, rows, noise=noise, tape=tape)
    held = max(noise[0], 1e-9) / tape
    condition, index = observability(fleet, poses_of(fleet, candidates, rows), held)
    return PoseChoice(rows, expected.position, expected.angle, *noise, condition, index)


def expected_error(
    fleet: Fleet, candidates: Candidates, rows: np.ndarray, *, noise: tuple[float, float], tape: float
) -> Prediction:
    """Predicted covariance of the tool over the workspace after measuring some candidates."""
    at = PoseArrays(candidates.at_q, candidates.at_r, candidates.at_R if fleet.nominal.turns else None)
    data = poses_of(fleet, candidates, rows)
    return predict(fleet.robot, data, at=at, noise=max(noise[0], 1e-9), angle=noise[1], tape=tape)


def poses_of(fleet: Fleet, candidates: Candidates, rows: np.ndarray) -> PoseArrays:
    """Some candidates as poses, without R where the plate cannot turn."""
    return PoseArrays(
        candidates.q[rows], candidates.r[rows], candidates.R[rows] if fleet.nominal.turns else None
    )


def device_noise(device: Device, r: np.ndarray, R: np.ndarray) -> tuple[float, float]:
    """Standard deviation per axis of what a device reads at poses, m and rad (0 without orientations), root mean squares."""
    if hasattr(device, "covariance"):
        variances = np.diagonal(getattr(device, "covariance")(r, R), axis1=1, axis2=2)  # noqa: B009
        angle = variances[:, 3:].mean() if variances.shape[1] > 3 else 0.0
        return float(np.sqrt(variances[:, :3].mean())), float(np.sqrt(angle))
    readings = np.stack([device.measure(r, R, seed).r for seed in range(READINGS)])
    return float(np.sqrt(np.nanmean(np.nanvar(readings, axis=0, ddof=1)))), 0.0


def observability(fleet: Fleet, data: PoseArrays, held: float) -> tuple[float, float]:
    """Condition number and Nahvi and Hollerbach's index of the identification Jacobian of all arms.

    held: noise by tape error, the least singular value of what is known better from poses than from the tape measure.
    """
    values = []
    for arm in fleet.arms:
        J = arm.closure(*data)[1] * scales(arm)
        s = np.linalg.svd(J.reshape(-1, arm.count), compute_uv=False)
        values.append(s[s > held])
    s = np.concatenate(values)
    return float(s.max() / s.min()), float(s.min() ** 2 / s.max())
