"""Which poses to measure, and how good the calibrated robot will be, before anything is measured.

    A_i = (noise / tape)^2 I + sum_k J_ik' J_ik       information of the poses on arm i, scaled as in `arm_fit`
    D-optimal: sum_i log det A_i is largest; poses are exchanged as long as that grows (Fedorov, 1972), and then for the
    next criterion as long as this one stays the largest but for SLACK
    tool: sum_i tr (W_i A_i^-1) is least, W_i = mean of G_i'G_i with G_i = dx/dp_i, the expected error of the tool itself
    condition (5.9): C_k = cond(J without pose k), poses with the least C_k are left out, a few at a time

The first term is what is known from a tape measure; it keeps directions that no pose determines out of the choice.
`predict` propagates noise of the device and the tape measure through the fit to the tool: dx = -(de/dx)^-1 (de/dp) dp.
Dressler (2012), section 5.4, which applies (5.9) once.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from gantrytau import Model, ModelError
from gantrytau.border.checks import check_words, number, whole
from gantrytau.describing.record import Record
from gantrytau_optimica.calibration.design.identifiability import (
    NOTHING,
    PoseArrays,
    check_deviations,
    deviations,
    finite_poses,
)
from gantrytau_optimica.calibration.design.pose_exchange import exchanged
from gantrytau_optimica.calibration.fitting.pose_residuals import named_jacobian
from gantrytau_optimica.calibration.links.arm_closure import ArmClosure, Orientation, read_arms
from gantrytau_optimica.calibration.links.arm_factors import NOISE, checked_poses, scales
from gantrytau_optimica.calibration.links.arm_poses import pose_rows, tool_gain
from gantrytau_optimica.calibration.links.groups import TAPE

Method = Literal["d-optimal", "tool", "condition", "random"]
PASS = 0.1  # of the poses that are too many, left out before (5.9) is evaluated anew
SLACK = 0.014  # of log det for each unknown: 0.7 % of its deviation, for 4 to 6 % less error of the tool
ENOUGH = 1.05  # of the fewest poses


@dataclass(frozen=True, eq=False)
class Prediction(Record):
    """The error of the tool that is to be expected after a calibration, at poses.

    position: standard deviation of its distance from where the robot believes it to be, (N,) in m; angle: the same of its
    orientation, (N,) in rad, zero where it cannot turn; covariance: of the pose, (N, 6, 6) or (N, 3, 3).
    """

    position: np.ndarray
    angle: np.ndarray
    covariance: np.ndarray

    @property
    def error(self) -> float:
        """Mean of `position`, m."""
        return float(self.position.mean())


def select_poses(
    robot: Model,
    measurements: Any,
    n: int,
    *,
    method: Method = "d-optimal",
    seed: int = 0,
    orientation: Orientation = "local",
    parameters: Sequence[str] | None = None,
    joints: Sequence[str] | None = None,
) -> np.ndarray:
    """The rows of n poses to measure, ascending, (n,).

    measurements: candidates, a record with q, r and R, or a tuple of them; rows that are not finite are not chosen;
    method: "d-optimal", "tool" for the least error of its position over the candidates, "condition" for (5.9), or
    "random"; seed: of the poses that exchange begins with; parameters, joints: of any robot, as of `calibrate`.
    Raises ModelError for another method, robot or number, and for arrays that do not fit.
    """
    check_words(select_poses, locals())
    whole("select_poses", "seed", seed, least=0)
    whole("select_poses", "n", n, least=1)
    if parameters is None:
        arms, poses, rows = _candidates(robot, measurements, orientation)
        blocks, weights = ([], []) if method == "random" else _blocks(arms, poses)
    else:
        poses, rows = finite_poses(measurements)
        J = named_jacobian(robot, parameters, joints, poses)
        there = np.isfinite(J).all(axis=(1, 2))
        rows, (blocks, weights) = rows[there], _held([J[there]], [J[there, :3]])
    whole("select_poses", "n", n, most=len(rows))
    start = np.random.default_rng(seed).choice(len(rows), n, replace=False)
    if method != "random":
        if method == "condition":
            start = _well_conditioned(blocks, n)
        else:
            start = exchanged(blocks, start, weights, None if method == "tool" else SLACK)
    return np.sort(rows[start])


def predict(
    robot: Model,
    measurements: Any,
    rows: Sequence[int] | np.ndarray | None = None,
    *,
    at: Any = None,
    noise: float = NOISE,
    angle: float = 0.0,
    tape: float = TAPE,
    orientation: Orientation = "local",
    certainty: np.ndarray | None = None,
) -> Prediction:
    """The error of the tool to be expected after calibration by some of the candidates.

    measurements: candidates, as for `select_poses`, rows: those that are measured, or a mask of them, all if None; at: the
    poses to predict for, candidates if None; noise, angle: standard deviations of the measured pose per axis, in m and
    rad; tape: of nominal parameters, in m at the joints; certainty: (N,) of those that are measured, by which their
    deviations are divided.
    Raises ModelError for another robot or arrays that do not fit, SolveError at a singular pose.
    """
    check_words(predict, locals())
    check_deviations("predict", noise, angle, tape)
    arms, poses, finite = _candidates(robot, measurements, orientation)
    if rows is not None and np.asarray(rows).dtype == bool:
        rows = np.flatnonzero(rows)
    if rows is not None and not np.isin(rows, finite).all():
        raise ModelError(
            "predict: found rows that the candidates do not have with finite numbers, expected rows of them",
            argument="rows",
        )
    chosen = poses if rows is None else _rows_of(poses, np.searchsorted(finite, rows))
    there = poses if at is None else _candidates(robot, at, orientation)[1]
    covariance = _parameter_covariance(arms, chosen, (noise, angle), tape, certainty)
    return _predicted(_gains(arms, there), covariance)


def enough_poses(
    robot: Model,
    measurements: Any,
    error: float,
    *,
    noise: float = NOISE,
    angle: float = 0.0,
    tape: float = TAPE,
    seed: int = 0,
) -> np.ndarray:
    """The rows of the fewest D-optimal poses, within one in twenty, that leave the tool an expected mean error of `error`.

    measurements: candidates, as for `select_poses`; error: in m, over the candidates; noise, angle, tape: as for `predict`.
    Raises ModelError where even all of the candidates are not enough.
    """
    whole("enough_poses", "seed", seed, least=0)
    check_deviations("enough_poses", noise, angle, tape)
    error = number("enough_poses", "error", error, above=0.0)
    arms, poses, finite = _candidates(robot, measurements, "local")
    blocks, weights = _blocks(arms, poses)
    gains = _gains(arms, poses)

    def expected(rows: np.ndarray) -> float:
        chosen = _rows_of(poses, rows)
        return _predicted(gains, _parameter_covariance(arms, chosen, (noise, angle), tape)).error

    chosen = np.arange(len(finite))
    if not (least := expected(chosen)) <= error:
        raise ModelError(
            f"enough_poses: all {len(finite)} candidates leave {least:.3g} m, expected no more than {error:.3g} m; offer "
            "more or other poses, or a better device",
            argument="error",
        )
    few, many = 0, len(finite)
    while many > max(few + 1, ENOUGH * few):
        n = min(max(few + 1, round(np.sqrt(max(few, 1) * many))), many - 1)
        start = np.random.default_rng(seed).choice(len(finite), n, replace=False)
        rows = exchanged(blocks, start, weights, SLACK)
        if expected(rows) > error:
            few = n
        else:
            many, chosen = n, rows
    return np.sort(finite[chosen])


def _gains(arms: Sequence[ArmClosure], poses: PoseArrays) -> np.ndarray:
    """dx/dp of all unknowns, arms one after another, (N, 6 or 3, p)."""
    return np.concatenate([gain for gain, _ in tool_gain(arms, *poses)], axis=2)


def _predicted(gains: np.ndarray, covariance: np.ndarray) -> Prediction:
    found = gains @ covariance @ np.swapaxes(gains, 1, 2)
    variances = np.diagonal(found, axis1=1, axis2=2)
    return Prediction(np.sqrt(variances[:, :3].sum(axis=1)), np.sqrt(variances[:, 3:].sum(axis=1)), found)


def _candidates(
    robot: Model, measurements: Any, orientation: Orientation
) -> tuple[tuple[ArmClosure, ...], PoseArrays, np.ndarray]:
    """The arms, the candidates whose numbers are finite, and their rows."""
    arms, (poses, rows) = read_arms(robot, orientation), finite_poses(measurements)
    return arms, PoseArrays(*[checked_poses(arm, *poses) for arm in arms][-1]), rows


def _rows_of(poses: PoseArrays, rows: np.ndarray) -> PoseArrays:
    return PoseArrays(poses.q[rows], poses.r[rows], None if poses.R is None else np.asarray(poses.R)[rows])


def _blocks(arms: Sequence[ArmClosure], poses: PoseArrays) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """J S of each arm, (N, m, rank), and W, (rank, rank), in the directions that all candidates together determine."""
    pairs = list(zip(arms, tool_gain(arms, *poses), strict=True))
    return _held(
        [J * scales(arm) for arm, (_, J) in pairs], [gain[:, :3] * scales(arm) for arm, (gain, _) in pairs]
    )


def _held(slopes: list[np.ndarray], gains: list[np.ndarray]) -> tuple[list[np.ndarray], list[np.ndarray]]:
    blocks, weights = [], []
    for J, gain in zip(slopes, gains, strict=True):
        _, s, V = np.linalg.svd(np.linalg.qr(J.reshape(-1, J.shape[2]), mode="r"), full_matrices=False)
        V = V[s > NOTHING * s[0]]
        rows = (gain @ V.T).reshape(-1, len(V))
        blocks.append(J @ V.T)
        weights.append(rows.T @ rows / len(J))
    return blocks, weights


def _well_conditioned(blocks: Sequence[np.ndarray], n: int) -> np.ndarray:
    """What is left when poses with the least (5.9), a product over the arms, are left out again and again."""
    left = np.arange(len(blocks[0]))
    while len(left) > n:
        criterion = np.zeros(len(left))
        for J in blocks:
            squares = np.swapaxes(J[left], 1, 2) @ J[left]
            values = np.linalg.eigvalsh(squares.sum(axis=0) - squares)
            floor = 1e-15 * values[:, -1]  # rounding: such a set no longer determines all parameters
            criterion += np.log(values[:, -1] / np.maximum(values[:, 0], floor)) / 2
        leave = max(1, int(PASS * (len(left) - n)))
        left = np.sort(left[np.argsort(criterion, kind="stable")[leave:]])
    return left


def _parameter_covariance(
    arms: Sequence[ArmClosure],
    poses: PoseArrays,
    noise: tuple[float, float],
    tape: float,
    certainty: np.ndarray | None = None,
) -> np.ndarray:
    """Covariance of all unknowns after a fit, arms one after another, (p, p).

    A pose is measured with one error for all of its links, which correlates what is identified for different arms.
    """
    least, halves, remains = noise[0] / tape, [], []
    for arm in arms:
        scale = scales(arm)
        J = arm.closure(*poses)[1] * scale
        J = J if certainty is None else J * certainty[:, None, None]
        rows = J.reshape(-1, arm.count)
        inverse = np.linalg.inv(rows.T @ rows + least**2 * np.eye(arm.count)) * scale[:, None]
        slopes = pose_rows([arm], *poses) * deviations(noise, poses.R)
        halves.append(inverse @ np.einsum("nmp,nmc->pnc", J, slopes).reshape(arm.count, -1))
        remains.append(least * noise[0] * inverse)  # of the tape measure's error
    found, start = np.concatenate(halves), 0
    covariance = found @ found.T
    for remain in remains:
        part = slice(start, start + len(remain))
        covariance[part, part] += remain @ remain.T
        start += len(remain)
    return covariance
