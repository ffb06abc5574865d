"""Controllers of the carts, sampled at 4 ms: they measure positions and speeds and give forces.

Dressler (2012), Figure 6.1, shows the cascade that drives each axis of his robots, and section 3.2 that it
takes references every 4 ms; its gains are not printed. What stands here is the usual form of such a cascade,
with gains of our own from masses and bandwidths. At each instant a controller sees what held just before it.
"""

from collections.abc import Sequence
from typing import Any

import casadi as ca

from gantrytau import Input, Model, Output, Parameter, Real, if_else, sampled
from gantrytau_models.control.closed_form_kinematics import carts_behind
from gantrytau_models.control.feedforward import Feedforward
from gantrytau_models.control.inverse_dynamics import InverseDynamics
from gantrytau_models.mechanisms.gantry_tau import check_record, tool_ahead_of_carts
from gantrytau_models.prototypes import Prototype


class Seen(Model):
    """What a controller has seen of its inputs at the last instant."""

    q = Real(3, unit="m", description="positions of the carts")
    v = Real(3, unit="m/s", start=0.0, description="speeds of the carts")
    q_ref = Real(3, unit="m", description="reference of the positions")
    v_ref = Real(3, unit="m/s", start=0.0, description="reference of the speeds")
    f_ff = Real(3, unit="N", start=0.0, description="feedforward of the forces")


class Controller(Model):
    """Base of controllers of three carts: subclasses say what force is `wanted` for what was `seen`.

    prototype: a record such as `prototypes.L1`, for gains that suit its masses; start: where the tool is at the
    start, (3,) in m, for the start values of positions, ahead of the carts unless given. Inputs are sampled every
    `period`; the force stays as it is in between, and between -limit and limit. Raises ModelError for what is
    no such record.
    """

    period = Parameter(0.004, unit="s", min=0.0, description="sampling period")
    limit = Parameter([1207.0] * 3, unit="N", min=0.0, description="largest force, either way")
    ratio = Parameter(190.5, unit="rad/m", description="angle of the rotor per way of the cart, for tau")
    q = Input(3, unit="m", description="measured positions of the carts")
    v = Input(3, unit="m/s", start=0.0, description="measured speeds of the carts")
    q_ref = Input(3, unit="m", description="reference of the positions")
    v_ref = Input(3, unit="m/s", start=0.0, description="reference of the speeds")
    f_ff = Input(3, unit="N", start=0.0, description="feedforward of the forces")
    f = Output(3, unit="N", description="forces of the actuators, the same from sample to sample")
    tau = Output(3, unit="N.m", description="torques of the motors that give f")
    wanted = Real(3, unit="N", description="forces that the controller asks for, before the limit")
    seen = Seen()

    def __init__(self, prototype: Prototype, *, start: Sequence[float] | None = None, **modifications: Any):
        check_record(prototype, type(self).__name__)
        tool = tool_ahead_of_carts(prototype) if start is None else start
        super().__init__(self._defaults(prototype, tool), **modifications)

    def _defaults(self, prototype: Prototype, tool: Sequence[float]) -> dict[str, Any]:
        q = dict(start=carts_behind(prototype, tool))
        return dict(q=q, q_ref=q, seen=dict(q=q, q_ref=q))

    def equations(self):
        yield sampled(self.seen.q, self.q, period=self.period)
        yield sampled(self.seen.v, self.v, period=self.period)
        yield sampled(self.seen.q_ref, self.q_ref, period=self.period)
        yield sampled(self.seen.v_ref, self.v_ref, period=self.period)
        yield sampled(self.seen.f_ff, self.f_ff, period=self.period)
        yield self.f == ca.fmax(-self.limit, ca.fmin(self.wanted, self.limit))
        yield self.tau == self.f / self.ratio

    def follow(self, reference: Feedforward, share: Any):
        """Equations by which the controller follows a reference, with a share, 0 to 1, of the feedforward."""
        yield self.q_ref == reference.q
        yield self.v_ref == reference.v
        yield self.f_ff == share * reference.f


class IntegralController(Controller):
    """Base of controllers that act on each axis by itself and have an integral part.

    While a force is at its limit, the integral goes back by the force that is too much, in the time
    `integral_time`, so that it does not wind up.
    """

    mass = Parameter(shape=3, unit="kg", min=0.0, description="mass that each motor is taken to move")
    integral_time = Parameter(0.1, unit="s", min=0.0, description="of the integral part")
    integral = Real(3, unit="N", start=0.0, description="integral part of the forces")
    proportional = Real(3, unit="N", description="what is integrated, divided by integral_time")

    def _defaults(self, prototype: Prototype, tool: Sequence[float]) -> dict[str, Any]:
        # a cart, and the plate as if it went along with each of them
        return super()._defaults(prototype, tool) | dict(
            mass=[mass + prototype.plate_mass for mass in prototype.cart_masses]
        )

    def equations(self):
        yield from super().equations()
        too_much = self.wanted - self.f
        change = self.period / self.integral_time * (self.proportional - too_much)
        yield sampled(self.integral, self.integral + change, period=self.period)


class CascadedController(IntegralController):
    """Position P around speed PI, axis by axis, with feedforward of speeds and forces.

    wanted speed = v_ref + k_p (q_ref - q)
    wanted force = f_ff + mass bandwidth (wanted speed - v) + integral
    """

    k_p = Parameter(20.0, unit="1/s", min=0.0, description="gain of the position")
    bandwidth = Parameter(80.0, unit="rad/s", min=0.0, description="of the loop of the speed")

    def equations(self):
        yield from super().equations()
        seen = self.seen
        v_wanted = seen.v_ref + self.k_p * (seen.q_ref - seen.q)
        yield self.proportional == self.mass * self.bandwidth * (v_wanted - seen.v)
        yield self.wanted == seen.f_ff + self.proportional + self.integral


class PidController(IntegralController):
    """Position PID, axis by axis, with feedforward of forces; the derivative is of the measured speed.

    wanted force = f_ff + mass (bandwidth^2 (q_ref - q) + 2 damping bandwidth (v_ref - v)) + integral
    """

    bandwidth = Parameter(
        35.0, unit="rad/s", min=0.0, description="natural angular frequency without integral"
    )
    damping = Parameter(1.0, unit="1", min=0.0, description="damping ratio without integral")

    def equations(self):
        yield from super().equations()
        seen = self.seen
        derivative = 2 * self.damping * self.bandwidth * self.mass * (seen.v_ref - seen.v)
        yield self.proportional == self.mass * self.bandwidth**2 * (seen.q_ref - seen.q)
        yield self.wanted == seen.f_ff + self.proportional + derivative + self.integral


class SeenWithAccelerations(Seen):
    """What a controller that follows accelerations, too, has seen."""

    a_ref = Real(3, unit="m/s2", start=0.0, description="reference of the accelerations of the carts")


class ComputedTorqueController(Controller):
    """Computed torque: the inverse dynamics of the robot turn wanted accelerations into forces.

        wanted acceleration = a_ref + 2 damping bandwidth (v_ref - v) + bandwidth^2 (q_ref - q)
        wanted force = M(q) wanted acceleration + what speeds and weight ask for + friction at v_ref + f_ff

    The errors of all axes then vanish alike. Friction is that of the reference: at a measured speed near zero
    its compensation would push back and forth. Out of reach there is no dynamics, and f is zero.
    """

    bandwidth = Parameter(35.0, unit="rad/s", min=0.0, description="natural angular frequency of errors")
    damping = Parameter(1.0, unit="1", min=0.0, description="damping ratio of errors")
    a_ref = Input(3, unit="m/s2", start=0.0, description="reference of the accelerations of the carts")
    a = Real(3, unit="m/s2", description="wanted accelerations of the carts")
    seen = SeenWithAccelerations()
    dynamics = InverseDynamics.open()

    def _defaults(self, prototype: Prototype, tool: Sequence[float]) -> dict[str, Any]:
        defaults = super()._defaults(prototype, tool)
        dynamics = dict(InverseDynamics(prototype).modifications) | dict(q=defaults["q"])
        return defaults | dict(dynamics=dynamics)

    def equations(self):
        yield from super().equations()
        seen, dynamics = self.seen, self.dynamics
        yield sampled(seen.a_ref, self.a_ref, period=self.period)
        by_speed = 2 * self.damping * self.bandwidth * (seen.v_ref - seen.v)
        yield self.a == seen.a_ref + by_speed + self.bandwidth**2 * (seen.q_ref - seen.q)
        yield dynamics.q == seen.q
        yield dynamics.v == seen.v
        yield dynamics.a == self.a
        for i, load in enumerate(dynamics.loads):
            force = dynamics.rigid[i] + load.friction(seen.v_ref[i]) + seen.f_ff[i]
            yield self.wanted[i] == if_else(dynamics.status > 0, 0.0, force)

    def follow(self, reference: Feedforward, share: Any):
        """Equations by which the controller follows a reference; what is fed forward are its accelerations."""
        yield self.q_ref == reference.q
        yield self.v_ref == reference.v
        yield self.a_ref == share * reference.a
        yield self.f_ff == ca.SX.zeros(3)
