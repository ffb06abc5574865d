"""The delta robot by Lagrange's equations with multipliers, in world axes, z up, SI units.

    o_i = outward direction of arm i, y_i = z x o_i its axis
    e_i(phi) = base o_i + arm (cos(phi_i) o_i - sin(phi_i) z)         elbow
    d_ij = T + R B_ij - e_i -+ spacing / 2 y_i                        rod ij, from arm to plate
    |d_ij| = L_ij;  A u = 0,  A u' + c = 0,  M u' + b + A' tension = (0, 0, tau),  u = (T', w, phi')

A rod is massless with a point mass in its middle. With parallel rods the plate stays level, and T is where three
spheres about e_i - B_i meet.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tests.references.rotations import skew

ARMS = np.array([0, 0, 1, 1, 2, 2])  # arm of each rod
SIDES = np.array([-1.0, 1.0, -1.0, 1.0, -1.0, 1.0])
AZIMUTHS = np.array([0.0, 2 * np.pi / 3, 4 * np.pi / 3])
OUT = np.column_stack([np.cos(AZIMUTHS), np.sin(AZIMUTHS), np.zeros(3)])
ACROSS = np.column_stack([-np.sin(AZIMUTHS), np.cos(AZIMUTHS), np.zeros(3)])
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Delta:
    """A delta robot; rods in the order 0-, 0+, 1-, 1+, 2-, 2+, arrays not to be changed."""

    base: float  # m
    arm: float  # m
    plate: float  # m
    spacing: float  # m
    lengths: np.ndarray  # (6,) m
    arm_mass: float  # kg, in the middle of the arm
    arm_inertia: float  # kg.m2, about its middle and the axis, with the motor's
    rod_mass: float  # kg
    plate_mass: float  # kg
    plate_inertia: np.ndarray  # (3, 3) kg.m2
    g: float = 9.81  # m/s2, along -z


class State(NamedTuple):
    """Positions and speeds that satisfy the constraints; w in world axes."""

    T: np.ndarray
    R: np.ndarray
    phi: np.ndarray
    T_dot: np.ndarray
    w: np.ndarray
    phi_dot: np.ndarray


def along(phi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Directions of the arms and their derivatives by phi, each (3, 3), arms in rows."""
    c, s = np.cos(phi)[:, None], np.sin(phi)[:, None]
    return c * OUT - s * UP, -s * OUT - c * UP


def plate_joints(robot: Delta, R: np.ndarray) -> np.ndarray:
    """Ball joints of the plate from its centre, (6, 3) in m, world axes."""
    return (robot.plate * OUT[ARMS] + robot.spacing / 2 * SIDES[:, None] * ACROSS[ARMS]) @ R.T


def arm_joints(robot: Delta, phi: np.ndarray) -> np.ndarray:
    """Ball joints of the arms, (6, 3) in m."""
    elbows = robot.base * OUT + robot.arm * along(phi)[0]
    return elbows[ARMS] + robot.spacing / 2 * SIDES[:, None] * ACROSS[ARMS]


def position(robot: Delta, phi: np.ndarray) -> np.ndarray:
    """Forward kinematics of the level plate below the base, (3,) in m: the lower point of three spheres.

    Raises ValueError where they do not meet.
    """
    centres = robot.base * OUT + robot.arm * along(phi)[0] - robot.plate * OUT
    radii = robot.lengths[::2]
    # differences of two spheres are planes: T = foot + t n
    planes = 2 * (centres[1:] - centres[0])
    right = (centres[1:] ** 2).sum(axis=1) - centres[0] @ centres[0] - radii[1:] ** 2 + radii[0] ** 2
    foot = np.linalg.lstsq(planes, right, rcond=None)[0]
    n = np.cross(planes[0], planes[1])
    n = n / np.linalg.norm(n)
    away = foot - centres[0]
    half = away @ n
    root = half**2 - away @ away + radii[0] ** 2
    if root < 0:
        raise ValueError(f"delta.position: the spheres do not meet at phi = {phi} rad")
    ways = [foot + (-half + sign * np.sqrt(root)) * n for sign in (1, -1)]
    return min(ways, key=lambda T: T[2])


def angles(robot: Delta, T: np.ndarray) -> np.ndarray:
    """Inverse kinematics of the level plate, elbows outside, (3,) in rad; NaN out of reach."""
    way = T + (robot.plate - robot.base) * OUT
    x, z, y = (way * OUT).sum(axis=1), way[:, 2], (way * ACROSS).sum(axis=1)
    # (x - a cos)^2 + (z + a sin)^2 = L^2 - y^2
    a = robot.arm
    cosine = (x**2 + z**2 + y**2 + a**2 - robot.lengths[::2] ** 2) / (2 * a * np.hypot(x, z))
    with np.errstate(invalid="ignore"):
        return np.arctan2(-z, x) - np.arccos(cosine)


def constraint_jacobian(robot: Delta, state: State) -> np.ndarray:
    """A, (6, 9): the rates of |d_ij| by u = (T', w, phi')."""
    B = plate_joints(robot, state.R)
    d = state.T + B - arm_joints(robot, state.phi)
    e = d / np.linalg.norm(d, axis=1)[:, None]
    arms = np.zeros((6, 3))
    arms[np.arange(6), ARMS] = -(e * robot.arm * along(state.phi)[1][ARMS]).sum(axis=1)
    return np.hstack([e, np.cross(B, e), arms])


def constraint_bias(robot: Delta, state: State) -> np.ndarray:
    """c, (6,) in m/s2: |d|'' without accelerations."""
    B = plate_joints(robot, state.R)
    d = state.T + B - arm_joints(robot, state.phi)
    L = np.linalg.norm(d, axis=1)
    e = d / L[:, None]
    direction, side = along(state.phi)
    d_dot = state.T_dot + np.cross(state.w, B) - robot.arm * (state.phi_dot[:, None] * side)[ARMS]
    bias = (
        np.cross(state.w, np.cross(state.w, B)) + robot.arm * (state.phi_dot[:, None] ** 2 * direction)[ARMS]
    )
    return (e * bias).sum(axis=1) + ((d_dot**2).sum(axis=1) - (e * d_dot).sum(axis=1) ** 2) / L


def middles(robot: Delta, state: State) -> tuple[np.ndarray, np.ndarray]:
    """Middles of the rods: rates by u, (6, 3, 9), and accelerations without u', (6, 3)."""
    B = plate_joints(robot, state.R)
    direction, side = along(state.phi)
    rates = np.zeros((6, 3, 9))
    for k, b in enumerate(B):
        rates[k, :, :3] = np.eye(3) / 2
        rates[k, :, 3:6] = -skew(b) / 2
        rates[k, :, 6 + ARMS[k]] = robot.arm * side[ARMS[k]] / 2
    centripetal = np.cross(state.w, np.cross(state.w, B))
    centripetal -= robot.arm * (state.phi_dot[:, None] ** 2 * direction)[ARMS]
    return rates, centripetal / 2


def mass_matrix(robot: Delta, state: State) -> np.ndarray:
    """M, (9, 9)."""
    M = np.zeros((9, 9))
    M[:3, :3] = robot.plate_mass * np.eye(3)
    M[3:6, 3:6] = state.R @ robot.plate_inertia @ state.R.T
    M[6:, 6:] = (robot.arm_inertia + robot.arm_mass * robot.arm**2 / 4) * np.eye(3)
    rates, _ = middles(robot, state)
    return M + robot.rod_mass * np.einsum("kab,kac->bc", rates, rates)


def accelerations(robot: Delta, state: State, tau: np.ndarray) -> np.ndarray:
    """(T'', w', phi''), (9,), under the torques tau, (3,) in N.m."""
    A = constraint_jacobian(robot, state)
    up = robot.g * UP
    inertia = state.R @ robot.plate_inertia @ state.R.T
    rates, centripetal = middles(robot, state)
    b = robot.rod_mass * np.einsum("kab,ka->b", rates, centripetal + up)
    b[:3] += robot.plate_mass * up
    b[3:6] += np.cross(state.w, inertia @ state.w)
    b[6:] += robot.arm_mass * robot.arm / 2 * along(state.phi)[1] @ up
    matrix = np.block([[mass_matrix(robot, state), A.T], [A, np.zeros((6, 6))]])
    force = np.concatenate([-b, -constraint_bias(robot, state)])
    force[6:9] += tau
    return np.linalg.solve(matrix, force)[:9]


def energy(robot: Delta, state: State) -> float:
    """Kinetic and potential energy, J."""
    u = np.concatenate([state.T_dot, state.w, state.phi_dot])
    joints = arm_joints(robot, state.phi) + state.T + plate_joints(robot, state.R)
    height = robot.plate_mass * state.T[2] + robot.rod_mass * joints[:, 2].sum() / 2
    height -= robot.arm_mass * robot.arm / 2 * np.sin(state.phi).sum()
    return float(u @ mass_matrix(robot, state) @ u / 2 + robot.g * height)


def level_state(robot: Delta, T: np.ndarray, T_dot: np.ndarray) -> State:
    """The state of the level plate at T with the velocity T', both (3,)."""
    state = State(T, np.eye(3), angles(robot, T), T_dot, np.zeros(3), np.zeros(3))
    A = constraint_jacobian(robot, state)
    rates = np.linalg.solve(A[:, 3:], -A[:, :3] @ T_dot)
    return state._replace(w=rates[:3], phi_dot=rates[3:])
