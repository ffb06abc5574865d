"""What reconstruction cannot begin with: words, lenses and images that do not fit together."""

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from gantrytau.border.refusal import did_you_mean
from gantrytau_optimica.fitting.finding import rows_in_words
from gantrytau_optimica.vision.detection.detections import LOST, Detections
from gantrytau_optimica.vision.intrinsics import Camera
from gantrytau_optimica.vision.opencv import VisionError

LEAST_POSES = 10
KNOWN = {
    "intrinsics": ("fixed", "estimate"),
    "scale": ("spacing", "pattern", "both"),
    "orientation": ("fixed", "free"),
    "corners": ("plate", "free"),
}


def check_images(detections: Detections, cameras: Sequence[Camera]) -> tuple[Camera, ...]:
    """The lenses, one for each camera of the images; VisionError where their number or size is another."""
    if not isinstance(detections, Detections):
        raise VisionError(
            f"reconstruct: found {type(detections).__name__}, expected Detections, as of detect(folders, pattern)"
        )
    lenses = (cameras,) if isinstance(cameras, Camera) else tuple(cameras)
    wrong = next((each for each in lenses if not isinstance(each, Camera)), None)
    if wrong is not None:
        words = f"found {type(wrong).__name__} among cameras, expected Camera of vision, the lens alone"
        raise VisionError(f"reconstruct: {words}")
    if len(lenses) != len(detections.size):
        raise VisionError(
            f"reconstruct: found {len(lenses)} cameras and images of {len(detections.size)}, expected one lens for each"
        )
    for c, (lens, size) in enumerate(zip(lenses, detections.size, strict=True)):
        if tuple(lens.size) != tuple(int(n) for n in size):
            raise VisionError(
                f"reconstruct: camera {c + 1}: found K for {lens.size[0]} x {lens.size[1]} pixels and images of {size[0]} x "
                f"{size[1]}, expected the same; K scales with the size of images"
            )
    return lenses


def check_words(
    intrinsics: str, scale: str | None, spacing: Any, orientation: str, corners: str, count: int
) -> str:
    """What tells the scale; VisionError for unknown words and for words that contradict each other."""
    if scale is None:
        scale = "pattern" if spacing is None else "both" if corners == "plate" else "spacing"
    asked = dict(intrinsics=intrinsics, scale=scale, orientation=orientation, corners=corners)
    for name, value in asked.items():
        if value not in KNOWN[name]:
            listed = ", ".join(map(repr, KNOWN[name]))
            raise VisionError(
                f"reconstruct: found {name}={value!r}, expected one of {listed}{did_you_mean(str(value), KNOWN[name])}"
            )
    if scale != "pattern" and spacing is None:
        raise VisionError(
            f"reconstruct: found scale={scale!r} without spacing, expected spacing=, positions of the carts in m; or "
            "scale='pattern'"
        )
    if scale == "pattern" and spacing is not None:
        raise VisionError(
            "reconstruct: found spacing and scale='pattern', which leaves it out; take scale='both'"
        )
    if corners == "free":
        refusals = {
            "scale='both', expected 'spacing' or 'pattern': free corners are scaled once, at the end": scale
            == "both",
            "intrinsics='estimate', expected 'fixed': without the plate images do not tell the lenses": intrinsics
            != "fixed",
            "one camera, expected two or more: depth of a single corner is not seen by one": count < 2,
        }
        for words in (words for words, there in refusals.items() if there):
            raise VisionError(f"reconstruct: with corners='free' found {words}; corners='plate' allows it")
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
