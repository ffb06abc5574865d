"""The servo of one cart, a cascade that takes references every 4 ms, and friction that gives before it slides.

Dressler (2012) prints of the servos how they follow a step, (6.11), and no gain; what else stands here is calibrated
so that a simulated robot answers steps as printed and follows a path about as well as his.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gantrytau import Input, Model, ModelError, Output, Parameter, Real, der, require, sampled
from gantrytau.border.checks import number, whole
from gantrytau.mechanics.friction_laws import dahl_rate
from gantrytau.mechanics.translational import Friction
from gantrytau_models.mechanisms.flexible import unstretched
from gantrytau_models.prototypes import Prototype

POLES = (0.9647, 0.9656, 0.9728)  # of (6.11), from sample to sample


def _places(delay: Any) -> int:
    """Of references on their way."""
    return whole("CartServo", "delay", delay, least=0) + 1


class CartServo(Model):
    """Position P around speed PI; references are taken every `period` and act `delay` samples later.

        e = k_ff v_ref + k_p (q_ref - q) - v,   f = f_ff + k_v (e + integral of e / T_i)

    delay: whole number of samples, 0 and more. What is measured acts at once, and so does f_ff. A fast loop of the speed
    makes exp(-k_p period) the pole of steps of q_ref from sample to sample: k_v is its bandwidth in rad/s times the mass
    that moves, by default 300 times 80 kg. Raises ModelError for another delay.
    """

    delay = 3
    period = Parameter(0.004, unit="s", min=0.0, description="sampling period of the references")
    k_p = Parameter(9.0, unit="1/s", min=0.0, description="gain of the position")
    k_v = Parameter(24e3, unit="kg/s", min=0.0, description="gain of the speed")
    T_i = Parameter(0.012, unit="s", min=0.0, description="integral time of the speed")
    k_ff = Parameter(0.95, unit="1", description="part of the reference of the speed that is fed forward")
    q_ref = Input(unit="m", description="reference of the position")
    v_ref = Input(unit="m/s", start=0.0, description="reference of the speed")
    q = Input(unit="m", description="measured position of the cart")
    v = Input(unit="m/s", start=0.0, description="measured speed of the cart")
    f_ff = Input(unit="N", start=0.0, description="force that is fed forward, at rest the whole force")
    f = Output(unit="N", description="force of the actuator")
    e = Real(unit="m/s", description="wanted less measured speed")
    integral = Real(unit="m", start=0.0, nominal=1e-3, description="integral of e")
    q_seen = Real(
        lambda self: _places(self.delay), unit="m", description="references on their way, the newest first"
    )
    v_seen = Real(lambda self: _places(self.delay), unit="m/s", start=0.0, description="the same of speeds")

    def equations(self):
        for taken, kept in ((self.q_ref, self.q_seen), (self.v_ref, self.v_seen)):
            for k in range(self.delay + 1):
                yield sampled(kept[k], taken if k == 0 else kept[k - 1], period=self.period)
        q_ref, v_ref = self.q_seen[self.delay], self.v_seen[self.delay]
        yield self.e == self.k_ff * v_ref + self.k_p * (q_ref - self.q) - self.v
        yield der(self.integral) == self.e
        yield self.f == self.f_ff + self.k_v * (self.e + self.integral / self.T_i)


class JointServo(CartServo):
    """The servo of a joint that turns: the same law with angles and torques."""

    k_v = Parameter(30.0, unit="N.m.s/rad", min=0.0, description="gain of the speed")
    q_ref = Input(unit="rad", description="reference of the angle")
    v_ref = Input(unit="rad/s", start=0.0, description="reference of the speed")
    q = Input(unit="rad", description="measured angle of the joint")
    v = Input(unit="rad/s", start=0.0, description="measured speed of the joint")
    f_ff = Input(unit="N.m", start=0.0, description="torque that is fed forward, at rest the whole torque")
    f = Output(unit="N.m", description="torque of the motor")
    e = Real(unit="rad/s", description="wanted less measured speed")
    integral = Real(unit="rad", start=0.0, nominal=1e-3, description="integral of e")
    q_seen = Real(
        lambda self: _places(self.delay), unit="rad", description="references on their way, the newest first"
    )
    v_seen = Real(lambda self: _places(self.delay), unit="rad/s", start=0.0, description="the same of speeds")


class PreslidingFriction(Friction):
    """Coulomb friction of a guideway that gives for some micrometres before it slides (Dahl 1968), and viscous friction.

    z' = v - |v| z / x, f = level f_c z / x + f_v v, where x is the way before it slides. What differs from run to run
    comes from outside: the level, and the deflection z_0 that earlier motion left.
    """

    f_c = Parameter(1.0, unit="N", min=0.0, description="Coulomb friction at the level 1")
    f_v = Parameter(0.0, unit="kg/s", min=0.0, description="viscous friction")
    x = Parameter(30e-6, unit="m", min=0.0, description="way before it slides")
    level = Input(unit="1", start=1.0, description="Coulomb friction over f_c")
    z_0 = Input(unit="m", start=0.0, description="deflection at the start")
    z = Real(unit="m", description="deflection before sliding")
    moved = Real(unit="m", description="deflection less that at the start", start=0.0, nominal=x)

    def equations(self):
        yield from super().equations()
        yield require(self.x > 0, "expected a way x above zero; take TanhFriction for none")
        yield self.z == self.z_0 + self.moved
        yield der(self.moved) == dahl_rate(self.v, self.z, 1.0, self.x)
        yield self.f == self.level * self.f_c * self.z / self.x + self.f_v * self.v


def cart_servos(
    prototype: Prototype,
    *,
    r: ArrayLike = (0.9, 2.7, -0.7),
    poles: Sequence[float] = POLES,
    bandwidth: float = 300.0,
    period: float = 0.004,
    delay: int = 3,
) -> list[CartServo]:
    """Servos of the carts of a robot with the tool near r (3,) in m, whose steps have the poles of (6.11).

    bandwidth: rad/s, of the loop of the speed, for each cart with its share of the tool: m_c + m_p |dr/dq_i|^2.
    Raises ModelError where the links do not reach r, and for poles that are not between 0 and 1.
    """
    bandwidth = number("cart_servos", "bandwidth", bandwidth, unit="rad/s", above=0.0)
    period = number("cart_servos", "period", period, unit="s", above=0.0)
    whole("cart_servos", "delay", delay, least=0)
    if len(poles) != len(prototype.arms) or not all(0 < a < 1 for a in poles):
        raise ModelError(
            f"cart_servos: found poles={list(poles)}, expected {len(prototype.arms)} numbers between 0 and 1"
        )
    masses = moved_masses(prototype, np.asarray(r, dtype=float))
    return [
        CartServo(k_p=float(-np.log(a) / period), k_v=float(bandwidth * mass), period=period, delay=delay)
        for a, mass in zip(poles, masses, strict=True)
    ]


def moved_masses(prototype: Prototype, r: np.ndarray) -> np.ndarray:
    """Masses that the actuators move one by one, (3,) in kg: each cart and its share of the tool at r (3,) in m."""
    positions = unstretched(prototype, r)
    rows, carts = [], []
    for arm, s in zip(prototype.arms, positions, strict=True):
        rod = r - np.array(arm.offset) - s * np.array(arm.direction)
        rows.append(rod / (rod @ np.array(arm.direction)))  # dq_i/dr, as the length of the rod is kept
        carts.append(np.dot(arm.direction, arm.direction))
    to_tool = np.linalg.inv(rows)
    return np.array(prototype.cart_masses) * carts + prototype.plate_mass * np.sum(to_tool**2, axis=0)
