"""The rigid body that no torque acts on: Euler's equations solved by Jacobi's elliptic functions.

Angular velocity w and inertia J (3, 3) in body axes, about the centre of mass; R takes body to world axes.

    J w' + w x J w = 0        energy w.J w / 2 and angular momentum |J w| are constant

In principal axes i, j, k, with k the one that the tip of w goes round (k is the axis of largest inertia if
|J w|^2 > 2 E J_j, else of smallest), after Landau and Lifshitz, Mechanics, paragraph 37:

    w = (A cn, s B sn, s C dn)(rate t + phase | m)
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.integrate import quad
from scipy.special import ellipj, ellipkinc

from tests.references.rotations import turn


class PrincipalAxes(NamedTuple):
    """Principal axes in the order i, j, k of the solution."""

    axes: np.ndarray  # (3, 3), columns in body axes, right-handed or left-handed
    J: np.ndarray  # (3,) kg.m2
    handed: float  # 1 or -1


def energy(J: np.ndarray, w: np.ndarray) -> float:
    """Kinetic energy of the rotation, J."""
    return float(w @ J @ w / 2)


def angular_momentum(J: np.ndarray, R: np.ndarray, w: np.ndarray) -> np.ndarray:
    """R J w, (3,) in N.m.s, world axes; w in body axes."""
    return R @ J @ w


def principal_axes(J: np.ndarray, w: np.ndarray) -> PrincipalAxes:
    """The principal axes in the order in which the solution needs them."""
    J = np.asarray(J, dtype=float)
    values, axes = np.linalg.eigh(J)
    if values * (values - values[1]) @ (axes.T @ w) ** 2 < 0:  # |J w|^2 < 2 E J_j
        values, axes = values[::-1], axes[:, ::-1]
    return PrincipalAxes(axes, values, round(np.linalg.det(axes)))


def angular_velocity(J: np.ndarray, w: np.ndarray, t: float) -> np.ndarray:
    """w after t seconds, (3,) in rad/s, body axes, of a body with w now.

    On the separatrix itself (|J w|^2 = 2 E J_j, a body that tumbles once) only starts with w_i > 0 are answered.
    """
    axes, (J_i, J_j, J_k), handed = principal_axes(J, w)
    w_i, w_j, w_k = axes.T @ w
    # 2 E J_k - L^2 and L^2 - 2 E J_i, written without cancellation
    slow = J_i * (J_k - J_i) * w_i**2 + J_j * (J_k - J_j) * w_j**2
    fast = J_k * (J_k - J_i) * w_k**2 + J_j * (J_j - J_i) * w_j**2
    if slow == 0:  # spin about k, or a sphere
        return w.copy()
    A, B = np.sqrt(slow / (J_i * (J_k - J_i))), np.sqrt(slow / (J_j * (J_k - J_j)))
    C = np.sqrt(fast / (J_k * (J_k - J_i)))
    m = (J_j - J_i) * slow / ((J_k - J_j) * fast)
    s = 1.0 if w_k >= 0 else -1.0
    rate = handed * np.sign(J_k - J_i) * np.sqrt((J_k - J_j) * fast / (J_i * J_j * J_k))
    sn, cn, dn, _ = ellipj(rate * t + ellipkinc(np.arctan2(s * w_j / B, w_i / A), m), m)
    return axes @ np.array([A * cn, s * B * sn, s * C * dn])


def orientation(J: np.ndarray, R: np.ndarray, w: np.ndarray, t: float) -> np.ndarray:
    """R after t seconds, (3, 3), to 1e-10 rad: axis k precesses about the constant angular momentum L.

    Rate of precession: (2 E - J_k w_k^2) |L| / (|L|^2 - J_k^2 w_k^2); its integral over t is a quadrature.
    """
    axes, values, _ = principal_axes(J, w)
    k, J_k = axes[:, 2], values[2]
    L = angular_momentum(J, R, w)
    size = np.linalg.norm(L)
    if np.linalg.norm(np.cross(k, J @ w)) <= 1e-14 * size:  # spin about k
        return R @ turn(w * t)

    def precession(time: float) -> float:
        now = angular_velocity(J, w, time)
        across = np.cross(k, J @ now)
        return float(size * (now @ J @ now - J_k * (k @ now) ** 2) / (across @ across))

    angle, _ = quad(precession, 0, t, epsabs=1e-11, epsrel=1e-12, limit=1000)
    before, after = triad(k, J @ w), triad(k, J @ angular_velocity(J, w, t))
    return turn(angle * L / size) @ R @ before @ after.T


def triad(k: np.ndarray, momentum: np.ndarray) -> np.ndarray:
    """Orthonormal columns: the momentum, what of k is across it, and the third, (3, 3)."""
    n = momentum / np.linalg.norm(momentum)
    across = k - (k @ n) * n
    across /= np.linalg.norm(across)
    return np.column_stack([n, across, np.cross(n, across)])


def symmetric_orientation(
    J_across: float, J_along: float, R: np.ndarray, w: np.ndarray, t: float
) -> np.ndarray:
    """R after t seconds of a top symmetric about its third axis: two steady rotations, (3, 3).

    Precession L / J_across about the constant L, spin (1 - J_along / J_across) w_3 about the body's axis.
    """
    J = np.diag([J_across, J_across, J_along])
    L = angular_momentum(J, R, w)
    spin = (1 - J_along / J_across) * w[2]
    return turn(L / J_across * t) @ R @ turn(np.array([0, 0, spin]) * t)
