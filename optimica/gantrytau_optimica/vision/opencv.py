"""OpenCV, which draws, reads and filters images: an extra that only this room needs."""

import importlib
from typing import Any

from gantrytau import GantryTauError


class VisionError(GantryTauError):
    """Images, cameras or patterns that cannot be used, or not together."""


def opencv() -> Any:
    """The module cv2; VisionError that says how to install it where it is missing."""
    try:
        return importlib.import_module("cv2")
    except ImportError as error:
        raise VisionError(
            "vision: OpenCV (cv2) is not installed, but images need it; pip install 'gantrytau[vision]'"
        ) from error
