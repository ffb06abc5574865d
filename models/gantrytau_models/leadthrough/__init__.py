"""Robots that are led by hand while their tool touches something: Dressler (2012), chapter 8."""

from gantrytau_models.leadthrough.adaptive_gain import AdaptiveForceControl
from gantrytau_models.leadthrough.assumed import operators, surfaces
from gantrytau_models.leadthrough.assumed.records import OperatorRecord, SurfaceRecord
from gantrytau_models.leadthrough.groove import Groove, GrooveLeadThrough, GrooveProjection, ToolInGroove
from gantrytau_models.leadthrough.laws import (
    ContactState,
    Impedance,
    NormalEstimate,
    Projection,
    ToolForceControl,
)
from gantrytau_models.leadthrough.lead_through import LeadThrough
from gantrytau_models.leadthrough.peg_control import PegControl
from gantrytau_models.leadthrough.peg_figures import plot_peg_forces, plot_peg_orientation, plot_peg_torques
from gantrytau_models.leadthrough.peg_in_hole import PegInHole, peg_disturbances
from gantrytau_models.leadthrough.peg_match import Match
from gantrytau_models.leadthrough.peg_tool import PegHand, PegTool
from gantrytau_models.leadthrough.servo_and_sensors import ForceSensor, LedArm, VelocityServo
from gantrytau_models.leadthrough.surface.contact_loop import ContactLoop, CriticalGain, contact_loop
from gantrytau_models.leadthrough.surface.led_robot import LedRobot
from gantrytau_models.leadthrough.surface.operator import Operator
from gantrytau_models.leadthrough.surface.surface_figures import plot_oscillation, plot_tool_force
from gantrytau_models.leadthrough.surface.surface_tracking import (
    LedTool,
    Surface,
    SurfaceTracking,
    surface_disturbances,
)

__all__ = [
    "AdaptiveForceControl",
    "ContactLoop",
    "ContactState",
    "CriticalGain",
    "ForceSensor",
    "Groove",
    "GrooveLeadThrough",
    "GrooveProjection",
    "Impedance",
    "LeadThrough",
    "LedArm",
    "LedRobot",
    "LedTool",
    "Match",
    "NormalEstimate",
    "Operator",
    "OperatorRecord",
    "PegControl",
    "PegHand",
    "PegInHole",
    "PegTool",
    "Projection",
    "Surface",
    "SurfaceRecord",
    "SurfaceTracking",
    "ToolForceControl",
    "ToolInGroove",
    "VelocityServo",
    "contact_loop",
    "operators",
    "peg_disturbances",
    "plot_oscillation",
    "plot_peg_forces",
    "plot_peg_orientation",
    "plot_peg_torques",
    "plot_tool_force",
    "surface_disturbances",
    "surfaces",
]
