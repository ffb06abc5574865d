"""Kinematics of robots: poses from joints and joints from poses, one or many at a time."""

from gantrytau.kinematics.accuracy import accuracy
from gantrytau.kinematics.assembly_modes import assembly_modes
from gantrytau.kinematics.configurations import Configuration
from gantrytau.kinematics.kinematics import Kinematics
from gantrytau.kinematics.workspace import Workspace, workspace

__all__ = ["Configuration", "Kinematics", "Workspace", "accuracy", "assembly_modes", "workspace"]
