"""What the controllers of the table hold or move: a pole, a crane, an arm, tanks, and robots with closed loops."""

import casadi as ca
import numpy as np

from gantrytau import Array, Input, Model, Real, Start, between, connect, der, sqrt
from gantrytau.mechanics.multibody import World
from gantrytau_models import DeltaRobot, GantryTau, SixLinkGantryTau, StewartPlatform, prototypes
from gantrytau_models.mechanisms.six_link import quaternion
from gantrytau_models.mechanisms.wrist import WristJoint
from gantrytau_optimica import Optimization
from tests.benchmarks.peers import six_link
from tests.benchmarks.peers.crane import FORCE, HOIST, LOAD, G, HoistCrane

GOAL = np.array([0.6, -0.4, 0.5, 0.3, -0.4, 0.2])  # rad, of the joints of the arm
TANKS = np.array([28.0, 32.0, 28.0, 32.0])  # cm2, Johansson (2000), table 1, as all numbers of the tanks
HOLES = np.array([0.071, 0.057, 0.071, 0.057])  # cm2
PUMPS, SHARES = (3.33, 3.35), (0.7, 0.6)  # cm3/(V.s), and of it into the lower tanks
LEVELS = (12.4, 12.7, 1.8, 1.4)  # cm, of rest at 3 V


class CraneInTime(Optimization):
    """The load goes 2 m to the side and 1 m up, the rope within 0.1 rad."""

    crane = HoistCrane(f=dict(min=-FORCE, max=FORCE), h=dict(min=0.0, max=HOIST))

    def integrand(self):
        o = self.crane
        away = (o.s - 2.0) ** 2 + (o.length - 3.0) ** 2 + 10 * o.phi**2
        return away + 0.1 * (o.v**2 + o.rate**2 + o.w**2) + 1e-6 * (o.f**2 + (o.h - LOAD * G) ** 2)

    def constraints(self):
        yield between(-0.1, self.crane.phi, 0.1)


class SixJoints(Model):
    """An arm of six driven revolutes in series."""

    world = World()
    joints = Array(
        WristJoint,
        [
            dict(axis=[0.0, 0.0, 1.0], offset=[0.0, 0.0, 0.3], m=6.0),
            dict(axis=[0.0, 1.0, 0.0], offset=[0.0, 0.0, 0.1], m=5.0, r_cm=[0.0, 0.0, 0.2]),
            dict(axis=[0.0, 1.0, 0.0], offset=[0.0, 0.0, 0.4], m=4.0, r_cm=[0.1, 0.0, 0.0]),
            dict(axis=[1.0, 0.0, 0.0], offset=[0.2, 0.0, 0.0], m=2.0, r_cm=[0.1, 0.0, 0.0]),
            dict(axis=[0.0, 1.0, 0.0], offset=[0.2, 0.0, 0.0], m=1.0, r_cm=[0.05, 0.0, 0.0]),
            dict(axis=[1.0, 0.0, 0.0], offset=[0.1, 0.0, 0.0], m=0.5, r_cm=[0.02, 0.0, 0.0]),
        ],
    )

    def equations(self):
        at = self.world.frame_b
        for joint in self.joints:
            yield connect(at, joint.frame_a)
            at = joint.frame_b


class ArmMoves(Optimization):
    """All joints go to GOAL, the two of the shoulder within 60 N.m."""

    arm = SixJoints()

    def integrand(self):
        joints = self.arm.joints
        away = sum((joint.phi - goal) ** 2 for joint, goal in zip(joints, GOAL, strict=True))
        return 10 * away + sum(0.1 * joint.w**2 + 1e-4 * joint.tau**2 for joint in joints)

    def constraints(self):
        for joint in self.arm.joints:
            yield between(-60.0, joint.tau, 60.0)


class QuadrupleTank(Model):
    """Four tanks that two pumps fill across (Johansson, The quadruple-tank process, IEEE Trans. CST 8 (2000))."""

    h = Real(4, start=LEVELS, nominal=10.0, description="levels in cm")
    u = Input(2, min=0.0, max=10.0, description="voltages of the pumps in V")

    def equations(self):
        out = ca.DM(HOLES) * sqrt(2 * 981.0 * self.h)
        first, second = (PUMPS[k] * self.u[k] for k in range(2))
        yield TANKS[0] * der(self.h[0]) == -out[0] + out[2] + SHARES[0] * first
        yield TANKS[1] * der(self.h[1]) == -out[1] + out[3] + SHARES[1] * second
        yield TANKS[2] * der(self.h[2]) == -out[2] + (1 - SHARES[1]) * second
        yield TANKS[3] * der(self.h[3]) == -out[3] + (1 - SHARES[0]) * first


class TanksFilled(Optimization):
    """The lower tanks shall stand at 15 and 11 cm, the upper ones no higher than 3 cm."""

    tanks = QuadrupleTank()

    def integrand(self):
        h, u = self.tanks.h, self.tanks.u
        return (h[0] - 15.0) ** 2 + (h[1] - 11.0) ** 2 + 0.01 * ca.sumsqr(u - 3.0)

    def constraints(self):
        yield between(0.2, self.tanks.h[2], 3.0)
        yield between(0.2, self.tanks.h[3], 3.0)


class DeltaReaches(Optimization):
    """The plate of a Delta goes aside, its motors within 15 N.m."""

    robot = DeltaRobot()

    def integrand(self):
        tool, arms = self.robot.tool, self.robot.arms
        away = ca.sumsqr(tool.r - np.array([0.1, 0.05, -0.75]))
        return 1e3 * away + ca.sumsqr(tool.v) + 1e-3 * sum(arm.tau**2 for arm in arms)

    def constraints(self):
        for arm in self.robot.arms:
            yield between(-15.0, arm.tau, 15.0)


class StewartMoves(Optimization):
    """A platform on six legs goes aside and up, its actuators within 300 N."""

    robot = StewartPlatform()

    def integrand(self):
        o, legs = self.robot.platform, self.robot.legs
        away = ca.sumsqr(o.r - np.array([0.05, -0.03, 0.85])) + ca.sumsqr(o.q[1:])
        return 1e3 * away + ca.sumsqr(o.v) + ca.sumsqr(o.w) + 1e-4 * sum(leg.f**2 for leg in legs)

    def constraints(self):
        for leg in self.robot.legs:
            yield between(-300.0, leg.f, 300.0)


class SixLinksMove(Optimization):
    """The plate of D1 goes aside, its carts within 1200 N."""

    robot = SixLinkGantryTau(
        prototypes.D1,
        tool=dict(r=Start(list(six_link.START)), q=Start(quaternion(six_link.TURN))),
        carts=[dict(s=Start(s)) for s in six_link.CARTS[0]],
    )

    def integrand(self):
        tool, carts = self.robot.tool, self.robot.carts
        away = ca.sumsqr(tool.r - np.array(six_link.START) - np.array([0.1, -0.1, 0.05]))
        return 1e3 * away + ca.sumsqr(tool.v) + 1e-5 * sum(cart.f**2 for cart in carts)

    def constraints(self):
        for cart in self.robot.carts:
            yield between(-six_link.LIMIT, cart.f, six_link.LIMIT)


class GantryTauMoves(Optimization):
    """The tool of L1 goes aside, its carts within 400 N."""

    robot = GantryTau(prototypes.L1)

    def integrand(self):
        tool, carts = self.robot.tool, self.robot.carts
        away = ca.sumsqr(tool.r - np.array([1.0, 2.9, -0.4]))
        return 1e3 * away + ca.sumsqr(tool.v) + 1e-5 * sum(cart.f**2 for cart in carts)

    def constraints(self):
        for cart in self.robot.carts:
            yield between(-400.0, cart.f, 400.0)
