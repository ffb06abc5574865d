"""Complete models: a pendulum, linkages, the Gantry-Tau robots with their parameters, and what drives them."""

from gantrytau_models import prototypes
from gantrytau_models.control import CascadedController, ComputedTorqueController, PidController
from gantrytau_models.delta import DeltaRobot
from gantrytau_models.f1 import F1GantryTau
from gantrytau_models.feedforward import Feedforward
from gantrytau_models.four_bar import FourBar
from gantrytau_models.gantry_tau import GantryTau
from gantrytau_models.inverse_dynamics import InverseDynamics
from gantrytau_models.kinematics import ForwardKinematics, InverseKinematics
from gantrytau_models.pendulum import Pendulum
from gantrytau_models.plant import MeasuredGantryTau, MotorDrivenGantryTau
from gantrytau_models.references import CircularReference
from gantrytau_models.six_link import SixLinkGantryTau
from gantrytau_models.stewart import StewartPlatform
from gantrytau_models.tracking import ControlledRobot, TrackingController
from gantrytau_models.wrist import F1WithWrist, SerialWrist, SixLinkWithWrist, WithWrist

__all__ = [
    "CascadedController",
    "CircularReference",
    "ComputedTorqueController",
    "ControlledRobot",
    "DeltaRobot",
    "F1GantryTau",
    "F1WithWrist",
    "Feedforward",
    "ForwardKinematics",
    "FourBar",
    "GantryTau",
    "InverseDynamics",
    "InverseKinematics",
    "MeasuredGantryTau",
    "MotorDrivenGantryTau",
    "Pendulum",
    "PidController",
    "SerialWrist",
    "SixLinkGantryTau",
    "SixLinkWithWrist",
    "StewartPlatform",
    "TrackingController",
    "WithWrist",
    "prototypes",
]
