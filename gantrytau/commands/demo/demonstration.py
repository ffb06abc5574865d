"""What `gantrytau demo` shows: the table, the pictures of thesis Figures 3.9 and 3.10, and files."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gantrytau.whole_files import replacing

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.table import Table

CART_COLOURS = ("#1f77b4", "#d95f02", "#2a9d5c")


@dataclass(frozen=True)
class Row:
    """One row of Table 3.1 (Dressler 2012): title, energy weight, and its printed time and energy."""

    key: str
    title: str
    weight: float
    line: bool
    thesis_time: float
    thesis_energy: float


ROWS = (
    Row("free_w0", "free path, w = 0", 0.0, False, 0.9074, 103.84),
    Row("free_w0001", "free path, w = 0.001", 0.001, False, 0.9191, 77.00),
    Row("free_w001", "free path, w = 0.01", 0.01, False, 0.9968, 50.13),
    Row("line_w0", "straight line, w = 0", 0.0, True, 0.97612, 57.33),
)


def summary(row: Row, optimum: Any) -> dict[str, Any]:
    """The figures of one row, as numbers."""
    return {
        "row": row.title,
        "time": optimum.final_time,
        "energy": optimum.integral("square"),
        "thesis_time": row.thesis_time,
        "thesis_energy": row.thesis_energy,
        "iterations": optimum.iterations,
        "seconds": optimum.build_time + optimum.solve_time,
    }


def table(summaries: list[dict[str, Any]]) -> "Table":
    """The rows beside Table 3.1 of the thesis."""
    from rich.box import SIMPLE
    from rich.table import Table

    found = Table(title="Minimum-time motion of the robot L1, beside Table 3.1 of the thesis", box=SIMPLE)
    found.add_column("motion", no_wrap=True)
    for heading in ("T (s)", "energy", "thesis T", "energy", "iter.", "took (s)"):
        found.add_column(heading, justify="right")
    for row in summaries:
        found.add_row(
            row["row"],
            f"{row['time']:.5f}",
            f"{row['energy']:.2f}",
            f"{row['thesis_time']:.4f}",
            f"{row['thesis_energy']:.2f}",
            str(row["iterations"]),
            f"{row['seconds']:.1f}",
        )
    return found


def save_trajectory(optimum: Any, file: Path) -> None:
    """The motion as CSV: tool, carts, forces and torques over time."""
    carts = [f"robot.carts[{k}].{name}" for k in range(3) for name in ("s", "v", "f", "friction")]
    optimum.result.select(["robot.tool.r", "robot.tool.v", *carts, "torque"]).save(file)


def draw_paths(optima: Mapping[str, Any], file: Path) -> "Figure":
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


def draw_torques(optima: Mapping[str, Any], limit: float, file: Path) -> "Figure":
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
