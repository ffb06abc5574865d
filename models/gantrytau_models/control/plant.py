"""The robot as a plant: motor torques in, what encoders and a tracker of the tool would measure out."""

from gantrytau import Array, Input, Model, Output, Parameter, Real, der
from gantrytau_models.mechanisms.gantry_tau import GantryTau


class Motor(Model):
    """A motor that drives a cart through a stiff gear; its rotor may have inertia."""

    ratio = Parameter(
        190.5,
        unit="rad/m",
        min=0.0,
        description="angle of the rotor per way of the cart; force per torque, too",
    )
    J = Parameter(0.0, unit="kg.m2", min=0.0, description="inertia of the rotor and what turns with it")
    v = Real(unit="m/s", description="speed of the cart along its guideway")
    w = Real(unit="rad/s", display="rpm", description="angular velocity of the rotor")
    tau = Input(unit="N.m", description="torque of the motor", start=0.0)
    f = Real(unit="N", description="force on the cart along its guideway, before friction")

    def equations(self):
        yield self.w == self.ratio * self.v
        yield self.f == self.ratio * (self.tau - self.J * der(self.w))


class Measured(Model):
    """Base of robots whose positions and speeds of the carts are outputs: put it before the robot.

    `class Plant(Measured, SixLinkGantryTau)` for a robot of yours; it takes what has `carts`.
    """

    carts: Array

    q = Output(3, unit="m", description="positions of the carts along their guideways, as measured")
    v = Output(3, unit="m/s", description="speeds of the carts along their guideways, as measured")

    def equations(self):
        yield from super().equations()
        for k, cart in enumerate(self.carts):
            yield self.q[k] == cart.s
            yield self.v[k] == cart.v


class MotorDriven(Measured):
    """Base of robots that motors drive, by the torques `motors[i].tau`; put it before the robot."""

    motors = Array(Motor, 3)

    def equations(self):
        yield from super().equations()
        for motor, cart in zip(self.motors, self.carts, strict=True):
            yield motor.v == cart.v
            yield cart.f == motor.f


class MeasuredGantryTau(Measured, GantryTau):
    """The three-link robot driven by the forces `carts[i].f`, with the measured `q` and `v`."""


class MotorDrivenGantryTau(MotorDriven, GantryTau):
    """The three-link robot driven by the motor torques `motors[i].tau`, with the measured `q` and `v`.

    190.5 N on a cart per N.m of its motor; tool position and velocity are `tool.r` and `tool.v`, friction is
    `carts[i].friction`. Arguments as of `GantryTau`.
    """
