"""The delta robot: three driven arms, each with two parallel rods to a plate that they keep level.

    elbow_i  = A_i + arm e(arms[i].phi)           the plate's joints B_i +- half the spacing across
    |r + B_i - elbow_i| = rod                     forward kinematics: three spheres that meet

Clavel, Delta, a fast robot with parallel geometry, Proc. 18th Int. Symp. on Industrial Robots, 1988. All six
rods hold the plate, a rigid body: that it stays level follows from the geometry and is not assumed.
"""

import casadi as ca
import numpy as np

from gantrytau import Array, Input, Model, Parameter, Real, StateSelect, connect, der
from gantrytau.mechanics.multibody import (
    Body,
    FixedRotation,
    FixedTranslation,
    Frame,
    Revolute,
    SphericalSpherical,
    World,
)
from gantrytau.mechanics.multibody.orientation import about
from gantrytau.mechanics.rotational import Inertia, Torque
from gantrytau_models.mechanisms.six_link import Plate

PHI = 0.3  # rad, of the arms below the level at the start


class Rod(Model):
    """One rod from an arm to the plate, with the offsets of its ball joints."""

    offset = Parameter(shape=3, unit="m", description="joint on the arm, from the elbow, in the arm's axes")
    plate_offset = Parameter(
        shape=3, unit="m", description="joint on the plate, from its centre, in its axes"
    )
    length = Parameter(unit="m", min=0.0, description="length between the ball joints")
    mass = Parameter(0.0, unit="kg", min=0.0, description="mass, in the middle of the rod")
    frame_arm = Frame()
    frame_plate = Frame()
    on_arm = FixedTranslation(r=offset)
    rod = SphericalSpherical(L=length, m=mass)
    on_plate = FixedTranslation(r=plate_offset)

    def equations(self):
        yield connect(self.frame_arm, self.on_arm.frame_a)
        yield connect(self.on_arm.frame_b, self.rod.frame_a)
        yield connect(self.rod.frame_b, self.on_plate.frame_b)
        yield connect(self.on_plate.frame_a, self.frame_plate)


class Arm(Model):
    """A driven arm and its rods. Its axes: x outwards, z up; phi turns the arm about y, downwards where positive."""

    azimuth = Parameter(
        0.0, unit="rad", display="deg", description="direction of the arm, about z of the base"
    )
    base_radius = Parameter(unit="m", min=0.0, description="from the centre of the base to the arm's axis")
    length = Parameter(unit="m", min=0.0, description="from the arm's axis to its elbow")
    plate_radius = Parameter(
        unit="m", min=0.0, description="from the plate's centre to the middle of its joints"
    )
    rod_length = Parameter(unit="m", min=0.0, description="length of the rods between the ball joints")
    spacing = Parameter(unit="m", min=0.0, description="distance of the two rods")
    rod_mass = Parameter(0.0, unit="kg", min=0.0, description="mass of a rod, in its middle")
    mass = Parameter(1.0, unit="kg", min=0.0, description="mass of the arm")
    r_cm = Parameter(
        lambda self: ca.vertcat(self.length / 2, 0, 0),
        shape=3,
        unit="m",
        description="its centre of mass from its axis, in its axes; in the middle unless set otherwise",
    )
    J = Parameter(
        lambda self: self.mass * self.length**2 / 12 * ca.diag(ca.vertcat(0, 1, 1)),
        shape=(3, 3),
        unit="kg.m2",
        description="its inertia about that, in its axes; of a slender bar unless set otherwise",
    )
    motor_inertia = Parameter(
        0.0, unit="kg.m2", min=0.0, description="inertia of motor and gear, seen at the arm"
    )
    phi = Real(unit="rad", display="deg", description="angle below the level", start=PHI)
    w = Real(unit="rad/s", display="deg/s", description="angular velocity")
    tau = Input(unit="N.m", description="torque of the motor, positive downwards", start=0.0)
    frame_a = Frame()
    frame_b = Frame()
    turn = FixedRotation(n=[0.0, 0.0, 1.0], phi=azimuth)
    base = FixedTranslation(r=lambda self: ca.vertcat(self.base_radius, 0, 0))
    shoulder = Revolute(
        n=[0.0, 1.0, 0.0], phi=dict(prefer=StateSelect.DEFAULT), w=dict(prefer=StateSelect.DEFAULT)
    )
    body = Body(m=mass, r_cm=r_cm, J=J)
    upper = FixedTranslation(r=lambda self: ca.vertcat(self.length, 0, 0))
    rods = Array(
        Rod,
        [
            dict(offset=lambda self: self.beside(-1.0), plate_offset=lambda self: self.on_plate(-1.0)),
            dict(offset=lambda self: self.beside(1.0), plate_offset=lambda self: self.on_plate(1.0)),
        ],
        length=rod_length,
        mass=rod_mass,
    )
    motor = Torque()
    rotor = Inertia(J=motor_inertia)

    def beside(self, side: float) -> ca.SX:
        """A ball joint on the arm, from the elbow, in the arm's axes, (3,) in m; side: -1 or 1."""
        return ca.vertcat(0, side * self.spacing / 2, 0)

    def on_plate(self, side: float) -> ca.SX:
        """The ball joint across from it on the plate, in the plate's axes, (3,) in m."""
        return about(ca.SX([0, 0, 1]), self.azimuth) @ ca.vertcat(
            self.plate_radius, side * self.spacing / 2, 0
        )

    def equations(self):
        yield connect(self.frame_a, self.turn.frame_a)
        yield connect(self.turn.frame_b, self.base.frame_a)
        yield connect(self.base.frame_b, self.shoulder.frame_a)
        yield connect(self.shoulder.frame_b, self.body.frame_a)
        yield connect(self.shoulder.frame_b, self.upper.frame_a)
        for rod in self.rods:
            yield connect(self.upper.frame_b, rod.frame_arm)
            yield connect(rod.frame_plate, self.frame_b)
        yield connect(self.motor.flange, self.rotor.flange_a)
        yield connect(self.rotor.flange_b, self.shoulder.axis)
        yield self.motor.tau == self.tau
        yield self.phi == self.shoulder.phi
        yield self.w == der(self.phi)


class DeltaRobot(Model):
    """A delta robot, driven by the torques `arms[i].tau` of its motors; it hangs from its base, z is up.

    Keywords modify members. Lengths and masses are the same for all arms unless `arms=[dict(rod_length=...), ...]`
    says otherwise; single rods are `arms[i].rods[j]`. The pose of the plate is `tool.r`, `tool.R`.
    It starts below the base, the arms 0.3 rad below the level, unless start values of `tool.r` say otherwise.
    """

    base_radius = Parameter(
        0.2, unit="m", min=0.0, description="from the centre of the base to the arms' axes"
    )
    arm_length = Parameter(0.3, unit="m", min=0.0, description="from an arm's axis to its elbow")
    rod_length = Parameter(0.8, unit="m", min=0.0, description="length of the rods between the ball joints")
    plate_radius = Parameter(0.06, unit="m", min=0.0, description="from the plate's centre to its joints")
    spacing = Parameter(0.12, unit="m", min=0.0, description="distance of the two rods of an arm")
    arm_mass = Parameter(0.6, unit="kg", min=0.0, description="mass of an arm")
    rod_mass = Parameter(0.1, unit="kg", min=0.0, description="mass of a rod")
    motor_inertia = Parameter(0.02, unit="kg.m2", min=0.0, description="of motor and gear, seen at the arm")
    plate_mass = Parameter(0.5, unit="kg", min=0.0, description="mass of the plate")
    world = World()
    arms = Array(
        Arm,
        [dict(azimuth=0.0), dict(azimuth=2 * np.pi / 3), dict(azimuth=4 * np.pi / 3)],
        base_radius=base_radius,
        length=arm_length,
        plate_radius=plate_radius,
        rod_length=rod_length,
        spacing=spacing,
        rod_mass=rod_mass,
        mass=arm_mass,
        motor_inertia=motor_inertia,
    )
    tool = Plate(
        m=plate_mass,
        J=np.diag([1e-3, 1e-3, 2e-3]),
        r=dict(prefer=StateSelect.PREFER, start=lambda self: self.below()),
        v=dict(prefer=StateSelect.PREFER, start=0.0),
    )

    def below(self) -> ca.SX:
        """The plate's place when all arms are PHI below the level, (3,) in m."""
        out = self.base_radius + self.arm_length * np.cos(PHI) - self.plate_radius
        # out of reach: some depth, so that it is clear that the plate is below
        depth = ca.sqrt(ca.fmax(self.rod_length**2 - out**2, 0.01 * self.rod_length**2))
        return ca.vertcat(0, 0, -self.arm_length * np.sin(PHI) - depth)

    def equations(self):
        for arm in self.arms:
            yield connect(self.world.frame_b, arm.frame_a)
            yield connect(arm.frame_b, self.tool.frame_a)
