"""Kinematics of robots: poses from joints and joints from poses, one or many at a time."""

from gantrytau.kinematics.kinematics import Kinematics

__all__ = ["Kinematics"]
