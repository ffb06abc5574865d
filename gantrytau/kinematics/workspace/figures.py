"""Figures of a workspace: a layer with its limits, and its border in space. Dressler (2012), Figures 2.4, 4.16, 5.22."""

import os
from typing import TYPE_CHECKING, Any

import numpy as np

from gantrytau.border.refusal import ModelError
from gantrytau.kinematics.workspace.cells import Cells
from gantrytau.kinematics.workspace.pose_limits import REASONS
from gantrytau.results.figures import check_suffix, finished

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# in the order of REASONS
_COLOURS = ("#9fd69f", "#ffffff", "#c9d5e8", "#f2dfb0", "#e8b3ab", "#d9c8ea", "#bfe3e0")
_OBSTACLE = "0.35"
_UNITS = {"stroke": "m", "turn": "rad", "angle": "rad", "clearance": "m"}
_FINE = 300  # points along a side, of which outlines of obstacles are drawn
_LAYERS = 12  # outlines across one axis that can still be told apart


def draw_layer(
    found: Cells, number: int, layer: int, quantity: str, file: str | os.PathLike[str] | None
) -> "Figure":
    """A layer across axis `number`; see `Workspace.plot`."""
    import matplotlib.pyplot as plt

    if file is not None:
        check_suffix(file)
    others = [k for k in range(3) if k != number]
    extent = found.box[others, 1] - found.box[others, 0]
    height = np.clip(5.0 * extent[1] / max(extent[0], 1e-9) + 1.0, 3.0, 8.0)
    figure, axis = plt.subplots(figsize=(6.0, height), layout="constrained")
    at = (found.x, found.y, found.z)[number][layer]
    if quantity == "limits":
        _limits(axis, found, number, layer, others)
    else:
        _levels(figure, axis, found, number, layer, others, quantity)
    hidden = _obstacles(axis, found, number, float(at), others)
    if quantity == "limits":
        _legend(figure, found, number, layer, hidden)
    _guideways(axis, found, number, float(at), others)
    axis.set_xlabel(f"{'xyz'[others[0]]} [m]")
    axis.set_ylabel(f"{'xyz'[others[1]]} [m]")
    axis.set_xlim(*found.box[others[0]])
    axis.set_ylim(*found.box[others[1]])
    axis.set_aspect("equal")
    area = found.cross_section(("x", "y", "z")[number], float(at))
    axis.set_title(f"{'xyz'[number]} = {at:.3g} m, inside {area:.3g} m²")
    return finished(figure, file)


def _layer_of(found: Cells, values: np.ndarray, number: int, layer: int) -> np.ndarray:
    """Values (nx * ny * nz,) of one layer, rows along the first of the two other axes."""
    return np.moveaxis(values.reshape(found.shape), number, 0)[layer]


def _edges(found: Cells, k: int) -> np.ndarray:
    return np.linspace(found.box[k, 0], found.box[k, 1], found.shape[k] + 1)


def _limits(axis: Any, found: Cells, number: int, layer: int, others: list[int]) -> None:
    """Cells in the colours of the limits that they break."""
    from matplotlib.colors import ListedColormap

    reasons = _layer_of(found, found.examined.reason, number, layer)
    colours = ListedColormap(list(_COLOURS))
    axis.pcolormesh(
        *(_edges(found, k) for k in others), reasons.T, cmap=colours, vmin=-0.5, vmax=len(REASONS) - 0.5
    )


def _legend(figure: Any, found: Cells, number: int, layer: int, hidden: bool) -> None:
    """What colours mean, below the axes, where it hides nothing; hidden: an obstacle is drawn."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    reasons = _layer_of(found, found.examined.reason, number, layer)
    shown = [k for k in range(len(REASONS)) if (reasons == k).any()]
    signs: list[Any] = [Patch(facecolor=_COLOURS[k], edgecolor="0.5", label=REASONS[k]) for k in shown]
    signs += [Patch(facecolor=_OBSTACLE, label="obstacle")] if hidden else []
    if len(found.rails):
        along = all(abs(way[number]) <= 0.5 * np.linalg.norm(way) for _, way in found.rails)
        line, end = ("-", "") if along else ("", "s")
        signs.append(Line2D([], [], color="tab:red", label="guideway", linestyle=line, marker=end))
    figure.legend(
        handles=signs, fontsize="small", loc="outside lower center", ncols=min(len(signs), 4), frameon=False
    )


def _levels(
    figure: Any, axis: Any, found: Cells, number: int, layer: int, others: list[int], quantity: str
) -> None:
    """Levels of what is left of one limit, inside."""
    values = _layer_of(found, getattr(found.examined, quantity), number, layer)
    inside = _layer_of(found, found.examined.inside, number, layer)
    known = inside & np.isfinite(values)
    if min(values.shape) < 2 or not known.any():
        raise ModelError(f"plot: found no place of the layer where {quantity} is limited; plot 'limits'")
    middles = ((found.x, found.y, found.z)[k] for k in others)
    filled = axis.contourf(*middles, np.ma.masked_where(~known, values).T, levels=12)
    figure.colorbar(filled, ax=axis, label=f"{quantity} left [{_UNITS[quantity]}]")


def _obstacles(axis: Any, found: Cells, number: int, at: float, others: list[int]) -> bool:
    """Outlines of obstacles where the layer cuts them; whether it cuts any."""
    sides = [np.linspace(found.box[k, 0], found.box[k, 1], _FINE) for k in others]
    if any(found.box[k, 0] == found.box[k, 1] for k in others):
        return False
    points = np.empty((_FINE, _FINE, 3))
    points[..., number] = at
    points[..., others[0]], points[..., others[1]] = np.meshgrid(*sides, indexing="ij")
    some = False
    for obstacle in found.limits.obstacles:
        distance = obstacle.distance(points).T
        if distance.min() < 0 < distance.max():
            axis.contourf(*sides, distance, levels=[-np.inf, 0.0], colors=[_OBSTACLE])
            some = True
    return some


def _guideways(axis: Any, found: Cells, number: int, at: float, others: list[int]) -> None:
    """Guideways as points where they pass through the layer, as lines where they go along it."""
    for i, (place, direction) in enumerate(found.rails):
        if abs(direction[number]) > 0.5 * np.linalg.norm(direction):
            point = place + (at - place[number]) / direction[number] * direction
            axis.plot(point[others[0]], point[others[1]], "s", color="tab:red", markersize=6)
            axis.annotate(f"{i + 1}", point[others], xytext=(5, 5), textcoords="offset points")
        else:
            axis.axline(place[others], place[others] + direction[others], color="tab:red", linewidth=0.8)


def draw_solid(found: Cells, file: str | os.PathLike[str] | None) -> "Figure":
    """Outlines of layers across each axis in space; see `Workspace.plot_solid`."""
    import matplotlib.pyplot as plt
    from matplotlib.ticker import MaxNLocator

    if file is not None:
        check_suffix(file)
    if min(found.shape) < 2:
        raise ModelError(f"plot_solid: found {found.shape} places, expected two along each axis; use plot()")
    figure = plt.figure(figsize=(6.5, 5.8))
    axis: Any = figure.add_subplot(projection="3d")
    for number, colour in enumerate(("tab:blue", "tab:orange", "tab:green")):
        _outlines(axis, found, number, colour)
    inside = found.places if len(found.places) else found.box.T
    side = (found.box[:, 1] - found.box[:, 0]) / found.shape
    low, high = inside.min(axis=0) - side, inside.max(axis=0) + side
    longest = (high - low).max()
    for k, name in enumerate("xyz"):
        getattr(axis, f"set_{name}label")(f"{name} [m]", labelpad=8.0)
        getattr(axis, f"set_{name}lim")(low[k], high[k])
        # ticks as far apart as on the longest side
        parts = max(2, round(6 * (high[k] - low[k]) / longest))
        getattr(axis, f"{name}axis").set_major_locator(MaxNLocator(parts))
    axis.set_box_aspect(high - low, zoom=0.9)  # with room for the labels
    axis.set_title(f"{found.volume:.3g} m³")
    return finished(figure, file)


def _outlines(axis: Any, found: Cells, number: int, colour: str) -> None:
    """Outlines of some layers across one axis."""
    from contourpy import contour_generator

    others = [k for k in range(3) if k != number]
    middles = [(found.x, found.y, found.z)[k] for k in range(3)]
    layers = np.linspace(0, found.shape[number] - 1, min(_LAYERS, found.shape[number])).round().astype(int)
    for layer in layers:
        share = np.moveaxis(found.fraction, number, 0)[layer]
        for line in contour_generator(middles[others[0]], middles[others[1]], share.T).lines(0.5):
            points = np.empty((len(line), 3))
            points[:, number], points[:, others] = middles[number][layer], line
            axis.plot(*points.T, color=colour, linewidth=0.7)
