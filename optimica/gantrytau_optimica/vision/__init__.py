"""Cameras: images of a scene, and the pattern found in images. Needs OpenCV, the extra `vision`."""

from gantrytau_optimica.vision.boards import Pattern
from gantrytau_optimica.vision.detection.detect import detect
from gantrytau_optimica.vision.detection.detections import Detections
from gantrytau_optimica.vision.image_files import read_poses, write_poses
from gantrytau_optimica.vision.intrinsics import Camera
from gantrytau_optimica.vision.opencv import VisionError
from gantrytau_optimica.vision.scenes.render import Images, render
from gantrytau_optimica.vision.scenes.scene import Light, Scene, true_corners

__all__ = [
    "Camera",
    "Detections",
    "Images",
    "Light",
    "Pattern",
    "Scene",
    "VisionError",
    "detect",
    "read_poses",
    "render",
    "true_corners",
    "write_poses",
]
