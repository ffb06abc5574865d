"""What reconstruction cannot begin with: words, lenses and images that do not fit together."""

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from gantrytau import ModelError
from gantrytau.border.checks import instance
from gantrytau.border.refusal import Given
from gantrytau_optimica.fitting.finding import rows_in_words
from gantrytau_optimica.vision.detection.detections import LOST, Detections
from gantrytau_optimica.vision.intrinsics import Camera
from gantrytau_optimica.vision.opencv import VisionError

LEAST_POSES = 10


def check_images(detections: Detections, cameras: Sequence[Camera]) -> tuple[Camera, ...]:
    """The lenses, one for each camera of the images; ModelError where their number or size is another."""
    expected = "Detections, as of detect(folders, pattern)"
    instance("reconstruct", "detections", detections, Detections, expected)
    lenses = (cameras,) if isinstance(cameras, Camera) else tuple(cameras)
    for lens in lenses:
        instance("reconstruct", "cameras", lens, Camera, "Camera of vision, the lens alone")
    if len(lenses) != len(detections.size):
        raise ModelError(
            f"found {len(lenses)} cameras and images of {len(detections.size)}, expected one lens for each",
            place="reconstruct",
            argument="cameras",
        )
    for c, (lens, size) in enumerate(zip(lenses, detections.size, strict=True)):
        if tuple(lens.size) != tuple(int(n) for n in size):
            raise ModelError(
                f"found K for {lens.size[0]} x {lens.size[1]} pixels and images of {size[0]} x {size[1]}, expected the "
                "same; K scales with the size of images",
                place=f"reconstruct: camera {c + 1}",
                argument="cameras",
            )
    return lenses


def told_scale(scale: str | None, spacing: Any, corners: str, intrinsics: str, count: int) -> str:
    """What tells the scale; ModelError for words that contradict each other, or do not fit the count of cameras."""
    if scale is None:
        scale = "pattern" if spacing is None else "both" if corners == "plate" else "spacing"
    if (scale == "pattern") == (spacing is not None):
        words = ("expected 'both' beside ", Given("spacing"), ", which it leaves out")
        if spacing is None:
            words = (
                "expected it with ",
                Given("spacing"),
                ", positions of the carts in m; or ",
                Given("scale", "pattern"),
            )
        raise ModelError(*words, place="reconstruct", found=Given("scale", scale))
    if corners == "free":
        refusals = {
            "free corners are scaled once, at the end": (scale == "both", Given("scale", scale)),
            "without the plate images do not tell the lenses": (
                intrinsics != "fixed",
                Given("intrinsics", intrinsics),
            ),
            "depth of a single corner is not seen by one camera": (count < 2, Given("cameras")),
        }
        for words, (wrong, found) in refusals.items():
            if wrong:
                raise ModelError(
                    f"{words}; ", Given("corners", "plate"), " allows it", place="reconstruct", found=found
                )
    return scale


def check_facing(detections: Detections, rows: np.ndarray) -> None:
    """VisionError where a camera sees the pattern from behind, as in mirrored images."""
    points = detections.pattern.points[:, :2]
    for c, corners in enumerate(detections.corners[:, rows]):
        seen = np.isfinite(corners[..., :1])
        count = np.maximum(seen.sum(axis=1, keepdims=True), 1)
        away = np.where(seen, corners, 0.0)
        away = np.where(seen, away - away.sum(axis=1, keepdims=True) / count, 0.0)
        # the images of right and up turn about each other the other way, as pixels count downwards
        behind = np.linalg.det(np.swapaxes(away, 1, 2) @ points) > 0
        known = seen.any(axis=(1, 2))
        if behind[known].sum() > known.sum() / 2:
            raise VisionError(
                f"reconstruct: camera {c + 1} sees the pattern from behind in {rows_in_words(rows[known & behind])}, "
                "expected from the front; its images are mirrored, or corners numbered the other way round: flip them"
            )


def usable_poses(detections: Detections) -> np.ndarray:
    """Rows of poses that two cameras saw, or the only one; VisionError for fewer than ten, with what lost the others."""
    needed = min(2, len(detections.size))
    rows = np.flatnonzero(detections.found.sum(axis=0) >= needed)
    if len(rows) < LEAST_POSES:
        steps = Counter(step for step in detections.steps.ravel().tolist() if step)
        where = {s: rows_in_words(np.flatnonzero((detections.steps == s).any(axis=0))) for s in steps}
        words = [f"{n} images at {step!r}, {where[step]}: {LOST[step]}" for step, n in steps.most_common()]
        lost = "; ".join(words) if words else "no image was lost"
        raise VisionError(
            f"reconstruct: found {len(rows)} poses of {len(detections.numbers)} with the pattern in {needed} images, "
            f"expected at least {LEAST_POSES}; lost were {lost}"
        )
    return rows
