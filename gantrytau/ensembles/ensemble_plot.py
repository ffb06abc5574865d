"""Figures of studies: a variable of all cases over time, as lines or as bands."""

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from gantrytau.border.refusal import ModelError
from gantrytau.ensembles.cases import Case, spoken
from gantrytau.ensembles.labelled_array import common_times, on_times
from gantrytau.results.display_units import DECLARED, Display, Shown, shown_units
from gantrytau.results.figures import check_suffix, finished
from gantrytau.results.result import Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LINES = 40  # of one axis, which are still seen one by one
LABELS = 8  # of lines, that a legend still tells apart
BANDS = ((5.0, 95.0, 0.2), (25.0, 75.0, 0.4))  # %, and how dark they are


def draw_fan(
    cases: Sequence[tuple[Case, Result]],
    names: Sequence[str],
    file: str | os.PathLike[str] | None,
    title: str,
    display: Display = None,
) -> "Figure":
    """The figure of the named variables of all cases, an axis for each, saved to `file` if one is named."""
    import matplotlib.pyplot as plt

    if file is not None:
        check_suffix(file)
    first = cases[0][1]
    for name in names:
        first[name]  # an unknown name raises
    scalars = [
        str(n) for name in names for n in (first.arrays[name].flat if name in first.arrays else [name])
    ]
    if not scalars:
        raise ModelError(f"{title}: plot() found no names, expected those of variables, as plot('x')")
    varied = [name for name in cases[0][0].chosen if name in first and name not in first.arrays]
    shown = shown_units(first, ("time", *scalars), display, DECLARED, "plot")
    shown |= {
        name: one
        for name, one in shown_units(first, varied, None, DECLARED, "plot").items()
        if name not in shown
    }
    figure, axes = plt.subplots(
        len(scalars),
        sharex=True,
        squeeze=False,
        figsize=(7.0, 1.2 + 2.4 * len(scalars)),
        layout="constrained",
    )
    for axis, name in zip(axes[:, 0], scalars, strict=True):
        (_lines if len(cases) <= LINES else _bands)(axis, cases, name, shown)
        axis.set_ylabel(shown[name].heading(name))
        axis.grid(alpha=0.3)
    axes[-1, 0].set_xlabel(shown["time"].heading("time"))
    told = {label: line for line, label in zip(*axes[0, 0].get_legend_handles_labels(), strict=True)}
    if 0 < len(told) <= LABELS:
        axes[0, 0].legend(told.values(), told.keys(), fontsize="small")
    figure.suptitle(f"{title}, {len(cases)} cases")
    return finished(figure, file)


def _lines(axis: Any, cases: Sequence[tuple[Case, Result]], name: str, shown: Mapping[str, Shown]) -> None:
    """One line for each case; where they are many, one colour for each value of the name that was given first."""
    import matplotlib.pyplot as plt

    told = [[_told(key, value, shown.get(key)) for key, value in c.names.items()] for c, _ in cases]
    words = [", ".join(parts) or str(case) for parts, (case, _) in zip(told, cases, strict=True)]
    if len(cases) > LABELS:
        words = [parts[0] for parts in told]
    groups = list(dict.fromkeys(words))
    colours = dict(zip(groups, plt.get_cmap("viridis")(np.linspace(0.0, 0.9, len(groups))), strict=True))
    for text, (_, result) in zip(words, cases, strict=True):
        label = text if len(groups) <= LABELS or text in (groups[0], groups[-1]) else None
        times, values = shown["time"].of(result.time), shown[name].of(result[name])
        axis.plot(times, values, color=colours[text], linewidth=1.0, label=label)


def _told(name: str, value: Any, shown: Shown | None) -> str:
    """What tells a case from others, in the unit in which it is shown."""
    if shown is None or shown.scale is None or not isinstance(value, (int, float)):
        return f"{name}={spoken(value)}"
    return f"{name}={spoken(shown.of(float(value)))} {shown.unit}"


def _bands(axis: Any, cases: Sequence[tuple[Case, Result]], name: str, shown: Mapping[str, Shown]) -> None:
    """The median of all cases, and bands that hold half and nine tenths of those that have not ended."""
    times = common_times([result for _, result in cases])
    table = shown[name].of(np.array([on_times(result, name, times) for _, result in cases]))
    times = shown["time"].of(times)
    for low, high, alpha in BANDS:
        below, above = np.nanpercentile(table, (low, high), axis=0)
        axis.fill_between(
            times, below, above, color="C0", alpha=alpha, linewidth=0, label=f"{high - low:.0f} %"
        )
    axis.plot(times, np.nanmedian(table, axis=0), color="C0", label="median")
