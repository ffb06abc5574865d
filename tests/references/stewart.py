"""The Stewart platform by virtual work in the six speeds of the platform, in world axes, z up, SI units.

    l_k = r + R b_k - a_k,  s_k = |l_k|,  u_k = l_k / s_k            legs, from base to platform
    speeds x' = (r', w);  ball joint k moves with p_k' = J_k x',  J_k = [1, -[R b_k]x]
    M(x) x'' + h(x, x') = sum_k J_k' u_k f_k                         f_k pushes leg k apart

A leg is a cylinder, its centre c along the leg, and a piston, its centre d back from the ball joint, each with an
inertia that is symmetric about the leg: across, and axial. The first axis e_k of the universal joint on the base is
fixed to it, the second is across it and the leg: that makes the angular velocity of a leg G(u) u'.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tests.references.rotations import skew, turn


@dataclass(frozen=True)
class Stewart:
    """A Stewart platform; arrays not to be changed."""

    base: np.ndarray  # (6, 3) m, a_k
    platform: np.ndarray  # (6, 3) m, b_k, platform axes
    axes: np.ndarray  # (6, 3) first axes of the universal joints, unit vectors
    mass: float  # kg, of the platform
    centre: np.ndarray  # (3,) m, of mass, platform axes
    inertia: np.ndarray  # (3, 3) kg.m2, about the centre of mass, platform axes
    leg_masses: np.ndarray  # (2,) kg, of cylinder and piston
    leg_centres: np.ndarray  # (2,) m, c and d
    across: np.ndarray  # (2,) kg.m2, inertias about the centres, across the leg
    axial: np.ndarray  # (2,) kg.m2, along it
    g: float = 9.81  # m/s2, along -z


class Pose(NamedTuple):
    """Pose and speeds of the platform: w in world axes."""

    r: np.ndarray
    R: np.ndarray
    v: np.ndarray
    w: np.ndarray


def lengths(robot: Stewart, r: np.ndarray, R: np.ndarray) -> np.ndarray:
    """Inverse kinematics: s_k, (6,) in m."""
    return np.linalg.norm(r + robot.platform @ R.T - robot.base, axis=1)


def jacobian(robot: Stewart, r: np.ndarray, R: np.ndarray) -> np.ndarray:
    """The rates of the lengths by (r', w), (6, 6)."""
    arms = robot.platform @ R.T
    u = (r + arms - robot.base) / lengths(robot, r, R)[:, None]
    return np.hstack([u, np.cross(arms, u)])


def pose_of_lengths(
    robot: Stewart, s: np.ndarray, r: np.ndarray, R: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Forward kinematics by Newton from a near pose; ArithmeticError when it does not converge."""
    for _ in range(30):
        error = s - lengths(robot, r, R)
        if np.abs(error).max() < 1e-14:
            break
        step = np.linalg.solve(jacobian(robot, r, R), error)
        r, R = r + step[:3], turn(step[3:]) @ R
    if not np.abs(s - lengths(robot, r, R)).max() < 1e-12:
        raise ArithmeticError(f"pose_of_lengths: no pose near {r} has the lengths {s}")
    return r, R


def spin(axis: np.ndarray, u: np.ndarray) -> np.ndarray:
    """G(u), (3, 3): the angular velocity of a leg along u that its universal joint allows is G u'."""
    second = np.cross(axis, u)
    size = np.sqrt(second @ second)
    b = second / size
    return np.outer(axis, b) / size + np.outer(b, np.cross(b, u))


def leg_forces(
    robot: Stewart, k: int, p: np.ndarray, p_dot: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What leg k needs in its ball joint: mass m (3, 3) and bias n (3,) in m p'' + n, and its direction u."""
    way = p - robot.base[k]
    s = np.sqrt(way @ way)
    u = way / s
    s_dot = u @ p_dot
    P = (np.eye(3) - np.outer(u, u)) / s
    u_dot = P @ p_dot
    u_bias = -(u * (u_dot @ u_dot) + 2 * s_dot / s * u_dot)  # u'' without p''; (u s)'' = p''
    G = spin(robot.axes[k], u)
    tiny = 1e-30  # a complex step has no cancellation
    G_dot = np.imag(spin(robot.axes[k], u + 1j * tiny * u_dot)) / tiny
    w, w_bias, w_rate = G @ u_dot, G_dot @ u_dot + G @ u_bias, G @ P
    up = np.array([0.0, 0.0, robot.g])
    c, d = robot.leg_centres
    # centres c u and p - d u
    rates = [c * P, np.eye(3) - d * P]
    biases = [c * u_bias, -d * u_bias]
    mass, bias = np.zeros((3, 3)), np.zeros(3)
    for i in range(2):
        inertia = robot.across[i] * (np.eye(3) - np.outer(u, u)) + robot.axial[i] * np.outer(u, u)
        mass += robot.leg_masses[i] * rates[i].T @ rates[i] + w_rate.T @ inertia @ w_rate
        bias += robot.leg_masses[i] * rates[i].T @ (biases[i] + up)
        bias += w_rate.T @ (inertia @ w_bias + np.cross(w, inertia @ w))
    return mass, bias, u


def equations(robot: Stewart, pose: Pose) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """M (6, 6), h (6,), and the matrix (6, 6) that takes the forces of the legs to those on the platform."""
    r, R, v, w = pose
    centre, inertia = R @ robot.centre, R @ robot.inertia @ R.T
    up = np.array([0.0, 0.0, robot.g])
    J = np.hstack([np.eye(3), -skew(centre)])
    M = robot.mass * J.T @ J
    M[3:, 3:] += inertia
    h = robot.mass * J.T @ (np.cross(w, np.cross(w, centre)) + up)
    h[3:] += np.cross(w, inertia @ w)
    drive = np.zeros((6, 6))
    for k, arm in enumerate(robot.platform @ R.T):
        J = np.hstack([np.eye(3), -skew(arm)])
        mass, bias, u = leg_forces(robot, k, r + arm, v + np.cross(w, arm))
        M += J.T @ mass @ J
        h += J.T @ (mass @ np.cross(w, np.cross(w, arm)) + bias)
        drive[:, k] = J.T @ u
    return M, h, drive


def accelerations(robot: Stewart, pose: Pose, f: np.ndarray) -> np.ndarray:
    """(r'', w'), (6,), under the leg forces f, (6,) in N."""
    M, h, drive = equations(robot, pose)
    return np.linalg.solve(M, drive @ f - h)


def energy(robot: Stewart, pose: Pose) -> float:
    """Kinetic and potential energy, J."""
    r, R, v, w = pose
    speeds = np.concatenate([v, w])
    height = robot.mass * (r + R @ robot.centre)[2]
    for k, p in enumerate(r + robot.platform @ R.T):
        u = (p - robot.base[k]) / np.linalg.norm(p - robot.base[k])
        c, d = robot.leg_centres
        height += robot.leg_masses @ [robot.base[k, 2] + c * u[2], p[2] - d * u[2]]
    return float(speeds @ equations(robot, pose)[0] @ speeds / 2 + robot.g * height)
