"""The minimum-time motions in pictures: thesis Figures 3.9 and 3.10, and that of six links."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from gantrytau import replacing
from gantrytau.commands.demo.thesis_table import BRANCH, BRANCH_TITLE, ROWS, SIX_LINK_TITLE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from gantrytau_optimica import Optimum

CART_COLOURS = ("#1f77b4", "#d95f02", "#2a9d5c")


BRANCH_COLOUR = "#b5179e"


def draw_paths(optima: "Mapping[str, Optimum]", file: Path | None = None) -> "Figure":
    """The paths of the tool, from above and from the side (thesis Figure 3.9), the best branch besides."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(9.0, 4.8), layout="constrained")
    for key, title in _titles(optima).items():
        style = {"line_w0": {"linestyle": "--", "color": "black"}, BRANCH: {"color": BRANCH_COLOUR}}
        for axis, across in zip(axes, (1, 2), strict=True):
            r = optima[key].playback["robot.tool.r"]
            axis.plot(r[:, 0], r[:, across], label=title, **style.get(key, {}))
    for axis, across, view in zip(axes, (1, 2), ("from above", "from the side"), strict=True):
        _view(axis, optima[ROWS[0].key], across, view)
    figure.legend(*axes[0].get_legend_handles_labels(), fontsize="small", ncols=2, loc="outside lower center")
    figure.suptitle("Path of the tool")
    return _saved(figure, file)


def draw_torques(optima: "Mapping[str, Optimum]", limit: float, file: Path | None = None) -> "Figure":
    """The motor torques over time as played back, with their limits (thesis Figure 3.10)."""
    import matplotlib.pyplot as plt

    titles = _titles(optima)
    figure, axes = plt.subplots(
        len(titles), sharex=True, sharey=True, figsize=(8.0, 2.0 * len(titles)), layout="constrained"
    )
    for axis, (key, title) in zip(axes, titles.items(), strict=True):
        _inputs(axis, optima[key], "torque[{}]", "motor", limit)
        axis.set(title=title, ylabel="torque [N.m]")
    figure.legend(*axes[0].get_legend_handles_labels(), fontsize="small", ncols=3, loc="outside lower center")
    axes[-1].set_xlabel("time [s]")
    return _saved(figure, file)


def draw_six_links(optimum: "Optimum", limit: float, file: Path) -> "Figure":
    """The path of the plate on six links and the forces of its carts as played back."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 3, figsize=(12.0, 3.6), width_ratios=(1.0, 1.0, 1.4), layout="constrained")
    r = optimum.playback["robot.tool.r"]
    for axis, across, view in zip(axes, (1, 2), ("from above", "from the side"), strict=False):
        axis.plot(r[:, 0], r[:, across], color=BRANCH_COLOUR)
        _view(axis, optimum, across, view)
    _inputs(axes[2], optimum, "robot.carts[{}].f", "cart", limit)
    axes[2].set(xlabel="time [s]", ylabel="force [N]", title="forces")
    axes[2].legend(fontsize="small", ncols=3, loc="upper center", bbox_to_anchor=(0.5, -0.18))
    figure.suptitle(f"{SIX_LINK_TITLE}: {optimum.final_time:.3f} s")
    return _saved(figure, file)


def _titles(optima: "Mapping[str, Optimum]") -> dict[str, str]:
    """Motions of the L1 by key, with their durations."""
    titles = {row.key: row.title for row in ROWS} | {BRANCH: BRANCH_TITLE}
    return {key: f"{title}: {optima[key].final_time:.3f} s" for key, title in titles.items() if key in optima}


def _view(axis: "Axes", optimum: "Optimum", across: int, view: str) -> None:
    """Axes of a path seen along one direction, with its ends."""
    for end, word in ((0, "A"), (-1, "B")):
        place = optimum.playback["robot.tool.r"][end]
        axis.plot(place[0], place[across], "o", color="black", markersize=4)
        axis.annotate(word, (place[0], place[across]), textcoords="offset points", xytext=(6, -12))
    axis.set(xlabel="x [m]", ylabel=f"{'xyz'[across]} [m]", title=view)
    axis.set_aspect("equal")
    axis.margins(0.08)
    axis.grid(alpha=0.3)


def _inputs(axis: "Axes", optimum: "Optimum", name: str, word: str, limit: float) -> None:
    """Three inputs as they drove the model, between the nodes as well, and their limits."""
    played = optimum.playback
    for k, colour in enumerate(CART_COLOURS):
        axis.plot(played.result.time, played[name.format(k)], color=colour, label=f"{word} {k + 1}")
    for bound in (-limit, limit):
        axis.axhline(bound, color="black", linewidth=0.8, linestyle=":")
    axis.set_ylim(-1.25 * limit, 1.25 * limit)
    axis.grid(alpha=0.3)


def _saved(figure: "Figure", file: Path | None) -> "Figure":
    import matplotlib.pyplot as plt

    if file is not None:
        with replacing(file) as partial:
            figure.savefig(partial, dpi=150)
    plt.close(figure)
    return figure
