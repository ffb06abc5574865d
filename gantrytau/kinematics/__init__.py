"""Kinematics of robots: poses from joints and joints from poses, one or many at a time."""

from gantrytau.kinematics.accuracy import Accuracy, accuracy
from gantrytau.kinematics.assembly_modes import AssemblyModes, assembly_modes
from gantrytau.kinematics.configurations import Configuration
from gantrytau.kinematics.kinematics import Kinematics
from gantrytau.kinematics.obstacles import Box, Capsule, Cylinder
from gantrytau.kinematics.workspace import Workspace, workspace
from gantrytau.kinematics.workspace_limits import Limits, examine

__all__ = [
    "Accuracy",
    "AssemblyModes",
    "Box",
    "Capsule",
    "Configuration",
    "Cylinder",
    "Kinematics",
    "Limits",
    "Workspace",
    "accuracy",
    "assembly_modes",
    "examine",
    "workspace",
]
