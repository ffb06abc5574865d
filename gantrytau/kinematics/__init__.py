"""Kinematics of robots: poses from joints and joints from poses, one or many at a time."""

from gantrytau.kinematics.accuracy import accuracy
from gantrytau.kinematics.assembly_modes import assembly_modes
from gantrytau.kinematics.kinematics import Kinematics

__all__ = ["Kinematics", "accuracy", "assembly_modes"]
