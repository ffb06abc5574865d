"""Poses of a plate on arms with given parameters, and how they move with those parameters.

    e(x, p) = 0      dx = -(de/dx)^-1 (de/dp) dp,   x = (T, rotation vector in the world)

Newton over all poses at once, from poses near by: the plate moves by less than a radian. (4.15), (4.30)-(4.31).
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from gantrytau import SolveError
from gantrytau.kinematics.rotations import turned
from gantrytau_optimica.calibration.links.arm_closure import ArmClosure
from gantrytau_optimica.calibration.links.forward import newton_steps

STEPS = 12
GOOD = 1e-9  # m, what is left of closure errors; steps are a thousand times larger where they do not converge
CLOSED = 1e-12  # m, rounding of lengths of metres and of the terms they come from


def pose_rows(arms: Sequence[ArmClosure], q: np.ndarray, r: np.ndarray, R: np.ndarray | None) -> np.ndarray:
    """Derivatives of the closure errors of all links by the pose, (N, links, 6), or (N, links, 3) without R."""
    rows = []
    for arm in arms:
        g = arm.directions(q, r, R)  # (N, m, 3)
        if R is None:
            rows.append(g)
            continue
        joints = np.stack([arm.vector_of(rod.plate_offset) for rod in arm.said.rods])
        levers = np.einsum("nij,mj->nmi", R, joints)
        rows.append(np.concatenate([g, np.cross(levers, g)], axis=2))
    return np.concatenate(rows, axis=1)


def poses_of(
    arms: Sequence[ArmClosure],
    q: np.ndarray,
    r: np.ndarray,
    R: np.ndarray | None,
    *,
    all_of_them: bool = True,
) -> tuple[np.ndarray, np.ndarray | None]:
    """The poses at actuator positions q, (N, n), near the poses r, (N, 3), and R, (N, 3, 3) or None.

    Where links cannot be closed from there it raises SolveError, or, with all_of_them=False, gives rows of NaN.
    """
    r, R = np.array(r, dtype=float), None if R is None else np.array(R, dtype=float)
    for _ in range(STEPS):
        errors = np.concatenate([arm.errors(q, r, R) for arm in arms], axis=1)
        open_rows = np.flatnonzero(np.abs(errors).max(axis=1) > CLOSED)
        if len(open_rows) == 0:
            break
        there = None if R is None else R[open_rows]
        rows = pose_rows(arms, q[open_rows], r[open_rows], there)
        step = newton_steps(rows, -errors[open_rows])
        r[open_rows] += step[:, :3]
        if R is not None and there is not None:
            R[open_rows] = turned(there, step[:, 3:])
    bad = ~(np.abs(np.concatenate([arm.errors(q, r, R) for arm in arms], axis=1)).max(axis=1) < GOOD)
    if bad.any() and all_of_them:
        raise SolveError(
            f"poses: the links of {bad.sum()} poses, the first in row {np.flatnonzero(bad)[0]}, cannot be closed in {STEPS} "
            "steps of Newton; start nearer to the pose, or leave poses out that are out of reach"
        )
    r[bad] = np.nan
    if R is not None:
        R[bad] = np.nan
    return r, R


def tool_gain(
    arms: Sequence[ArmClosure], q: np.ndarray, r: np.ndarray, R: np.ndarray | None
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Per arm dx/dp, (N, 6 or 3, p), and its Jacobian of closure errors, (N, m, p).

    Raises SolveError at a pose where the plate is not held.
    """
    try:
        inverse = np.linalg.inv(pose_rows(arms, q, r, R))
    except np.linalg.LinAlgError:
        raise SolveError(
            "poses: at one of them the links do not hold the plate; leave singular poses out"
        ) from None
    gains, start = [], 0
    for arm in arms:
        J = arm.closure(q, r, R)[1]
        part = inverse[:, :, start : start + len(arm.links)]
        gains.append((-part @ J, J))
        start += len(arm.links)
    return gains


class ArmKinematics:
    """Forward kinematics of calibrated arms, also of quaternions that are not unit: `fk(q, near)` by Newton."""

    def __init__(self, arms: Sequence[ArmClosure], r: np.ndarray, R: np.ndarray):
        self.arms = tuple(arms)
        self.start_r, self._R = r, R
        self.turns = True

    def fk(self, q: Any, near: Any = None) -> tuple[np.ndarray, np.ndarray]:
        """Positions (N, 3) and orientations (N, 3, 3) for actuator positions (N, 6), from poses (r, R) near by.

        near: by default a measured pose. NaN where links do not close.
        """
        q = np.asarray(q, dtype=float)
        single, q = q.ndim == 1, np.atleast_2d(q)
        r, R = near if near is not None else (self.start_r, self._R)
        r, R = np.broadcast_to(r, (len(q), 3)), np.broadcast_to(R, (len(q), 3, 3))
        found, turned = poses_of(self.arms, q, r, R, all_of_them=False)
        turned = np.asarray(turned)
        return (found[0], turned[0]) if single else (found, turned)
