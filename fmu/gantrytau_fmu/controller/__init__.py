"""A robot controller whose references others overwrite from sample to sample."""

from gantrytau_fmu.controller.channels import Channel, Declaration
from gantrytau_fmu.controller.clients import Client, Sample
from gantrytau_fmu.controller.controller import Controller
from gantrytau_fmu.controller.external_kinematics import ExternalKinematics
from gantrytau_fmu.controller.reference_path import AxisLimits
from gantrytau_fmu.controller.timing import ClientCounts, ControlledResult, Timing

__all__ = [
    "AxisLimits",
    "Channel",
    "Client",
    "ClientCounts",
    "ControlledResult",
    "Controller",
    "Declaration",
    "ExternalKinematics",
    "Sample",
    "Timing",
]
