"""Closure errors of an arm over many poses as one triangle, and what it says of the unknowns.

    J S = U diag(s) V'

S scales each unknown to the metres that it moves a joint by. J is triangularised in blocks of poses that stay in the cache,
so condition is not squared. Dressler (2012), section 5.4.
"""

import numpy as np

from gantrytau import ModelError
from gantrytau.border.checks import array
from gantrytau_optimica.calibration.links.arm_closure import ArmClosure

NOISE = 1e-5  # m, of a laser tracker at two metres
LEVER = 0.25  # m, a turn by 1 rad, or a quaternion by 1/2, moves the joints on a turntable about this far
BLOCK = 1024  # poses; Jacobians of 38 columns for them take 1 MB


def scales(arm: ArmClosure) -> np.ndarray:
    """Scale of each parameter: change for a metre at a joint, (p,)."""
    turning = [".rotation[" in name or ".gain" in name for name in arm.names]
    quaternion = [".orientation[" in name for name in arm.names]
    return np.where(turning, 1 / LEVER, np.where(quaternion, 0.5 / LEVER, 1.0))


def triangle(
    arm: ArmClosure,
    q: np.ndarray,
    r: np.ndarray,
    R: np.ndarray | None,
    scale: np.ndarray,
    root: np.ndarray | None = None,
) -> np.ndarray:
    """The triangular factor F of [J S, e] over all poses, (p + 1, p + 1): F'F = [J S, e]' [J S, e].

    root: (m, c) or (N, m, c), makes it F'F = [..]' root root' [..].
    """
    factor = np.zeros((0, arm.count + 1))
    for start in range(0, len(q), BLOCK):
        part = slice(start, start + BLOCK)
        e, J = arm.closure(q[part], r[part], None if R is None else R[part])
        rows = np.concatenate([J * scale, e[:, :, None]], axis=2)
        if root is not None:
            rows = np.swapaxes(root if root.ndim == 2 else root[part], -1, -2) @ rows
        factor = np.linalg.qr(np.vstack([factor, rows.reshape(-1, arm.count + 1)]), mode="r")
    return np.asarray(factor)


def half_covariance(factor: np.ndarray, spread: np.ndarray, least: float) -> np.ndarray:
    """C with C C' the covariance of the scaled unknowns in the directions that are held.

    factor: that of J S, with p columns; spread: that of root' J S, root root' the covariance of the errors of a pose;
    C = (S J'J S)^-1 spread' within the directions of singular values from `least`.
    """
    _, s, V = np.linalg.svd(factor, full_matrices=False)
    held = s >= least
    return V[held].T @ ((V[held] @ spread.T) / s[held, None] ** 2)


def checked_poses(
    arm: ArmClosure, q: np.ndarray, r: np.ndarray, R: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """The measurements as arrays of floats, once their shapes and numbers are right; raises ModelError."""
    q = array(arm.name, "q", q, (None, None))
    r = array(arm.name, "r", r, (len(q), 3))
    columns = 1 + max([arm.cart, *arm.columns])
    if len(q) == 0 or q.shape[1] < columns:
        found = f"found q of {len(q)} x {q.shape[1]}, expected n x {columns}, n > 0"
        raise ModelError(found, place=arm.name, argument="q")
    if not arm.turns:
        return q, r, None  # the plate of such an arm keeps its orientation, whatever was measured of it
    if R is None:
        raise ModelError(
            "found no orientations R, expected them as the plate turns", place=arm.name, argument="R"
        )
    return q, r, array(arm.name, "R", R, (len(q), 3, 3))
