"""Figures of steps: what was asked for, what was measured, and the law."""

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from gantrytau import ModelError
from gantrytau.results.figures import check_suffix, finished
from gantrytau_optimica.identification.servos.step_response import StepResponse

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST = 6  # steps that one figure still shows


def draw_steps(
    steps: Sequence[StepResponse], simulated: Sequence[np.ndarray], file: str | os.PathLike[str] | None
) -> "Figure":
    """One panel for each actuator and step; of many steps the first ones."""
    import matplotlib.pyplot as plt

    if file is not None:
        check_suffix(file)
    shown = list(zip(steps, simulated, strict=True))[:MOST]
    actuators = steps[0].position.shape[1]
    if not actuators:
        raise ModelError("ServoModel.plot: found no actuator to draw")
    figure, axes = plt.subplots(
        actuators,
        len(shown),
        sharex="col",
        squeeze=False,
        figsize=(1.0 + 3.2 * len(shown), 1.0 + 2.2 * actuators),
        layout="constrained",
    )
    for k, (step, model) in enumerate(shown):
        for i, axis in enumerate(axes[:, k]):
            axis.plot(step.t, step.reference[:, i], color="0.5", drawstyle="steps-post", label="reference")
            axis.plot(step.t, step.position[:, i], label="measured")
            axis.plot(step.t, model[:, i], "--", label="law")
            axis.grid(alpha=0.3)
            if k == 0:
                axis.set_ylabel(f"actuator {i} [m, rad]")
        axes[0, k].set_title(f"step {k}", fontsize="medium")
        axes[-1, k].set_xlabel("time [s]")
    axes[0, 0].legend(fontsize="small")
    return finished(figure, file)
