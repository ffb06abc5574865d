"""A minimum-time motion of the six-link robot D1: from components, and by hand with rod tensions.

R = R_start C(p)                                     Cayley: (1 + p.p) C = (1 - p.p) 1 + 2 p p' + 2 [p]x
d_k = T + R B_k - A_k - q_i n_i,  |d_k| = L_k        rod k on cart i; p and q follow from the six lengths
c_k = m_k / 2 (middle_k'' + g z)                     half of what the mass in the middle of a rod needs
F_k = c_k + tension_k d_k / L_k                      on the plate
0 = m (T'' + g z) + sum F_k,   0 = J w' + w x J w + sum R B_k x F_k
f_i = M_i (n_i.n_i q_i'' + g n_i.z) + friction_i(q_i') + n_i.sum (c_k - tension_k d_k / L_k)
"""

import casadi as ca
import numpy as np

from gantrytau import Start, between
from gantrytau_models import SixLinkGantryTau, prototypes
from gantrytau_models.mechanisms.six_link import quaternion
from gantrytau_optimica import Free, Optimization, final, initial
from tests.benchmarks.gta import trapezoid
from tests.benchmarks.peers.written import Columns, Motion

START, END = (-0.3810854, -4.234675413, -0.013504232), (0.317839115, -4.681717984, 0.153995869)  # m
# m, where they are there
CARTS = ((0.972182324, 0.904239254, 0.940267196), (1.503179006, 1.749897504, 1.61476282))
TURN = np.array(
    [
        [0.995487603, -0.040770981, 0.085684694],
        [-0.091801453, -0.185288944, 0.97838666],
        [-0.024013094, -0.981837554, -0.188195218],
    ]
)  # of the plate at the start
LIMIT, G, SMOOTHING = 1200.0, 9.81, 0.05  # N, m/s2, m/s
NEWTON = 100.0  # tensions and forces are written in hundreds of N


class SixLinkMotion(Optimization):
    """From rest to rest as fast as the carts allow."""

    robot = SixLinkGantryTau(
        prototypes.D1,
        tool=dict(r=Start(list(START)), q=Start(quaternion(TURN))),
        carts=[dict(s=Start(s)) for s in CARTS[0]],
    )
    final_time = Free(1.0, unit="s", min=0.05, max=5.0, description="duration of the motion")

    def objective(self):
        return self.final_time

    def constraints(self):
        for at, r in ((initial, START), (final, END)):
            yield at(self.robot.tool.r) == list(r)
            yield at(self.robot.tool.v) == 0
        for cart in self.robot.carts:
            yield between(-LIMIT, cart.f, LIMIT)


def motion() -> Motion:
    """By hand: accelerations of the tool are chosen, forces of the carts are limits on the path."""
    robot, up = prototypes.D1, ca.DM([0, 0, 1])
    T, v, a, p, q, w, dq, dw, ddq = (
        ca.SX.sym(name, 3) for name in ("T", "v", "a", "p", "q", "w", "dq", "dw", "ddq")
    )
    tension = ca.SX.sym("tension", 6)
    square = ca.sumsqr(p)
    R = TURN @ ((1 - square) * ca.SX.eye(3) + 2 * p @ p.T + 2 * ca.skew(p)) / (1 + square)
    J = R @ ca.DM(robot.plate_inertia) @ R.T
    force = robot.plate_mass * (a + G * up)
    moment = J @ dw + ca.cross(w, J @ w)
    lengths, rates, accelerations, forces = [], [], [], []
    for i, arm in enumerate(robot.arms):
        n = ca.DM(arm.direction)
        driven = robot.cart_masses[i] * (ca.sumsqr(n) * ddq[i] + G * n[2])
        driven += robot.coulomb[i] * ca.tanh(dq[i] / SMOOTHING) + robot.viscous[i] * dq[i]
        for link in arm.links:
            b = R @ ca.DM(link.plate_offset)
            d = T + b - ca.DM(link.offset) - q[i] * n
            speed = v + ca.cross(w, b) - dq[i] * n
            joint = a + ca.cross(dw, b) + ca.cross(w, ca.cross(w, b))
            middle = link.mass / 2 * ((joint + ddq[i] * n) / 2 + G * up)
            pull = NEWTON * tension[len(lengths)] * d / link.length
            lengths.append((ca.sumsqr(d) - link.length**2) / (2 * link.length))
            rates.append(ca.dot(d, speed) / link.length)
            accelerations.append((ca.dot(d, joint - ddq[i] * n) + ca.sumsqr(speed)) / (10 * link.length))
            force += middle + pull
            moment += ca.cross(b, middle + pull)
            driven += ca.dot(n, middle - pull)
        forces.append(driven / LIMIT)
    first, last = (np.concatenate(side)[:, None] for side in ((START, CARTS[0]), (END, CARTS[1])))

    def guess(shares: np.ndarray) -> Columns:
        position, speed, acceleration = trapezoid(shares)
        place, rate = first + (last - first) * position, (last - first) * speed
        slope, none = (last - first) * acceleration, np.zeros((3, shares.size))
        z = [none, place[3:], none, rate[3:], none, slope[3:], none, none]
        return np.vstack([place[:3], rate[:3]]), np.vstack(z), slope[:3]

    unlimited, rest = np.full(33, np.inf), np.zeros(3)
    return Motion(
        x=ca.vertcat(T, v), z=ca.vertcat(p, q, w, dq, dw, ddq, tension), u=a, ode=ca.vertcat(v, a),
        residual=ca.vertcat(*lengths, *rates, *accelerations, force / NEWTON, moment / 10), path=ca.vertcat(*forces),
        path_limits=(-1.0, 1.0), limits=(-unlimited, unlimited), start=np.append(START, rest), end=np.append(END, rest),
        guess=guess, guessed_time=1.0, times=(0.05, 5.0),
    )  # fmt: skip
