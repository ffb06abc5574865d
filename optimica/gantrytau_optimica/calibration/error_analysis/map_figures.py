"""Figures of errors over the workspace: Dressler (2012), Figure 4.7, and maps of error vectors."""

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from gantrytau.border.checks import whole
from gantrytau.border.refusal import Given, ModelError
from gantrytau.results.figures import finished
from gantrytau_optimica.calibration.error_analysis.guideway_figures import MICRO, panels_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ARROW = 0.15  # the longest arrow by the width of what is drawn
MOST_LAYERS = 12


def draw_orientation(
    places: np.ndarray,
    turns: np.ndarray,
    causes: Mapping[str, np.ndarray],
    file: str | os.PathLike[str] | None,
) -> "Figure":
    """Turns (N, 3) about x, y and z in 0.001 deg over the poses, sorted by their places along the guideways."""
    figure, panels = panels_of(3, file)
    order = np.argsort(places, kind="stable")
    parts = {"measured": turns - turns.mean(axis=0), **causes}
    for axis, name, k in zip(panels, "xyz", range(3), strict=True):
        for label, part in parts.items():
            style = "." if label == "measured" else "-"
            axis.plot(1e3 * np.degrees(part[order, k]), style, markersize=3, linewidth=0.8, label=label)
        axis.set_ylabel(f"about {name} [0.001°]")
    panels[0].legend(fontsize="small")
    panels[-1].set_xlabel("pose, in the order along the guideways")
    return finished(figure, file)


def draw_map(
    r: np.ndarray, errors: np.ndarray, axes: str, layers: int, file: str | os.PathLike[str] | None
) -> "Figure":
    """Errors as coloured arrows on a plane; each panel holds the poses of one layer along the third axis."""
    if len(axes) != 2 or axes[0] == axes[1] or not set(axes) <= set("xyz"):
        raise ModelError("expected two of x, y and z, such as 'yz'", place="plot", found=Given("axes", axes))
    whole("plot", "layers", layers, least=1, most=MOST_LAYERS)
    first, second = ("xyz".index(a) for a in axes)
    third = 3 - first - second
    figure, panels = panels_of(1, file, layers, sharey=True, figsize=(1.6 + 3.8 * layers, 4.4))
    borders = np.linspace(r[:, third].min(), r[:, third].max(), layers + 1)
    layer = np.clip(np.searchsorted(borders, r[:, third], side="right") - 1, 0, layers - 1)
    size = np.linalg.norm(errors, axis=1)
    width = max(np.ptp(r[:, first]), np.ptp(r[:, second]), 1e-9)
    scale = size.max() / (ARROW * width) or 1.0
    drawn = []
    for k, axis in enumerate(panels):
        rows = layer == k
        arrows = axis.quiver(
            r[rows, first], r[rows, second], errors[rows, first], errors[rows, second],
            MICRO * size[rows], angles="xy", scale_units="xy", scale=scale, width=0.005,
            clim=(0.0, MICRO * size.max()),
        )  # fmt: skip
        drawn.append(arrows)
        axis.set_aspect("equal")
        # one window for all, which leaves room for arrows
        axis.set_xlim(r[:, first].min() - ARROW * width, r[:, first].max() + ARROW * width)
        axis.set_ylim(r[:, second].min() - ARROW * width, r[:, second].max() + ARROW * width)
        axis.set_xlabel(f"{axes[0]} [m]")
        if layers > 1:
            axis.set_title(
                f"{'xyz'[third]} from {borders[k]:.2f} to {borders[k + 1]:.2f} m", fontsize="small"
            )
    panels[0].set_ylabel(f"{axes[1]} [m]")
    figure.colorbar(drawn[0], ax=panels, label="error [µm]")
    return finished(figure, file)


def draw_sizes(errors: np.ndarray, principal: np.ndarray, file: str | os.PathLike[str] | None) -> "Figure":
    """Histograms of lengths and of components along the principal axes, the columns of `principal`."""
    figure, (left, right) = panels_of(1, file, 2)
    size = np.linalg.norm(errors, axis=1)
    left.hist(MICRO * size, bins="auto")
    left.axvline(MICRO * size.mean(), color="k", linewidth=0.8, label=f"mean {MICRO * size.mean():.0f} µm")
    left.set_xlabel("length of the error [µm]")
    left.set_ylabel("poses")
    left.legend(fontsize="small")
    for k, components in enumerate((errors @ principal).T):
        right.hist(MICRO * components, bins="auto", histtype="step", label=f"axis {k + 1}")
    right.set_xlabel("component along a principal axis [µm]")
    right.legend(fontsize="small")
    return finished(figure, file)
