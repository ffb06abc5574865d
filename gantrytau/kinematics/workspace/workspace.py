"""Where the tool of a robot can be: a grid of places, each with the first limit that is broken there."""

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from gantrytau.border.checks import array, check_words, number, whole
from gantrytau.border.refusal import Given, ModelError
from gantrytau.kinematics.kinematics import Kinematics
from gantrytau.kinematics.workspace.cells import Axis, Cells, border
from gantrytau.kinematics.workspace.examine import examiner_of
from gantrytau.kinematics.workspace.figures import draw_layer, draw_solid
from gantrytau.kinematics.workspace.grid_spacing import checked_places, settled_spacing
from gantrytau.kinematics.workspace.model_limits import ModelExaminer
from gantrytau.kinematics.workspace.pose_limits import Examiner, Limits
from gantrytau.language.model import Model
from gantrytau.progress import shows_progress

if TYPE_CHECKING:
    from matplotlib.figure import Figure

USUAL = 0.05  # m, of a cell
_MOST = 20_000_000  # places, whose results fill a few GB


class Workspace(Cells):
    """Workspace of a robot: grid cells inside, the broken limit of each cell outside, see `Cells`, and figures."""

    def plot(
        self,
        axis: Axis | None = None,
        at: float | None = None,
        *,
        quantity: Literal["limits", "stroke", "turn", "angle", "clearance"] = "limits",
        file: str | os.PathLike[str] | None = None,
    ) -> "Figure":
        """One layer across an axis (Figures 2.4, 4.16, 5.22 to 5.24), by default the largest across x.

        quantity: "limits" colours the first limit that is broken; "stroke", "turn", "angle" and "clearance" draw levels
        of the distance from a limit. Obstacles and guideways are drawn where the layer cuts them. file: saves it there, too.
        Raises ModelError for other axes and quantities.
        """
        check_words(Workspace.plot, locals())
        if self.dimensions < 2:
            raise ModelError(
                f"{self.name}: found a workspace with the extent {self.extent.tolist()} m, expected a slice or a solid to "
                "draw; give a wider box"
            )
        flat = np.flatnonzero(self.extent == 0)
        number = "xyz".index(axis or "xyz"[flat[0] if len(flat) else 0])
        shares = np.moveaxis(self.fraction, number, 0).reshape(self.shape[number], -1).mean(axis=1)
        layer = int(shares.argmax()) if at is None else self.layer(number, at)
        return draw_layer(self, number, layer, quantity, file)

    def plot_solid(self, *, file: str | os.PathLike[str] | None = None) -> "Figure":
        """The border in space, as outlines of its layers across each axis; ModelError for a slice."""
        return draw_solid(self, file)


@shows_progress
def workspace(
    robot: Model | Kinematics,
    limits: Limits | None = None,
    *,
    spacing: float | None = None,
    places: int | None = None,
    box: ArrayLike | None = None,
    R: ArrayLike | None = None,
    refine: int = 1,
) -> Workspace:
    """The workspace of a robot with one orientation of its plate.

    robot: an instance such as GantryTau(prototypes.L1), or its Kinematics; spacing: greatest side of a cell, m, by
    default 0.05; places: in place of spacing, number of cells inside, to some per cent; box: (3, 2) of
    (least, largest) x, y, z in m, equal ones for a slice, or None for the box given by strokes and links;
    R: (3, 3), or None for the orientation given by the links, of a robot that turns its tool for that of its start; refine:
    number of points along each axis that judge a cell on the border. Raises ModelError for a box, a spacing or a robot that
    does not fit, and where neither strokes nor a box bound the workspace.
    """
    refine = whole("workspace", "refine", refine, least=1)
    if spacing is not None:
        spacing = number("workspace", "spacing", spacing, unit="m", above=0.0)
    checked_places(places, spacing, "workspace")
    limits = limits or Limits()
    examiner = examiner_of(robot, limits)
    bounds = _bounds(examiner) if box is None else array("workspace", "box", box, (3, 2), unit="m")
    if not (bounds[:, 0] <= bounds[:, 1]).all():
        found = Given("box", box)
        raise ModelError("expected pairs (least, largest) of x, y and z in m", place="workspace", found=found)
    if places is not None:
        spacing = settled_spacing(
            places, bounds, lambda step: int(examiner(_grid(examiner.name, bounds, step)[0], R).inside.sum())
        )
    places_of_grid, axes = _grid(examiner.name, bounds, USUAL if spacing is None else spacing)
    examined = examiner(places_of_grid, R)
    inside = examined.inside.reshape([len(axis) for axis in axes])
    fraction = inside.astype(float)
    if refine > 1:
        cut = border(inside)
        fraction[cut] = _shares(examiner, places_of_grid[cut.ravel()], bounds, inside.shape, R, refine)
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
        rails=examiner.rails,
        refine=refine,
    )


def _shares(
    examiner: Examiner | ModelExaminer,
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


def _grid(name: str, box: np.ndarray, spacing: float) -> tuple[np.ndarray, list[np.ndarray]]:
    """Middles of all cells, (N, 3), the last coordinate varying fastest, and their coordinates along each axis."""
    axes = _cells(name, box, spacing)
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3), axes


def _cells(name: str, box: np.ndarray, spacing: float) -> list[np.ndarray]:
    """Middles of cells of equal size along each axis."""
    extents = box[:, 1] - box[:, 0]
    counts = np.maximum(np.ceil(extents / spacing - 1e-9), 1.0)
    if counts.prod() > _MOST:
        raise ModelError(
            f"{name}: found a spacing of {spacing:g} m for a box of {extents.tolist()} m, {counts.prod():.3g} places; "
            f"expected {_MOST:.0e} at most; take a wider spacing, fewer places or a smaller box"
        )
    return [
        low + (np.arange(int(n)) + 0.5) / n * extent
        for low, n, extent in zip(box[:, 0], counts, extents, strict=True)
    ]


def _bounds(examiner: Examiner | ModelExaminer) -> np.ndarray:
    """The box outside of which some link cannot reach: around the way of its cart by its length, (3, 2)."""
    if isinstance(examiner, ModelExaminer):
        raise ModelError(
            f"{examiner.name}: found no box for a robot that does not say by rods() how far its links reach, expected three "
            "pairs (least, largest) of x, y and z in m, equal ones for a plane; give box=",
            argument="box",
        )
    strokes, arm = examiner.strokes[: examiner.carts], examiner.geometry.arm
    if not np.isfinite(strokes).all():
        raise ModelError(
            f"Limits.strokes: found {strokes.tolist()} of {examiner.name}, expected finite ones to bound the workspace; "
            "give strokes=, or box=, a slice for example",
            argument="strokes",
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
