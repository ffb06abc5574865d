"""A grid of places of the tool, each with the first limit that is broken there: sizes, parts and sections of it."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from gantrytau.border.checks import check_words, number
from gantrytau.border.refusal import ModelError
from gantrytau.describing.record import Record
from gantrytau.kinematics.workspace.pose_limits import REASONS, Examined, Limits
from gantrytau.language.self_description.appearance import Cloud, Shape

Axis = Literal["x", "y", "z"]


@dataclass(frozen=True, eq=False)
class Cells(Record):
    """Places of the tool on a grid, x, y, z: the middles of its cells in m; box: (3, 2) in m, which the cells fill.

    examined: all places, the last coordinate varying fastest, and what they leave of the limits; fraction: how much of
    each cell is inside, (nx, ny, nz), 0 or 1 unless cells on the border were refined. rails: a point and the direction
    of each guideway, (arms, 2, 3); limits, refine: what was asked for.
    """

    name: str
    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    box: np.ndarray
    examined: Examined
    fraction: np.ndarray
    limits: Limits
    rails: np.ndarray
    refine: int

    def __str__(self) -> str:
        counts = np.bincount(self.reason.ravel(), minlength=len(REASONS))
        shares = ", ".join(
            f"{n / self.reason.size:.0%} {word}" for word, n in zip(REASONS, counts, strict=True) if n
        )
        dimensions = self.dimensions
        size = (
            f"{self.volume:.4g} m3"
            if dimensions == 3
            else f"{self.area:.4g} m2"
            if dimensions == 2
            else "no area"
        )
        count = int(self.parts.max(initial=0))
        parts = f" in {count} separate parts" if count > 1 else ""
        return f"Workspace of {self.name}: {size}{parts}; of {self.reason.size} places {shares}"

    @property
    def shape(self) -> tuple[int, int, int]:
        """Numbers of places along x, y and z."""
        return len(self.x), len(self.y), len(self.z)

    @property
    def reason(self) -> np.ndarray:
        """The first limit that is broken, as a number of REASONS, 0 for none, (nx, ny, nz)."""
        return self.examined.reason.reshape(self.shape)

    @property
    def inside(self) -> np.ndarray:
        """Whether the middle of a cell keeps all limits, (nx, ny, nz)."""
        return self.reason == 0

    @cached_property
    def parts(self) -> np.ndarray:
        """Parts that no way through faces of cells connects, 1 for the largest, 0 outside, (nx, ny, nz)."""
        from scipy.ndimage import label

        labels = np.zeros(self.shape, dtype=np.int32)
        label(self.inside, output=labels)
        count = int(labels.max(initial=0))
        order = np.argsort(-np.bincount(labels.ravel(), minlength=count + 1)[1:], kind="stable")
        rank = np.zeros(count + 1, dtype=int)
        rank[1 + order] = 1 + np.arange(count)
        return rank[labels]

    @property
    def places(self) -> np.ndarray:
        """The places inside, (k, 3) in m."""
        return self.examined.r[self.examined.inside]

    def shapes(self) -> Iterator[Shape]:
        """How pictures show it: the places at its border as dots."""
        at_border = border(self.inside) & self.inside
        sides = [np.ptp(axis) / (len(axis) - 1) for axis in (self.x, self.y, self.z) if len(axis) > 1]
        yield Cloud(places=self.examined.r[at_border.ravel()], size=0.2 * min(sides, default=0.1))

    @property
    def extent(self) -> np.ndarray:
        """Sides of the box, (3,) in m."""
        return self.box[:, 1] - self.box[:, 0]

    @property
    def spacing(self) -> float:
        """The longest side of a cell, in m; 0 for a single place."""
        return float((self.extent / self.shape).max())

    @property
    def dimensions(self) -> int:
        """3 for a solid, 2 for a slice."""
        return int((self.extent > 0).sum())

    @property
    def volume(self) -> float:
        """Of the cells inside, in m3; zero for a slice, whose size is `area`."""
        return float(self.fraction.mean() * self.extent.prod())

    @property
    def area(self) -> float:
        """Of a slice, in m2; ModelError for a workspace that is no slice."""
        if self.dimensions != 2:
            raise ModelError(
                f"{self.name}: found a workspace with the extent {self.extent.tolist()} m, expected a slice for its area; "
                "ask for volume, or for cross_section(axis, at)"
            )
        return float(self.fraction.mean() * self.extent[self.extent > 0].prod())

    @cached_property
    def uncertainty(self) -> float:
        """Estimated standard error of volume in m3, or of area in m2 for a slice, from the cells that its border cuts.

        Each such cell is wrong like a number spread evenly over it. Borders run along the grid, so that the cells of one
        row are taken as wrong alike, those of different rows as independent; the worst of the three directions counts.
        """
        dimensions = self.dimensions
        size = self.extent[self.extent > 0].prod() / self.fraction.size
        cut = border(self.inside)
        rows = max(np.sqrt((cut.sum(axis=k).astype(float) ** 2).sum()) for k in range(3))
        # of k^d places in a cell the border cuts k^(d - 2) rows of k: an error of k^(d / 2) places
        return float(size * rows / np.sqrt(12.0) * self.refine ** (-dimensions / 2))

    def cross_section(self, axis: Axis = "x", at: float | None = None) -> float:
        """Area across an axis at a coordinate in m, by default the largest; m2, of the layer of cells around it."""
        check_words(Cells.cross_section, locals())
        across = "xyz".index(axis)
        layers = np.moveaxis(self.fraction, across, 0)
        others = np.delete(self.extent, across).prod()
        areas = layers.reshape(len(layers), -1).mean(axis=1) * others
        return float(areas.max() if at is None else areas[self.layer(across, at)])

    def layer(self, axis: int, at: float) -> int:
        """The layer of cells that contains a coordinate along axis 0, 1 or 2."""
        low, high = self.box[axis]
        at = number(self.name, "at", at, unit="m", least=low, most=high)
        count = self.shape[axis]
        return min(int((at - low) / (high - low) * count), count - 1) if high > low else 0


def border(inside: np.ndarray) -> np.ndarray:
    """Cells with a neighbour, by face, edge or corner, on the other side; the same shape."""
    padded = np.pad(inside, 1, mode="edge")
    every = np.ones_like(inside)
    some = np.zeros_like(inside)
    for shift in np.ndindex(3, 3, 3):
        part = padded[tuple(slice(k, k + n) for k, n in zip(shift, inside.shape, strict=True))]
        every, some = every & part, some | part
    return some & ~every
