"""The cell from three sides: workspace, obstacles, poses and the way through them."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gantrytau.kinematics.workspace.obstacles import Obstacle
from gantrytau.whole_files import replacing
from gantrytau_optimica.procedure.pose_plan import PosePlan

VIEWS = (("from above", 0, 1), ("from the side", 0, 2), ("from the front", 1, 2))
FINE, DEEP = 160, 60  # points along the sides of a picture and into it, by which obstacles are seen
AROUND = 0.08  # of the extent, that is left around the workspace
CLOSE = 0.03  # of the extent, within which numbers of poses share a place
WAY = 12  # poses that draw the way of a move, which is no straight line in space


def draw_plan(plan: PosePlan, file: Path) -> None:
    """Draw a plan whose cell is known to a PNG file."""
    import matplotlib.pyplot as plt

    assert plan.cell is not None
    box = _extent(plan)
    figure, axes = plt.subplots(2, 2, figsize=(11.0, 9.5), layout="constrained")
    for axis, (title, across, up) in zip(axes.flat[:3], VIEWS, strict=True):
        _places(axis, plan, across, up)
        _obstacles(axis, plan.cell.limits.obstacles, box, across, up)
        _poses(axis, plan, across, up)
        _device(axis, plan, box, across, up)
        axis.set(
            xlim=box[across],
            ylim=box[up],
            xlabel=f"{'xyz'[across]} [m]",
            ylabel=f"{'xyz'[up]} [m]",
            title=title,
        )
        axis.set_aspect("equal")
    handles, labels = axes.flat[0].get_legend_handles_labels()
    rest = axes.flat[3]
    rest.axis("off")
    rest.legend(handles, labels, loc="upper left", frameon=False)
    rest.text(0.03, 0.42, _words(plan), va="top", transform=rest.transAxes, fontsize="small")
    with replacing(file) as partial:
        figure.savefig(partial, dpi=110)
    plt.close(figure)


def _extent(plan: PosePlan) -> np.ndarray:
    """What the pictures show, (3, 2): the workspace and the program with some space around."""
    points = np.concatenate([plan.workspace.r, plan.r])
    low, high = points.min(axis=0), points.max(axis=0)
    space = AROUND * (high - low).max()
    return np.stack([low - space, high + space], axis=1)


def _places(axis: Any, plan: PosePlan, across: int, up: int) -> None:
    """Cells of the workspace seen along the third axis."""
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import Rectangle

    r, step = plan.workspace.r, plan.workspace.spacing
    # places of a grid differ by less than rounding from each other along its axes
    columns, rows = (np.round(r[:, k] / (step / 4)).astype(int) for k in (across, up))
    seen = np.unique(np.column_stack([columns, rows]), axis=0) * (step / 4)
    cells = [Rectangle((x - step / 2, y - step / 2), step, step) for x, y in seen]
    axis.add_collection(PatchCollection(cells, facecolor="#cfe8cf", edgecolor="none", zorder=0))
    axis.fill([], [], color="#cfe8cf", label="workspace of the nominal robot")


def _obstacles(axis: Any, obstacles: Sequence[Obstacle], box: np.ndarray, across: int, up: int) -> None:
    """Obstacles seen along the third axis, what of them is within the picture."""
    deep = 3 - across - up
    x, y, z = (np.linspace(box[k, 0], box[k, 1], n) for k, n in ((across, FINE), (up, FINE), (deep, DEEP)))
    points = np.empty((FINE, FINE, DEEP, 3))
    points[..., across], points[..., up], points[..., deep] = np.meshgrid(x, y, z, indexing="ij")
    for k, obstacle in enumerate(obstacles):
        near = obstacle.distance(points).min(axis=2).T
        if near.min() < 0:
            axis.contourf(x, y, near, levels=[-np.inf, 0.0], colors=["0.45"], alpha=0.6, zorder=1)
        if k == 0:
            axis.fill([], [], color="0.45", alpha=0.6, label="obstacle")


def _poses(axis: Any, plan: PosePlan, across: int, up: int) -> None:
    passed = ~plan.measured
    passed[[0, -1]] = False
    at = plan.r[plan.measured]

    def marks(points: np.ndarray, style: str, label: str, **how: Any) -> None:
        if len(points):
            axis.plot(*points[:, [across, up]].T, style, label=label, **how)

    marks(_way(plan), "-", "way of the tool", color="tab:blue", linewidth=0.6, alpha=0.7, zorder=2)
    marks(plan.unseen, "x", "safe, but not visible", color="tab:orange", markersize=4, zorder=3)
    marks(plan.r[passed], "o", "only passed", mfc="white", mec="tab:blue", markersize=4, zorder=4)
    marks(plan.lost, "v", "not reached, replaced", color="tab:red", markersize=5, zorder=4)
    marks(at, "o", "to measure, numbered as in poses.csv", color="tab:blue", markersize=5, zorder=5)
    _numbers(axis, plan.numbers[plan.measured], at[:, [across, up]])
    axis.plot(*plan.r[0, [across, up]], "s", color="black", markersize=7, label="home", zorder=5)


def _numbers(axis: Any, numbers: np.ndarray, at: np.ndarray) -> None:
    """Numbers (n,) beside points (n, 2): those of points on top of each other in one row of words; to the left below where
    there is no room to the right above.
    """
    apart = max(np.ptp(at, axis=0).max() * CLOSE, 1e-6)  # a single pose has no extent
    left = list(range(len(at)))
    while left:
        first = left[0]
        here = [k for k in left if np.abs(at[k] - at[first]).max() <= apart]
        left = [k for k in left if k not in here]
        away = (at - at[here[-1]]) / apart
        crowded = ((away[:, 0] > 0.5) & (away[:, 0] < 3) & (away[:, 1] > -0.7) & (away[:, 1] < 2)).any()
        axis.annotate(
            ", ".join(str(numbers[k]) for k in here),
            at[here[-1]],
            xytext=(-3, -3) if crowded else (3, 3),
            ha="right" if crowded else "left",
            va="top" if crowded else "bottom",
            textcoords="offset points",
            fontsize=6.5,
            zorder=6,
        )


def _way(plan: PosePlan) -> np.ndarray:
    """The tool along all moves."""
    assert plan.cell is not None
    steps = np.linspace(0.0, 1.0, WAY)[:, None]
    moves = [(1 - steps) * a + steps * b for a, b in zip(plan.q, plan.q[1:], strict=False)]
    return plan.cell.fleet.nominal.pose(np.concatenate(moves))[0]


def _device(axis: Any, plan: PosePlan, box: np.ndarray, across: int, up: int) -> None:
    """The device, or an arrow at the border towards it."""
    place = np.asarray(plan.settings["device_r"], dtype=float)[[across, up]]
    limits = box[[across, up]]
    name = plan.settings["device"]
    if ((limits[:, 0] < place) & (place < limits[:, 1])).all():
        axis.plot(*place, "^", color="tab:purple", markersize=10, label=name, zorder=6)
        return
    middle = limits.mean(axis=1)
    away = place - middle
    half = (limits[:, 1] - limits[:, 0]) / 2
    reach = (half / np.maximum(np.abs(away), 1e-9)).min()
    arrow = dict(arrowstyle="-|>", color="tab:purple", linewidth=1.5)
    axis.annotate("", middle + 0.98 * reach * away, middle + 0.82 * reach * away, arrowprops=arrow, zorder=6)
    if up == 1:
        label = f"to the {name} at {np.round(plan.settings['device_r'], 2).tolist()} m"
        axis.plot([], [], "-", color="tab:purple", label=label)


def _words(plan: PosePlan) -> str:
    places = plan.workspace
    return (
        f"{plan.robot_name}, {plan.kind}\n{int(plan.measured.sum())} poses to measure, verdict: "
        f"{'good' if plan.verdict.good else 'NOT GOOD ENOUGH'}\nworkspace {places.volume:.3g} m³ ± "
        f"{places.uncertainty:.1g}, {places.share:.0%} visible\ngrid {places.spacing * 1e3:.3g} mm"
    )
