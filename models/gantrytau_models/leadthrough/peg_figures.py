"""Figures 8.7 and 8.9 of a match that is led into its hole: forces and torques, and how it is turned."""

import os
from typing import TYPE_CHECKING

import numpy as np

from gantrytau import Result
from gantrytau.whole_files import replacing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def plot_peg_orientation(
    result: Result, file: str | os.PathLike[str] | None = None, name: str = ""
) -> "Figure":
    """The angles ZYZ of the tool (Figure 8.9), and what is not singular where it points down: tilt and rotation.

    result: of a `PegInHole`, or of a model in which `name` leads to one; saved to `file` if one is named.
    """
    figure, axes = _panels(3, 7.0)
    t, at = result.time, _within(name)
    for angle in ("alpha", "beta", "gamma"):
        axes[0].plot(t, np.degrees(np.unwrap(result[at(angle)])), label=angle)
    axes[0].set_ylabel("ZYZ [deg]")
    axis = result[at("tool.axis")]
    for letter, row in zip("xy", axis.T[:2], strict=True):
        axes[1].plot(t, np.degrees(np.arcsin(row)), label=f"tilt along {letter}")
    axes[1].plot(t, np.degrees(result[at("tool.angle")]), "k", lw=0.8, label="tilt")
    axes[1].set_ylabel("tilt [deg]")
    axes[2].plot(t, np.degrees(result[at("yaw")]), label="alpha - gamma, less that of the start")
    axes[2].set_ylabel("rotation [deg]")
    return _finished(figure, axes, file)


def plot_peg_forces(result: Result, file: str | os.PathLike[str] | None = None, name: str = "") -> "Figure":
    """Forces of the tool on the hole (Figure 8.7), as they are measured and as they are, in its axes, and how deep it is."""
    figure, axes = _panels(3, 7.0)
    t, at = result.time, _within(name)
    for k, letter in enumerate("xyz"):
        axes[0].plot(t, result[at("sensor.f_seen")][:, k], lw=0.6, label=letter)
        axes[1].plot(t, result[at("sensor.f")][:, k], lw=0.9, label=letter)
    axes[0].set_ylabel("measured [N]")
    axes[1].set_ylabel("force [N]")
    axes[2].plot(t, -1e3 * result[at("tool.r")][:, 2], label="depth of the tip")
    axes[2].set_ylabel("depth [mm]")
    return _finished(figure, axes, file)


def plot_peg_torques(result: Result, file: str | os.PathLike[str] | None = None, name: str = "") -> "Figure":
    """Torques of the tool about the tool centre point, in its axes (Figure 8.7), and those that its sensor measures."""
    figure, axes = _panels(2, 5.0)
    t, at = result.time, _within(name)
    for k, letter in enumerate("xyz"):
        axes[0].plot(t, 1e3 * result[at("sensor.t_seen")][:, k], lw=0.6, label=letter)
        axes[1].plot(t, 1e3 * result[at("sensor.t")][:, k], lw=0.9, label=letter)
    axes[0].set_ylabel("measured [mN m]")
    axes[1].set_ylabel("torque [mN m]")
    return _finished(figure, axes, file)


def _within(name: str):
    return lambda variable: f"{name}.{variable}" if name else variable


def _panels(rows: int, height: float) -> "tuple[Figure, list[Axes]]":
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, height), layout="constrained")
    return figure, list(figure.subplots(rows, 1, sharex=True))


def _finished(figure: "Figure", axes: "list[Axes]", file: str | os.PathLike[str] | None) -> "Figure":
    for one in axes:
        one.grid(alpha=0.3)
        one.legend(loc="best", fontsize="small")
    axes[-1].set_xlabel("time [s]")
    if file is not None:
        with replacing(file) as partial:
            figure.savefig(partial, dpi=150)
    return figure
