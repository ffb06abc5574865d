"""Complete models: a pendulum, linkages, the Gantry-Tau robots with their parameters, and what drives them."""

from typing import TYPE_CHECKING

from gantrytau.door import door
from gantrytau_models import prototypes

if TYPE_CHECKING:
    from gantrytau_models.control.closed_form_kinematics import ForwardKinematics, InverseKinematics
    from gantrytau_models.control.controllers import (
        CascadedController,
        ComputedTorqueController,
        PidController,
    )
    from gantrytau_models.control.feedforward import Feedforward
    from gantrytau_models.control.inverse_dynamics import InverseDynamics
    from gantrytau_models.control.plant import MeasuredGantryTau, MotorDrivenGantryTau
    from gantrytau_models.control.references import CircularReference
    from gantrytau_models.control.servos import CartServo, JointServo, PreslidingFriction, cart_servos
    from gantrytau_models.control.tracking import ControlledRobot, TrackingController
    from gantrytau_models.mechanisms.bushed_links import BushedSixLinkGantryTau
    from gantrytau_models.mechanisms.delta import DeltaRobot
    from gantrytau_models.mechanisms.elastic_links import ElasticSixLinkGantryTau
    from gantrytau_models.mechanisms.error_sources import (
        F1OnScrews,
        GantryTauOnRacks,
        SaggingGantryTau,
        SixLinkOnRacks,
        WithRacks,
    )
    from gantrytau_models.mechanisms.f1 import F1GantryTau
    from gantrytau_models.mechanisms.five_dof import FiveDofGantryTau
    from gantrytau_models.mechanisms.flexible import FlexibleGantryTau
    from gantrytau_models.mechanisms.gantry_tau import GantryTau
    from gantrytau_models.mechanisms.pendulum import Pendulum
    from gantrytau_models.mechanisms.planar.five_bar import FiveBar
    from gantrytau_models.mechanisms.planar.four_bar import FourBar
    from gantrytau_models.mechanisms.six_link import SixLinkGantryTau
    from gantrytau_models.mechanisms.stewart import StewartPlatform
    from gantrytau_models.mechanisms.wrist import F1WithWrist, SerialWrist, SixLinkWithWrist, WithWrist
else:
    __getattr__, __dir__ = door(__name__)

__all__ = [
    "BushedSixLinkGantryTau",
    "CartServo",
    "CascadedController",
    "CircularReference",
    "ComputedTorqueController",
    "ControlledRobot",
    "DeltaRobot",
    "ElasticSixLinkGantryTau",
    "F1GantryTau",
    "F1OnScrews",
    "F1WithWrist",
    "Feedforward",
    "FiveBar",
    "FiveDofGantryTau",
    "FlexibleGantryTau",
    "ForwardKinematics",
    "FourBar",
    "GantryTau",
    "GantryTauOnRacks",
    "InverseDynamics",
    "InverseKinematics",
    "JointServo",
    "MeasuredGantryTau",
    "MotorDrivenGantryTau",
    "Pendulum",
    "PidController",
    "PreslidingFriction",
    "SaggingGantryTau",
    "SerialWrist",
    "SixLinkGantryTau",
    "SixLinkOnRacks",
    "SixLinkWithWrist",
    "StewartPlatform",
    "TrackingController",
    "WithRacks",
    "WithWrist",
    "cart_servos",
    "prototypes",
]
