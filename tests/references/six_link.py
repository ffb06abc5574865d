"""The six-link Gantry-Tau by Lagrange's equations with multipliers, in world axes, z up, SI units.

    d_ij = T + R B_ij - A_ij - q_i v_i                  from the cart to the plate end of link ij
    |d_ij| = L_ij                                       six constraints; Dressler (2012), eq. 4.14
    A u = 0,  A u' + c = 0                              their rates, A (6, 9)
    M u' + b + A' tension = (0, 0, f)                   nine generalised speeds u = (T', w, q')

The plate is a rigid body whose centre of mass is the tool point T; R is the rotation from plate to world axes and
w its angular velocity in world axes. Cart i runs along v_i, not normalised: its speed is |v_i| q_i', and f_i is
conjugate to q_i. A link is a massless rod with a point mass at its middle; its tension is the mean of the axial
forces in its two halves, positive when it pulls.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from tests.references.rotations import skew, turn

ARMS = np.array([0, 1, 1, 2, 2, 2])  # arm of each link


@dataclass(frozen=True)
class SixLink:
    """A six-link Gantry-Tau; links in the order 1, 2a, 2b, 3a, 3b, 3c, arrays not to be changed."""

    directions: np.ndarray  # (3, 3), v_i in rows
    cart_joints: np.ndarray  # (6, 3) m, A_ij at q = 0, world axes
    plate_joints: np.ndarray  # (6, 3) m, B_ij from the tool point, plate axes
    lengths: np.ndarray  # (6,) m
    plate_mass: float  # kg
    plate_inertia: np.ndarray  # (3, 3) kg.m2, about the tool point, plate axes
    cart_masses: np.ndarray  # (3,) kg
    link_masses: np.ndarray  # (6,) kg
    g: float = 9.81  # m/s2, along -z


class State(NamedTuple):
    """Positions and speeds that satisfy the constraints."""

    T: np.ndarray  # (3,) m
    R: np.ndarray  # (3, 3)
    q: np.ndarray  # (3,) m
    T_dot: np.ndarray  # (3,) m/s
    w: np.ndarray  # (3,) rad/s, world axes
    q_dot: np.ndarray  # (3,) m/s


class Accelerations(NamedTuple):
    """The solution of the equations of motion."""

    T_ddot: np.ndarray  # (3,) m/s2
    w_dot: np.ndarray  # (3,) rad/s2, world axes
    q_ddot: np.ndarray  # (3,) m/s2
    tension: np.ndarray  # (6,) N


def parameters_L1() -> SixLink:
    """L1: Table 5.1 (modified), masses of Table 6.3 (model 2); plate joints, J and link masses are assumed.

    The links of an arm are parallel and equally long, so the plate keeps its orientation R = I.
    """
    offsets = np.array([[-1.8089, 3.5093, 0.0039], [-1.8656, 2.2456, 0.2074], [-1.8086, 3.2774, -1.4434]])
    plate_joints = np.array(
        [
            [0, 0, 0],
            [0, 0.12, 0.05],
            [0, -0.12, 0.05],
            [0.10, 0.05, -0.10],
            [-0.10, 0.10, -0.10],
            [0, -0.12, -0.15],
        ]
    )
    return SixLink(
        directions=np.array(
            [[0.9994, -0.0293, -0.0022], [0.9990, -0.0264, -0.0045], [0.9997, -0.0296, -0.0014]]
        ),
        cart_joints=offsets[ARMS] + plate_joints,
        plate_joints=plate_joints,
        lengths=np.array([2.0608, 2.0633, 2.0611])[ARMS],
        plate_mass=9.13,
        plate_inertia=np.diag([0.20, 0.25, 0.30]),
        cart_masses=np.array([13.58, 13.64, 38.23]),
        link_masses=np.full(6, 0.5),
    )


def parameters_symmetric() -> SixLink:
    """L1 with all guideways along e_x: the geometry in which most terms cancel exactly."""
    return replace(parameters_L1(), directions=np.tile([1.0, 0.0, 0.0], (3, 1)))


def parameters_longer(link: int = 1, by: float = 1e-4) -> SixLink:
    """L1 with one link (0 to 5) longer, by in m: the plate no longer keeps its orientation."""
    nominal = parameters_L1()
    return replace(nominal, lengths=nominal.lengths + by * (np.arange(6) == link))


def parameters_disturbed(seed: int = 1, size: float = 0.02) -> SixLink:
    """L1 with lengths and joints disturbed by up to size (m), unlike links and an inertia without symmetry.

    Where three links of an arm are nearly in one plane, centimetres turn the plate by radians: other seeds may
    have no pose in the middle of the workspace.
    """
    rng = np.random.default_rng(seed)
    nominal = parameters_L1()
    half = rng.normal(size=(3, 3))
    return replace(
        nominal,
        lengths=nominal.lengths + rng.uniform(-size, size, 6),
        cart_joints=nominal.cart_joints + rng.uniform(-size, size, (6, 3)),
        plate_joints=nominal.plate_joints + rng.uniform(-size, size, (6, 3)),
        plate_inertia=nominal.plate_inertia + 0.02 * half @ half.T,
        link_masses=rng.uniform(0.3, 2.0, 6),
    )


def link_vectors(robot: SixLink, T: np.ndarray, R: np.ndarray, q: np.ndarray) -> np.ndarray:
    """d_ij, (6, 3) in m, from cart joint to plate joint."""
    return T + robot.plate_joints @ R.T - robot.cart_joints - (q[:, None] * robot.directions)[ARMS]


def constraints(robot: SixLink, T: np.ndarray, R: np.ndarray, q: np.ndarray) -> np.ndarray:
    """|d_ij| - L_ij, (6,) in m."""
    return np.linalg.norm(link_vectors(robot, T, R, q), axis=1) - robot.lengths


def plate_jacobian(robot: SixLink, T: np.ndarray, R: np.ndarray, q: np.ndarray) -> np.ndarray:
    """The rates of |d_ij| by (T', w), (6, 6): the inverse of J_SP in eq. 4.31, w instead of Euler rates."""
    d = link_vectors(robot, T, R, q)
    e = d / np.linalg.norm(d, axis=1)[:, None]
    return np.hstack([e, np.cross(robot.plate_joints @ R.T, e)])


def constraint_jacobian(robot: SixLink, T: np.ndarray, R: np.ndarray, q: np.ndarray) -> np.ndarray:
    """A, (6, 9): the rates of |d_ij| by u = (T', w, q')."""
    plate = plate_jacobian(robot, T, R, q)
    carts = np.zeros((6, 3))
    carts[np.arange(6), ARMS] = -(plate[:, :3] * robot.directions[ARMS]).sum(axis=1)
    return np.hstack([plate, carts])


def constraint_bias(robot: SixLink, state: State) -> np.ndarray:
    """c, (6,) in m/s2: what |d_ij|'' is without accelerations, e.d'' + (|d'|^2 - (e.d')^2) / |d|."""
    d = link_vectors(robot, state.T, state.R, state.q)
    L = np.linalg.norm(d, axis=1)
    e = d / L[:, None]
    arms = robot.plate_joints @ state.R.T
    d_dot = state.T_dot + np.cross(state.w, arms) - (state.q_dot[:, None] * robot.directions)[ARMS]
    centripetal = np.cross(state.w, np.cross(state.w, arms))
    across = (d_dot**2).sum(axis=1) - (e * d_dot).sum(axis=1) ** 2
    return (e * centripetal).sum(axis=1) + across / L


def middle_jacobians(robot: SixLink, R: np.ndarray) -> np.ndarray:
    """The rates of the link middles (A_ij + B_ij) / 2 by u, (6, 3, 9)."""
    rates = np.zeros((6, 3, 9))
    for k, arm in enumerate(robot.plate_joints @ R.T):
        rates[k, :, :3] = np.eye(3) / 2
        rates[k, :, 3:6] = -skew(arm) / 2
        rates[k, :, 6 + ARMS[k]] = robot.directions[ARMS[k]] / 2
    return rates


def mass_matrix(robot: SixLink, R: np.ndarray) -> np.ndarray:
    """M, (9, 9), of the speeds u = (T', w, q')."""
    M = np.zeros((9, 9))
    M[:3, :3] = robot.plate_mass * np.eye(3)
    M[3:6, 3:6] = R @ robot.plate_inertia @ R.T
    M[6:, 6:] = np.diag(robot.cart_masses * (robot.directions**2).sum(axis=1))
    rates = middle_jacobians(robot, R)
    return M + np.einsum("k,kab,kac->bc", robot.link_masses, rates, rates)


def bias_force(robot: SixLink, R: np.ndarray, w: np.ndarray) -> np.ndarray:
    """b, (9,) in N and N.m: centripetal and gyroscopic forces, and weight."""
    up = np.array([0.0, 0.0, robot.g])
    b = np.zeros(9)
    b[:3] = robot.plate_mass * up
    b[3:6] = np.cross(w, R @ robot.plate_inertia @ R.T @ w)
    b[6:] = robot.cart_masses * (robot.directions @ up)
    centripetal = np.cross(w, np.cross(w, robot.plate_joints @ R.T)) / 2
    return b + np.einsum("k,kab,ka->b", robot.link_masses, middle_jacobians(robot, R), centripetal + up)


def equations(robot: SixLink, state: State, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Matrix (15, 15) and right-hand side (15,) of the linear equations for (u', tension)."""
    A = constraint_jacobian(robot, state.T, state.R, state.q)
    matrix = np.block([[mass_matrix(robot, state.R), A.T], [A, np.zeros((6, 6))]])
    force = -bias_force(robot, state.R, state.w)
    force[6:] += f
    return matrix, np.concatenate([force, -constraint_bias(robot, state)])


def accelerations(
    robot: SixLink,
    T: np.ndarray,
    R: np.ndarray,
    q: np.ndarray,
    T_dot: np.ndarray,
    w: np.ndarray,
    q_dot: np.ndarray,
    f: np.ndarray,
) -> Accelerations:
    """Accelerations and tensions of a consistent state under the cart forces f, (3,) in N.

    Raises numpy.linalg.LinAlgError where the constraints are exactly dependent.
    """
    x = np.linalg.solve(*equations(robot, State(T, R, q, T_dot, w, q_dot), f))
    return Accelerations(x[:3], x[3:6], x[6:9], x[9:])


def energy(robot: SixLink, state: State) -> float:
    """Kinetic and potential energy, J."""
    u = np.concatenate([state.T_dot, state.w, state.q_dot])
    carts = robot.directions[:, 2] * state.q
    joints = state.T + robot.plate_joints @ state.R.T
    middles = (robot.cart_joints[:, 2] + carts[ARMS] + joints[:, 2]) / 2
    height = robot.plate_mass * state.T[2] + robot.cart_masses @ carts + robot.link_masses @ middles
    return float(u @ mass_matrix(robot, state.R) @ u / 2 + robot.g * height)


def cart_positions(robot: SixLink, T: np.ndarray, R: np.ndarray) -> np.ndarray:
    """q, (3,) in m, that fits the first link of each arm, the cart behind the tool; NaN out of reach."""
    q = np.empty(3)
    for i, k in enumerate((0, 1, 3)):
        v = robot.directions[i]
        away = T + R @ robot.plate_joints[k] - robot.cart_joints[k]
        along = away @ v / (v @ v)
        across = away - along * v
        with np.errstate(invalid="ignore"):
            q[i] = along - np.sqrt((robot.lengths[k] ** 2 - across @ across) / (v @ v))
    return q


def plate_pose(robot: SixLink, q: np.ndarray, T: np.ndarray, R: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The pose (T, R) at cart positions q, by Newton from a near one, to rounding.

    Raises ArithmeticError when Newton does not converge.
    """
    residual = constraints(robot, T, R, q)
    for _ in range(30):
        if np.abs(residual).max() < 2e-15:
            break
        step = np.linalg.solve(plate_jacobian(robot, T, R, q), -residual)
        T, R = T + step[:3], turn(step[3:]) @ R
        residual = constraints(robot, T, R, q)
    if not np.abs(residual).max() < 1e-13:
        raise ArithmeticError(
            f"plate_pose: links are wrong by {residual} m at q = {q}; start nearer to the pose"
        )
    return T, R


def consistent_states(
    robot: SixLink,
    count: int,
    seed: int,
    low: tuple[float, float, float] = (0.2, 2.5, -0.9),
    high: tuple[float, float, float] = (1.6, 3.1, -0.3),
    speed: float = 1.0,
) -> list[State]:
    """Random states near a box of tool positions (m), with cart speeds q' up to speed (m/s) either way.

    q is drawn as that of a tool position in the box with a level plate; the pose then follows from q, and is kept
    if the plate turns by less than 0.5 rad.
    """
    rng = np.random.default_rng(seed)
    states = []
    while len(states) < count:
        guess = rng.uniform(low, high)
        q = cart_positions(robot, guess, np.eye(3))
        try:
            T, R = plate_pose(robot, q, guess, np.eye(3))
        except (ArithmeticError, np.linalg.LinAlgError):
            continue  # out of reach, or too near to a singular pose
        if np.trace(R) < 1 + 2 * np.cos(0.5):
            continue  # Newton went to another assembly mode
        A = constraint_jacobian(robot, T, R, q)
        q_dot = rng.uniform(-speed, speed, 3)
        twist = np.linalg.solve(A[:, :6], -A[:, 6:] @ q_dot)
        states.append(State(T, R, q, twist[:3], twist[3:], q_dot))
    return states
