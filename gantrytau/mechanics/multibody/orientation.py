"""Rotation matrices from axes and quaternions, on symbols and numbers."""

from typing import Any

import casadi as ca


def unit(n: Any) -> ca.SX:
    """The direction of a vector, of length one."""
    n = ca.SX(n)
    return n / ca.norm_2(n)


def about(n: Any, phi: Any) -> ca.SX:
    """Rotation by phi about the axis n, (3, 3); Rodrigues' formula. n: of length one."""
    along = n @ n.T
    return along + (ca.SX.eye(3) - along) * ca.cos(phi) + ca.skew(n) * ca.sin(phi)


def of_quaternion(q: Any) -> ca.SX:
    """Rotation of a unit quaternion, scalar first, (3, 3)."""
    a, u = q[0], ca.skew(q[1:4])
    return ca.SX.eye(3) + 2 * a * u + 2 * (u @ u)


def spin_of_quaternion(q: Any, rate: Any) -> ca.SX:
    """Angular velocity of the rotation of a unit quaternion, resolved in the frame it turns against, (3,)."""
    a, u = q[0], q[1:4]
    return 2 * (a * rate[1:4] - u * rate[0] + ca.cross(u, rate[1:4]))


def turning(R: Any) -> ca.SX:
    """Axis of the rotation R times 2 tan(angle / 2), (3,): the rotation itself if small, large at half a turn."""
    axial = ca.vertcat(R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]) / 2
    return 4 * axial / (1 + ca.trace(R))
