"""Level plots of the accuracy over a slice of poses: Dressler (2012), Figures 4.8 to 4.10."""

import os
from typing import TYPE_CHECKING, Any

import numpy as np

from gantrytau.errors import ModelError
from gantrytau.results.figures import check_suffix, has_windows
from gantrytau.results.files import replacing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from gantrytau.kinematics.accuracy.accuracy import Accuracy

_LEVELS = 12
_GAP = 3.0  # triangles with sides longer than this many times the usual one span what has no poses


def draw_levels(found: "Accuracy", quantity: str, axes: str, file: str | os.PathLike[str] | None) -> "Figure":
    """One panel of levels, or three for the areas of the faces; see `Accuracy.plot`."""
    import matplotlib.pyplot as plt

    if file is not None:
        check_suffix(file)
    panels = _panels(found, quantity)
    first, second = _coordinates(axes)
    triangles = _triangles(found.r[:, first], found.r[:, second], np.isfinite(found.error), axes)
    extent = np.ptp(found.r[np.isfinite(found.error)], axis=0)
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
        _carts(axis, found, first, second)
        axis.set_xlabel(f"{axes[0]} [m]")
        axis.set_ylabel(f"{axes[1]} [m]")
        axis.set_aspect("equal")
    if file is not None:
        with replacing(file) as partial:
            figure.savefig(partial, dpi=150)
    if file is not None or not has_windows(plt.get_backend()):
        plt.close(figure)  # there is no window: the figure belongs to its caller alone
    return figure


def _panels(found: "Accuracy", quantity: str) -> dict[str, np.ndarray]:
    """Labels and values of the panels of a figure."""
    if quantity == "error":
        return {"largest error of the tool [µm]": found.error * 1e6}
    if quantity == "bound":
        return {"bound of the error of the tool [µm]": found.bound * 1e6}
    if quantity == "areas":
        return {f"face orthogonal to link {i + 1} [10⁻³ mm²]": found.areas[:, i] * 1e9 for i in range(3)}
    if quantity == "angles":
        pairs = ((2, 3), (3, 1), (1, 2))
        angles = np.rad2deg(found.angles)
        return {f"angle of links {i} and {j} [°]": angles[:, k] for k, (i, j) in enumerate(pairs)}
    if quantity == "dihedral angles":
        angles = np.rad2deg(found.dihedral_angles)
        return {f"angle of the sides that meet at link {i + 1} [°]": angles[:, i] for i in range(3)}
    raise ModelError(
        f"plot: found the quantity {quantity!r}, expected 'error', 'bound', 'areas', 'angles' or 'dihedral angles'"
    )


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


def _carts(axis: Any, found: "Accuracy", first: int, second: int) -> None:
    """The guideways, where they pass through a slice that is across them."""
    middle = np.nanmean(found.carts, axis=0)
    for i, cart in enumerate(middle):
        axis.plot(cart[first], cart[second], "s", color="tab:red", markersize=5)
        axis.annotate(f"{i + 1}", (cart[first], cart[second]), xytext=(4, 4), textcoords="offset points")
