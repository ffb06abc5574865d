"""A robot with a pattern before two cameras, as in thesis section 5.5: guideways along the view, 4.2 m away."""

from functools import cache

import numpy as np

from gantrytau_models import SixLinkGantryTau, prototypes
from gantrytau_optimica.calibration.devices.cameras import PlacedCamera
from gantrytau_optimica.vision import Camera, Detections, Images, Light, Pattern, Scene, render, true_corners

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


def lines(
    seed: int, *, width: float = 0.8, height: float = 0.8, count: int = 21, each: int = 12
) -> tuple[np.ndarray, np.ndarray]:
    """Places (N, 3) of the tool on lines along the guideways, at random beside each other, and carts (N, 3), in m."""
    beside = np.random.default_rng(seed).uniform(-0.5, 0.5, (count, 2)) * [width, height]
    x = np.linspace(-0.85, 0.85, each)
    r = MIDDLE + np.array([[a, *b] for b in beside for a in x])
    kinematics = scene().kinematics
    assert kinematics is not None
    return r, kinematics.ik(r, np.eye(3))


def seen(
    r: np.ndarray, cameras: list[PlacedCamera], noise: float = 0.1, seed: int = 0, R: np.ndarray | None = None
) -> Detections:
    """Corners as cameras would find them, with noise in pixels, of poses that are wholly in the image."""
    true = true_corners(scene(), cameras, r, R)
    corners = true + noise * np.random.default_rng(seed).standard_normal(true.shape)
    outside = np.stack([~c.inside(each).all(axis=1) for c, each in zip(cameras, corners, strict=True)])
    corners[outside] = np.nan
    steps = np.where(outside, "corners", "")
    size = np.array([camera.size for camera in cameras])
    return Detections(
        Pattern.quincunx(SIDE), corners, np.full(corners.shape[:3], noise), steps, size, np.arange(len(r))
    )
