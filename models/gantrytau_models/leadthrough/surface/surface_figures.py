"""Figures 8.4 and 8.5 of Dressler (2012), drawn from simulated runs."""

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from gantrytau import ModelError, Result
from gantrytau.border.checks import number

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WINDOW = 0.4  # s, in which single samples are seen


def plot_tool_force(runs: Mapping[str, Result], file: str | os.PathLike[str] | None = None) -> "Figure":
    """Figure 8.4: the force of the tool along its z axis, N, of runs of `SurfaceTracking` by their names.

    file: also save the figure there. Raises ModelError for no runs, and for results without f_n.
    """
    from matplotlib.figure import Figure

    _refuse_none(runs, "plot_tool_force")
    figure = Figure(figsize=(8, 1 + 2 * len(runs)), layout="constrained")
    panels = figure.subplots(len(runs), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    for axes, (name, run) in zip(panels, runs.items(), strict=True):
        axes.plot(run.time, run["f_n"], linewidth=0.8)
        axes.axhline(2.0, color="C3", linewidth=0.8, linestyle="--", label="2 N, the reference")
        axes.set(title=name, ylabel="force along z, N")
        axes.grid(alpha=0.3)
    panels[0].legend(loc="upper right", fontsize=8)
    panels[-1].set_xlabel("time, s")
    if file is not None:
        figure.savefig(file)
    return figure


def plot_oscillation(
    runs: Mapping[str, Result], *, begin: float = 8.0, file: str | os.PathLike[str] | None = None
) -> "Figure":
    """Figure 8.5: what sounds on a stiff plate, the force over 0.4 s from `begin`, s, and the spectra of all that follows.

    runs: of `SurfaceTracking` by their names, as of several gates; file: also save the figure there. Raises ModelError for
    no runs, for results without f_n, and for runs that end before.
    """
    from matplotlib.figure import Figure

    begin = number("plot_oscillation", "begin", begin, unit="s")
    _refuse_none(runs, "plot_oscillation")
    figure = Figure(figsize=(9, 4), layout="constrained")
    force, spectrum = figure.subplots(1, 2)
    for name, run in runs.items():
        times, values = _evenly(run, begin, name)
        shown = times <= begin + WINDOW
        force.plot(times[shown], values[shown], linewidth=0.9, label=name)
        around = (values - values.mean()) * np.hanning(values.size)
        amplitude = 4 * np.abs(np.fft.rfft(around)) / values.size  # of a sine, with this window
        spectrum.plot(np.fft.rfftfreq(values.size, times[1] - times[0]), amplitude, linewidth=0.9, label=name)
    force.set(xlabel="time, s", ylabel="force along z, N", title="force of the tool")
    spectrum.set(xlabel="frequency, Hz", ylabel="amplitude, N", title="spectrum")
    for axes in (force, spectrum):
        axes.grid(alpha=0.3)
    spectrum.legend(fontsize=8)
    if file is not None:
        figure.savefig(file)
    return figure


def _refuse_none(runs: Mapping[str, Result], place: str) -> None:
    if not isinstance(runs, Mapping) or not runs:
        raise ModelError(
            f"{place}: found {type(runs).__name__} without runs, expected results by name, as {{'metal': run}}"
        )


def _evenly(run: Result, begin: float, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Times and forces at even distances, once at each time, from `begin` on while the tool is on the surface."""
    times, rows = np.unique(run.time, return_index=True)
    force = run["f_n"][rows]
    held = times >= begin
    after = np.flatnonzero(held & (times > begin + WINDOW) & (force <= 0) & (np.roll(force, -25) <= 0))
    held &= times < (times[after[0]] if after.size else np.inf)
    if np.count_nonzero(held) < 100:
        raise ModelError(
            f"plot_oscillation: found {name} on the surface for less than 100 samples from {begin:g} s on, expected more"
        )
    return times[held], force[held]
