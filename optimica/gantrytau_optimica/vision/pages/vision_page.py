"""A page of images and what they told: how many were found, which were lost at which step, how well places are known."""

import base64
import os
from collections import Counter
from collections.abc import Iterator, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from gantrytau.describing.pages import page, table, verdict
from gantrytau.whole_files import replacing
from gantrytau_optimica.vision.detection.detections import LOST, Detections
from gantrytau_optimica.vision.image_series import ImageSeries, image_series
from gantrytau_optimica.vision.opencv import opencv
from gantrytau_optimica.vision.reconstruction.reconstruction import Reconstruction

Array = np.ndarray
SHOWN = 24  # images that were lost, as pictures
GOOD = 2  # that were found, of each camera, to compare with
WIDTH = 360  # pixels of a picture
ENOUGH = 0.95  # of the poses, from which on detection is good
STYLE = """
.images { display: flex; flex-wrap: wrap; gap: 1rem; } figure { margin: 0; width: 360px; }
figure img { width: 100%; } figcaption { font-size: .85rem; }
"""


def write_vision_page(
    path: str | os.PathLike[str],
    detections: Detections,
    images: Sequence[Any] = (),
    reconstruction: Reconstruction | None = None,
) -> None:
    """Write a page (HTML, complete in itself) of detections and perhaps of the poses from them.

    images: the folders or arrays that `detect` was given, to show those that were lost, brightened.
    """
    series = [image_series(each, f"camera {c + 1}") for c, each in enumerate(images)]
    share = float(detections.pairs.mean())
    reasons = str(detections).splitlines()[:1]
    parts = [
        "<h1>Images of a pattern</h1>",
        verdict(share >= ENOUGH, f"{100 * share:.1f} % of the poses were seen by all cameras", reasons),
        table(("step", "images", "what it says"), _steps(detections)),
        *([] if reconstruction is None else _places(reconstruction)),
        "<h2>Findings</h2>" if detections.findings else "",
        "".join(f"<p>{escape(str(finding))}</p>" for finding in detections.findings),
        *(_pictures("Images that were lost", _lost(detections, series)) if series else []),
        *(_pictures("Images that were found", _found(detections, series)) if series else []),
    ]
    with replacing(path) as partial:
        Path(partial).write_text(page("Images of a pattern", parts, STYLE), encoding="utf-8")


def _steps(detections: Detections) -> Iterator[tuple[str, str, str]]:
    counts = Counter(detections.steps.ravel().tolist())
    yield "found", str(counts[""]), f"corners within {np.nanmedian(detections.sigma):.2g} pixel"
    for step, words in LOST.items():
        if counts[step]:
            yield step, str(counts[step]), words


def _places(found: Reconstruction) -> list[str]:
    first, *others = str(found).splitlines()
    head = ("camera", "focal length [pixel]", "centre [pixel]", "k1, k2", "place [m]")
    rows = [
        (
            str(c + 1),
            f"{camera.focal[0]:.1f} +- {camera.focal[0] * deviations[0]:.1f}",
            f"{camera.centre[0]:.1f}, {camera.centre[1]:.1f} +- {deviations[1]:.1f}, {deviations[2]:.1f}",
            f"{camera.distortion[0]:.4f}, {camera.distortion[1]:.4f}",
            ", ".join(f"{x:.4f}" for x in camera.r),
        )
        for c, (camera, deviations) in enumerate(zip(found.cameras, found.lens_deviations, strict=True))
    ]
    said = [f"<p>{escape(first)}; {escape(others[0])}.</p>", table(head, rows, "numbers")]
    return ["<h2>Poses and cameras</h2>", *said, *(f"<p>{escape(str(f))}</p>" for f in found.findings)]


def _lost(detections: Detections, series: list[ImageSeries]) -> list[tuple[str, Array, Array | None]]:
    shown = []
    for c, k in np.argwhere((detections.steps != "") & (detections.steps != "file"))[:SHOWN]:
        image = series[c].load(int(detections.numbers[k]))
        if image is not None:
            words = f"camera {c + 1}, image {detections.numbers[k]}: {detections.steps[c, k]}"
            shown.append((words, image, None))
    return shown


def _found(detections: Detections, series: list[ImageSeries]) -> list[tuple[str, Array, Array | None]]:
    shown = []
    for c, each in enumerate(series):
        for k in np.flatnonzero(detections.found[c])[:GOOD]:
            image = each.load(int(detections.numbers[k]))
            if image is not None:
                words = f"camera {c + 1}, image {detections.numbers[k]}: found"
                shown.append((words, image, detections.corners[c, k]))
    return shown


def _pictures(heading: str, shown: list[tuple[str, Array, Array | None]]) -> list[str]:
    pictures = [(escape(words), _encoded(image, corners)) for words, image, corners in shown]
    figures = [
        f'<figure><img alt="{words}" src="{link}"><figcaption>{words}</figcaption></figure>'
        for words, link in pictures
    ]
    return [f"<h2>{heading}</h2>", f'<div class="images">{"".join(figures)}</div>'] if figures else []


def _encoded(image: Array, corners: Array | None) -> str:
    """The picture as a link, its darkest grey value black and its lightest white, corners marked."""
    cv2 = opencv()
    low, high = np.percentile(image, [0.5, 99.5])
    grey = np.clip((image - low) / max(high - low, 1.0) * 255, 0, 255).astype(np.uint8)
    colour = cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR)
    for x, y in () if corners is None else corners[np.isfinite(corners[:, 0])]:
        cv2.circle(colour, (round(float(x)), round(float(y))), 4, (0, 60, 255), 2)
    scale = WIDTH / colour.shape[1]
    small = cv2.resize(colour, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    _, data = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, 80])
    return "data:image/jpeg;base64," + base64.b64encode(data.tobytes()).decode()
