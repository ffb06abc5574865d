"""Pictures of a loop: Nyquist curve, Nichols chart and root locus."""

import os
from typing import TYPE_CHECKING, Any

import numpy as np

from gantrytau.answers.linear_systems.bode_and_poles import around, frequencies_to_draw
from gantrytau.answers.linear_systems.closed_loop import SisoSystem
from gantrytau.answers.linear_systems.poles_and_zeros import transmission_zeros
from gantrytau.results.figures import check_suffix, finished

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SEEN = 4.0  # half of the width of a Nyquist picture at most; beyond, the curve leaves it
CONTOURS = (-20, -10, -6, -3, 0, 1, 2, 3, 6, 10)  # |T| in dB on a Nichols chart
GAINS = 200
STEP = 0.01  # of the largest pole or zero, by which poles of neighbouring gains differ at most


def draw_nyquist(
    loops: dict[str, SisoSystem], frequencies: Any, file: str | os.PathLike[str] | None
) -> "Figure":
    """L over positive frequencies, dashed over negative ones, with -1 and the unit circle."""
    figure, axis = _figure(file)
    circle = np.exp(1j * np.linspace(0, 2 * np.pi, 400))
    axis.plot(np.real(circle), np.imag(circle), color="0.6", linewidth=0.8)
    axis.plot(-1, 0, "+", color="C3", markersize=11, markeredgewidth=1.8)
    size = 1.5
    for k, (label, loop) in enumerate(loops.items()):
        values = _curve(loop, frequencies)
        shown = values[np.abs(values) < SEEN]
        size = max(size, float(np.abs(shown).max(initial=0.0)))
        axis.plot(np.real(values), np.imag(values), color=f"C{k}", label=label)
        axis.plot(np.real(values), -np.imag(values), color=f"C{k}", linestyle="--", linewidth=0.8)
        _arrow(axis, values, f"C{k}")
    axis.set_aspect("equal")
    axis.set_xlim(-1.1 * size, 1.1 * size)
    axis.set_ylim(-1.1 * size, 1.1 * size)
    axis.set_xlabel("real part of L")
    axis.set_ylabel("imaginary part of L")
    return _named(figure, axis, loops, file)


def draw_nichols(
    loops: dict[str, SisoSystem], frequencies: Any, file: str | os.PathLike[str] | None
) -> "Figure":
    """L in dB over its phase in degrees, with contours of |T| in dB."""
    figure, axis = _figure(file)
    phases, levels = [], []
    for k, (label, loop) in enumerate(loops.items()):
        values = _curve(loop, frequencies)
        phase = np.degrees(np.unwrap(np.angle(values)))
        level = 20 * np.log10(np.abs(values))
        shown = (level > -60) & (level < 60)
        if np.any(shown):  # the turn in which the curve meets 0 dB about -180 degrees
            at = int(np.argmin(np.abs(level)))
            phase = phase - 360 * np.round((phase[at] + 180) / 360)
        axis.plot(phase, level, color=f"C{k}", label=label)
        phases += phase[shown].tolist()
        levels += level[shown].tolist()
    left = 90 * np.floor(min([-270, *phases]) / 90)
    right = 90 * np.ceil(max([-90, *phases]) / 90)
    low, high = min([-30, *levels]), max([30, *levels])
    x, y = np.meshgrid(np.linspace(left, right, 721), np.linspace(low, high, 401))
    L = 10 ** (y / 20) * np.exp(1j * np.radians(x))
    with np.errstate(divide="ignore"):
        T = 20 * np.log10(np.abs(L / (1 + L)))
    lines = axis.contour(x, y, T, levels=CONTOURS, colors="0.6", linewidths=0.7)
    axis.clabel(lines, fmt="%g dB", fontsize="x-small")
    for centre in np.arange(-180 - 360 * 8, 360 * 8, 360):
        if left <= centre <= right:
            axis.plot(centre, 0, "+", color="C3", markersize=11, markeredgewidth=1.8)
    axis.set_xlim(left, right)
    axis.set_ylim(low, high)
    axis.set_xticks(np.arange(left, right + 1, 45 if right - left <= 360 else 90))
    axis.set_xlabel("phase of L [deg]")
    axis.set_ylabel("gain of L [dB]")
    return _named(figure, axis, loops, file)


def draw_root_locus(loop: SisoSystem, gains: Any, file: str | os.PathLike[str] | None) -> "Figure":
    """Eigenvalues of A - k B C / (1 + k D) for gains k (N,): open poles as crosses, zeros as circles, k = 1 as dots."""
    figure, axis = _figure(file)
    poles = loop.poles
    zeros = transmission_zeros(loop.A, loop.B, loop.C, loop.D)
    now = loop.closed().poles
    near = np.concatenate([poles, zeros, now])
    lines = _paths(loop, _gains(loop) if gains is None else gains, float(np.abs(near).max(initial=0.0)))
    axis.axhline(0.0, color="0.7", linewidth=0.8)
    axis.axvline(0.0, color="0.7", linewidth=0.8)
    if loop.period is not None:
        circle = np.exp(1j * np.linspace(0, 2 * np.pi, 400))
        axis.plot(np.real(circle), np.imag(circle), color="0.5", linewidth=0.8)
        axis.set_aspect("equal")
    axis.plot(np.real(lines), np.imag(lines), color="C0", linewidth=1.2)
    axis.plot(np.real(poles), np.imag(poles), "x", color="C3", markersize=9, label="poles, k = 0")
    if zeros.size:
        label = "zeros, k without end"
        axis.plot(
            np.real(zeros), np.imag(zeros), "o", color="C2", markersize=8, fillstyle="none", label=label
        )
    axis.plot(np.real(now), np.imag(now), "o", color="C0", markersize=5, label="closed loop, k = 1")
    if loop.period is None:
        around(axis, near)
    else:
        size = 1.2 * max(1.0, float(np.abs(near).max(initial=0.0)))
        axis.set_xlim(-size, size)
        axis.set_ylim(-size, size)
    unit = " [1/s]" if loop.period is None else f" of z, {1 / loop.period:g} Hz"
    axis.set_xlabel(f"real part{unit}")
    axis.set_ylabel(f"imaginary part{unit}")
    axis.legend(fontsize="small")
    axis.set_title(f"{loop.title}: {loop.output} over {loop.input}", fontsize="medium")
    return finished(figure, file)


def _gains(loop: SisoSystem) -> np.ndarray:
    """Gains k from zero to where they are nearly at the zeros."""
    hertz = frequencies_to_draw(loop)
    sizes = np.abs(loop.response(hertz))
    sizes = sizes[np.isfinite(sizes) & (sizes > 0)]
    return np.append(0.0, np.geomspace(min(1.0, 0.01 / sizes.max()), max(1.0, 10 / sizes.min()), GAINS))


def _paths(loop: SisoSystem, gains: np.ndarray, size: float) -> np.ndarray:
    """Closed poles (N, n) in columns that are continuous, with further gains where they move fast, as where two meet."""
    from scipy.optimize import linear_sum_assignment

    lines = np.zeros((0, len(loop.A)))
    for _ in range(16):
        found = [np.linalg.eigvals(loop.closed(float(k)).A) for k in gains]
        paths = found[:1]
        for new in found[1:]:
            paths.append(new[linear_sum_assignment(np.abs(paths[-1][:, None] - new[None, :]))[1]])
        lines = np.array(paths)
        inside = np.minimum(np.abs(lines[:-1]), np.abs(lines[1:])) < 1.5 * size
        fast = np.any((np.abs(np.diff(lines, axis=0)) > STEP * size) & inside, axis=1)
        if not np.any(fast):
            break
        gains = np.sort(np.append(gains, (gains[:-1] + gains[1:])[fast] / 2))
    return lines


def _figure(file: str | os.PathLike[str] | None) -> "tuple[Figure, Axes]":
    import matplotlib.pyplot as plt

    if file is not None:
        check_suffix(file)
    figure, axis = plt.subplots(figsize=(5.7, 5.6), layout="constrained")
    axis.grid(alpha=0.3)
    return figure, axis


def _curve(loop: SisoSystem, frequencies: Any) -> np.ndarray:
    """The finite values of L at frequencies (N,) in Hz, else around all poles and zeros."""
    values = loop.response(frequencies_to_draw(loop) if frequencies is None else frequencies)
    return values[np.isfinite(values) & (values != 0)]


def _arrow(axis: "Axes", values: np.ndarray, color: str) -> None:
    """The direction of rising frequency, in the middle of what is shown."""
    inside = np.abs(values) < SEEN
    way = np.cumsum(np.abs(np.diff(values)) * (inside[1:] & inside[:-1]))
    if not way.size or not way[-1]:
        return
    k = int(np.searchsorted(way, way[-1] / 2))
    start, end = values[k], values[k + 1]
    axis.annotate(
        "",
        (end.real, end.imag),
        (start.real, start.imag),
        arrowprops=dict(arrowstyle="-|>", color=color, mutation_scale=16),
    )


def _named(
    figure: "Figure", axis: "Axes", loops: dict[str, SisoSystem], file: str | os.PathLike[str] | None
) -> "Figure":
    first = next(iter(loops.values()))
    if len(loops) > 1:
        axis.legend(fontsize="small")
    axis.set_title(f"{first.title}: {first.output} over {first.input}", fontsize="medium")
    return finished(figure, file)
