"""The closed form of the three-link Gantry-Tau, written by hand: the peer of the translated model.

Dressler (2012), equations 6.3 to 6.8, derived again by Lagrange with a point mass in the middle of each link
and all guideways along e_x. Base frame, z up, SI units. Letters: T tool position, q cart positions, D_i the
link vector from cart to tool, W = J^-1 the matrix of q' = W T' (6.5), c_i = |D_i'|^2 the centripetal term
(6.6).

    |D_i|^2 = L_i^2                         D_i = T - A_i - q_i e_x                     (6.3)
    q'' = W T'' + c / dX                                                                (6.6, solved for q'')
    M1 T'' + M2 q'' + G = W' (f - friction(q'))                                         (6.7, 6.8)
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import casadi as ca

Friction = Literal["tanh", "piecewise linear"] | None
Triple = tuple[float, float, float]


@dataclass(frozen=True)
class ThreeLink:
    """A three-link Gantry-Tau with guideways along (1, 0, 0)."""

    lengths: Triple  # m
    offsets: tuple[Triple, Triple, Triple]  # m, A_i^s of (4.7): cart joint less plate joint at q = 0
    plate_mass: float  # kg
    cart_masses: Triple  # kg
    link_masses: Triple  # kg
    coulomb: Triple  # N
    viscous: Triple  # kg/s
    friction: Friction = "tanh"
    smoothing: float = 0.05  # m/s, speed at which Coulomb friction is nearly fully developed
    g: float = 9.81  # m/s2


# Table 5.1 (modified: lengths and offsets) and Table 6.3, model 2, guideways along (1, 0, 0)
GT_A = ThreeLink(
    lengths=(2.0608, 2.0633, 2.0611),
    offsets=((-1.8089, 3.5093, 0.0039), (-1.8656, 2.2456, 0.2074), (-1.8086, 3.2774, -1.4434)),
    plate_mass=9.13,
    cart_masses=(13.58, 13.64, 38.23),
    link_masses=(0.0, 0.0, 0.0),
    coulomb=(128.62, 145.13, 194.57),
    viscous=(102.43, 355.25, 388.77),
)
GT_A_HEAVY_LINKS = replace(GT_A, link_masses=(0.9, 1.7, 2.4))


class Arm(NamedTuple):
    """What one arm contributes: the slopes in its row (1, y, z) of W, and the speeds that follow."""

    slope_y: ca.SX  # dY / dX
    slope_z: ca.SX  # dZ / dX
    velocity: ca.SX  # q', m/s
    centripetal: ca.SX  # c / dX, m/s2


def reach(robot: ThreeLink, i: int, T: ca.SX) -> ca.SX:
    """dX_i = sqrt(L^2 - dY^2 - dZ^2), m: how far the tool is ahead of cart i."""
    _, y, z = robot.offsets[i]
    return ca.sqrt(robot.lengths[i] ** 2 - (T[1] - y) ** 2 - (T[2] - z) ** 2)


def inverse_kinematics(robot: ThreeLink, T: ca.SX) -> ca.SX:
    """Cart positions, (3,) in m, carts behind the tool."""
    return ca.vertcat(*(T[0] - robot.offsets[i][0] - reach(robot, i, T) for i in range(3)))


def forward_kinematics(robot: ThreeLink, q: ca.SX) -> ca.SX:
    """Tool position, (3,) in m: the common point of three spheres that is ahead of the carts."""
    centres = [ca.DM(robot.offsets[i]) + q[i] * ca.DM([1, 0, 0]) for i in range(3)]
    e1 = centres[1] - centres[0]
    e3 = centres[2] - centres[0]
    d = ca.norm_2(e1)
    e1 = e1 / d
    i = ca.dot(e1, e3)
    e2 = e3 - i * e1
    j = ca.norm_2(e2)
    e2 = e2 / j
    normal = ca.cross(e1, e2)
    L = [length**2 for length in robot.lengths]
    x = (L[0] - L[1] + d**2) / (2 * d)
    y = (L[0] - L[2] + i**2 + j**2 - 2 * i * x) / (2 * j)
    z = ca.sqrt(L[0] - x**2 - y**2)
    return centres[0] + x * e1 + y * e2 + ca.sign(normal[0]) * z * normal


def velocity_jacobian(robot: ThreeLink, T: ca.SX) -> ca.SX:
    """W = J^-1 of q' = W T', (3, 3); equation 6.5."""
    rows = []
    for i in range(3):
        _, y, z = robot.offsets[i]
        inverse = 1 / reach(robot, i, T)
        rows.append(ca.horzcat(1, (T[1] - y) * inverse, (T[2] - z) * inverse))
    return ca.vertcat(*rows)


def accelerations(robot: ThreeLink, T: ca.SX, dT: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
    """Tool accelerations T'' = J q'' - Dm^-1 c, (3,) in m/s2; equation 6.6."""
    centripetal = [((dT[0] - dq[i]) ** 2 + dT[1] ** 2 + dT[2] ** 2) / reach(robot, i, T) for i in range(3)]
    return ca.solve(velocity_jacobian(robot, T), ddq - ca.vertcat(*centripetal))


def mass_matrix_tool(robot: ThreeLink, T: ca.SX) -> ca.SX:
    """M1 of equation 6.7, (3, 3) in kg."""
    quarter = [m / 4 for m in robot.link_masses]
    W = velocity_jacobian(robot, T)
    M = (robot.plate_mass + sum(quarter)) * ca.SX.eye(3)
    M[:, 0] += W.T @ ca.DM(quarter)
    return M


def mass_matrix_carts(robot: ThreeLink, T: ca.SX) -> ca.SX:
    """M2 of equation 6.7, (3, 3) in kg."""
    quarter = [m / 4 for m in robot.link_masses]
    M = velocity_jacobian(robot, T).T @ ca.diag(ca.DM(robot.cart_masses) + ca.DM(quarter))
    M[0, :] += ca.DM(quarter).T
    return M


def gravity(robot: ThreeLink) -> ca.DM:
    """G of equation 6.7, (3,) in N."""
    return ca.DM([0, 0, robot.g * (robot.plate_mass + sum(robot.link_masses) / 2)])


def friction_force(robot: ThreeLink, i: int, v: ca.SX) -> ca.SX:
    """Friction in cart i at speed v (N), positive for positive speed."""
    if robot.friction is None:
        return ca.SX(0)
    ratio = v * (1 / robot.smoothing)
    sign = ca.tanh(ratio) if robot.friction == "tanh" else ca.fmin(ca.fmax(ratio, -1), 1)
    return robot.coulomb[i] * sign + robot.viscous[i] * v


def arms(robot: ThreeLink, T: ca.SX, dT: ca.SX) -> list[Arm]:
    """Kinematics of the three arms with every common subexpression written once."""
    across = dT[1] ** 2 + dT[2] ** 2
    result = []
    for i in range(3):
        _, y, z = robot.offsets[i]
        dY, dZ = T[1] - y, T[2] - z
        inverse = 1 / ca.sqrt(robot.lengths[i] ** 2 - dY**2 - dZ**2)
        slope_y, slope_z = dY * inverse, dZ * inverse
        ahead = slope_y * dT[1] + slope_z * dT[2]  # q' - x'
        result.append(Arm(slope_y, slope_z, dT[0] + ahead, (ahead**2 + across) * inverse))
    return result


def forward_dynamics(robot: ThreeLink, T: ca.SX, dT: ca.SX, f: ca.SX) -> ca.SX:
    """T'' from the actuator forces f (before friction), (3,) in m/s2.

    (M1 + M2 W) T'' = W' (f - friction) - G - M2 c/dX, the symmetric matrix on the left by Cholesky without
    roots.
    """
    quarter = [m / 4 for m in robot.link_masses]
    plate = robot.plate_mass + sum(quarter)
    M11 = plate + sum(robot.cart_masses) + 3 * sum(quarter)
    M12, M13, M22, M23, M33 = ca.SX(0), ca.SX(0), ca.SX(plate), ca.SX(0), ca.SX(plate)
    b1, b2, b3 = ca.SX(0), ca.SX(0), -gravity(robot)[2]
    for i, arm in enumerate(arms(robot, T, dT)):
        cart = robot.cart_masses[i] + quarter[i]
        y, z = arm.slope_y, arm.slope_z
        cart_y, cart_z = cart * y, cart * z
        M12 += cart_y + quarter[i] * y
        M13 += cart_z + quarter[i] * z
        M22 += cart_y * y
        M23 += cart_y * z
        M33 += cart_z * z
        force = f[i] - friction_force(robot, i, arm.velocity) - cart * arm.centripetal
        b1 += force - quarter[i] * arm.centripetal
        b2 += force * y
        b3 += force * z
    l21, l31 = M12 * (1 / M11), M13 * (1 / M11)
    d2, s23 = M22 - l21 * M12, M23 - l31 * M12
    l32 = s23 / d2
    b2 -= l21 * b1
    x3 = (b3 - l31 * b1 - l32 * b2) / (M33 - l31 * M13 - l32 * s23)
    x2 = b2 / d2 - l32 * x3
    return ca.vertcat(b1 * (1 / M11) - l21 * x2 - l31 * x3, x2, x3)


def inverse_dynamics(robot: ThreeLink, T: ca.SX, dT: ca.SX, ddT: ca.SX) -> ca.SX:
    """Actuator forces (before friction) of a motion, (3,) in N."""
    quarter = [m / 4 for m in robot.link_masses]
    inertia = (robot.plate_mass + sum(quarter)) * ddT + gravity(robot)
    rest, rows = [], []
    for i, arm in enumerate(arms(robot, T, dT)):
        ddq = ddT[0] + arm.slope_y * ddT[1] + arm.slope_z * ddT[2] + arm.centripetal
        inertia[0] += quarter[i] * ddq
        rest.append(
            robot.cart_masses[i] * ddq + quarter[i] * (ddq + ddT[0]) + friction_force(robot, i, arm.velocity)
        )
        rows.append(ca.horzcat(1, arm.slope_y, arm.slope_z))
    return ca.vertcat(*rest) + ca.solve(ca.vertcat(*rows).T, inertia)


def forward_dynamics_function(robot: ThreeLink) -> ca.Function:
    """T'' = f(T, T', f) as a CasADi function: the reference for counting instructions and for timing."""
    T, dT, f = ca.SX.sym("T", 3), ca.SX.sym("dT", 3), ca.SX.sym("f", 3)
    return ca.Function(
        "forward_dynamics", [T, dT, f], [forward_dynamics(robot, T, dT, f)], ["T", "dT", "f"], ["ddT"]
    )
