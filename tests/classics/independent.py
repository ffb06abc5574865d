"""Positions of the IFToMM mechanisms at given times, by other equations and another integrator than the toolkit's."""

from collections.abc import Callable

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk

G = 9.81  # m/s2
EXACT = dict(rtol=1e-12, atol=1e-13)


def pendulum(times: np.ndarray) -> np.ndarray:
    """A01 in closed form, released at (1, 0): (count, 2) in m."""
    modulus = 0.5  # squared, sin(90 deg / 2)
    sn, *_ = ellipj(ellipk(modulus) - np.sqrt(G) * times, modulus)
    half = np.sqrt(modulus) * sn  # sine of half the angle from below
    return np.column_stack([2 * half * np.sqrt(1 - half**2), 2 * half**2 - 1])


def windows(count: int, times: np.ndarray) -> np.ndarray:
    """A02 as the one pendulum that all bars together are, to one side of upright at 1 m/s: (times, 2) in m."""
    inertia, moment = (count + 1) / 3 + count, G * ((count + 1) / 2 + count)
    found = solve_ivp(
        lambda t, z: [z[1], moment / inertia * np.sin(z[0])],
        (0, times[-1]),
        [0.0, 1.0],
        "DOP853",
        times,
        **EXACT,
    )
    return np.column_stack([np.sin(found.y[0]), np.cos(found.y[0])])


def governor(times: np.ndarray) -> np.ndarray:
    """A05 by Lagrange's equations: angles of shaft and arms, and the slide, which is found: (times, 3) in m."""
    q, v = ca.SX.sym("q", 3), ca.SX.sym("v", 3)
    tilt, height = q[1], q[2]
    across, along = 0.3 * (1 + 1e-4) / 12, 0.3 * 2e-4 / 12
    moving = (along + 0.005) * v[0] ** 2 + 3 * v[2] ** 2
    lifted = 3 * G * height
    for mass, length in ((0.3, 0.5), (5.0, 1.0)):
        moving += 2 * mass * ((length * v[1]) ** 2 + ((0.05 + length * ca.sin(tilt)) * v[0]) ** 2)
        lifted += 2 * mass * G * (1 - length * ca.cos(tilt))
    moving += 2 * (along * (v[0] * ca.cos(tilt)) ** 2 + across * ((v[0] * ca.sin(tilt)) ** 2 + v[1] ** 2))
    line = ca.norm_2(ca.vertcat(0.5 * ca.sin(tilt), 1 - 0.5 * ca.cos(tilt) - height))
    stretch = ca.jacobian(line, q)
    forces = -2 * (8e5 * (line - 0.5) + 4e4 * (stretch @ v)) * stretch.T
    rates = _lagrange(q, v, moving / 2, lifted, forces)
    start = [0.0, np.pi / 3, 0.5, 2 * np.pi, 0.0, 0.0]
    found = solve_ivp(rates, (0, times[-1]), start, "Radau", times, rtol=1e-11, atol=1e-12)
    return np.outer(found.y[2], [0.0, 0.0, 1.0])


def _lagrange(
    q: ca.SX, v: ca.SX, moving: ca.SX, lifted: ca.SX, forces: ca.SX
) -> Callable[[float, np.ndarray], np.ndarray]:
    momentum = ca.jacobian(moving, v).T
    right = ca.jacobian(moving - lifted, q).T + forces - ca.jtimes(momentum, q, v)
    rates = ca.vertcat(v, ca.solve(ca.jacobian(momentum, v), right))
    f = ca.Function("rates", [ca.vertcat(q, v)], [rates])
    return lambda t, z: np.asarray(f(z)).ravel()


def bricard(times: np.ndarray) -> np.ndarray:
    """A04 by the angles of its joints along the one motion that closes the loop, the third corner: (times, 3) in m.

    q' = t(q) w with the null vector t of the loop's Jacobian; w by its own rate from Lagrange's equations along t.
    """
    axes, ways = (
        np.eye(3)[[1, 2, 0, 1, 2]],
        np.array([[1, 0, 0], [0, -1, 0], [0, 0, 1], [-1, 0, 0], [0, 1, 0]]),
    )
    q, v = ca.SX.sym("q", 5), ca.SX.sym("v", 5)
    R, place, moving, lifted, corners = ca.SX.eye(3), ca.SX.zeros(3), 0, 0, []
    for k in range(5):
        cross = ca.skew(axes[k])
        R = R @ (ca.SX.eye(3) + ca.sin(q[k]) * cross + (1 - ca.cos(q[k])) * cross @ cross)
        centre = place + R @ ways[k] / 2
        speed = ca.jtimes(centre, q, v)
        spin = ca.inv_skew(ca.reshape(ca.jtimes(ca.vec(R), q, v), 3, 3) @ R.T)
        thick = np.where(ways[k], 1.0, 0.01)
        inertia = np.diag((thick.sum() - thick) / 12)
        moving += (ca.sumsqr(speed) + (R.T @ spin).T @ inertia @ (R.T @ spin)) / 2
        lifted += G * centre[1]
        place = place + R @ ways[k]
        corners.append(place)
    # the loop ends at z = 1, on the last joint, which turns about x: the last frame's x axis stays that of the world
    loop = ca.vertcat(place - ca.DM([0, 0, 1]), R[1, 0], R[2, 0])
    slopes = ca.jacobian(loop, q)
    mass = ca.jacobian(ca.jacobian(moving, v).T, v)
    bend = ca.jtimes(ca.jacobian(moving, v).T, q, v) - ca.jacobian(moving, q).T + ca.jacobian(lifted, q).T
    parts = ca.Function("parts", [q, v], [slopes, mass, bend, ca.jtimes(ca.jtimes(loop, q, v), q, v), loop])

    def closed(angles: np.ndarray) -> np.ndarray:
        for _ in range(3):
            slope, *_, off = (np.asarray(one) for one in parts(angles, np.zeros(5)))
            angles = angles - np.linalg.pinv(slope, rcond=1e-6) @ off.ravel()
        return angles

    def rates(t: float, z: np.ndarray) -> np.ndarray:
        slope, inertia, force, curve, _ = (np.asarray(one) for one in parts(z[:5], z[5:]))
        tangent = np.linalg.svd(slope)[2][-1]
        own = np.linalg.pinv(slope, rcond=1e-6) @ -curve.ravel()  # acceleration that the loop asks for
        along = -tangent @ (force.ravel() + inertia @ own) / (tangent @ inertia @ tangent)
        return np.concatenate([z[5:], own + along * tangent])

    assert np.abs(closed(np.zeros(5))).max() < 1e-12
    found = solve_ivp(rates, (0, times[-1]), np.zeros(10), "DOP853", times, rtol=1e-11, atol=1e-12)
    corner = ca.Function("corner", [q], [corners[2]])
    return np.array([np.asarray(corner(closed(angles))).ravel() for angles in found.y[:5].T])
