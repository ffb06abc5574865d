"""Motions of the six-link Gantry-Tau from rest, and the singular pose that they meet.

While the links of an arm are parallel, forces along them with the sum zero turn the plate. Those of 3a, 3b and 3c
span two directions of moment, but only one where the three links lie in one plane. There the plate is free to
turn, the constraint Jacobian A (6, 9) loses rank with the columns of the carts too, and the tensions grow as
1 / (time left) when a motion approaches such a pose, because the plate is kept from turning by nothing else.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from tests.references import six_link
from tests.references.rotations import skew
from tests.references.six_link import SixLink, State

LEVEL = np.eye(3)
FIRST_LINKS = [0, 1, 3]  # one link of each arm
FREE = [0, 1, 2, 6, 7, 8]  # T' and q' in u


def simulate(robot: SixLink, T: np.ndarray, f: np.ndarray, stop: float, tolerance: float = 1e-10) -> Any:
    """Motion from rest near tool position T (m) under constant cart forces f (N), as solve_ivp returns it.

    q is that of a level plate at T, and the pose follows from q. Integrates all nine speeds without any correction
    of drift; `state` reads a row of the solution.
    """
    q = six_link.cart_positions(robot, T, LEVEL)
    T, R = six_link.plate_pose(robot, q, T, LEVEL)

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        now = state(y)
        found = six_link.accelerations(robot, *now, f)
        R_dot = (skew(now.w) @ now.R).ravel()
        return np.concatenate([now.T_dot, R_dot, now.q_dot, found.T_ddot, found.w_dot, found.q_ddot])

    start = np.concatenate([T, R.ravel(), q, np.zeros(9)])
    return solve_ivp(
        rates, (0, stop), start, method="DOP853", rtol=tolerance, atol=tolerance / 100, dense_output=True
    )


def state(y: np.ndarray) -> State:
    """One column of the solution of `simulate`, (24,), by name."""
    return State(y[:3], y[3:12].reshape(3, 3), y[12:15], y[15:18], y[18:21], y[21:])


def level_motion(robot: SixLink, T: np.ndarray, f: np.ndarray, stop: float) -> Any:
    """The same motion of a robot of nominal geometry with one link per arm and a plate that cannot turn.

    It is regular where the six-link robot is singular; `level_state` reads a row of the solution.
    """
    q = six_link.cart_positions(robot, T, LEVEL)

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        matrix, force = six_link.equations(robot, level_state(y), f)
        kept = FREE + [9 + k for k in FIRST_LINKS]
        found = np.linalg.solve(matrix[np.ix_(kept, kept)], force[kept])
        return np.concatenate([y[6:], found[:6]])

    start = np.concatenate([T, q, np.zeros(6)])
    return solve_ivp(rates, (0, stop), start, method="DOP853", rtol=1e-11, atol=1e-13, dense_output=True)


def level_state(y: np.ndarray) -> State:
    """One column of the solution of `level_motion`, (12,), by name."""
    T, q, T_dot, q_dot = y.reshape(4, 3)
    return State(T, LEVEL, q, T_dot, np.zeros(3), q_dot)


def singular_time(robot: SixLink, motion: Any) -> float:
    """Time in s at which the plate Jacobian of a `level_motion` changes its sign, to 1e-12 s.

    Raises ValueError where it does not.
    """

    def determinant(t: float) -> float:
        now = level_state(motion.sol(t))
        return float(np.linalg.det(six_link.plate_jacobian(robot, now.T, now.R, now.q)))

    grid = np.linspace(0, motion.t[-1], 201)
    values = [determinant(t) for t in grid]
    for k in range(200):
        if values[k] * values[k + 1] < 0:
            root: Any = brentq(determinant, grid[k], grid[k + 1], xtol=1e-13)
            return root
    raise ValueError(
        f"singular_time: the determinant keeps its sign until {motion.t[-1]} s; simulate for longer"
    )
