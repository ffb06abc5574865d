"""Where the tool of a robot can be: a grid of places, each with the first limit that is broken there."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from gantrytau.errors import ModelError
from gantrytau.kinematics.kinematics import Kinematics
from gantrytau.kinematics.poses import floats, real, told
from gantrytau.kinematics.workspace.pose_limits import REASONS, Examined, Examiner, Limits
from gantrytau.language.model import Model

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST = 20_000_000  # places, whose results fill a few GB


@dataclass(frozen=True, eq=False)
class Workspace:
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
        dimensions = self._dimensions
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

    @property
    def _extent(self) -> np.ndarray:
        return self.box[:, 1] - self.box[:, 0]

    @property
    def _dimensions(self) -> int:
        return int((self._extent > 0).sum())

    @property
    def volume(self) -> float:
        """Of the cells inside, in m3; zero for a slice, whose size is `area`."""
        return float(self.fraction.mean() * self._extent.prod())

    @property
    def area(self) -> float:
        """Of a slice, in m2; ModelError for a workspace that is no slice."""
        if self._dimensions != 2:
            raise ModelError(
                f"{self.name}: found a workspace with the extent {self._extent.tolist()} m, expected a slice for its area; "
                "ask for volume, or for cross_section(axis, at)"
            )
        return float(self.fraction.mean() * self._extent[self._extent > 0].prod())

    @cached_property
    def uncertainty(self) -> float:
        """Estimated standard error of volume in m3, or of area in m2 for a slice, from the cells that its border cuts.

        Each such cell is wrong like a number spread evenly over it. Borders run along the grid, so that the cells of one
        row are taken as wrong alike, those of different rows as independent; the worst of the three directions counts.
        """
        dimensions = self._dimensions
        size = self._extent[self._extent > 0].prod() / self.fraction.size
        cut = border(self.inside)
        rows = max(np.sqrt((cut.sum(axis=k).astype(float) ** 2).sum()) for k in range(3))
        # of k^d places in a cell the border cuts k^(d - 2) rows of k: an error of k^(d / 2) places
        return float(size * rows / np.sqrt(12.0) * self.refine ** (-dimensions / 2))

    def cross_section(self, axis: str = "x", at: float | None = None) -> float:
        """Area across an axis at a coordinate in m, by default the largest; m2, of the layer of cells around it."""
        number = _axis(self.name, axis)
        layers = np.moveaxis(self.fraction, number, 0)
        others = np.delete(self._extent, number).prod()
        areas = layers.reshape(len(layers), -1).mean(axis=1) * others
        return float(areas.max() if at is None else areas[self._layer(number, at)])

    def _layer(self, number: int, at: float) -> int:
        """The layer of cells that contains a coordinate."""
        low, high = self.box[number]
        if not low <= real(at) <= high:
            raise ModelError(
                f"{self.name}: found {'xyz'[number]} = {at!r} m, expected {low:.6g} to {high:.6g}, the box of the workspace"
            )
        count = self.shape[number]
        return min(int((at - low) / (high - low) * count), count - 1) if high > low else 0

    def plot(
        self,
        axis: str | None = None,
        at: float | None = None,
        *,
        quantity: str = "limits",
        file: str | os.PathLike[str] | None = None,
    ) -> "Figure":
        """One layer across an axis (Figures 2.4, 4.16, 5.22 to 5.24), by default the largest across x.

        quantity: "limits" colours the first limit that is broken; "stroke", "turn", "angle" and "clearance" draw levels
        of what is left of one. Obstacles and guideways are drawn where the layer cuts them. file: saves it there, too.
        Raises ModelError for other axes and quantities.
        """
        from gantrytau.kinematics.workspace.figures import draw_layer

        if self._dimensions < 2:
            raise ModelError(
                f"{self.name}: found a workspace with the extent {self._extent.tolist()} m, expected a slice or a solid to "
                "draw; give a wider box"
            )
        flat = np.flatnonzero(self._extent == 0)
        number = _axis(self.name, axis or "xyz"[flat[0] if len(flat) else 0])
        shares = np.moveaxis(self.fraction, number, 0).reshape(self.shape[number], -1).mean(axis=1)
        layer = int(shares.argmax()) if at is None else self._layer(number, at)
        return draw_layer(self, number, layer, quantity, file)

    def plot_solid(self, *, file: str | os.PathLike[str] | None = None) -> "Figure":
        """The border in space, as outlines of its layers across each axis; ModelError for a slice."""
        from gantrytau.kinematics.workspace.figures import draw_solid

        return draw_solid(self, file)


def workspace(
    robot: Model | Kinematics,
    limits: Limits | None = None,
    *,
    spacing: float = 0.05,
    box: ArrayLike | None = None,
    R: ArrayLike | None = None,
    refine: int = 1,
) -> Workspace:
    """The workspace of a robot with one orientation of its plate.

    robot: an instance such as GantryTau(prototypes.L1), or its Kinematics; spacing: side of a cell at most, m; box:
    (3, 2) of (least, largest) x, y, z in m, equal ones for a slice, or None for what strokes and links allow; R: (3, 3),
    None for the orientation that the links give, for a robot with turntables that of its start; refine: cells on the
    border are judged by that many places along each axis. Raises ModelError for a box, a spacing or a robot that does
    not fit, and where neither strokes nor a box bound the workspace.
    """
    limits = limits or Limits()
    examiner = Examiner(robot, limits)
    bounds = _bounds(examiner) if box is None else floats(box)
    if bounds.shape != (3, 2) or not (np.isfinite(bounds).all() and (bounds[:, 0] <= bounds[:, 1]).all()):
        raise ModelError(
            f"{examiner.name}: found the box {told(bounds if box is None else box)}, expected three finite "
            "pairs (least, largest) of x, y and z in m; give box=, or strokes of all carts in Limits"
        )
    axes = _cells(examiner.name, bounds, spacing)
    if not (isinstance(refine, (int, np.integer)) and refine >= 1):
        raise ModelError(f"{examiner.name}: found refine={refine!r}, expected a whole number from 1")
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    examined = examiner(grid.reshape(-1, 3), R)
    inside = examined.inside.reshape(grid.shape[:3])
    fraction = inside.astype(float)
    if refine > 1:
        cut = border(inside)
        fraction[cut] = _shares(examiner, grid[cut], bounds, inside.shape, R, refine)
    x, y, z = axes
    return Workspace(
        name=examiner.name,
        x=x,
        y=y,
        z=z,
        box=bounds,
        examined=examined,
        fraction=fraction,
        limits=limits,
        rails=np.stack([examiner.geometry.offset, examiner.geometry.direction], axis=1),
        refine=int(refine),
    )


def border(inside: np.ndarray) -> np.ndarray:
    """Cells with a neighbour, by face, edge or corner, on the other side; the same shape."""
    padded = np.pad(inside, 1, mode="edge")
    every = np.ones_like(inside)
    some = np.zeros_like(inside)
    for shift in np.ndindex(3, 3, 3):
        part = padded[tuple(slice(k, k + n) for k, n in zip(shift, inside.shape, strict=True))]
        every, some = every & part, some | part
    return some & ~every


def _shares(
    examiner: Examiner,
    middles: np.ndarray,
    box: np.ndarray,
    shape: Sequence[int],
    R: ArrayLike | None,
    refine: int,
) -> np.ndarray:
    """How much of each cell is inside, (k,), by places spread evenly over it."""
    sides = (box[:, 1] - box[:, 0]) / shape
    steps = (np.arange(refine) + 0.5) / refine - 0.5
    offsets = [steps * side if side else np.zeros(1) for side in sides]
    spread = np.stack(np.meshgrid(*offsets, indexing="ij"), axis=-1).reshape(-1, 3)
    examined = examiner((middles[:, None] + spread).reshape(-1, 3), R)
    return examined.inside.reshape(len(middles), len(spread)).mean(axis=1)


def _cells(name: str, box: np.ndarray, spacing: float) -> list[np.ndarray]:
    """Middles of cells of equal size along each axis."""
    if not 0 < real(spacing) < np.inf:
        raise ModelError(f"{name}: found spacing={spacing!r}, expected a length above 0 m")
    extents = box[:, 1] - box[:, 0]
    counts = np.maximum(np.ceil(extents / spacing - 1e-9), 1.0)
    if counts.prod() > _MOST:
        raise ModelError(
            f"{name}: found a spacing of {spacing:g} m for a box of {extents.tolist()} m, {counts.prod():.3g} places; "
            f"expected {_MOST:.0e} at most; take a wider spacing or a smaller box"
        )
    return [
        low + (np.arange(int(n)) + 0.5) / n * extent
        for low, n, extent in zip(box[:, 0], counts, extents, strict=True)
    ]


def _bounds(examiner: Examiner) -> np.ndarray:
    """The box outside of which some link cannot reach: around the way of its cart by its length, (3, 2)."""
    strokes, arm = examiner.strokes[: examiner.carts], examiner.geometry.arm
    if not np.isfinite(strokes).all():
        raise ModelError(
            f"{examiner.name}: found strokes {strokes.tolist()}, expected finite ones to bound the workspace; give "
            "Limits(strokes=...) or box=, a slice for example"
        )
    direction = examiner.geometry.direction[arm]
    ends = examiner.around[:, None] + strokes[arm][:, :, None] * direction[:, None]  # (m, 2, 3)
    # a link ends in the half of its sphere on the side of the cart on which it is at home
    length = examiner.geometry.length[:, None]
    ahead = examiner.linked.sides[arm, None] * direction / np.linalg.norm(direction, axis=1, keepdims=True)
    across = np.sqrt(np.maximum(1 - ahead**2, 0.0))
    others = examiner.reach[:, None] - length
    back, forth = (np.where(way > 0, across, 1.0) * length + others for way in (ahead, -ahead))
    low, high = (ends.min(axis=1) - back).max(axis=0), (ends.max(axis=1) + forth).min(axis=0)
    if (low >= high).any():
        raise ModelError(
            f"{examiner.name}: found links that cannot meet in any place; correct lengths or strokes"
        )
    return np.stack([low, high], axis=1)


def _axis(name: str, axis: Any) -> int:
    if axis not in ("x", "y", "z"):
        raise ModelError(f"{name}: found the axis {axis!r}, expected 'x', 'y' or 'z'")
    return "xyz".index(axis)
