"""The planar four-bar loop by hand, twice: one crank angle and Lagrange, or nine coordinates and the forces in the pins.

In the plane, x from the crank's pivot to the rocker's, all angles from there, SI units:

    O crank pivot (0, 0)    P = a e(theta)    S = P + b e(phi) = C + c e(psi)    C rocker pivot (ground, 0)

Bodies in the order crank (from O to P), coupler (from P to S), rocker (from C to S). The centre of mass of a body
is given in its own axes, x along the link from its first pin.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

QUARTER = np.array([[0.0, -1.0], [1.0, 0.0]])  # turns a vector by 90 degrees


@dataclass(frozen=True)
class FourBar:
    """A four-bar loop in a plane; arrays not to be changed."""

    ground: float  # m, distance of the two pivots
    lengths: np.ndarray  # (3,) m, a, b, c
    masses: np.ndarray  # (3,) kg
    centres: np.ndarray  # (3, 2) m, in the axes of the link
    inertias: np.ndarray  # (3,) kg.m2, about the centre of mass and the plane's normal
    gravity: np.ndarray  # (2,) m/s2, in the plane


class Loop(NamedTuple):
    """Angles theta, phi, psi of the three links, and their first and second derivatives by theta."""

    angles: np.ndarray  # (3,) rad
    slopes: np.ndarray  # (3,)
    curvatures: np.ndarray  # (3,)


def example(gravity: tuple[float, float] = (0.0, -9.81)) -> FourBar:
    """A crank and rocker after Grashof (0.3 + 1.0 < 0.8 + 0.7) whose centres lie off the links."""
    return FourBar(
        ground=1.0,
        lengths=np.array([0.3, 0.8, 0.7]),
        masses=np.array([1.2, 2.0, 1.6]),
        centres=np.array([[0.14, 0.02], [0.45, 0.10], [0.30, -0.05]]),
        inertias=np.array([0.012, 0.11, 0.07]),
        gravity=np.array(gravity),
    )


def gravity_in_plane(
    rotation: np.ndarray, gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
) -> np.ndarray:
    """What acts in a tilted plane, (2,) in m/s2; rotation (3, 3) takes plane axes (x, y, normal) to world axes."""
    return (rotation.T @ np.array(gravity))[:2]


def along(angle: float) -> np.ndarray:
    """The unit vector e(angle), (2,)."""
    return np.array([np.cos(angle), np.sin(angle)])


def loop(bars: FourBar, theta: float, branch: int = 1) -> Loop:
    """The closed loop at crank angle theta (rad).

    branch: 1 with S on the left of the line from P to C, -1 on its right. Raises ValueError where the loop cannot
    be closed.
    """
    a, b, c = bars.lengths
    P = a * along(theta)
    diagonal = np.array([bars.ground, 0.0]) - P
    D = np.hypot(*diagonal)
    cosine = (b**2 + D**2 - c**2) / (2 * b * D)
    if not abs(cosine) < 1:
        raise ValueError(
            f"four_bar.loop: the pins are {D:.6g} m apart at theta = {theta:.6g} rad; bars of "
            f"{b:.6g} m and {c:.6g} m cannot be joined there, choose another theta"
        )
    phi = np.arctan2(diagonal[1], diagonal[0]) + branch * np.arccos(cosine)
    S = P + b * along(phi)
    psi = np.arctan2(S[1], S[0] - bars.ground)
    e = [along(angle) for angle in (theta, phi, psi)]
    # derivatives of a e(theta) + b e(phi) - c e(psi) = const, once and twice
    matrix = np.column_stack([b * QUARTER @ e[1], -c * QUARTER @ e[2]])
    first = np.linalg.solve(matrix, -a * QUARTER @ e[0])
    second = np.linalg.solve(matrix, a * e[0] + b * e[1] * first[0] ** 2 - c * e[2] * first[1] ** 2)
    return Loop(np.array([theta, phi, psi]), np.array([1.0, *first]), np.array([0.0, *second]))


def centre_motion(bars: FourBar, closed: Loop) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centres of mass, each (3, 2) in m: positions, and first and second derivatives by theta."""
    a = bars.lengths[0]
    theta = closed.angles[0]
    pivots = np.array([[0.0, 0.0], a * along(theta), [bars.ground, 0.0]])
    pivots_1 = np.array([[0.0, 0.0], a * QUARTER @ along(theta), [0.0, 0.0]])
    pivots_2 = np.array([[0.0, 0.0], -a * along(theta), [0.0, 0.0]])
    out = np.array([turned(angle) @ r for angle, r in zip(closed.angles, bars.centres, strict=True)])
    side = out @ QUARTER.T
    s1, s2 = closed.slopes[:, None], closed.curvatures[:, None]
    return pivots + out, pivots_1 + s1 * side, pivots_2 + s2 * side - s1**2 * out


def turned(angle: float) -> np.ndarray:
    """The plane rotation by angle (rad), (2, 2)."""
    return np.cos(angle) * np.eye(2) + np.sin(angle) * QUARTER


def accelerations(bars: FourBar, theta: float, w: float, torque: float = 0.0, branch: int = 1) -> np.ndarray:
    """Angular accelerations of the three links, (3,) in rad/s2.

    I theta'' + I'(theta) w^2 / 2 = torque + weight; w crank speed in rad/s, torque on the crank in N.m.
    """
    closed = loop(bars, theta, branch)
    _, r1, r2 = centre_motion(bars, closed)
    _, s1, s2 = closed
    inertia = bars.masses @ (r1**2).sum(axis=1) + bars.inertias @ s1**2
    half_slope = bars.masses @ (r1 * r2).sum(axis=1) + bars.inertias @ (s1 * s2)
    force = torque + bars.masses @ (r1 @ bars.gravity)
    crank = (force - half_slope * w**2) / inertia
    return s1 * crank + s2 * w**2


def accelerations_with_reactions(
    bars: FourBar, theta: float, w: float, torque: float = 0.0, branch: int = 1
) -> tuple[np.ndarray, np.ndarray]:
    """Angular accelerations (3,) in rad/s2 and forces in the pins O, P, S, C, (4, 2) in N, in plane axes.

    Newton and Euler for three free bodies and the four pins that join them: the forces are those on the crank in
    O, on the coupler in P, and on the rocker in S and C.
    """
    closed = loop(bars, theta, branch)
    ends = np.column_stack([bars.lengths, np.zeros(3)])
    first = [turned(t) @ -r for t, r in zip(closed.angles, bars.centres, strict=True)]
    last = [turned(t) @ (end - r) for t, end, r in zip(closed.angles, ends, bars.centres, strict=True)]
    # pin: bodies that meet, with their arm from the centre of mass and the sign of the force on them
    pins = [
        [(0, first[0], 1)],
        [(1, first[1], 1), (0, last[0], -1)],
        [(2, last[2], 1), (1, last[1], -1)],
        [(2, first[2], 1)],
    ]
    speeds = closed.slopes * w
    matrix, force = np.zeros((17, 17)), np.zeros(17)
    for k in range(3):
        matrix[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = np.diag(
            [bars.masses[k], bars.masses[k], bars.inertias[k]]
        )
        force[3 * k : 3 * k + 2] = bars.masses[k] * bars.gravity
    force[2] += torque
    for p, members in enumerate(pins):
        rows = slice(9 + 2 * p, 11 + 2 * p)
        for k, arm, sign in members:
            rate = sign * np.column_stack([np.eye(2), QUARTER @ arm])
            matrix[rows, 3 * k : 3 * k + 3] = rate
            matrix[3 * k : 3 * k + 3, rows] = -rate.T
            force[rows] += sign * speeds[k] ** 2 * arm
    x = np.linalg.solve(matrix, force)
    return x[2:9:3], x[9:].reshape(4, 2)


def energy(bars: FourBar, theta: float, w: float, branch: int = 1) -> float:
    """Kinetic and potential energy, J."""
    closed = loop(bars, theta, branch)
    r, r1, _ = centre_motion(bars, closed)
    inertia = bars.masses @ (r1**2).sum(axis=1) + bars.inertias @ closed.slopes**2
    return float(inertia * w**2 / 2 - bars.masses @ (r @ bars.gravity))
