"""The controller of lead-through: two force sensors in, the velocity of the tool out, once in a period."""

from gantrytau import Input, Model, Output, Parameter, Real, dot, sampled
from gantrytau_models.leadthrough.laws import (
    ContactState,
    Impedance,
    NormalEstimate,
    Projection,
    ToolForceControl,
)


class HandAndTool(Model):
    """Base of controllers of a tool that is led: hand and tool say velocities, their projections what is let through."""

    period = Parameter(0.004, unit="s", min=0.0, description="sampling period")
    f_h = Input(3, unit="N", start=0.0, description="force of the hand on the handle, as measured")
    f_t = Input(3, unit="N", start=0.0, description="force of the tool on what it touches, as measured")
    t_t = Input(3, unit="N.m", start=0.0, description="torque of the tool on what it touches, as measured")
    v_tool = Input(3, unit="m/s", start=0.0, description="velocity of the tool")
    hand = Impedance(period=period)
    tool = ToolForceControl()
    normal = NormalEstimate()
    projection = Projection()
    contact = Real(unit="1", description="1 in contact, else 0")
    v = Output(3, unit="m/s", start=0.0, description="velocity for the servos, from sample to sample")
    w = Output(3, unit="rad/s", start=0.0, description="angular velocity for the servos")

    def equations(self):
        hand, tool, normal, projection = self.hand, self.tool, self.normal, self.projection
        yield normal.f == self.f_t
        yield tool.f == self.f_t
        yield tool.t == self.t_t
        yield tool.n == normal.n
        yield hand.f == self.f_h
        yield hand.v_tool == self.v_tool
        yield hand.passed == projection.p_h
        yield projection.contact == self.contact
        yield projection.n == normal.n
        yield projection.v_h == hand.v
        yield projection.v_t == tool.v
        yield projection.w_t == tool.w
        yield sampled(self.v, projection.p_h + projection.p_t, period=self.period)
        yield sampled(self.w, projection.w, period=self.period)


class LeadThrough(HandAndTool):
    """A tool that is led by hand, and in contact holds a force by itself: (8.1) to (8.11).

    V = P_h(V_h) + P_t(V_t): the handle is a mass with damping, the tool a force control, and the state of contact says who
    moves what. All within one instant, from the forces just before it; `v` and `w` are held until the next one.
    tool_control=False leaves all motion to the hand, whatever the tool touches. Forces are in axes of the tool.
    """

    tool_control = True
    state = ContactState(period=HandAndTool.period)
    f_n = Real(unit="N", description="force of the tool along n")

    def equations(self):
        yield from super().equations()
        yield self.f_n == dot(self.normal.n, self.f_t)
        yield self.state.f_n == self.f_n
        yield self.state.pull == -dot(self.normal.n, self.f_h)
        yield self.contact == (self.state.contact if self.tool_control else 0.0)
