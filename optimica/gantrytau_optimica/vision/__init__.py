"""Cameras: images of a scene, the pattern in them, and poses of the robot from it. Needs OpenCV, the extra `vision`."""

from gantrytau_optimica.vision.boards import Pattern
from gantrytau_optimica.vision.comparison.arm_table import ArmTable, arm_table
from gantrytau_optimica.vision.comparison.compare import Comparison, compare
from gantrytau_optimica.vision.comparison.comparison_figures import plot_comparison
from gantrytau_optimica.vision.detection.detect import detect
from gantrytau_optimica.vision.detection.detections import Detections
from gantrytau_optimica.vision.image_files import read_poses, write_poses
from gantrytau_optimica.vision.intrinsics import Camera
from gantrytau_optimica.vision.opencv import VisionError
from gantrytau_optimica.vision.pages.vision_page import write_vision_page
from gantrytau_optimica.vision.places_files import paired, read_carts, read_places
from gantrytau_optimica.vision.reconstruction.reconstruct import reconstruct
from gantrytau_optimica.vision.reconstruction.reconstruction import Reconstruction
from gantrytau_optimica.vision.rehearsal import Rehearsal, rehearse_plan
from gantrytau_optimica.vision.scenes.render import Images, render
from gantrytau_optimica.vision.scenes.scene import Light, Scene, true_corners
from gantrytau_optimica.vision.tracking.tracker import PatternTracker, Tracked

__all__ = [
    "ArmTable",
    "Camera",
    "Comparison",
    "Detections",
    "Images",
    "Light",
    "Pattern",
    "PatternTracker",
    "Reconstruction",
    "Rehearsal",
    "Scene",
    "Tracked",
    "VisionError",
    "arm_table",
    "compare",
    "detect",
    "paired",
    "plot_comparison",
    "read_carts",
    "read_places",
    "read_poses",
    "reconstruct",
    "rehearse_plan",
    "render",
    "true_corners",
    "write_poses",
    "write_vision_page",
]
