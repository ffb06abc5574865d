"""Masses, friction, servos and compliance of robots from measured motion."""

from gantrytau_optimica.identification.excitation.design_excitation import design_excitation
from gantrytau_optimica.identification.excitation.excitation_result import Excitation
from gantrytau_optimica.identification.friction.friction_map import FrictionMap, friction_over_load
from gantrytau_optimica.identification.friction.friction_result import Friction
from gantrytau_optimica.identification.friction.identify_friction import identify_friction
from gantrytau_optimica.identification.logs.motion_log import MotionLog
from gantrytau_optimica.identification.logs.robot_checks import check_motion
from gantrytau_optimica.identification.physical.mechanical_form import MechanicalForm
from gantrytau_optimica.identification.physical.physical_form import PhysicalForm, physical_form
from gantrytau_optimica.identification.rigid.identification import Identification
from gantrytau_optimica.identification.rigid.identify import identify
from gantrytau_optimica.identification.rigid.model_comparison import (
    FURTHER_MODELS,
    TABLE_6_3,
    ModelComparison,
    compare_models,
    printed_models,
)
from gantrytau_optimica.identification.rigid.robot_dynamics import IdentificationError
from gantrytau_optimica.identification.servos.identify_servo import identify_servo
from gantrytau_optimica.identification.servos.servo_model import ServoModel
from gantrytau_optimica.identification.servos.step_response import StepResponse
from gantrytau_optimica.identification.spectra.measured_response import MeasuredResponse, measured_response
from gantrytau_optimica.identification.spectra.resonances import resonances
from gantrytau_optimica.identification.systems.identify_system import IdentifiedSystem, identify_system

__all__ = [
    "FURTHER_MODELS",
    "TABLE_6_3",
    "Excitation",
    "Friction",
    "FrictionMap",
    "Identification",
    "IdentificationError",
    "IdentifiedSystem",
    "MeasuredResponse",
    "MechanicalForm",
    "ModelComparison",
    "MotionLog",
    "PhysicalForm",
    "ServoModel",
    "StepResponse",
    "check_motion",
    "compare_models",
    "design_excitation",
    "friction_over_load",
    "identify",
    "identify_friction",
    "identify_servo",
    "identify_system",
    "measured_response",
    "physical_form",
    "printed_models",
    "resonances",
]
