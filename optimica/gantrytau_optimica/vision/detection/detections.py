"""Where the corners of a pattern were found in images, and at which step the others were lost."""

import json
import os
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gantrytau import ModelError
from gantrytau.describing.record import Record
from gantrytau.results.figures import check_suffix, finished
from gantrytau.whole_files import replacing
from gantrytau_optimica.fitting.finding import Finding
from gantrytau_optimica.vision.boards import Pattern

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = np.ndarray
ARRAYS = ("corners", "sigma", "steps", "size", "numbers")
LOST = {  # step -> what it says of an image that ended there, and what to do
    "file": "there is no image, or it cannot be read; take it again or write it anew",
    "dark": "it is black, or of one grey and noise; open the aperture, or look at the lens cap",
    "saturated": "white is at the end of the grey values; close the aperture or expose less",
    "corners": "no four corners where black squares touch; the pattern is hidden, out of focus or out of the image",
    "squares": "no four of these corners make a square; the pattern is hidden, or seen from too far aside",
    "edges": "too few edges are where the pattern has them; it is partly hidden or out of the image",
    "background": "the pattern stands where it stands in the background; leave out images that are alike, or background=0",
    "ambiguous": "two patterns are seen; cover one, or let the other stand still in all images",
}


@dataclass(frozen=True, eq=False)
class Detections(Record):
    """Corners of a pattern in images of C cameras at N poses.

    corners: (C, N, P, 2) in pixels, in the order of `pattern.points`, NaN where missing; sigma: standard deviation of
    each in pixels, (C, N, P), by how much its edges scatter; steps: (C, N), the step that lost an image, a key of LOST,
    and "" where it was found; size: (width, height) of the images of each camera, (C, 2) in pixels; numbers: of the
    images, as their files have them, (N,); findings: what was noticed, rows from 0. candidates: corners (k, 4, 2) in pixels
    of the likeliest black squares, by (camera, row); backgrounds: the median image of each camera, None without. Files
    of detections hold neither.
    """

    pattern: Pattern
    corners: Array = field(repr=False)
    sigma: Array = field(repr=False)
    steps: Array = field(repr=False)
    size: Array
    numbers: Array = field(repr=False)
    findings: tuple[Finding, ...] = ()
    candidates: Mapping[tuple[int, int], Array] = field(default_factory=dict, repr=False)
    backgrounds: tuple[Array | None, ...] = field(default=(), repr=False)

    @property
    def found(self) -> Array:
        """Whether the pattern was found in an image, (C, N)."""
        return self.steps == ""

    @property
    def pairs(self) -> Array:
        """Whether all cameras found it, (N,)."""
        return np.asarray(self.found.all(axis=0))

    @cached_property
    def centres(self) -> Array:
        """Mean of the corners, (C, N, 2) in pixels, NaN where the pattern was not found.

        Corners that are missing are those of the projective map of the pattern through the others.
        """
        filled = self.corners.copy()
        for c, k in zip(*np.nonzero(self.found & np.isnan(self.corners).any(axis=(2, 3))), strict=True):
            there = np.isfinite(filled[c, k, :, 0])
            H = homography(self.pattern.points[there, :2], filled[c, k, there])
            filled[c, k, ~there] = mapped(H, self.pattern.points[~there, :2])
        return filled.mean(axis=2)

    def plot(
        self, image: Array, camera: int = 0, row: int = 0, *, file: str | os.PathLike[str] | None = None
    ) -> "Figure":
        """Candidates for squares and measured corners over an image (height, width): Dressler (2012), Figure 5.13."""
        import matplotlib.pyplot as plt

        if file is not None:
            check_suffix(file)
        figure, axis = plt.subplots(figsize=(8.0, 6.2), layout="constrained")
        axis.imshow(image, cmap="gray")
        squares = self.candidates.get((camera, row), np.zeros((0, 4, 2)))
        for k, square in enumerate(squares):
            axis.plot(*square[[0, 1, 2, 3, 0]].T, color="C1", label="" if k else "candidates for squares")
        axis.plot(*self.corners[camera, row].T, "x", color="C0", label="corners")
        axis.set_axis_off()
        axis.legend()
        return finished(figure, file)

    def plot_background(self, camera: int = 0, *, file: str | os.PathLike[str] | None = None) -> "Figure":
        """The median image of a camera: Dressler (2012), Figure 5.12. Raises ModelError where none was made."""
        import matplotlib.pyplot as plt

        if file is not None:
            check_suffix(file)
        still = self.backgrounds[camera] if camera < len(self.backgrounds) else None
        if still is None:
            raise ModelError(
                f"plot_background: found no median image of camera {camera}, expected one; give detect some images and "
                "background=10",
                argument="camera",
            )
        figure, axis = plt.subplots(figsize=(8.0, 6.2), layout="constrained")
        axis.imshow(still, cmap="gray")
        axis.set_axis_off()
        return finished(figure, file)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Keep them in a file that `read` reads, .npz."""
        pattern = {f.name: getattr(self.pattern, f.name) for f in fields(Pattern)}
        told = [dict(kind=f.kind, rows=f.rows.tolist(), message=f.message) for f in self.findings]
        with replacing(path) as partial, open(partial, "wb") as file:
            np.savez_compressed(
                file,
                **{name: getattr(self, name) for name in ARRAYS},
                said=np.array(json.dumps({"pattern": pattern, "findings": told})),
            )

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> "Detections":
        """Detections of a file as of `save`. Raises ModelError for what is none."""
        path = Path(path)
        if not path.is_file():
            raise ModelError(f"{path}: there is no such file; write it by Detections.save")
        try:
            with np.load(path, allow_pickle=False) as kept:
                arrays = {name: kept[name] for name in ARRAYS}
                said = json.loads(str(kept["said"]))
                pattern = Pattern(**said["pattern"])
                told = tuple(
                    Finding(f["kind"], np.array(f["rows"], dtype=int), f["message"]) for f in said["findings"]
                )
        except (OSError, ValueError, KeyError, TypeError, zipfile.BadZipFile) as error:
            raise ModelError(
                f"{path}: found no corners of images ({error}), expected a file by `gantrytau vision detect` or "
                "Detections.save"
            ) from None
        return cls(pattern, findings=told, **arrays)

    def __str__(self) -> str:
        cameras, poses = self.steps.shape
        lines = [f"{self.pairs.sum()} of {poses} poses seen by all of {cameras} cameras"]
        return "\n".join([*lines, *(str(finding) for finding in self.findings)])


def homography(flat: Array, images: Array) -> Array:
    """The projective map (3, 3) from points (k, 2) in a plane to their images (k, 2) with least squares, k from 4.

    Direct linear transformation with both sets about their means and of size one (Hartley 1997).
    """
    sides = []
    for points in (flat, images):
        mean, spread = points.mean(axis=0), np.sqrt(np.mean((points - points.mean(axis=0)) ** 2))
        sides.append(
            np.array([[1 / spread, 0, -mean[0] / spread], [0, 1 / spread, -mean[1] / spread], [0, 0, 1]])
        )
    a, b = mapped(sides[0], flat), mapped(sides[1], images)
    one, zero = np.ones(len(a)), np.zeros((len(a), 3))
    rows = np.column_stack([a, one])
    upper = np.hstack([rows, zero, -b[:, :1] * rows])
    lower = np.hstack([zero, rows, -b[:, 1:] * rows])
    both = np.vstack([upper, lower])
    least = np.linalg.svd(both, full_matrices=len(both) < both.shape[1])[2][-1]
    H = np.linalg.solve(sides[1], least.reshape(3, 3) @ sides[0])
    return H / H[2, 2]


def mapped(H: Array, points: Array) -> Array:
    """Points (k, 2) by a projective map (3, 3)."""
    found = points @ H[:, :2].T + H[:, 2]
    return found[:, :2] / found[:, 2:]
