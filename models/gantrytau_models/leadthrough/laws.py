"""The laws of lead-through, one block each: Dressler (2012), (8.1) to (8.11). All act within one instant, and what they
remember is sampled, so that sensor, controller and servo follow one another within the same period.

Forces and torques are those of the tool on the workpiece, in axes of the tool, n points from the tool into the workpiece:
so a positive gain is stable. The thesis prints neither signs nor gains.
"""

import math

import casadi as ca

from gantrytau import (
    Input,
    Model,
    Output,
    Parameter,
    Real,
    cross,
    dot,
    fabs,
    fmax,
    fmin,
    if_else,
    norm_2,
    require,
    sampled,
)

TINY = 1e-12  # N, below which a force has no direction


class Impedance(Model):
    """The handle as a mass with damping: a = M^-1 (F_h - D V_tool), V_h(k + 1) = P_h(V_h(k)) + T a(k), (8.6) and (8.7).

    The velocity starts anew from what was let through of it, so that what is projected away or beyond the limit does not
    wind up. anti_windup=False goes on from V_h(k) itself, (8.5). One sample after a force begins the velocity is T F / M:
    the printed form, with its operator of time, is a sample late.
    """

    anti_windup = True
    period = Parameter(0.004, unit="s", min=0.0, description="sampling period")
    M = Parameter([2.0] * 3, unit="kg", min=0.0, description="mass felt at the handle, along each axis")
    D = Parameter(
        [40.0] * 3, unit="N.s/m", min=0.0, description="damping felt at the handle, along each axis"
    )
    f = Input(3, unit="N", start=0.0, description="force of the hand on the handle")
    v_tool = Input(3, unit="m/s", start=0.0, description="velocity of the tool")
    passed = Input(3, unit="m/s", start=0.0, description="what was let through of v, P_h(V_h)")
    a = Real(3, unit="m/s2", description="acceleration that the force asks for")
    v = Output(3, unit="m/s", start=0.0, description="velocity for the force, V_h, before it is projected")

    def equations(self):
        yield require(
            ca.mmin(self.M) > 0, "expected masses above zero; a small mass follows the hand at once"
        )
        # a sample late the damping would push beyond rest, z^2 - z + T D / M = 0, and the tool swing between its limits
        yield require(
            ca.mmin(self.M - self.period * self.D) > 0,
            "expected masses above period times damping; take a larger mass, or less damping",
        )
        yield self.a == (self.f - self.D * self.v_tool) / self.M
        before = self.passed if self.anti_windup else self.v
        yield sampled(self.v, before + self.period * self.a, period=self.period)


class ToolForceControl(Model):
    """V_t = K (f_ref n - f), w_t = K_tau (0 - t): (8.4), which holds a force along n and none across it, and no torque.

    w_t + align z x n turns the tool until its axis z is the normal, as section 8.5 of the thesis wishes: it follows round
    surfaces, behind by the angle of v / (radius align).
    """

    K = Parameter([0.03] * 3, unit="m/(s.N)", min=0.0, description="velocity for a force, along each axis")
    K_tau = Parameter([0.0] * 3, unit="rad/(s.N.m)", min=0.0, description="angular velocity for a torque")
    f_ref = Parameter(2.0, unit="N", description="force along n")
    align = Parameter(0.0, unit="1/s", min=0.0, description="angular velocity for an angle between z and n")
    f = Input(3, unit="N", start=0.0, description="force of the tool")
    t = Input(3, unit="N.m", start=0.0, description="torque of the tool")
    n = Input(3, unit="1", description="direction into the workpiece")
    v = Output(3, unit="m/s", description="velocity, V_t")
    w = Output(3, unit="rad/s", description="angular velocity")

    def equations(self):
        yield self.v == self._gain() * (self.f_ref * self.n - self.f)
        yield self.w == -self.K_tau * self.t + self.align * cross([0.0, 0.0, 1.0], self.n)

    def _gain(self):
        return self.K


class ContactState(Model):
    """Whether the tool is in contact: it begins above the force `on`, and ends when the hand pulls with more than `release`.

    After a release a new contact begins only once the force has been below `rearm`: without this the force that is still
    there would begin it in the very next sample, and the tool would never come off. Contact whose force is gone ends, too,
    after `patience`: until then the tool seeks the surface with K f_ref, beyond it the robot would go on into the void.
    Samples without force count up, those with force down, so that noise does not hide a loss. Both rules are not printed.
    """

    period = Parameter(0.004, unit="s", min=0.0, description="sampling period")
    on = Parameter(0.5, unit="N", min=0.0, description="force of the tool along n at which contact begins")
    release = Parameter(8.0, unit="N", min=0.0, description="force of the hand against n at which it ends")
    rearm = Parameter(
        0.2, unit="N", min=0.0, description="force of the tool below which contact may begin anew"
    )
    patience = Parameter(
        0.25, unit="s", min=0.0, description="time without force after which contact is lost"
    )
    f_n = Input(unit="N", start=0.0, description="force of the tool along n")
    pull = Input(unit="N", start=0.0, description="force of the hand against n")
    touched = Real(unit="1", start=0.0, description="1 where there was contact at the last instant")
    armed = Real(unit="1", start=1.0, description="1 where contact may begin")
    missing = Real(
        unit="s", start=0.0, description="time of contact without force, less that with force since"
    )
    contact = Output(unit="1", description="1 in contact, else 0")

    def equations(self):
        nothing = fabs(self.f_n) < fmin(self.rearm, self.on)
        missing = fmax(0.0, self.missing + if_else(nothing, self.period, -self.period))
        lost = missing > self.patience + 0.5 * self.period
        kept = if_else(self.pull > self.release, 0.0, if_else(lost, 0.0, 1.0))
        ready = if_else(fabs(self.f_n) < self.rearm, 1.0, self.armed)
        begun = ready * if_else(self.f_n > self.on, 1.0, 0.0)
        yield self.contact == if_else(self.touched > 0.5, kept, begun)
        # a release takes the arms away, and while there is contact there is nothing to begin
        armed = if_else(self.touched > 0.5, 0.0, ready)
        yield sampled(self.touched, self.contact, period=self.period)
        yield sampled(self.armed, armed, period=self.period)
        yield sampled(self.missing, if_else(self.touched > 0.5, missing, 0.0), period=self.period)


class NormalEstimate(Model):
    """n = f / |f| where it is within `gate` of the nominal normal, else the nominal one: (8.10).

    At the gate itself the estimate is taken, and below `least` there is none: the thesis says neither. gate=pi takes every
    estimate, as a peg in a hole needs.
    """

    gate = Parameter(
        0.1745329251994330,
        unit="rad",
        min=0.0,
        max=math.pi,
        description="angle within which it is believed, phi_L",
    )
    nominal = Parameter([0.0, 0.0, 1.0], unit="1", description="nominal normal, n_n, of length one")
    least = Parameter(0.05, unit="N", min=0.0, description="force below which there is no estimate")
    f = Input(3, unit="N", start=0.0, description="force of the tool")
    n = Output(3, unit="1", description="direction into the workpiece")
    passed = Output(unit="1", description="1 where the estimate is taken")

    def equations(self):
        size = norm_2(self.f)
        estimate = self.f / ca.fmax(size, TINY)
        near = ca.logic_or(self.gate >= ca.pi, dot(estimate, self.nominal) >= ca.cos(self.gate))
        yield require(ca.fabs(norm_2(self.nominal) - 1) < 1e-9, "expected a nominal normal of length one")
        yield self.passed == if_else(ca.logic_and(size >= self.least, near), 1.0, 0.0)
        yield self.n == if_else(self.passed > 0.5, estimate, self.nominal)


class Projection(Model):
    """Who moves the tool whereto: the hand across n, the tool's force along it and its torque about all axes, in contact;
    the hand alone elsewhere. (8.8), (8.9), (8.11); with the limit of the speed of the hand, which is part of P_h.
    """

    v_max = Parameter(0.25, unit="m/s", min=0.0, description="largest speed by the hand")
    contact = Input(unit="1", start=0.0, description="1 in contact")
    n = Input(3, unit="1", description="direction into the workpiece")
    v_h = Input(3, unit="m/s", start=0.0, description="velocity by the hand, before it is projected")
    v_t = Input(3, unit="m/s", description="velocity by the tool's force")
    w_t = Input(3, unit="rad/s", description="angular velocity by the tool's torque")
    p_h = Output(3, unit="m/s", description="P_h(V_h)")
    p_t = Output(3, unit="m/s", description="P_t(V_t)")
    w = Output(3, unit="rad/s", description="angular velocity of the tool that is asked for")

    def equations(self):
        n = self.n
        across = self.v_h - self.contact * dot(n, self.v_h) * n
        size = norm_2(across)
        yield self.p_h == across * ca.fmin(1.0, self.v_max / ca.fmax(size, TINY))
        yield self.p_t == self.contact * dot(n, self.v_t) * n
        yield self.w == self.contact * self.w_t
