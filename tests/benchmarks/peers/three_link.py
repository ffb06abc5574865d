"""The motion GT-A of the three-link robot by hand: torques are chosen, accelerations and reaches follow.

The reaches dX (m) are bounded unknowns with the length of the link as their equation: no square root is evaluated.

    0 = dX^2 + dY^2 + dZ^2 - L^2             0 = M1 T'' + M2 q'' + G - W' (gear * torque - friction)
"""

import casadi as ca
import numpy as np

from tests.benchmarks.closed_form import friction_force
from tests.benchmarks.gta import Task, reaches, trapezoid
from tests.benchmarks.peers.written import Columns, Motion


def motion(task: Task | None = None) -> Motion:
    """On a free path, or along the straight line in its path coordinate; without a task from A to B of GT-A."""
    task = task or Task()
    n = 1 if task.line else 3
    y, dy, ddy = (ca.SX.sym(name, n) for name in ("y", "dy", "ddy"))
    dX, torque = ca.SX.sym("dX", 3), ca.SX.sym("torque", 3)
    residual = residuals(task)(y, dy, ddy, dX, torque)
    first, last = (np.zeros(1), np.ones(1)) if task.line else (np.array(task.start), np.array(task.end))

    def guess(shares: np.ndarray) -> Columns:
        position, speed, acceleration = trapezoid(shares)
        tool = np.array(task.start) + position[:, None] * np.subtract(task.end, task.start)
        span, T = (last - first)[:, None], task.guessed_time
        x = np.vstack([first[:, None] + span * position, span * speed / T])
        z = np.vstack([span * acceleration / T**2, reaches(task.robot, tool).T])
        return x, z, np.zeros((3, shares.size))

    free, limit, least = np.full(3 * n, np.inf), np.full(3, task.torque_limit), np.full(3, task.least_reach)
    return Motion(
        x=ca.vertcat(y, dy), z=ca.vertcat(ddy, dX), u=torque,
        ode=ca.vertcat(dy, ddy), residual=residual, path=ca.SX(0, 1), path_limits=(0.0, 0.0),
        # an upper limit of the reaches would lead to other branches
        limits=(np.concatenate([-free, least, -limit]), np.concatenate([free, np.full(3, np.inf), limit])),
        start=np.append(first, np.zeros(n)), end=np.append(last, np.zeros(n)),
        guess=guess, guessed_time=task.guessed_time, times=(0.1, 5.0),
    )  # fmt: skip


def residuals(task: Task) -> ca.Function:
    """(y, dy, ddy, dX, torque) -> residuals (6,) of link lengths and forces; y: tool position or path coordinate."""
    robot, n = task.robot, 1 if task.line else 3
    y, dy, ddy = ca.SX.sym("y", n), ca.SX.sym("dy", n), ca.SX.sym("ddy", n)
    dX, torque = ca.SX.sym("dX", 3), ca.SX.sym("torque", 3)
    along = ca.DM(task.end) - ca.DM(task.start)
    tool, velocity, acceleration = (
        (ca.DM(task.start) + y * along, dy * along, ddy * along) if task.line else (y, dy, ddy)
    )
    balance = ca.vertcat(0, 0, robot.g * robot.plate_mass) + robot.plate_mass * acceleration
    lengths = []
    for i in range(3):
        _, offset_y, offset_z = robot.offsets[i]
        dY, dZ = tool[1] - offset_y, tool[2] - offset_z
        slope_y, slope_z = dY / dX[i], dZ / dX[i]
        ahead = slope_y * velocity[1] + slope_z * velocity[2]
        centripetal = (ahead**2 + velocity[1] ** 2 + velocity[2] ** 2) / dX[i]
        ddq = acceleration[0] + slope_y * acceleration[1] + slope_z * acceleration[2] + centripetal
        net = (
            task.gear * torque[i] - friction_force(robot, i, velocity[0] + ahead) - robot.cart_masses[i] * ddq
        )
        balance -= net * ca.vertcat(1, slope_y, slope_z)
        lengths.append(dX[i] ** 2 + dY**2 + dZ**2 - robot.lengths[i] ** 2)
    residual = ca.vertcat(*lengths, balance)
    return ca.Function("point", [y, dy, ddy, dX, torque], [residual])
