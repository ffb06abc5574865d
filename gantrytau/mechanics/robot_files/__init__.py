"""Robots from files: URDF, MJCF and SDF, the formats of ROS, MuJoCo and Gazebo, with the loops of parallel robots."""

from gantrytau.mechanics.robot_files.read_robot import read_mjcf, read_sdf, read_urdf
from gantrytau.mechanics.robot_files.robot_class import DescribedRobot
from gantrytau.mechanics.robot_files.robot_parts import LinkBody, LinkFrame, Origin, PlanarJoint

__all__ = [
    "DescribedRobot",
    "LinkBody",
    "LinkFrame",
    "Origin",
    "PlanarJoint",
    "read_mjcf",
    "read_sdf",
    "read_urdf",
]
