"""Inverse dynamics of three-link robots for measured positions and speeds, and accelerations that are wanted.

The components of `GantryTau` differentiate a position to have its speed; a controller measures both, and chooses
the acceleration. So these are the equations of Dressler (2012), (6.3) to (6.7), with all three as inputs:
links of length L_i from the cart to the tool, D_i = r - A_i, with half their mass at the middle moved by
either end, carry a force lambda_i D_i.
"""

import casadi as ca

from gantrytau import Array, Input, Model, Output, Parameter, Real, dot, tanh
from gantrytau.border.refusal import ModelError
from gantrytau_models.control.closed_form_kinematics import ForwardKinematics
from gantrytau_models.prototypes import Prototype


class CartLoad(Model):
    """Masses and friction of one cart and its link."""

    m = Parameter(1.0, unit="kg", min=0.0, description="mass of cart and motor")
    link_mass = Parameter(0.0, unit="kg", min=0.0, description="mass of the link")
    f_c = Parameter(0.0, unit="N", min=0.0, description="Coulomb friction")
    f_v = Parameter(0.0, unit="kg/s", min=0.0, description="viscous friction")
    v_s = Parameter(0.05, unit="m/s", min=0.0, description="smoothing speed")

    def friction(self, v: ca.SX) -> ca.SX:
        """Friction at a speed, N, positive against positive speed; the law of `TanhFriction`."""
        return self.f_c * tanh(v / self.v_s) + self.f_v * v


class InverseDynamics(ForwardKinematics):
    """Actuator forces `f` of the carts for their positions `q`, speeds `v` and accelerations `a`.

    `f` is the force before friction: what moves the masses, `rigid`, and the friction at v. `tool_v` is the
    velocity of the tool. `status` is that of the forward kinematics, and q must be within reach. Raises as
    `ForwardKinematics`.
    """

    plate_mass = Parameter(1.0, unit="kg", min=0.0, description="mass of plate and tool")
    g = Parameter(9.81, unit="m/s2", description="acceleration of gravity, along -z")
    loads = Array(CartLoad, 3)
    v = Input(3, unit="m/s", start=0.0, description="speeds of the carts along their guideways")
    a = Input(3, unit="m/s2", start=0.0, description="accelerations of the carts")
    f = Output(3, unit="N", description="actuator forces, before friction")
    rigid = Output(3, unit="N", description="the forces without friction")
    tool_v = Output(3, unit="m/s", description="velocity of the tool, resolved in the world")
    tool_a = Real(3, unit="m/s2", description="acceleration of the tool, resolved in the world")
    tension = Real(3, unit="N/m", description="force of the links over their lengths, positive if they push")

    def _defaults(self, prototype: Prototype) -> dict:
        if prototype.friction_by_direction():
            raise ModelError(
                f"found {prototype.name}, whose friction differs with the direction, expected one number for each cart; "
                "replace its coulomb and viscous by their means",
                place=type(self).__name__,
                argument="prototype",
            )
        loads = zip(
            prototype.cart_masses, prototype.link_masses, prototype.coulomb, prototype.viscous, strict=True
        )
        return super()._defaults(prototype) | dict(
            plate_mass=prototype.plate_mass,
            loads=[dict(m=m, link_mass=link, f_c=f_c, f_v=f_v) for m, link, f_c, f_v in loads],
        )

    def equations(self):
        yield from super().equations()
        gravity = ca.vertcat(0, 0, self.g)
        on_plate = self.plate_mass * (self.tool_a + gravity)
        for i, (arm, load) in enumerate(zip(self.arms, self.loads, strict=True)):
            link = self.r - arm.offset - self.q[i] * arm.direction
            turning = self.tool_v - self.v[i] * arm.direction
            yield dot(link, turning) == 0
            yield dot(link, self.tool_a - self.a[i] * arm.direction) == -dot(turning, turning)
            # each end bears half of what moves the mass in the middle
            cart_a = self.a[i] * arm.direction
            half = load.link_mass / 2 * ((self.tool_a + cart_a) / 2 + gravity)
            on_plate = on_plate + half - self.tension[i] * link
            on_cart = load.m * (cart_a + gravity) + half + self.tension[i] * link
            yield self.rigid[i] == dot(on_cart, arm.direction)
            yield self.f[i] == self.rigid[i] + load.friction(self.v[i])
        yield on_plate == ca.SX.zeros(3)
