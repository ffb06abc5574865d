"""Images of a scene, with light, lens, blur and noise, the same for the same seed."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gantrytau import ModelError
from gantrytau.border.checks import whole
from gantrytau.border.refusal import Given
from gantrytau.describing.record import Record
from gantrytau_optimica.calibration.devices.cameras import PlacedCamera
from gantrytau_optimica.vision.image_files import file_name, write_image, write_poses
from gantrytau_optimica.vision.opencv import opencv
from gantrytau_optimica.vision.scenes.drawing import bodies, draw, wall_of
from gantrytau_optimica.vision.scenes.scene import GREATEST, Light, Scene

Array = np.ndarray
POSES = "poses.csv"
GOOD = Light()


@dataclass(frozen=True, eq=False)
class Images(Record):
    """Images and the poses of the plate that they show.

    frames: one for each camera: arrays (N, height, width), or the folder of its files; r: (N, 3) in m; R: (N, 3, 3).
    """

    frames: tuple[Any, ...]
    r: Array
    R: Array


def render(
    scene: Scene,
    poses: Any,
    cameras: Sequence[PlacedCamera],
    *,
    light: Light | Sequence[Light] = GOOD,
    seed: int = 0,
    folder: str | os.PathLike[str] | None = None,
) -> Images:
    """Images of a scene at poses of the plate, by each camera.

    poses: positions (N, 3) in m, or (r, R) with orientations (N, 3, 3) or (3, 3); cameras: where they stand
    (`PlacedCamera.looking`, `PlacedCamera.placed`); light: one for all, or one for each pose; seed: of noise and tilt: each
    image has its own numbers, whatever other images there are. folder: write the images to folder/camera1/0000.png and so
    on and the poses to folder/poses.csv; otherwise they are kept in memory, 0.8 MB each.
    Raises ModelError for cameras that stand nowhere, lights that are not as many as the poses, and poses out of reach.
    """
    whole("render", "seed", seed, least=0)
    r, R = scene.poses(*poses) if isinstance(poses, tuple) else scene.poses(poses)
    if not cameras or not all(isinstance(camera, PlacedCamera) for camera in cameras):
        raise ModelError(
            "expected cameras that stand somewhere; place them by PlacedCamera.looking(r, at) or PlacedCamera.placed(r, R)",
            place="render",
            found=Given("cameras", cameras),
        )
    lights = [light] * len(r) if isinstance(light, Light) else list(light)
    if len(lights) != len(r):
        raise ModelError(
            f"found {len(lights)} lights for {len(r)} poses, expected one, or one for each pose",
            place="render",
            argument="light",
        )
    bars = scene.links(r, R)
    walls = [wall_of(scene, camera) for camera in cameras]

    def image(c: int, k: int) -> Array:
        grey = draw(scene, walls[c], r[k], R[k], bodies(scene, cameras[c], bars, k))
        return expose(grey, lights[k], np.random.default_rng([seed, c, k]))

    rows = range(len(r))
    if folder is None:
        return Images(tuple(np.stack([image(c, k) for k in rows]) for c in range(len(cameras))), r, R)
    folders = tuple(Path(folder) / f"camera{c + 1}" for c in range(len(cameras)))
    for c, place in enumerate(folders):
        place.mkdir(parents=True, exist_ok=True)
        for k in rows:
            write_image(place / file_name(k), image(c, k))
    write_poses(Path(folder) / POSES, r, R)
    return Images(folders, r, R)


def expose(grey: Array, light: Light, random: np.random.Generator) -> Array:
    """The image that a camera makes of grey values: light, blur, noise and whole numbers."""
    cv2 = opencv()
    height, width = grey.shape
    x, y = np.linspace(-1, 1, width, dtype=np.float32), np.linspace(-1, 1, height, dtype=np.float32)[:, None]
    tilt = light.tilt * random.standard_normal(2)
    falls = 1 - light.vignetting * (x * x + y * y) / 2
    image = grey * (light.gain * falls * (1 + (light.lamp / 2 + tilt[0]) * x + tilt[1] * y))
    if light.blur > 0:
        image = cv2.GaussianBlur(image, (0, 0), light.blur)
    if light.noise > 0:
        image = image + light.noise * random.standard_normal(grey.shape, dtype=np.float32)
    greatest = GREATEST[light.bits]
    whole = np.clip(np.rint(image * (greatest / 255)), 0, greatest)
    return whole.astype(np.uint8 if light.bits == 8 else np.uint16)
