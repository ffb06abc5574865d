"""Pose residuals of a robot by named parameters, and their least squares.

    e = exp([w]x) R0 m + t - r(q, p)       of places m, in the base of the robot
    a = vector(exp([w]x) R0 M R(q, p)')    of orientations M, by a lever as long as noise of places is to that of turns

x = (w, t, p); w and t are there where poses were measured in any frame. Rows count by the certainty of their pose.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gantrytau import Model
from gantrytau.describing.record import Record
from gantrytau.kinematics.rotations import left_jacobian, motion, of_vector, rotation_vector, skewed
from gantrytau_optimica.calibration.data.measurements import Measurements
from gantrytau_optimica.calibration.fitting.tool_function import ToolFunction, tool_function
from gantrytau_optimica.calibration.links.arm_factors import LEVER
from gantrytau_optimica.calibration.links.groups import TAPE, tape_limit
from gantrytau_optimica.fitting.least_squares import Minimum, Prior, least_squares
from gantrytau_optimica.fitting.robust import (
    OUTLIER,
    huber_weights,
    limit,
    robust_deviation,
    tukey_roots,
    without_strays,
)

Array = np.ndarray
FRAME = tuple(f"frame.{part}[{k}]" for part in ("R", "t") for k in range(3))
ROUNDS = 30  # of reweighting, and of finding noise and lever
LEAST = 1e-12  # m, of the noise: rounding of places of metres


@dataclass(frozen=True, eq=False)
class PoseResiduals(Record):
    """Residuals of measured poses by named parameters x.

    tool: of the robot; data: measured poses, all finite; turn: R0 (3, 3), or None for poses in the base; lever: of
    rotations, m; weights: of poses, (N,); prior: value and standard deviation by index in x.
    """

    tool: ToolFunction
    data: Measurements
    turn: Array | None
    lever: float
    weights: Array
    prior: Mapping[int, tuple[float, float]]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters x."""
        return self.tool.names if self.turn is None else (*FRAME, *self.tool.names)

    @property
    def scale(self) -> Array:
        """Scale of each parameter: change for a metre at the tool, about."""
        return (
            self.tool.scale
            if self.turn is None
            else np.array([1 / LEVER] * 3 + [1.0] * 3 + [*self.tool.scale])
        )

    def frame(self, x: Array) -> tuple[Array, Array, Array]:
        """R and t of base = R measured + t, and p."""
        if self.turn is None:
            return np.eye(3), np.zeros(3), x
        return of_vector(x[:3]) @ self.turn, x[3:6], x[6:]

    def poses(self, x: Array) -> Array:
        """Residuals e and a of each pose, (N, 3 or 6), without weights."""
        R, t, p = self.frame(x)
        r, turned = self.tool(self.data.q, p)
        e = self.data.r @ R.T + t - r
        if turned is None or self.data.R is None:
            return e
        return np.hstack([e, self.lever * rotation_vector(R @ self.data.R @ np.swapaxes(turned, 1, 2))])

    def jacobian(self, x: Array) -> Array:
        """Jacobian of e and a by x, (N, 3 or 6, n)."""
        R, _, p = self.frame(x)
        units = np.repeat([1.0, self.lever], 3)[: 6 if self.tool.turning else 3]
        found = -self.tool.jacobian(self.data.q, p) * units[:, None]
        if self.turn is None:
            return found
        count, rows = found.shape[:2]
        by_frame = np.zeros((count, rows, 6))
        by_frame[:, :3, :3] = -skewed(self.data.r @ R.T) @ left_jacobian(x[:3])
        by_frame[:, :3, 3:] = np.eye(3)
        if rows == 6:
            by_frame[:, 3:, :3] = self.lever * left_jacobian(x[:3])
        return np.concatenate([by_frame, found], axis=2)

    def minimum(self, x: Array, noise: float) -> Minimum:
        """Least squares from x; noise: m, directions known worse than by a tape measure do not move."""
        return least_squares(
            lambda x: (self.poses(x) * self.weights[:, None]).ravel(),
            self.weighted_jacobian,
            x,
            scale=self.scale,
            priors=[Prior.of(self.prior, noise)],
            smallest=tape_limit(noise),
        )

    def weighted_jacobian(self, x: Array) -> Array:
        """Jacobian of all weighted residuals, (m, n)."""
        return (self.jacobian(x) * self.weights[:, None, None]).reshape(-1, len(x))

    def robust(self, x: Array) -> tuple[Array, float, float]:
        """Weighted residuals (N, 3 or 6) of a robust fit, and standard deviations of positions and rotations."""
        J = self.weighted_jacobian(x) * self.scale
        left = (self.poses(x) * self.weights[:, None]).ravel()
        used = np.repeat(self.weights > 0, len(left) // len(self.weights))
        left[used] = without_strays(left[used], J[used])
        left, rank = left.reshape(len(self.weights), -1), int(np.linalg.matrix_rank(J))
        seen = left[self.weights > 0]
        share = [rank // 2, rank // 2] if self.tool.turning else [rank]
        sizes = [robust_deviation(seen[:, 3 * k : 3 * k + 3].ravel(), n) for k, n in enumerate(share)]
        return left, max(sizes[0], LEAST), max(sizes[-1], LEAST)


def started(tool: ToolFunction, data: Measurements, framed: bool) -> tuple[PoseResiduals, Array]:
    """Residuals and start values: nominal parameters, in the frame of their best fit."""
    sure = np.ones(len(data)) if data.certainty is None else data.certainty
    if not framed:
        return PoseResiduals(tool, data, None, LEVER, sure, {}), tool.nominal
    r, _ = tool(data.q, tool.nominal)
    there = np.isfinite(r).all(axis=1)
    turn, shift = motion(data.r[there], r[there])
    return PoseResiduals(tool, data, turn, LEVER, sure, {}), np.concatenate(
        [np.zeros(3), shift, tool.nominal]
    )


def named_jacobian(
    robot: Model, parameters: Sequence[str], joints: Sequence[str] | None, poses: Any
) -> Array:
    """Jacobian of poses (q, r, R) by named parameters and a frame over their scales, (N, 3 or 6, n)."""
    q, r, R = poses
    tool = tool_function(robot, parameters, joints, R is not None)
    residuals, x = started(tool, Measurements(q, r, R), True)
    return residuals.jacobian(x) * residuals.scale


def fitted(residuals: PoseResiduals, x: Array, robust: bool) -> tuple[PoseResiduals, Minimum, float]:
    """Least squares with converged noise, lever of rotations and, for a robust loss, Tukey's weights."""
    sure, noise, begin = residuals.weights, 0.0, x
    minimum = residuals.minimum(x, noise)
    for _ in range(ROUNDS):
        before = noise
        _, noise, turned = residuals.robust(minimum.x)
        lever = residuals.lever * (noise / turned if residuals.tool.turning else 1.0)
        weights = sure
        if robust:
            sizes = np.abs(replace(residuals, weights=sure).robust(minimum.x)[0]).max(axis=1) / noise
            weights = sure * tukey_roots(sizes)
            if 2 * np.count_nonzero(weights) <= len(weights):  # far off, where the least sum of amounts leads
                amounts = np.abs(residuals.poses(minimum.x)).max(axis=1)
                weights = sure * np.sqrt(huber_weights(np.maximum(amounts, LEAST), float(np.median(amounts))))
        settled = abs(noise - before) < 0.01 * noise and np.abs(weights - residuals.weights).max() < 1e-3
        residuals = replace(residuals, lever=float(np.clip(lever, 1e-3, 1e3)), weights=weights)
        held = minimum.rank == len(x) and minimum.singular.min() > noise / TAPE
        minimum = residuals.minimum(minimum.x if held else begin, noise)
        if settled:
            break
    return residuals, minimum, noise


def strays(residuals: PoseResiduals, x: Array) -> Array:
    """Indices of poses with larger residuals than noise explains."""
    sure = residuals.data.certainty
    every = replace(residuals, weights=np.ones(len(residuals.data)) if sure is None else sure)
    left, noise, turned = every.robust(x)
    sizes = np.abs(left / np.repeat([noise, turned], 3)[: left.shape[1]]).max(axis=1)
    return np.flatnonzero(sizes > max(OUTLIER, limit(left.size - len(x))))
