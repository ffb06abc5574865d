"""Figures of guideways: Dressler (2012), Figures 4.3 to 4.5."""

import os
from typing import TYPE_CHECKING, Any

import numpy as np

from gantrytau.errors import ModelError
from gantrytau.results.figures import check_suffix, finished

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from gantrytau_optimica.calibration.surveys.guideways import Linearity

MICRO = 1e6  # um in a m
UNKNOWN = 3.0  # standard errors of the smooth part by the noise: where it is measured they are below one


def draw_errors(found: "Linearity", file: str | os.PathLike[str] | None) -> "Figure":
    """Errors along and across the axis over the position, with the smooth part and twice its standard error."""
    figure, panels = panels_of(len(found.noise), file)
    line = np.linspace(found.q.min(), found.q.max(), 501)
    smooth, doubt = found.profile(line)
    smooth[doubt > UNKNOWN * found.noise] = np.nan  # in a gap without points
    names = ("along the axis", "across, to the side", "across, upwards")
    for axis, name, error, curve, band in zip(panels, names, found.error.T, smooth.T, doubt.T, strict=False):
        axis.plot(found.q, MICRO * error, ".", markersize=3, label="measured")
        axis.plot(line, MICRO * curve, label="smooth part")
        axis.fill_between(line, MICRO * (curve - 2 * band), MICRO * (curve + 2 * band), alpha=0.3)
        axis.set_ylabel(f"{name} [µm]")
    panels[0].legend(fontsize="small")
    panels[-1].set_xlabel("position of the cart [m]")
    return finished(figure, file)


def draw_backlash(found: "Linearity", file: str | os.PathLike[str] | None) -> "Figure":
    """Errors along the axis, in two colours for the two directions of motion, with the fit but for its waves."""
    if found.backlash is None:
        raise ModelError(
            "plot_backlash: found points from one direction of motion only, expected both; measure forth and back"
        )
    figure, (axis,) = panels_of(1, file)
    for side, name in ((1, "with rising q"), (-1, "with falling q")):
        rows = np.flatnonzero(found.rising == side)
        rows = rows[np.argsort(found.q[rows])]
        (line,) = axis.plot(
            found.q[rows], MICRO * found.along[rows], ".-", markersize=3, linewidth=0.4, label=name
        )
        smooth = found.profile(found.q[rows])[0][:, 0] - side * found.backlash / 2
        axis.plot(found.q[rows], MICRO * smooth, color=line.get_color(), linewidth=1.5)
    axis.set_title(f"backlash {MICRO * found.backlash:.1f} ± {MICRO * (found.backlash_error or 0.0):.1f} µm")
    axis.set_xlabel("position of the cart [m]")
    axis.set_ylabel("error along the axis [µm]")
    axis.legend(fontsize="small")
    return finished(figure, file)


def draw_spectrum(found: "Linearity", periods: np.ndarray, file: str | os.PathLike[str] | None) -> "Figure":
    """Amplitudes over periods, and where the pitch is."""
    figure, (axis,) = panels_of(1, file)
    names = ("along the axis", "across, to the side", "across, upwards")
    for name, amplitude in zip(names, found.spectrum(periods).T, strict=False):
        axis.plot(1e3 * periods, MICRO * amplitude, label=name)
    if found.cyclic is not None:
        axis.axvline(1e3 * found.cyclic.pitch, color="k", linewidth=0.6, linestyle=":", label="pitch")
    axis.set_xlabel("period [mm]")
    axis.set_ylabel("amplitude [µm]")
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
