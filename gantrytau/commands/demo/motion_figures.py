"""The minimum-time motions in pictures: thesis Figures 3.9 and 3.10."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from gantrytau import replacing
from gantrytau.commands.demo.thesis_table import ROWS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from gantrytau_optimica import Optimum

CART_COLOURS = ("#1f77b4", "#d95f02", "#2a9d5c")


def draw_paths(optima: "Mapping[str, Optimum]", file: Path) -> "Figure":
    """The paths of the tool, from above and from the side (thesis Figure 3.9)."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(9.0, 4.8), layout="constrained")
    for row in ROWS:
        r = optima[row.key]["robot.tool.r"]
        style = {"linestyle": "--", "color": "black"} if row.line else {}
        for axis, across in zip(axes, (1, 2), strict=True):
            axis.plot(
                r[:, 0], r[:, across], label=f"{row.title}: {optima[row.key].final_time:.3f} s", **style
            )
    for axis, across, name, view in zip(axes, (1, 2), "yz", ("from above", "from the side"), strict=True):
        for end, word in ((0, "A"), (-1, "B")):
            place = optima[ROWS[0].key]["robot.tool.r"][end]
            axis.plot(place[0], place[across], "o", color="black", markersize=4)
            axis.annotate(word, (place[0], place[across]), textcoords="offset points", xytext=(6, -12))
        axis.set(xlabel="x [m]", ylabel=f"{name} [m]", title=view)
        axis.set_aspect("equal")
        axis.margins(0.08)
        axis.grid(alpha=0.3)
    figure.legend(*axes[0].get_legend_handles_labels(), fontsize="small", ncols=2, loc="outside lower center")
    figure.suptitle("Path of the tool")
    return _saved(figure, file)


def draw_torques(optima: "Mapping[str, Optimum]", limit: float, file: Path) -> "Figure":
    """The motor torques over time, with their limits (thesis Figure 3.10)."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(len(ROWS), sharex=True, sharey=True, figsize=(8.0, 8.0), layout="constrained")
    for axis, row in zip(axes, ROWS, strict=True):
        optimum = optima[row.key]
        for k, colour in enumerate(CART_COLOURS):
            axis.plot(optimum.time[1:], optimum[f"torque[{k}]"][1:], color=colour, label=f"motor {k + 1}")
        for bound in (-limit, limit):
            axis.axhline(bound, color="black", linewidth=0.8, linestyle=":")
        axis.set(
            title=f"{row.title}: {optimum.final_time:.3f} s",
            ylabel="torque [N.m]",
            ylim=(-1.25 * limit, 1.25 * limit),
        )
        axis.grid(alpha=0.3)
    figure.legend(*axes[0].get_legend_handles_labels(), fontsize="small", ncols=3, loc="outside lower center")
    axes[-1].set_xlabel("time [s]")
    return _saved(figure, file)


def _saved(figure: "Figure", file: Path) -> "Figure":
    import matplotlib.pyplot as plt

    with replacing(file) as partial:
        figure.savefig(partial, dpi=150)
    plt.close(figure)
    return figure
