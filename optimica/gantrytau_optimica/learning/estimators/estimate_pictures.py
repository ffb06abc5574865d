"""Pictures of estimates beside what gauges saw: Dressler (2012), Figure 7.1."""

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from gantrytau import ModelError, Result
from gantrytau.results.figures import check_suffix, finished
from gantrytau_optimica.learning.estimators.estimator import Estimator, at_rest
from gantrytau_optimica.learning.estimators.estimators import Measured
from gantrytau_optimica.learning.pose_maps import PoseMap

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MILLI, MICRO = 1e3, 1e6
MOVES = 0.05  # of the largest motion, from which an axis is drawn


def plot_estimates(
    run: Result,
    estimators: Mapping[str, Estimator],
    kinematics: PoseMap,
    *,
    file: str | os.PathLike[str] | None = None,
) -> "Figure":
    """What the tool did in a run by its gauges, and how far estimators, by their names, are off, for each axis that moved.

    The legend has the rms from where the reference leaves its first position. Saved to `file` if one is named. Raises
    ModelError for no estimators, for those of actuators, and as `estimate` does.
    """
    import matplotlib.pyplot as plt

    if not estimators:
        raise ModelError(
            "plot_estimates: found no estimators, expected one at least, by name", argument="estimators"
        )
    for name, one in estimators.items():
        if not isinstance(one, Estimator) or one.joints:
            raise ModelError(
                f"plot_estimates: found {name} that is {one!r}, expected an estimator of the tool, such as Kinematic()",
                argument="estimators",
            )
    if file is not None:
        check_suffix(file)
    gauge = Measured()
    measured = gauge.estimate(run, kinematics)
    motion = gauge.signals(run, kinematics)["r"]
    errors = {name: one.estimate(run, kinematics) - measured for name, one in estimators.items()}
    size = np.ptp(motion, axis=0)
    shown = np.flatnonzero(size >= MOVES * size.max())
    moving = np.arange(len(motion)) >= len(at_rest(run))
    figure, axes = plt.subplots(
        2, len(shown), figsize=(5.2 * len(shown), 5.4), layout="constrained", sharex=True, squeeze=False
    )
    for (above, below), k in zip(axes.T, shown, strict=True):
        above.plot(run.time, MILLI * motion[:, k], color="0.2")
        above.set(title=f"tool {'xyz'[k]}", ylabel="measured [mm]")
        for name, error in errors.items():
            rms = MICRO * np.sqrt(np.mean(error[moving, k] ** 2))
            below.plot(run.time, MICRO * error[:, k], linewidth=1.0, label=f"{name}, {rms:.0f} um")
        below.set(xlabel="time [s]", ylabel="estimate less measured [um]")
        below.legend(loc="upper center", bbox_to_anchor=(0.5, -0.18), ncols=2, frameon=False)
    return finished(figure, file)
