"""Figures of guideways: Dressler (2012), Figures 4.3 to 4.5."""

import os
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from gantrytau.results.figures import check_suffix, finished

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MICRO = 1e6  # um in a m
Profile = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]  # smooth part and its standard error in m
UNKNOWN = 3.0  # standard errors of the smooth part by the noise: where it is measured they are below one


def draw_errors(
    q: np.ndarray,
    errors: np.ndarray,
    profile: Profile,
    noise: np.ndarray,
    file: str | os.PathLike[str] | None,
) -> "Figure":
    """Errors along and across the axis over the position, with the smooth part and twice its standard error."""
    figure, panels = panels_of(len(noise), file)
    line = np.linspace(q.min(), q.max(), 501)
    smooth, doubt = profile(line)
    smooth[doubt > UNKNOWN * noise] = np.nan  # in a gap without points
    names = ("along the axis", "across, to the side", "across, upwards")
    for axis, name, error, curve, band in zip(panels, names, errors.T, smooth.T, doubt.T, strict=False):
        axis.plot(q, MICRO * error, ".", markersize=3, label="measured")
        axis.plot(line, MICRO * curve, label="smooth part")
        axis.fill_between(line, MICRO * (curve - 2 * band), MICRO * (curve + 2 * band), alpha=0.3)
        axis.set_ylabel(f"{name} [µm]")
    panels[0].legend(fontsize="small")
    panels[-1].set_xlabel("position of the cart [m]")
    return finished(figure, file)


def draw_backlash(
    sides: Mapping[str, tuple[np.ndarray, np.ndarray, np.ndarray]],
    backlash: float,
    doubt: float,
    file: str | os.PathLike[str] | None,
) -> "Figure":
    """Errors along the axis, in two colours for the two directions of motion: q, error and its smooth part of each."""
    figure, (axis,) = panels_of(1, file)
    for name, (q, along, smooth) in sides.items():
        (line,) = axis.plot(q, MICRO * along, ".-", markersize=3, linewidth=0.4, label=name)
        axis.plot(q, MICRO * smooth, color=line.get_color(), linewidth=1.5)
    axis.set_title(f"backlash {MICRO * backlash:.1f} ± {MICRO * doubt:.1f} µm")
    axis.set_xlabel("position of the cart [m]")
    axis.set_ylabel("error along the axis [µm]")
    axis.legend(fontsize="small")
    return finished(figure, file)


def panels_of(
    rows: int, file: str | os.PathLike[str] | None, columns: int = 1, **policy: Any
) -> "tuple[Figure, list[Any]]":
    """An empty figure with its axes; the name of the file is checked before anything is drawn."""
    import matplotlib.pyplot as plt

    if file is not None:
        check_suffix(file)
    size = (7.0 if columns == 1 else 1.0 + 4.2 * columns, 1.2 + 2.4 * rows)
    policy = dict(sharex=columns == 1, figsize=size) | policy
    figure, axes = plt.subplots(rows, columns, squeeze=False, layout="constrained", **policy)
    for axis in axes.flat:
        axis.grid(alpha=0.3)
    return figure, list(axes.flat)
