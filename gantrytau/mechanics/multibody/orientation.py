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


def rotation_vector(R: Any) -> ca.SX:
    """Axis of the rotation R times its angle, (3,) in rad: smooth up to half a turn, where the axis may be either.

    axis * tan(angle / 4) is halved until the series of the arc tangent is exact to rounding in eight terms, so that it
    has no quotient 0/0 where nothing is turned.
    """
    axial = ca.vertcat(R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]) / 2
    cosine = ca.sqrt(1 + ca.trace(R)) / 2  # of half the angle
    part, share = axial / (2 * cosine * (1 + cosine)), 4
    while share < 32:
        part, share = part / (1 + ca.sqrt(1 + ca.dot(part, part))), 2 * share
    square, series = ca.dot(part, part), ca.SX(0)
    for k in reversed(range(8)):
        series = 1 / (2 * k + 1) - square * series
    return share * series * part
