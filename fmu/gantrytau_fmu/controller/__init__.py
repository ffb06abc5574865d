"""A robot controller whose references others overwrite from sample to sample."""

from gantrytau_fmu.controller.channels import Channel, Declaration
from gantrytau_fmu.controller.clients import Client, Sample
from gantrytau_fmu.controller.controller import Controller
from gantrytau_fmu.controller.exchange import (
    FileStream,
    FunctionClient,
    RemoteClient,
    Server,
    haptic_client,
    run_client,
    stream_file,
    stream_sensor,
)
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
    "FileStream",
    "FunctionClient",
    "RemoteClient",
    "Sample",
    "Server",
    "Timing",
    "haptic_client",
    "run_client",
    "stream_file",
    "stream_sensor",
]
