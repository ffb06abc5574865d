"""A minimum-time motion of the delta robot: from components, and by hand with a plate that stays level.

e_i = (base - plate) o_i + arm (cos(phi_i) o_i - sin(phi_i) z)    elbow less the place of its joint on the plate
d_i = T - e_i,  |d_i| = rod                                       the two rods of an arm as one
c_i = rods / 2 ((T'' + e_i'') / 2 + g z)                          half of what a mass in the middle of the rods needs
0 = plate (T'' + g z) + sum c_i + tension_i d_i / rod
tau_i = J phi_i'' + arm mass / 2 arm g z.e_i' / phi_i' + (de_i / dphi_i).(c_i - tension_i d_i / rod)
"""

import casadi as ca
import numpy as np

from gantrytau import between
from gantrytau_models import DeltaRobot
from gantrytau_optimica import Free, Optimization, final, initial
from tests.benchmarks.gta import trapezoid
from tests.benchmarks.peers.written import Columns, Motion

START, END = (0.005910812, 0.225231848, -0.856752116), (0.224324724, -0.094084274, -0.773002065)  # m
# rad, of the arms there
ANGLES = ((0.662455729, 0.339366619, 0.970972357), (0.027859289, 0.772906182, 0.505291612))
LIMIT = 12.0  # N.m
AZIMUTHS = (0.0, 2 * np.pi / 3, 4 * np.pi / 3)
BASE, ARM, ROD, PLATE = 0.2, 0.3, 0.8, 0.06  # m
ARM_MASS, RODS_MASS, PLATE_MASS, MOTOR, G = 0.6, 0.2, 0.5, 0.02, 9.81  # kg, kg of both rods, kg, kg.m2, m/s2


class DeltaMotion(Optimization):
    """From rest to rest as fast as the motors allow."""

    robot = DeltaRobot()
    final_time = Free(0.5, unit="s", min=0.02, max=5.0, description="duration of the motion")

    def objective(self):
        return self.final_time

    def constraints(self):
        for at, r in ((initial, START), (final, END)):
            yield at(self.robot.tool.r) == list(r)
            yield at(self.robot.tool.v) == 0
        for arm in self.robot.arms:
            yield between(-LIMIT, arm.tau, LIMIT)


def motion() -> Motion:
    """By hand: accelerations of the plate are chosen, torques are limits on the path."""
    T, v, a, phi, w, dw, tension = (
        ca.SX.sym(name, 3) for name in ("T", "v", "a", "phi", "w", "dw", "tension")
    )
    up = ca.DM([0, 0, 1])
    lengths, rates, accelerations, torques = [], [], [], []
    plate = PLATE_MASS * (a + G * up)
    for i, azimuth in enumerate(AZIMUTHS):
        out = ca.DM([np.cos(azimuth), np.sin(azimuth), 0])
        along, side = (
            ca.cos(phi[i]) * out - ca.sin(phi[i]) * up,
            -ca.sin(phi[i]) * out - ca.cos(phi[i]) * up,
        )
        d = T - (BASE - PLATE) * out - ARM * along
        speed, elbow = v - ARM * w[i] * side, ARM * (dw[i] * side - w[i] ** 2 * along)
        lengths.append((ca.sumsqr(d) - ROD**2) / (2 * ROD))
        rates.append(ca.dot(d, speed) / ROD)
        accelerations.append((ca.dot(d, a - elbow) + ca.sumsqr(speed)) / (10 * ROD))
        middle, pull = RODS_MASS / 2 * ((a + elbow) / 2 + G * up), 10 * tension[i] * d / ROD
        plate += middle + pull
        torques.append(
            (MOTOR + ARM_MASS * ARM**2 / 3) * dw[i]
            + ARM_MASS * G * ARM / 2 * ca.dot(up, side)
            + ARM * ca.dot(side, middle - pull)
        )
    first, last = (np.concatenate(side)[:, None] for side in ((START, ANGLES[0]), (END, ANGLES[1])))

    def guess(shares: np.ndarray) -> Columns:
        position, speed, acceleration = trapezoid(shares)
        place, rate = first + (last - first) * position, (last - first) * speed / 0.5
        slope, none = (last - first) * acceleration / 0.5**2, np.zeros((3, shares.size))
        x = np.vstack([place[:3], rate[:3]])
        return x, np.vstack([place[3:], rate[3:], slope[3:], none]), slope[:3]

    unlimited = np.full(21, np.inf)
    rest = np.zeros(3)
    return Motion(
        x=ca.vertcat(T, v), z=ca.vertcat(phi, w, dw, tension), u=a, ode=ca.vertcat(v, a),
        residual=ca.vertcat(*lengths, *rates, *accelerations, plate / 10), path=ca.vertcat(*torques) / LIMIT,
        path_limits=(-1.0, 1.0), limits=(-unlimited, unlimited), start=np.append(START, rest), end=np.append(END, rest),
        guess=guess, guessed_time=0.5, times=(0.02, 5.0),
    )  # fmt: skip
