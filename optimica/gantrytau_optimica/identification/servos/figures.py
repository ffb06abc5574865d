"""Figures of steps: what was measured, the law, and what the law leaves."""

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from gantrytau.results.figures import check_suffix, finished
from gantrytau_optimica.identification.servos.step_response import StepResponse

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw_steps(
    steps: Sequence[StepResponse],
    simulated: Sequence[np.ndarray],
    rest: np.ndarray,
    file: str | os.PathLike[str] | None,
) -> "Figure":
    """A row for each actuator: its steps from rest (steps, n), and beside them the residuals of the law."""
    import matplotlib.pyplot as plt

    if file is not None:
        check_suffix(file)
    actuators = rest.shape[1]
    figure, axes = plt.subplots(
        actuators,
        2,
        sharex=True,
        squeeze=False,
        figsize=(10.0, 1.0 + 2.4 * actuators),
        layout="constrained",
    )
    for i, (motion, left) in enumerate(axes):
        took = np.flatnonzero(np.isfinite(rest[:, i])).tolist()
        for number, k in enumerate(took):
            step, law = steps[k], simulated[k][:, i] - rest[k, i]
            t, colour, first = step.t - step.t[0], f"C{number % 10}", number == 0
            moved = step.position[:, i] - rest[k, i]
            asked = step.reference[:, i] - step.reference[0, i]
            motion.plot(t, asked, color="0.7", drawstyle="steps-post", label="reference" if first else None)
            motion.plot(t, moved, color=colour, label=f"step {k}")
            motion.plot(t, law, "--", color="black", linewidth=0.8, label="law" if first else None)
            left.plot(t, moved - law, color=colour, linewidth=0.8)
        motion.set_ylabel(f"actuator {i} [m, rad]")
        motion.legend(fontsize="x-small")
        for axis in (motion, left):
            axis.grid(alpha=0.3)
    axes[0, 0].set_title("from rest", fontsize="medium")
    axes[0, 1].set_title("measured less the law", fontsize="medium")
    for axis in axes[-1]:
        axis.set_xlabel("time [s]")
    return finished(figure, file)
