"""A tool that is led along a surface, section 8.4 of Dressler (2012)."""

import math
import warnings
from collections.abc import Mapping
from typing import Any

import casadi as ca

from gantrytau import Input, Model, Output, Parameter, Real, require, white_noise
from gantrytau.border.checks import instance
from gantrytau.inputs.random_signals import WhiteNoise
from gantrytau.language.model import merge
from gantrytau_models.leadthrough.adaptive_gain import AdaptiveForceControl
from gantrytau_models.leadthrough.assumed import operators
from gantrytau_models.leadthrough.assumed.records import OperatorRecord, SurfaceRecord
from gantrytau_models.leadthrough.lead_through import LeadThrough
from gantrytau_models.leadthrough.servo_and_sensors import ForceSensor, LedArm, VelocityServo
from gantrytau_models.leadthrough.surface.contact_loop import CriticalGain, contact_loop
from gantrytau_models.leadthrough.surface.operator import Operator

SLOW = 1e-3  # m/s, below which rolling resistance fades
LONG = 1e6  # s: noise of this period is one number for a run
STEEPEST = math.radians(30.0)  # of a face that is nearly flat; a tilt in degrees is beyond it
START = -0.03  # m, of the tool before the surface


class Surface(Model):
    """A surface that a rigid tool presses in: f = stiffness times the depth, along its normal, and rolling resistance.

    z of the tool points into it. The tool is moved by its velocity, so the force is what a sensor sees and moves nothing.
    """

    stiffness = Parameter(unit="N/m", min=0.0, description="stiffness against the tool")
    tilt = Parameter(
        0.0, unit="rad", min=-STEEPEST, max=STEEPEST, description="angle against the x axis of the tool"
    )
    ripple = Parameter(0.0, unit="m", min=0.0, description="amplitude of its ripple")
    ripple_length = Parameter(0.03, unit="m", min=0.0, description="length of a ripple along x")
    rolling = Parameter(0.0, unit="1", min=0.0, description="rolling resistance over normal force")
    r = Input(3, unit="m", description="position of the tool")
    v = Input(3, unit="m/s", description="velocity of the tool")
    height = Output(unit="m", description="of the tool before the surface, along z; negative inside it")
    n = Real(3, unit="1", description="normal into the surface")
    load = Real(unit="N", description="force along the normal")
    f = Output(3, unit="N", description="force of the tool on the surface")

    def equations(self):
        wave = 2 * ca.pi / self.ripple_length
        slope = ca.tan(self.tilt)
        z = slope * self.r[0] + self.ripple * ca.sin(wave * self.r[0])
        yield require(self.ripple_length > 0, "expected ripples longer than nothing")
        yield require(
            self.ripple * wave <= math.tan(STEEPEST),
            "expected flat ripples, 30 degrees at most; are they in m?",
        )
        rise = slope + self.ripple * wave * ca.cos(wave * self.r[0])
        yield self.height == z - self.r[2]
        yield self.n == ca.vertcat(-rise, 0, 1) / ca.sqrt(1 + rise**2)
        # the depth along the normal of a face that is nearly flat
        yield self.load == self.stiffness * ca.fmax(0.0, -self.height) * self.n[2]
        slip = self.v - ca.dot(self.v, self.n) * self.n
        yield self.f == self.load * (self.n + self.rolling * slip / ca.sqrt(ca.dot(slip, slip) + SLOW**2))


class ToolOnSurface(Model):
    """A tool on a surface with its sensors and whoever leads it; what moves it is said by others.

    Arguments as of `SurfaceTracking`; pressing: whether the hand helps the contact.
    """

    period = Parameter(0.004, unit="s", min=0.0, description="sampling period")
    v_ref = Real(3, unit="m/s", description="velocity that is asked for")
    f_h = Output(3, unit="N", description="force of the hand, as measured")
    f_t = Output(3, unit="N", description="force of the tool, as measured")
    v_tool = Output(3, unit="m/s", description="velocity of the tool")
    f_n = Output(unit="N", description="force of the tool along z")
    hand = Operator.open(period=period)
    handle = ForceSensor(std_bias_f=0.05)
    sensor = ForceSensor()
    arm = LedArm()
    face = Surface()

    def __init__(
        self,
        surface: SurfaceRecord,
        *,
        pressing: bool = True,
        operator: OperatorRecord = operators.SKILLED,
        arm: LedArm | Mapping[str, Any] | None = None,
        **modifications: Any,
    ):
        name = type(self).__name__
        instance(name, "surface", surface, SurfaceRecord, "a record such as surfaces.METAL")
        face = {name: getattr(surface, name) for name in surface.__dataclass_fields__ if name != "name"}
        hand = Operator(operator, pressing=pressing).modifications
        if not isinstance(arm, LedArm):
            arm = VelocityServo(dict(r=dict(start=[0.0, 0.0, START])), **(arm or {}))
        super().__init__(dict(face=face, hand=dict(hand), arm=arm), **modifications)

    def equations(self):
        arm, face = self.arm, self.face
        yield arm.v_ref == self.v_ref
        yield arm.f == face.f
        yield self.v_tool == arm.v
        yield face.r == arm.r
        yield face.v == arm.v
        yield self.f_n == face.f[2]
        yield self.sensor.f == face.f
        yield self.sensor.t == 0
        yield self.f_t == self.sensor.f_seen
        yield self.hand.height == face.height
        yield self.hand.v == arm.v
        yield self.handle.f == self.hand.f
        yield self.handle.t == 0
        yield self.f_h == self.handle.f_seen


class LedTool(ToolOnSurface):
    """All of `SurfaceTracking` but its controller: velocities in, `v_ref`; measured forces of handle and tool out, `f_h` and
    `f_t`. To be exported as an FMU beside one of `LeadThrough`.
    """

    v_ref = Input(3, unit="m/s", start=0.0, description="velocity that is asked for")


class SurfaceTracking(ToolOnSurface):
    """A tool that is led along a surface and holds 2 N there by itself.

    surface: as `surfaces.METAL`; tool_control=False leaves the contact to the hand; operator: as `operators.SKILLED`; arm: a
    `VelocityServo`, of which dict(T_v=0.001) changes the lag, unless another is given, as `LedRobot(prototypes.L1)` or a
    `LedArm` of yours. Axes are those of the tool, z into the surface. What is random comes from outside:
    `inputs=surface_disturbances()`. Warns of a gain beyond the critical one (`CriticalGain`), where the arm has the lag of a
    servo. Raises ModelError for what is no such record.
    """

    control = LeadThrough(period=ToolOnSurface.period)

    def __init__(
        self,
        surface: SurfaceRecord,
        *,
        tool_control: bool = True,
        operator: OperatorRecord = operators.SKILLED,
        **modifications: Any,
    ):
        control = merge(dict(tool_control=tool_control), modifications.pop("control", {}))
        super().__init__(surface, pressing=tool_control, operator=operator, control=control, **modifications)
        # an arm that is no servo with a lag of first order has another loop, and a gain that adapts finds its own
        adapts = isinstance(control.get("tool"), AdaptiveForceControl)
        lagging = not isinstance(arm := modifications.get("arm"), LedArm) or hasattr(arm, "T_v")
        if tool_control and lagging and not adapts and (loop := contact_loop(self)).share >= 1:
            warnings.warn(
                f"SurfaceTracking: the tool will hop on the surface: {loop}; a smaller control.tool.K or a softer "
                "surface holds it",
                CriticalGain,
                stacklevel=2,
            )

    def equations(self):
        yield from super().equations()
        control = self.control
        yield control.f_h == self.f_h
        yield control.f_t == self.f_t
        yield control.t_t == 0
        yield control.v_tool == self.v_tool
        yield self.v_ref == control.v


def surface_disturbances(period: float = 0.004) -> dict[str, WhiteNoise]:
    """What is random in a `SurfaceTracking`, as inputs of a simulation, whose seed, or that of a study, draws them."""
    found: dict[str, WhiteNoise] = {}
    for sensor in ("handle", "sensor"):
        found[f"{sensor}.white_f"] = white_noise([1.0] * 3, period)
        found[f"{sensor}.bias_f"] = white_noise([1.0] * 3, LONG)
    found["hand.white"] = found["hand.white_force"] = white_noise(1.0, period)
    found["hand.white_tremor"] = white_noise([1.0] * 2, period)
    found["hand.draw"] = white_noise([1.0] * 3, LONG)
    return found
