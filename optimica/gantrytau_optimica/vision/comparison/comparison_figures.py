"""Pictures of how measured places miss a reference, as Figures 5.15 and 5.17 to 5.19 of the thesis."""

import os
from typing import TYPE_CHECKING

import numpy as np

from gantrytau.results.figures import check_suffix, finished
from gantrytau_optimica.vision.comparison.compare import Comparison

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ARROW = 0.08  # of the extent of the places: the largest arrow
MARGIN = 0.12  # of the extent, for arrows at the border
AXES = "xyz"


def plot_comparison(comparison: Comparison, *, file: str | os.PathLike[str] | None = None) -> "Figure":
    """Figures 5.15, 5.17 to 5.19: a map in two views with enlarged error arrows, histograms of amounts and by axis."""
    from matplotlib.figure import Figure

    if file is not None:
        check_suffix(file)
    known = np.isfinite(comparison.distances)
    places, error = comparison.reference[known], 1e3 * comparison.error[known]
    amounts = 1e3 * comparison.distances[known]
    figure = Figure(figsize=(11, 7.5), layout="constrained")
    shown = figure.subplot_mosaic("aabb\ncdef")
    enlarged = ARROW * np.ptp(places, axis=0).max() / max(amounts.max(), 1e-12)
    arrows, dots = enlarged * error, []
    for name, (i, j) in {"a": (0, 1), "b": (0, 2)}.items():
        axes = shown[name]
        axes.quiver(
            places[:, i], places[:, j], arrows[:, i], arrows[:, j],
            angles="xy", scale_units="xy", scale=1, width=0.002, color="0.4",
        )  # fmt: skip
        dots.append(axes.scatter(places[:, i], places[:, j], c=amounts, s=14, cmap="viridis"))
        axes.set_xlabel(f"{AXES[i]} [m]")
        axes.set_ylabel(f"{AXES[j]} [m]")
        axes.margins(MARGIN)
        axes.set_aspect("equal")
    figure.colorbar(dots[0], ax=[shown["a"], shown["b"]], label="error [mm]")
    mean = f"mean {amounts.mean():.2g} mm, largest {amounts.max():.2g} mm"
    figure.suptitle(f"{known.sum()} places: {mean}; arrows {enlarged * 1e3:.3g} times as long")
    bins = int(np.clip(np.sqrt(len(amounts)), 5, 20))
    shown["c"].hist(amounts, bins=bins, color="tab:blue")
    shown["c"].set_xlabel("error [mm]")
    shown["c"].set_ylabel("places")
    for k, name in enumerate("def"):
        shown[name].hist(error[:, k], bins=bins, color="tab:orange")
        shown[name].set_xlabel(f"along {AXES[k]} [mm]")
    return finished(figure, file)
