"""The F1 by Lagrange's equations with multipliers, in world axes, z up, SI units.

    place of a joint on the plate    B_ij = T + R B_ij^0                              (4.19)
    place of a joint on an arm       [A_ij; 1] = H_i [A_bj; 1]                        (4.16)-(4.18), (4.20)-(4.24)
    |B_ij - A_ij| = L_ij             six constraints; A u = 0, A u' + c = 0 their rates, A (6, 12)
    M u' + b + A' tension = (0, 0, f, tau)      twelve generalised speeds u = (T', w, q1' .. q6')

Dressler (2012), section 4.5. w is the angular velocity of the plate in world axes. Speeds of all points and bodies are
linear in u; `Place` carries the matrices and what of the accelerations remains without u'. A link is a massless rod
with a point mass at its middle; its tension is the mean of the axial forces in its halves, positive when it pulls.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from tests.references.rotations import skew, turn

SPEEDS = 12
UP = np.array([0.0, 0.0, 9.81])  # m/s2
HOME_Q = np.array([0.4, 0.0, 0.0, 0.0, 0.0, 0.0])  # m, rad: a pose far from singular ones
# m, near the tool of F1 and F1_ideal there, links uncrossed, below the carts
HOME = np.array([-0.2, 2.1, -0.2])


@dataclass(frozen=True, eq=False)
class Place:
    """A frame: position, orientation, how u moves it, and its accelerations without u'."""

    r: np.ndarray  # (3,) m
    R: np.ndarray = field(default_factory=lambda: np.eye(3))
    v_u: np.ndarray = field(default_factory=lambda: np.zeros((3, SPEEDS)))  # velocity by u
    w_u: np.ndarray = field(default_factory=lambda: np.zeros((3, SPEEDS)))  # angular velocity by u
    w: np.ndarray = field(default_factory=lambda: np.zeros(3))  # rad/s
    a: np.ndarray = field(default_factory=lambda: np.zeros(3))  # m/s2
    z: np.ndarray = field(default_factory=lambda: np.zeros(3))  # rad/s2

    def shifted(self, offset: np.ndarray) -> Place:
        """The frame at an offset in its own axes."""
        d = self.R @ offset
        a = self.a + np.cross(self.z, d) + np.cross(self.w, np.cross(self.w, d))
        return Place(self.r + d, self.R, self.v_u - skew(d) @ self.w_u, self.w_u, self.w, a, self.z)

    def turned(self, Q: np.ndarray, axis: np.ndarray, angle: float, rate: float, k: int) -> Place:
        """The frame after R(1u) and then the rotation by u[k]' about an axis."""
        R = self.R @ Q @ turn(angle * axis)
        n = R @ axis
        w_u = self.w_u.copy()
        w_u[:, k] += n
        z = self.z + np.cross(self.w, n) * rate
        return Place(self.r, R, self.v_u, w_u, self.w + n * rate, self.a, z)


class State(NamedTuple):
    """Positions and speeds that satisfy the constraints."""

    T: np.ndarray  # (3,) m
    R: np.ndarray  # (3, 3)
    q: np.ndarray  # (6,) m, rad
    u: np.ndarray  # (12,) T', w, q'


class Accelerations(NamedTuple):
    """The solution of the equations of motion."""

    u_dot: np.ndarray  # (12,)
    tension: np.ndarray  # (6,) N


def rotation(u: np.ndarray) -> np.ndarray:
    """R = I + 2 w [r]x + 2 [r]x^2 of a scalar-first quaternion."""
    K = skew(u[1:])
    return np.eye(3) + 2 * u[0] * K + 2 * K @ K


def arms(robot, q: np.ndarray, q_dot: np.ndarray) -> list[list[Place]]:
    """Per arm its cart, (4.20), and the frames of its turntables, H of (4.21) and (4.23)."""
    places, k = [], 3
    for i, arm in enumerate(robot.arms):
        along = np.zeros((3, SPEEDS))
        along[:, 6 + i] = arm.direction
        chain = [Place(np.array(arm.offset) + q[i] * np.array(arm.direction), v_u=along)]
        for turntable in arm.turntables:
            base = chain[-1].shifted(np.array(turntable.offset))
            Q, axis = rotation(np.array(turntable.orientation)), np.array(turntable.axis)
            chain.append(base.turned(Q, axis, q[k], q_dot[k], 6 + k))
            k += 1
        places.append(chain)
    return places


def plate(T: np.ndarray, R: np.ndarray, w: np.ndarray) -> Place:
    """The frame of the tool."""
    v_u, w_u = np.zeros((3, SPEEDS)), np.zeros((3, SPEEDS))
    v_u[:, :3] = w_u[:, 3:6] = np.eye(3)
    return Place(T, R, v_u, w_u, w)


def links(robot, state: State) -> list[tuple[Place, Place]]:
    """The ends of each link, on its arm and on the plate."""
    tool = plate(state.T, state.R, state.u[3:6])
    return [
        (chain[-1].shifted(np.array(link.cart_offset)), tool.shifted(np.array(link.plate_offset)))
        for arm, chain in zip(robot.arms, arms(robot, state.q, state.u[6:]), strict=True)
        for link in arm.links
    ]


def lengths(robot) -> np.ndarray:
    """L_ij, (6,) in m."""
    return np.array([link.length for arm in robot.arms for link in arm.links])


def constraints(robot, state: State) -> np.ndarray:
    """|B_ij - A_ij| - L_ij, (6,) in m."""
    return np.array([np.linalg.norm(b.r - a.r) for a, b in links(robot, state)]) - lengths(robot)


def constraint_rates(robot, state: State) -> tuple[np.ndarray, np.ndarray]:
    """A, (6, 12), and c, (6,) in m/s2: e.d'' without u' + (|d'|^2 - (e.d')^2) / |d|."""
    A, c = [], []
    for a, b in links(robot, state):
        d, d_u = b.r - a.r, b.v_u - a.v_u
        size = np.linalg.norm(d)
        e, rate = d / size, d_u @ state.u
        A.append(e @ d_u)
        c.append(e @ (b.a - a.a) + (rate @ rate - (e @ rate) ** 2) / size)
    return np.array(A), np.array(c)


def masses(robot, state: State) -> list[tuple[float, np.ndarray, Place]]:
    """Mass, inertia about the centre of mass in own axes, and centre of mass of each body."""
    none = np.zeros((3, 3))
    tool = plate(state.T, state.R, state.u[3:6]).shifted(np.array(robot.plate_centre))
    found = [(robot.plate_mass, np.array(robot.plate_inertia), tool)]
    for i, (arm, chain) in enumerate(zip(robot.arms, arms(robot, state.q, state.u[6:]), strict=True)):
        found.append((robot.cart_masses[i], none, chain[0]))
        for turntable, place in zip(arm.turntables, chain[1:], strict=True):
            found.append((turntable.mass, np.array(turntable.inertia), place))
    link_masses = [link.mass for arm in robot.arms for link in arm.links]
    for mass, (a, b) in zip(link_masses, links(robot, state), strict=True):
        found.append((mass, none, Place((a.r + b.r) / 2, v_u=(a.v_u + b.v_u) / 2, a=(a.a + b.a) / 2)))
    return found


def mass_and_bias(robot, state: State) -> tuple[np.ndarray, np.ndarray]:
    """M, (12, 12), and b, (12,): centripetal and gyroscopic forces, and weight."""
    M, b = np.zeros((SPEEDS, SPEEDS)), np.zeros(SPEEDS)
    for m, J_own, place in masses(robot, state):
        J = place.R @ J_own @ place.R.T
        M += m * place.v_u.T @ place.v_u + place.w_u.T @ J @ place.w_u
        b += m * place.v_u.T @ (place.a + UP)
        b += place.w_u.T @ (J @ place.z + np.cross(place.w, J @ place.w))
    return M, b


def accelerations(robot, state: State, force: np.ndarray) -> Accelerations:
    """Accelerations and tensions under forces on the carts and torques on the turntables, (6,) in N, N.m."""
    M, b = mass_and_bias(robot, state)
    A, c = constraint_rates(robot, state)
    matrix = np.block([[M, A.T], [A, np.zeros((6, 6))]])
    x = np.linalg.solve(matrix, np.concatenate([-b[:6], force - b[6:], -c]))
    return Accelerations(x[:SPEEDS], x[SPEEDS:])


def energy(robot, state: State) -> float:
    """Kinetic and potential energy, J."""
    M, _ = mass_and_bias(robot, state)
    height = sum(m * place.r @ UP for m, _, place in masses(robot, state))
    return float(state.u @ M @ state.u / 2 + height)


def plate_pose(robot, q: np.ndarray, T: np.ndarray, R: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The pose (T, R) at actuator coordinates q, by Newton from a near one, to rounding.

    Raises ArithmeticError when Newton does not converge.
    """
    residual = np.full(6, np.inf)
    for _ in range(30):
        state = State(T, R, q, np.zeros(SPEEDS))
        residual = constraints(robot, state)
        if np.abs(residual).max() < 2e-15:
            break
        A, _ = constraint_rates(robot, state)
        step = np.linalg.solve(A[:, :6], -residual)
        T, R = T + step[:3], turn(step[3:]) @ R
    if not np.abs(residual).max() < 1e-13:
        raise ArithmeticError(
            f"plate_pose: links are wrong by {residual} m at q = {q}; start nearer to the pose"
        )
    return T, R


def nominal_rotation(robot) -> np.ndarray:
    """The rotation nearest to plate_rotation, of which the record has six decimals."""
    left, _, right = np.linalg.svd(np.array(robot.plate_rotation))
    return left @ right


def pose_from_home(robot, q: np.ndarray, steps: int = 5) -> tuple[np.ndarray, np.ndarray]:
    """The pose at q on the branch of HOME: followed while the actuators go from HOME_Q to q."""
    T, R = HOME, nominal_rotation(robot)
    for share in np.linspace(0.0, 1.0, steps + 1):
        T, R = plate_pose(robot, HOME_Q + share * (q - HOME_Q), T, R)
    return T, R


def consistent_states(robot, count: int, seed: int, speed: float = 1.0) -> list[State]:
    """Random states on the branch of HOME: carts within 0.2 m of HOME_Q, turntables within 0.3 rad.

    q4 and q5 turn joints about nearly opposite axes, so their sum is kept within 0.06 rad. Rates of the actuators up
    to speed, m/s and rad/s.
    """
    rng = np.random.default_rng(seed)
    states: list[State] = []
    for _ in range(count):
        q = rng.uniform(-1.0, 1.0, 6) * [0.2, 0.2, 0.2, 0.3, 0.03, 0.3]
        q[3], q[4] = q[4] + q[3], q[4] - q[3]
        q += HOME_Q
        T, R = pose_from_home(robot, q)
        A, _ = constraint_rates(robot, State(T, R, q, np.zeros(SPEEDS)))
        q_dot = rng.uniform(-speed, speed, 6)
        states.append(State(T, R, q, np.concatenate([np.linalg.solve(A[:, :6], -A[:, 6:] @ q_dot), q_dot])))
    return states
