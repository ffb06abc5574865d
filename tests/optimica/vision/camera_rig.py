"""A robot with a pattern before two cameras, as in thesis section 5.5: guideways along the view, 4.2 m away."""

from functools import cache

import numpy as np

from gantrytau_models import SixLinkGantryTau, prototypes
from gantrytau_optimica.calibration.devices.cameras import Camera as PlacedCamera
from gantrytau_optimica.vision import Camera, Images, Light, Pattern, Scene, render

SIDE = 0.06  # m
LENS = Camera.guess((1024, 768), 1290.0)
TYPICAL = Camera([[1296.0, 0, 518.0], [0, 1296.0, 377.0], [0, 0, 1]], [-0.12, 0.03, 0, 0, 0])
MIDDLE = np.array([1.3, 3.0, -0.6])


@cache
def scene() -> Scene:
    """GT-A with a quincunx of 60 mm cells."""
    return Scene(Pattern.quincunx(SIDE), SixLinkGantryTau(prototypes.GT_A))


def pair(lens: Camera = LENS, base: float = 1.2) -> list[PlacedCamera]:
    """Two cameras beside each other that look along -x."""
    return [lens.looking(np.add(MIDDLE, [3.5, side * base / 2, 0.0]), MIDDLE) for side in (-1, 1)]


def places(count: int, seed: int) -> np.ndarray:
    """Positions of the tool in view of both cameras, x over 1.5 m, (count, 3) in m."""
    return MIDDLE + np.random.default_rng(seed).uniform([-0.8, -0.4, -0.4], [0.7, 0.4, 0.4], (count, 3))


def views(count: int, seed: int, light: Light = Light(), lens: Camera = LENS) -> Images:  # noqa: B008
    """Images of the pair at random places."""
    return render(scene(), places(count, seed), pair(lens), light=light, seed=seed)
