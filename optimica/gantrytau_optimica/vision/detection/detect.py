"""The corners of a pattern in the images of all cameras."""

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from gantrytau import ModelError
from gantrytau.border.checks import instance, number, whole
from gantrytau.border.refusal import Given
from gantrytau_optimica.fitting.finding import Finding, rows_in_words
from gantrytau_optimica.vision.boards import Pattern
from gantrytau_optimica.vision.detection.charuco import find_charuco
from gantrytau_optimica.vision.detection.detections import LOST, Detections
from gantrytau_optimica.vision.detection.quarter_turns import told_up
from gantrytau_optimica.vision.detection.quincunx import find_quincunx
from gantrytau_optimica.vision.image_series import ImageSeries, image_series, rows_of
from gantrytau_optimica.vision.scenes.render import Images

Array = np.ndarray
LEAST = 3  # images of which a median leaves out what moves


def detect(
    images: Images | Sequence[Any],
    pattern: Pattern,
    *,
    background: int = 10,
    normalise: bool = True,
    up: float = 0.0,
) -> Detections:
    """The corners of a pattern in images, and the step at which images were lost.

    images: for each camera a folder, whose files are paired by the last number in their names, or an array (N, height,
    width[, 3]) of 8 or 16 bits, or what `render` returned. background: a quincunx that stands in the median of so many
    images of a camera is another one; 0 for none. normalise: contrast is compared with the noise, so that images may be
    dim; otherwise it has to be 30 grey values of 255. up: direction in the image of the side of a quincunx that is up,
    rad clockwise from the upper edge; it looks the same after a quarter of a turn, the nearest is taken. Takes about
    70 ms of one processor for a pair of images with 0.8 million pixels each.
    Raises ModelError for folders and arrays that hold no images, or of several sizes.
    """
    whole("detect", "background", background, least=0)
    up = number("detect", "up", up)
    frames = _frames_of(images)
    instance("detect", "pattern", pattern, Pattern, "a Pattern, as Pattern.quincunx(0.06)")
    cameras = [image_series(each, f"camera {c + 1}") for c, each in enumerate(frames)]
    numbers = rows_of(cameras)
    shape = (len(cameras), len(numbers), len(pattern.points))
    corners, sigma, steps = (
        np.full((*shape, 2), np.nan),
        np.full(shape, np.nan),
        np.full(shape[:2], "file", "U12"),
    )
    findings: list[Finding] = []
    candidates: dict[tuple[int, int], Array] = {}
    backgrounds: list[Array | None] = []
    for c, series in enumerate(cameras):
        still, few = _background(series, background if pattern.kind == "quincunx" else 0)
        findings += few
        backgrounds.append(still)
        for k, file in enumerate(numbers):
            grey = series.load(file) if file in series.numbers else None
            if grey is None:
                continue
            if pattern.kind == "charuco":
                seen = find_charuco(grey, pattern, normalise)
            else:
                seen = find_quincunx(grey, pattern, still, normalise, up)
                candidates[c, k] = seen.candidates
            steps[c, k] = seen.step
            if seen.edges is not None:
                corners[c, k], sigma[c, k] = seen.edges.corners, seen.edges.sigma
    if pattern.kind == "quincunx":
        findings += told_up(corners, sigma, up)
    findings += [finding for c, each in enumerate(steps) for finding in _lost(each, c)]
    size = np.array([series.size for series in cameras])
    seen_besides = candidates, tuple(backgrounds)
    return Detections(pattern, corners, sigma, steps, size, np.array(numbers), tuple(findings), *seen_besides)


def _frames_of(images: Images | Sequence[Any]) -> Sequence[Any]:
    """The images of each camera; ModelError where there are none."""
    frames = images.frames if isinstance(images, Images) else images
    if isinstance(frames, (str, np.ndarray)) or not isinstance(frames, Sequence) or not len(frames):
        found = Given("images", images)
        raise ModelError(
            "expected a list with a folder or an array for each camera", place="detect", found=found
        )
    return frames


def _background(series: ImageSeries, count: int) -> tuple[Array | None, list[Finding]]:
    """Median of images taken evenly over a series, and what is noticed where there are few."""
    if not count:
        return None, []
    chosen = np.unique(np.linspace(0, len(series.numbers) - 1, count).round().astype(int))
    images = [series.load(series.numbers[k]) for k in chosen]
    there = [image for image in images if image is not None]
    few = []
    if len(there) < count:
        what = f"{len(there)} images for a background of {count}"
        ends = (
            "none is made, patterns that stand still are taken for the robot's"
            if len(there) < LEAST
            else "it is of these"
        )
        message = f"{series.name}: found {what}; {ends}; take more images"
        few = [Finding("few images", np.arange(len(there)), message)]
    if len(there) < LEAST:
        return None, few
    return np.median(np.stack(there).astype(np.uint8), axis=0).astype(np.float32), few


def _lost(steps: Array, c: int) -> list[Finding]:
    """What is said of images that were lost, step by step."""
    found = []
    for step in Counter(steps.tolist()):
        if step:
            rows = np.flatnonzero(steps == step)
            words = f"camera {c + 1}: {len(rows)} of {len(steps)} images, {rows_in_words(rows, len(steps))}: {LOST[step]}"
            found.append(Finding(step, rows, words))
    return found
