"""Pictures of linear systems: gain and phase over frequency, poles and zeros in the plane."""

import os
from typing import TYPE_CHECKING, Protocol

import numpy as np

from gantrytau.answers.linear_systems.poles_and_zeros import in_s
from gantrytau.errors import ModelError
from gantrytau.results.figures import check_suffix, finished

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST = 16  # pairs of inputs and outputs that one figure still shows
POINTS = 2000


class Drawn(Protocol):
    """What is drawn of a linear system."""

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    period: float | None

    @property
    def title(self) -> str: ...
    @property
    def poles(self) -> np.ndarray: ...
    @property
    def zeros(self) -> np.ndarray: ...
    def unit(self, name: str) -> str: ...


def frequencies_to_draw(system: Drawn) -> np.ndarray:
    """Frequencies in Hz, (N,), from a tenth of the slowest pole or zero to ten times the fastest, dense at resonances."""
    corners = np.concatenate([in_s(system.poles, system.period), in_s(system.zeros, system.period)])
    corners = corners[np.isfinite(corners)]
    sizes = np.abs(corners) / (2 * np.pi)
    largest = float(sizes.max(initial=0.0))
    corners, sizes = corners[sizes > 1e-9 * largest], sizes[sizes > 1e-9 * largest]
    low, high = (sizes.min() / 10, sizes.max() * 10) if sizes.size else (0.01, 100.0)
    if system.period is not None:
        high = 0.5 / system.period
        low = min(low, high / 1000)
    grid = np.geomspace(low, high, POINTS)
    peaks = np.abs(np.imag(corners)) / (2 * np.pi)
    widths = np.maximum(np.abs(np.real(corners)), 1e-6 * np.abs(corners)) / (2 * np.pi)
    around = np.concatenate([[-k, k] for k in np.geomspace(0.01, 30, 60)])
    near = (peaks[:, None] + widths[:, None] * around).ravel()
    return np.unique(np.concatenate([grid, near[(near >= low) & (near <= high)]]))


def draw_bode(
    system: Drawn, hertz: np.ndarray, response: np.ndarray, file: str | os.PathLike[str] | None
) -> "Figure":
    """Gain in the units of the quantities and phase in degrees over frequency in Hz, a column for each input."""
    import matplotlib.pyplot as plt
    from matplotlib.ticker import MaxNLocator

    if file is not None:
        check_suffix(file)
    rows, columns = len(system.outputs), len(system.inputs)
    if not 0 < rows * columns <= MOST:
        raise ModelError(
            f"{system.title}: plot_bode found {rows} outputs and {columns} inputs, expected 1 to {MOST} pairs; name "
            "fewer in inputs= and outputs="
        )
    figure, axes = plt.subplots(
        2 * rows,
        columns,
        sharex=True,
        squeeze=False,
        figsize=(1.5 + 5.0 * columns, 1.0 + 3.6 * rows),
        layout="constrained",
        height_ratios=[3, 2] * rows,
    )
    for i, output in enumerate(system.outputs):
        for j, name in enumerate(system.inputs):
            gain, phase = axes[2 * i, j], axes[2 * i + 1, j]
            values = response[i, j]
            gain.loglog(hertz, np.abs(values))
            if not np.any(np.abs(values) > 0):
                gain.set_yscale("linear")
            gain.set_ylabel(f"gain [{_ratio(system.unit(output), system.unit(name))}]")
            gain.set_title(f"{output} over {name}", fontsize="medium")
            phase.semilogx(hertz, _phase(values))
            phase.set_ylabel("phase [deg]")
            phase.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 1.5, 3, 4.5, 9, 10]))
            for axis in (gain, phase):
                axis.grid(alpha=0.3, which="both")
    for axis in axes[-1]:
        axis.set_xlabel("frequency [Hz]")
    figure.suptitle(system.title)
    return finished(figure, file)


def draw_poles(system: Drawn, file: str | os.PathLike[str] | None) -> "Figure":
    """Poles as crosses, zeros as circles; the edge of stability is the imaginary axis or the unit circle."""
    import matplotlib.pyplot as plt

    if file is not None:
        check_suffix(file)
    figure, axis = plt.subplots(figsize=(6.0, 5.5), layout="constrained")
    poles, zeros = system.poles, system.zeros
    axis.axhline(0.0, color="0.7", linewidth=0.8)
    axis.axvline(0.0, color="0.7", linewidth=0.8)
    if system.period is not None:
        angle = np.linspace(0.0, 2 * np.pi, 400)
        axis.plot(np.cos(angle), np.sin(angle), color="0.5", linewidth=0.8)
        axis.set_aspect("equal")
    axis.plot(np.real(poles), np.imag(poles), "x", markersize=9, label=f"{len(poles)} poles")
    axis.plot(
        np.real(zeros), np.imag(zeros), "o", markersize=8, fillstyle="none", label=f"{len(zeros)} zeros"
    )
    if system.period is None:
        _around(axis, np.concatenate([poles, zeros]))
    unit = " [1/s]" if system.period is None else f" of z, {1 / system.period:g} Hz"
    axis.set_xlabel(f"real part{unit}")
    axis.set_ylabel(f"imaginary part{unit}")
    axis.grid(alpha=0.3)
    axis.legend()
    axis.set_title(system.title)
    return finished(figure, file)


def _around(axis: "Axes", points: np.ndarray) -> None:
    """Limits that show all points and the imaginary axis."""
    size = float(np.abs(points).max(initial=0.0)) or 1.0
    wide = max(float(np.abs(np.real(points)).max(initial=0.0)), 0.05 * size)
    left, right = (
        min(np.min(np.real(points), initial=0.0), 0.0),
        max(np.max(np.real(points), initial=0.0), 0.0),
    )
    axis.set_xlim(left - 0.15 * wide, right + 0.15 * wide)
    tall = max(float(np.abs(np.imag(points)).max(initial=0.0)), 0.1 * size)
    axis.set_ylim(-1.15 * tall, 1.15 * tall)


def _phase(values: np.ndarray) -> np.ndarray:
    """Degrees without jumps, beginning between -180 and 180."""
    known = np.isfinite(values) & (values != 0)
    found = np.full(values.shape, np.nan)
    found[known] = np.degrees(np.unwrap(np.angle(values[known])))
    return found


def _ratio(above: str, below: str) -> str:
    """The unit of an output over that of an input."""
    above, below = above or "1", below or "1"
    if above == below:
        return "1"
    above, below = (f"({unit})" if "/" in unit or "." in unit else unit for unit in (above, below))
    return f"{above}/{below}" if below != "1" else above.strip("()")
