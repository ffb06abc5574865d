"""Kinematics of robots: poses from joints and joints from poses, one or many at a time."""

from gantrytau.kinematics.accuracy.accuracy import Accuracy, accuracy
from gantrytau.kinematics.accuracy.joint_errors import JointErrors
from gantrytau.kinematics.cart_joints import CartJoints, cart_joints
from gantrytau.kinematics.kinematics import Kinematics
from gantrytau.kinematics.modes.assembly_modes import AssemblyModes, assembly_modes
from gantrytau.kinematics.modes.assembly_study import AssemblyStudy, assembly_study
from gantrytau.kinematics.rods.configurations import Configuration
from gantrytau.kinematics.turntable_screw import TurntableScrew
from gantrytau.kinematics.workspace.examine import examine
from gantrytau.kinematics.workspace.grid_spacing import grid_spacing
from gantrytau.kinematics.workspace.obstacles import Box, Capsule, Cylinder
from gantrytau.kinematics.workspace.pose_limits import Limits
from gantrytau.kinematics.workspace.workspace import Workspace, workspace
from gantrytau.language.self_description.rods import RodArm, Rods, RodTurntable, SingleRod

__all__ = [
    "Accuracy",
    "AssemblyModes",
    "AssemblyStudy",
    "Box",
    "Capsule",
    "CartJoints",
    "Configuration",
    "Cylinder",
    "JointErrors",
    "Kinematics",
    "Limits",
    "RodArm",
    "RodTurntable",
    "Rods",
    "SingleRod",
    "TurntableScrew",
    "Workspace",
    "accuracy",
    "assembly_modes",
    "assembly_study",
    "cart_joints",
    "examine",
    "grid_spacing",
    "workspace",
]
