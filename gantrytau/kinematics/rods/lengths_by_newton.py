"""Newton's method on the lengths of links, for many poses at once.

What is free may be the pose, (4.30); actuator coordinates, (4.27) to (4.29); or some of both. Solved poses drop out.

The printed update of (4.27) has the wrong sign: with e = L - |B - A(Q)| the step is -(de/dQ)^-1 e. (4.15) is (4.30)
multiplied by the slopes of the lengths by the actuators, and its steps end in the same pose.
"""

from collections.abc import Sequence

import numpy as np

from gantrytau.answers.many_points.elimination import solved
from gantrytau.kinematics.rods.rod_geometry import RodGeometry
from gantrytau.kinematics.rotations import turned

ROUNDING = 1e-13  # of lengths, relative to the size of coordinates: some hundred times a rounding
MOST = 30  # iterations
BLOCK = 2048  # poses whose matrices stay in the cache
LONGEST = 0.5  # m or rad of one step; only far away, where the linear model says little


def solve_lengths(
    geometry: RodGeometry, q: np.ndarray, r: np.ndarray, R: np.ndarray, free: Sequence[int]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Coordinates q (N, n), r (N, 3), R (N, 3, 3) at which links have their lengths, and the number of iterations (N,).

    free: columns that may move, of the pose (0 to 5) and then of q (6, ...), as many as links. Rows where it does not
    end are NaN.
    """
    q, r, R = (np.array(a, dtype=float) for a in (q, r, R))
    iterations = np.zeros(len(q), dtype=int)
    for first in range(0, len(q), BLOCK):
        part = slice(first, first + BLOCK)
        _solve_block(geometry, (q[part], r[part], R[part]), iterations[part], list(free))
    return q, r, R, iterations


def _solve_block(
    geometry: RodGeometry,
    at: tuple[np.ndarray, np.ndarray, np.ndarray],
    iterations: np.ndarray,
    free: list[int],
) -> None:
    """Moves the arrays `at` in place."""
    q, r, R = at
    pose = [k for k in free if k < 6]
    joints = [k - 6 for k in free if k >= 6]
    close = ROUNDING * (np.abs(geometry.offset).max() + geometry.length.max())
    rows = np.flatnonzero(
        np.isfinite(q).all(axis=1) & np.isfinite(r).all(axis=1) & np.isfinite(R).all(axis=(1, 2))
    )
    spoiled = np.setdiff1d(np.arange(len(q)), rows)
    with np.errstate(all="ignore"):
        for _ in range(MOST + 1):
            length, _, by_pose, by_joints = geometry.slopes(q[rows], r[rows], R[rows], joints=bool(joints))
            error = geometry.length - length
            open_ = ~(np.abs(error).max(axis=1) <= close)
            rows, error = rows[open_], error[open_]
            if rows.size == 0:
                break
            matrix = np.concatenate([by_pose[open_][:, :, pose], by_joints[open_][:, :, joints]], axis=2)
            step = limited(solved(matrix, error))
            iterations[rows] += 1
            whole = np.zeros((rows.size, 6))
            whole[:, pose] = step[:, : len(pose)]
            r[rows] += whole[:, :3]
            if any(k >= 3 for k in pose):
                R[rows] = turned(R[rows], whole[:, 3:])
            q[rows[:, None], np.array(joints, dtype=int)] += step[:, len(pose) :]
    for lost in (rows, spoiled):
        q[lost], r[lost], R[lost] = np.nan, np.nan, np.nan


def limited(step: np.ndarray) -> np.ndarray:
    """Steps (N, k), shortened to LONGEST in their largest element; those that are NaN become zero."""
    largest = np.abs(step).max(axis=1, keepdims=True)
    return np.nan_to_num(step * np.minimum(1.0, LONGEST / np.maximum(largest, LONGEST)), nan=0.0)
