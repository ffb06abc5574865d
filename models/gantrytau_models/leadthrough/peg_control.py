"""The control of a tool that is led by hand while it is in a hole, (8.2) to (8.11) of Dressler (2012)."""

from gantrytau import (
    Input,
    Model,
    ModelError,
    Output,
    Parameter,
    Real,
    acos,
    dot,
    fmax,
    fmin,
    if_else,
    norm_2,
    sampled,
)

NORMALS = ("force", "gated")


class PegControl(Model):
    """Forces of hand and tool become velocities of the tool, every `period`. Gains are assumed, not printed.

    Without contact the hand leads, V_h(k + 1) = P_h(V_h(k)) + Ts M^-1 (F_h - D V) (8.7). In contact it does so across the
    direction n of the tool's force f, along which K_f (0 - f) acts, and the torque turns the tool, K_tau (0 - t) (8.11).
    f and t are those of the tool on the hole, t about the tool centre point.

    normal: "force" takes n = f / |f|; "gated" does so only within `gate` of the nominal normal, along the tool (8.10),
    which keeps the walls' forces out and is here to show it. Raises ModelError for another.
    """

    normal = "force"
    period = Parameter(0.004, unit="s", min=0.0, description="sampling period")
    K_f = Parameter(0.005, unit="m/(s.N)", description="velocity for a force of the tool")
    K_tau = Parameter(3.0, unit="rad/(s.N.m)", description="angular velocity for a torque of the tool")
    M = Parameter(2.0, unit="kg", min=0.0, description="mass that the hand feels")
    D = Parameter(40.0, unit="N.s/m", min=0.0, description="damping that the hand feels")
    on = Parameter(0.25, unit="N", min=0.0, description="force above which there is contact")
    off = Parameter(0.15, unit="N", min=0.0, description="force below which there is none any more")
    v_max = Parameter(0.25, unit="m/s", min=0.0, description="largest speed")
    w_max = Parameter(0.5, unit="rad/s", min=0.0, description="largest angular velocity")
    gate = Parameter(0.17453292519943295, unit="rad", description="angle of n that is believed, if gated")
    f_h = Input(3, unit="N", description="force of the hand")
    f = Input(3, unit="N", description="force of the tool on the hole")
    t = Input(3, unit="N.m", description="torque of the tool on the hole")
    v = Input(3, unit="m/s", description="velocity of the tool")
    axis = Input(3, unit="1", description="direction of the tool, out of the hole")
    v_ref = Output(3, unit="m/s", start=0.0, description="velocity for the servos")
    w_ref = Output(3, unit="rad/s", start=0.0, description="angular velocity for the servos")
    load = Real(unit="N", description="force of the tool")
    contact = Real(unit="1", description="1 in contact, else 0")
    touched = Real(unit="1", start=0.0, description="the contact of the sample before")
    n = Real(3, unit="1", description="direction in which force is controlled")
    v_h = Real(3, unit="m/s", start=0.0, description="velocity of the hand's law, before its projection")
    led = Real(3, unit="m/s", description="velocity by the hand, P_h(V_h)")
    pushed = Real(3, unit="m/s", description="velocity by the tool's force, P_t(V_t)")

    def __init__(self, **modifications):
        normal = modifications.get("normal", self.normal)
        if normal not in NORMALS:
            raise ModelError(f"PegControl: found normal={normal!r}, expected 'force' or 'gated'")
        super().__init__(**modifications)

    def equations(self):
        yield self.load == norm_2(self.f)
        limit = if_else(self.touched > 0.5, self.off, self.on)
        yield self.contact == if_else(self.load > limit, 1, 0)
        n = self.f / if_else(self.load > 0, self.load, self.on)
        if self.normal == "gated":
            angle = acos(fmax(-1, fmin(1, -dot(self.axis, n))))
            n = if_else(angle <= self.gate, n, -self.axis)
        yield self.n == n
        hand = within(self.v_h, self.v_max)
        yield self.led == hand - self.contact * dot(self.n, hand) * self.n
        yield self.pushed == -self.contact * within(self.K_f * dot(self.n, self.f) * self.n, self.v_max)
        acceleration = (self.f_h - self.D * self.v) / self.M
        turned = -self.contact * within(self.K_tau * self.t, self.w_max)
        yield sampled(self.touched, self.contact, period=self.period)
        yield sampled(self.v_h, self.led + self.period * acceleration, period=self.period)
        yield sampled(self.v_ref, self.led + self.pushed, period=self.period)
        yield sampled(self.w_ref, turned, period=self.period)


def within(v, largest):
    """A velocity (3,) whose size is kept to the largest."""
    size = norm_2(v)
    return v * if_else(size > largest, largest / size, 1)
