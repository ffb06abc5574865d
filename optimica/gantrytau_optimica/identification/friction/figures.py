"""Figures of friction: Dressler (2012), Figures 6.2 to 6.4."""

import os
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from gantrytau.results.figures import check_suffix, finished
from gantrytau_optimica.identification.friction.constant_runs import ConstantRuns

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw_friction(
    names: Sequence[str],
    runs: ConstantRuns,
    mass: float,
    law: Callable[[np.ndarray], np.ndarray],
    file: str | os.PathLike[str] | None,
) -> "Figure":
    """One panel for each actuator, force less weight over speed, and one of the weight in each run."""
    import matplotlib.pyplot as plt

    if file is not None:
        check_suffix(file)
    weight = runs.known + mass * runs.slope
    figure, axes = plt.subplots(
        len(names) + 1, squeeze=False, figsize=(7.0, 1.2 + 2.2 * (len(names) + 1)), layout="constrained"
    )
    fastest = np.max(np.abs(runs.v), axis=0)
    share = np.linspace(-1, 1, 402)  # without zero, where the law jumps
    lines = law(share[:, None] * fastest)
    for i, (name, axis) in enumerate(zip(names, axes[:, 0], strict=False)):
        moving = runs.v[:, i] != 0
        axis.plot(runs.v[moving, i], (runs.f - weight)[moving, i], ".", label="runs, less weight")
        for side in (share > 0, share < 0):
            axis.plot(share[side] * fastest[i], lines[side, i], color="C1")
        axis.set_ylabel(f"{name} [N]")
        axis.grid(alpha=0.3)
    axes[-2, 0].set_xlabel("speed [m/s]")
    axes[-1, 0].plot(runs.runs, weight, ".-", linewidth=0.5, label=list(names))
    axes[-1, 0].set_ylabel("weight [N]")
    axes[-1, 0].set_xlabel("number of the run")
    axes[-1, 0].legend(fontsize="small")
    return finished(figure, file)


def draw_places(r: np.ndarray, file: str | os.PathLike[str] | None) -> "Figure":
    """Places r (R, 3) of the tool, across the guideways and along them."""
    import matplotlib.pyplot as plt

    if file is not None:
        check_suffix(file)
    figure, panels = plt.subplots(1, 2, figsize=(8.0, 3.6), layout="constrained")
    for axis, (i, j) in zip(panels, ((1, 2), (0, 2)), strict=True):
        axis.plot(r[:, i], r[:, j], "x")
        axis.set(xlabel=f"{'xyz'[i]} [m]", ylabel=f"{'xyz'[j]} [m]")
        axis.margins(0.2)
        axis.grid(alpha=0.3)
    return finished(figure, file)
