"""Robots from URDF files, the tree that ROS, Drake and Pinocchio read, and a file of the loops that URDF cannot state."""

from gantrytau.mechanics.urdf.read_urdf import UrdfRobot, read_urdf
from gantrytau.mechanics.urdf.urdf_parts import LinkBody, LinkFrame, Origin, PlanarJoint

__all__ = ["LinkBody", "LinkFrame", "Origin", "PlanarJoint", "UrdfRobot", "read_urdf"]
