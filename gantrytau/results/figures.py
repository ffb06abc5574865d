"""Figures of results: variables over time, one axis for each unit."""

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gantrytau.border.refusal import Given, ModelError
from gantrytau.results.display_units import DECLARED, Display, shown_units
from gantrytau.results.series import Series
from gantrytau.whole_files import replacing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BAND = 0.45  # height of the bands of a mode, inches
_FEW = 12  # lines that one figure still shows distinctly


def draw(
    result: Series, names: tuple[str, ...], file: str | os.PathLike[str] | None, display: Display = None
) -> "Figure":
    """The figure of the named variables of a result over time, in units as `shown_units` reads them, saved to a `file`."""
    import matplotlib.pyplot as plt

    if file is not None:
        check_suffix(file)
    lines = _lines(result, names)
    modes = [name for name in lines if name in result.modes]
    shown = shown_units(result, ("time", *lines), display, DECLARED, "plot")
    axes_of_unit: dict[str, list[str]] = {}
    for name in lines:
        if name not in modes:
            axes_of_unit.setdefault(shown[name].unit, []).append(name)
    times = shown["time"].of(result.time)
    heights = [BAND] * len(modes) + [2.2] * len(axes_of_unit)
    figure, axes = plt.subplots(
        len(heights), sharex=True, squeeze=False, figsize=(7.0, 1.2 + sum(heights)), layout="constrained",
        gridspec_kw=dict(height_ratios=heights),
    )  # fmt: skip
    for axis, name in zip(axes[:, 0], modes, strict=False):
        _bands(axis, result, name, times)
    for axis, (unit, members) in zip(axes[len(modes) :, 0], axes_of_unit.items(), strict=True):
        for name in members:
            style = "steps-post" if name in result.held else "default"
            axis.plot(times, shown[name].of(result[name]), label=name, drawstyle=style)
        axis.set_ylabel(_label(members, unit))
        axis.grid(alpha=0.3)
        if len(members) > 1:
            axis.legend(fontsize="small")
    axes[-1, 0].set_xlabel(shown["time"].heading("time"))
    if result.title:
        figure.suptitle(result.title)
    return finished(figure, file)


def _bands(axis: "Axes", result: Series, name: str, t: np.ndarray) -> None:
    """A mode over time as bands, each colour with the name of its mode."""
    import matplotlib.pyplot as plt

    numbers, words = result[name].astype(int), result.modes[name]
    starts = np.flatnonzero(np.append(True, np.diff(numbers) != 0))
    ends = np.append(t[starts[1:]], t[-1])
    colours = plt.get_cmap("tab10")
    told = set[int]()
    for start, end in zip(starts, ends, strict=True):
        k = int(numbers[start])
        axis.axvspan(
            t[start], end, color=colours(k % 10), alpha=0.5, lw=0, label=None if k in told else words[k]
        )
        told.add(k)
    axis.set_yticks([])
    axis.set_ylabel(name, rotation=0, ha="right", va="center")
    axis.legend(fontsize="small", ncols=len(told), loc="center")


def finished(figure: "Figure", file: str | os.PathLike[str] | None) -> "Figure":
    """The figure, saved to `file` if one is named; where there is no window for it, it belongs to its caller alone."""
    import matplotlib.pyplot as plt

    if any(axes.get_aspect() != "auto" for axes in figure.axes):
        figure.draw_without_rendering()  # the layout of a first drawing forgets what equal scales take
    if file is not None:
        with replacing(file) as partial:
            figure.savefig(partial, dpi=150)
    if file is not None or not has_windows(plt.get_backend()):
        plt.close(figure)
    return figure


def check_suffix(file: str | os.PathLike[str]) -> None:
    """ModelError unless a file has the suffix of a format in which Matplotlib draws."""
    from matplotlib.backend_bases import FigureCanvasBase

    suffix, formats = Path(file).suffix, sorted(FigureCanvasBase.get_supported_filetypes())
    if suffix.removeprefix(".").lower() not in formats:
        known = ", ".join(f".{name}" for name in formats)
        words = f"expected one of {known}; name the file {Path(file).stem}.png, for example"
        raise ModelError(words, place="plot", found=Given("file", str(file)))


def has_windows(backend: str) -> bool:
    """Whether figures of a Matplotlib backend stay open until their reader closes them: "TkAgg" yes, "agg" no."""
    from matplotlib.backends.registry import BackendFilter, backend_registry

    interactive = backend_registry.list_builtin(BackendFilter.INTERACTIVE)
    # notebooks with living figures: `%matplotlib widget`
    return backend.lower() in {*interactive, "widget", "ipympl", "module://ipympl.backend_nbagg"}


def _lines(result: Series, names: tuple[str, ...]) -> list[str]:
    """The scalars that the names stand for."""
    if not names:
        names = result.names
        if not 0 < len(names) <= _FEW:
            raise ModelError(
                f"{result.title or 'Result'}: plot() found {len(names)} variables, expected 1 to {_FEW}; "
                "name those to draw, as in plot('tool.r')"
            )
    lines: list[str] = []
    for name in names:
        result[name]  # an unknown name raises
        lines += list(result.arrays[name].flat) if name in result.arrays else [name]
    return list(dict.fromkeys(lines))


def _label(members: list[str], unit: str) -> str:
    """The name if there is one line only, and the unit unless it is one."""
    name = members[0] if len(members) == 1 else ""
    return " ".join(filter(None, [name, f"[{unit}]" if unit else ""]))
