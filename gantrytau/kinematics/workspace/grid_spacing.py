"""How wide the cells of a grid are, of which so many fill a volume."""

from collections.abc import Callable
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from gantrytau.border.checks import array, check_words, whole
from gantrytau.border.refusal import Given, ModelError, short
from gantrytau.kinematics.workspace.cells import Cells

MOST = 10**12  # places, of which no machine examines as many
CLOSE = 0.02  # of the number of places inside
ROUNDS = 8  # of a guess, which the number of places inside corrects; whole cells leave a few per cent


def grid_spacing(
    places: int, of: float | ArrayLike | Cells, *, dimensions: Literal[1, 2, 3, None] = None
) -> float:
    """Side in m of equal cells, of which a given number fills a volume, an area or a length.

        grid_spacing(1000, 2.0)                                   # 1000 cells in 2 m3
        grid_spacing(1000, [[0, 1], [-1, 1], [0.5, 0.5]])         # in a box, here a slice
        grid_spacing(20_000, workspace(robot, limits, spacing=0.2))       # in the cells inside

    of: a size, in m3, or in m2 with dimensions=2 and m with dimensions=1; a box (3, 2) of (least, largest) x, y, z, with
    equal ones for a slice; or a workspace. Raises ModelError for a number below one and for a size of zero.
    """
    check_words(grid_spacing, locals())
    count = whole("grid_spacing", "places", places, least=1, most=MOST)
    size, sides = _size(of)
    if dimensions is not None and sides not in (None, dimensions):
        raise ModelError(
            f"expected {sides}, as it has, or nothing",
            place="grid_spacing",
            found=Given("dimensions", dimensions),
        )
    return float((size / count) ** (1.0 / (sides or dimensions or 3)))


def settled_spacing(places: int, box: np.ndarray, inside: Callable[[float], int]) -> float:
    """A spacing in m of the grid in a box (3, 2) of which about so many places are inside.

    inside: how many there are with a spacing. That of places that fill the box where no place is inside.
    """
    if not (box[:, 1] > box[:, 0]).any():
        return 1.0  # a single place, whatever the spacing
    step = best = grid_spacing(places, box)
    dimensions, gap = int((box[:, 1] > box[:, 0]).sum()), np.inf
    for _ in range(ROUNDS):
        found = inside(step)
        if found == 0:
            step /= 1.5
            continue
        miss = float(np.log(found / places))
        if abs(miss) < gap:
            best, gap = step, abs(miss)
        if gap < CLOSE:
            break
        step *= float(np.exp(miss / dimensions))
    return best


def checked_places(places: Any, spacing: Any, where: str) -> None:
    """ModelError for a number of places that is none, or that stands beside a spacing."""
    if places is None:
        return
    whole(where, "places", places, least=1, most=MOST)
    if spacing is not None:
        found = Given("places", places)
        raise ModelError(
            "expected none beside ", Given("spacing", spacing), "; leave one out", place=where, found=found
        )


def _size(of: Any) -> tuple[float, int | None]:
    """A size, and of how many dimensions it is where that is known."""
    if isinstance(of, Cells):
        extent = of.extent[of.extent > 0]
        size, sides = float(of.fraction.mean() * extent.prod()), len(extent)
        words = f"a workspace of {of.name} with nothing inside"
    else:
        found = array("grid_spacing", "of", of, (), (3, 2))
        size, sides, words = float(found) if found.shape == () else np.nan, None, short(of)
        if found.shape and (found[:, 0] <= found[:, 1]).all():
            extent = found[:, 1] - found[:, 0]
            size, sides = float(extent[extent > 0].prod()), int((extent > 0).sum())
    if not 0 < size < np.inf or sides == 0:
        raise ModelError(
            f"grid_spacing: found {words}, expected a size above 0, a box of (least, largest) x, y and z in m, or a "
            "workspace with something inside",
            argument="of",
        )
    return size, sides
