"""A tool that is led along a groove: it touches two surfaces at once, and only the way along the groove is the hand's.

    f = sum over both walls of stiffness max(0, m_i.r) m_i,    m = (0, +-cos(a), sin(a))       a: wall against the z axis
    P_h(V) = g g.V,    P_t(V) = V - g g.V                      g: along the groove, in place of (8.8) and (8.9)

With n the nominal normal (8.4) holds a force into the groove and none across it, so that the tool stays in the middle
however the hand pushes. Dressler (2012), section 8.5, names grooves as what comes after one surface.
"""

import math
from typing import Any

import casadi as ca

from gantrytau import Input, Model, Output, Parameter, dot, norm_2, require
from gantrytau_models.leadthrough.laws import TINY, NormalEstimate, Projection
from gantrytau_models.leadthrough.lead_through import HandAndTool, LeadThrough
from gantrytau_models.leadthrough.servo_and_sensors import VelocityServo


class Groove(Model):
    """Two even walls that give way along their normals, without friction; r = 0 touches both, z points into them."""

    stiffness = Parameter(2000.0, unit="N/m", min=0.0, description="of each wall along its normal")
    wall = Parameter(
        math.pi / 4, unit="rad", min=0.0, max=math.pi / 2, description="angle of the walls against z"
    )
    turn = Parameter(0.0, unit="rad", description="of the groove about z, from the x axis")
    r = Input(3, unit="m", description="position of the tool")
    f = Output(3, unit="N", description="force of the tool on both walls")

    def equations(self):
        across = ca.vertcat(-ca.sin(self.turn), ca.cos(self.turn), 0)
        down = ca.vertcat(0, 0, ca.sin(self.wall))
        walls = [down + side * ca.cos(self.wall) * across for side in (1, -1)]
        forces: list[Any] = [self.stiffness * ca.fmax(0.0, dot(m, self.r)) * m for m in walls]
        yield self.f == forces[0] + forces[1]


class GrooveProjection(Projection):
    """In contact the hand moves the tool along the groove alone, and its force moves it in both directions across."""

    along = Parameter([1.0, 0.0, 0.0], unit="1", description="direction of the groove, g, of length one")

    def equations(self):
        g = self.along
        yield require(ca.fabs(norm_2(g) - 1) < 1e-9, "expected a direction of length one")
        free = self.v_h - self.contact * (self.v_h - dot(g, self.v_h) * g)
        yield self.p_h == free * ca.fmin(1.0, self.v_max / ca.fmax(norm_2(free), TINY))
        yield self.p_t == self.contact * (self.v_t - dot(g, self.v_t) * g)
        yield self.w == self.contact * self.w_t


class GrooveLeadThrough(LeadThrough):
    """`LeadThrough` in a groove. The nominal normal is kept: an estimate would follow forces across, and not end them."""

    normal = NormalEstimate(gate=0.0)
    projection = GrooveProjection()


class ToolInGroove(Model):
    """A tool in a groove, without noise; `f_h` is the force of the hand. control: any controller of hand and tool."""

    f_h = Input(3, unit="N", start=0.0, description="force of the hand on the handle")
    groove = Groove()
    arm = VelocityServo()
    control: HandAndTool = GrooveLeadThrough()

    def equations(self):
        arm, control = self.arm, self.control
        yield self.groove.r == arm.r
        yield control.f_h == self.f_h
        yield control.f_t == self.groove.f
        yield control.t_t == 0
        yield control.v_tool == arm.v
        yield arm.v_ref == control.v
        yield arm.f == self.groove.f
