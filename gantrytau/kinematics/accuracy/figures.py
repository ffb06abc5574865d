"""Level plots of the accuracy over a slice of poses: Dressler (2012), Figures 4.8 to 4.10."""

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from gantrytau.border.refusal import ModelError
from gantrytau.results.figures import check_suffix, finished

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LEVELS = 12
_GAP = 3.0  # triangles with sides longer than this many times the usual one span what has no poses


def draw_levels(
    panels: Mapping[str, np.ndarray],
    r: np.ndarray,
    inside: np.ndarray,
    carts: np.ndarray,
    axes: str,
    file: str | os.PathLike[str] | None,
) -> "Figure":
    """A panel of levels for each label and its values (N,); see `Accuracy.plot`.

    r: (N, 3) in m; inside: whether a pose is in reach, (N,); carts: (N, 3, 3) in m, NaN out of reach.
    """
    import matplotlib.pyplot as plt

    if file is not None:
        check_suffix(file)
    first, second = _coordinates(axes)
    triangles = _triangles(r[:, first], r[:, second], inside, axes)
    extent = np.ptp(r[inside], axis=0)
    size = (1.0 + 4.6 * len(panels), np.clip(3.6 * extent[second] / extent[first] + 0.6, 2.5, 6.0))
    figure, drawn = plt.subplots(1, len(panels), squeeze=False, figsize=size, layout="constrained")
    for axis, (title, values) in zip(drawn[0], panels.items(), strict=True):
        # points out of reach are in no triangle that is drawn
        filled = axis.tricontourf(triangles, np.nan_to_num(values), levels=_levels(values), extend="max")
        lines = axis.tricontour(
            triangles, np.nan_to_num(values), levels=filled.levels, colors="k", linewidths=0.4
        )
        axis.clabel(lines, fontsize="x-small", fmt="%g")
        figure.colorbar(filled, ax=axis, label=title)
        _carts(axis, carts, first, second)
        axis.set_xlabel(f"{axes[0]} [m]")
        axis.set_ylabel(f"{axes[1]} [m]")
        axis.set_aspect("equal")
    return finished(figure, file)


def _coordinates(axes: str) -> tuple[int, int]:
    if not (isinstance(axes, str) and len(axes) == 2 and set(axes) <= set("xyz") and axes[0] != axes[1]):
        raise ModelError(f"plot: found the axes {axes!r}, expected two of x, y and z, such as 'yz'")
    return "xyz".index(axes[0]), "xyz".index(axes[1])


def _triangles(horizontal: np.ndarray, vertical: np.ndarray, inside: np.ndarray, axes: str) -> Any:
    """Triangles between the poses in reach, without those that span gaps."""
    from matplotlib.tri import Triangulation

    places = np.stack([horizontal, vertical], axis=-1)
    spread = (
        np.linalg.svd(places[inside] - places[inside].mean(axis=0), compute_uv=False) if inside.any() else [0]
    )
    if len(spread) < 2 or spread[1] < 1e-9 * spread[0] or inside.sum() < 3:
        raise ModelError(
            f"plot: found {inside.sum()} poses in reach, on one line of the {axes} plane; expected poses that span it, "
            "such as a grid; name the two coordinates that vary"
        )
    triangles = Triangulation(horizontal, vertical)
    corners = places[triangles.triangles]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1).max(axis=1)
    triangles.set_mask(~inside[triangles.triangles].all(axis=1) | (longest > _GAP * np.median(longest)))
    return triangles


def _levels(values: np.ndarray) -> np.ndarray:
    """Round levels; the largest per cent, which grows beyond bounds near singular poses, is in one colour."""
    from matplotlib.ticker import MaxNLocator

    low, high = np.nanpercentile(values, [0, 99])
    return np.asarray(MaxNLocator(_LEVELS).tick_values(low, max(high, low + 1e-9 * (abs(low) + 1))))


def _carts(axis: Any, carts: np.ndarray, first: int, second: int) -> None:
    """The guideways, where they pass through a slice that is across them."""
    middle = np.nanmean(carts, axis=0) if carts.shape[1] else ()
    for i, cart in enumerate(middle):
        axis.plot(cart[first], cart[second], "s", color="tab:red", markersize=5)
        axis.annotate(f"{i + 1}", (cart[first], cart[second]), xytext=(4, 4), textcoords="offset points")
