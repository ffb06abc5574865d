"""Pictures of linear systems: gain and phase over frequency, poles and zeros in the plane."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from gantrytau.answers.linear_systems.poles_and_zeros import in_s
from gantrytau.border.checks import instance
from gantrytau.border.refusal import Given, ModelError
from gantrytau.results.figures import check_suffix, finished

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST = 16  # pairs of inputs and outputs that one figure still shows
POINTS = 2000


class Dynamics(Protocol):
    """Poles and zeros of a linear system."""

    @property
    def period(self) -> float | None: ...
    @property
    def poles(self) -> np.ndarray: ...
    @property
    def zeros(self) -> np.ndarray: ...


class Drawn(Dynamics, Protocol):
    """A linear system, as figures need it."""

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    @property
    def title(self) -> str: ...
    def unit(self, name: str) -> str: ...
    def response(self, frequencies: Any) -> np.ndarray: ...


class Spectrum(Protocol):
    """A frequency response that was measured: hertz (N,), response (outputs, inputs, N) complex."""

    @property
    def hertz(self) -> np.ndarray: ...
    @property
    def response(self) -> np.ndarray: ...


def frequencies_to_draw(system: Dynamics) -> np.ndarray:
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


@dataclass(frozen=True, eq=False)
class Curves:
    """A frequency response (outputs, inputs, N) at frequencies (N,) in Hz: a line, or points that were measured."""

    label: str
    hertz: np.ndarray
    response: np.ndarray
    points: bool = False


def beside_each_other(
    system: Drawn, verb: str, beside: Mapping[str, Any] | None, spectra: bool = False
) -> dict[str, Any]:
    """A system under its title, and others by their names; ModelError for what is none, or of another shape."""
    found: dict[str, Any] = {system.title: system}
    place = f"{system.title}.{verb}"
    expected = (
        f"{'systems or measured spectra' if spectra else 'systems'} by other names, {{'measured': ...}}"
    )
    for label, other in instance(place, "beside", beside or {}, Mapping, expected).items():
        measured = spectra and hasattr(other, "hertz")
        known = measured or (hasattr(other, "poles") and hasattr(other, "outputs"))
        if label in found or not known:
            raise ModelError(f"expected {expected}", place=place, found=Given("beside", beside))
        shape = np.shape(other.response)[:2] if measured else (len(other.outputs), len(other.inputs))
        own = (len(system.outputs), len(system.inputs))
        if spectra and shape != own:
            words = f"found {shape[0]} outputs, {shape[1]} inputs of {label}, expected {own[0]} and {own[1]}"
            raise ModelError(words, place=place, argument="beside")
        found[label] = other
    return found


def curves_of(systems: Mapping[str, Any], frequencies: Any) -> list["Curves"]:
    """What is drawn of each: systems at the frequencies (N,) in Hz or around all their poles, spectra where they are known.

    Of other systems than the first, the part below half of their sampling frequency.
    """
    models = [one for one in systems.values() if not hasattr(one, "hertz")]
    hertz = (
        np.unique(np.concatenate([frequencies_to_draw(one) for one in models]))
        if frequencies is None
        else np.atleast_1d(np.asarray(frequencies, dtype=float))
    )
    if frequencies is None and len(models) < len(systems):
        seen = np.concatenate([one.hertz for one in systems.values() if hasattr(one, "hertz")])
        hertz = hertz[(hertz >= seen[seen > 0].min() / 2) & (hertz <= 2 * seen.max())]
    found = []
    for k, (label, one) in enumerate(systems.items()):
        if hasattr(one, "hertz"):
            kept = (one.hertz > 0) & (one.hertz >= hertz.min()) & (one.hertz <= hertz.max())
            found.append(Curves(label, one.hertz[kept], one.response[:, :, kept], points=True))
        else:
            half = np.inf if one.period is None else 0.5 / one.period
            known = hertz if k == 0 and frequencies is not None else hertz[hertz <= half]
            found.append(Curves(label, known, one.response(known)))
    return found


def draw_bode(
    system: Drawn, curves: Sequence[Curves], file: str | os.PathLike[str] | None, dB: bool, rad_per_s: bool
) -> "Figure":
    """Gain in the units of the quantities or dB, phase in degrees, over frequency, a column for each input."""
    import matplotlib.pyplot as plt
    from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter, StrMethodFormatter

    if file is not None:
        check_suffix(file)
    rows, columns = len(system.outputs), len(system.inputs)
    if not 0 < rows * columns <= MOST:
        words = f"found {rows} outputs and {columns} inputs, expected 1 to {MOST} pairs; name fewer in "
        raise ModelError(words, Given("inputs"), " and ", Given("outputs"), place=f"{system.title}.plot_bode")
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
            for one in curves:
                x = one.hertz * (2 * np.pi if rad_per_s else 1.0)
                _draw_curve(gain, phase, one, x, one.response[i, j], dB)
            gain.set_xscale("log")
            seen = any(np.any(abs(one.response[i, j]) > 0) for one in curves)
            gain.set_yscale("log" if seen and not dB else "linear")
            unit = _ratio(system.unit(output), system.unit(name))
            gain.set_ylabel(f"gain [{unit if not dB else 'dB' if unit == '1' else f'dB of {unit}'}]")
            gain.set_title(f"{output} over {name}", fontsize="medium")
            phase.set_ylabel("phase [deg]")
            phase.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 1.5, 3, 4.5, 9, 10]))
            for axis in (gain, phase):
                axis.grid(alpha=0.3, which="both")
    ends = axes[0, 0].get_xlim()
    for axis in axes[-1]:
        axis.set_xlabel("angular frequency [rad/s]" if rad_per_s else "frequency [Hz]")
        if ends[1] < 500 * ends[0]:  # few powers of ten: 2 and 5 between them, in plain numbers
            axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axis.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
            axis.xaxis.set_minor_formatter(NullFormatter())
    if len(curves) > 1:
        axes[0, 0].legend(fontsize="small")
    figure.suptitle(system.title)
    return finished(figure, file)


def _draw_curve(
    gain: "Axes", phase: "Axes", curve: Curves, x: np.ndarray, values: np.ndarray, dB: bool
) -> None:
    """One response over x; points have no line, as neighbours scatter. Phases are in the turn of the first curve."""
    line, marker = ("none", ".") if curve.points else ("-", "none")
    with np.errstate(divide="ignore"):
        sizes = 20 * np.log10(np.abs(values)) if dB else np.abs(values)
    gain.plot(x, sizes, linestyle=line, marker=marker, markersize=3, label=curve.label)
    angles = _phase(values)
    if phase.lines and np.any(np.isfinite(angles)):
        known, first = (np.asarray(of, dtype=float) for of in phase.lines[0].get_data())
        turns = np.round((angles - np.interp(x, known, first)) / 360)  # of noise, each point by itself
        angles = angles - 360 * (turns if curve.points else np.nanmedian(turns))
    phase.semilogx(x, angles, linestyle=line, marker=marker, markersize=3)


def draw_poles(systems: Mapping[str, Drawn], file: str | os.PathLike[str] | None) -> "Figure":
    """Poles as crosses, zeros as circles; the edge of stability is the imaginary axis or the unit circle.

    Of several systems in the plane of z where they share a period, else in that of s, where those of z have no zeros:
    s = log(z) / period holds for poles alone.
    """
    import matplotlib.pyplot as plt

    if file is not None:
        check_suffix(file)
    figure, axis = plt.subplots(figsize=(6.0, 5.5), layout="constrained")
    first, *others = systems.values()
    period = first.period if all(other.period == first.period for other in others) else None
    axis.axhline(0.0, color="0.7", linewidth=0.8)
    axis.axvline(0.0, color="0.7", linewidth=0.8)
    if period is not None:
        angle = np.linspace(0.0, 2 * np.pi, 400)
        axis.plot(np.cos(angle), np.sin(angle), color="0.5", linewidth=0.8)
        axis.set_aspect("equal")
    shown = []
    for k, (label, system) in enumerate(systems.items()):
        of = f" of {label}" if others else ""
        for points, kind, marker in ((system.poles, "poles", "x"), (system.zeros, "zeros", "o")):
            if period is None and system.period is not None:
                points = in_s(points, system.period)[: len(points) if kind == "poles" else 0]
                points = points[np.isfinite(points)]  # z = 0 is no point of s
            if others and not points.size:
                continue
            axis.plot(
                np.real(points),
                np.imag(points),
                marker,
                color=f"C{k}" if others else None,
                markersize=9 - 2 * k if k < 3 else 4,
                fillstyle="none",
                label=f"{len(points)} {kind}{of}",
            )
            shown.append(points)
    if period is None:
        around(axis, np.concatenate(shown))
    unit = " [1/s]" if period is None else f" of z, {1 / period:g} Hz"
    axis.set_xlabel(f"real part{unit}")
    axis.set_ylabel(f"imaginary part{unit}")
    axis.grid(alpha=0.3)
    axis.legend(fontsize="small" if others else None)
    axis.set_title(first.title)
    return finished(figure, file)


def around(axis: "Axes", points: np.ndarray) -> None:
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
