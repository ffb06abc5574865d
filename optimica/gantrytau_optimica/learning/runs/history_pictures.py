"""Pictures of learning: Dressler (2012), Figures 7.5 to 7.18."""

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from gantrytau import ModelError
from gantrytau.border.checks import one_of
from gantrytau.results.figures import check_suffix, finished
from gantrytau_optimica.learning.servo_loop import unit_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MILLI = 1e3


def draw(history: Any, what: str, file: str | os.PathLike[str] | None) -> "Figure":
    """One of PICTURES. Raises ModelError for another."""
    one_of("History.plot", "what", what, PICTURES)
    if file is not None:
        check_suffix(file)
    return finished(PICTURES[what](history), file)


def plot_learning(histories: Mapping[str, Any], *, file: str | os.PathLike[str] | None = None) -> "Figure":
    """Errors of the measured tool over runs, by axis, of several ways to learn: Dressler (2012), Figures 7.16 to 7.18."""
    import matplotlib.pyplot as plt
    from matplotlib.ticker import MaxNLocator

    if not histories:
        raise ModelError("plot_learning: found no histories, expected one at least, by name")
    if file is not None:
        check_suffix(file)
    moved = sorted({k for h in histories.values() for k in h.reference.moving})
    figure, axes = plt.subplots(
        1, len(moved), figsize=(4.2 * len(moved), 3.4), layout="constrained", squeeze=False
    )
    for axis, k in zip(axes[0], moved, strict=True):
        for name, history in histories.items():
            axis.plot(history.tool_relative[:, k], "o-", label=name)
        axis.set(title=f"tool {'xyz'[k]}", xlabel="run", ylabel="error [% of the first run]", ylim=(0, None))
        axis.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes[0, -1].legend()
    return finished(figure, file)


def _errors(history: Any) -> "Figure":
    import matplotlib.pyplot as plt
    from matplotlib.ticker import MaxNLocator

    figure, axis = plt.subplots(figsize=(6.4, 3.6), layout="constrained")
    for name, values in zip(history.names, history.relative.T, strict=True):
        axis.plot(values, "o-", label=name)
    for k in history.reference.moving:
        if k not in history.columns:
            axis.plot(history.tool_relative[:, k], "s--", mfc="none", label=f"tool {'xyz'[k]}")
    axis.set(xlabel="run", ylabel="error [% of the first run]", ylim=(0, None))
    axis.xaxis.set_major_locator(MaxNLocator(integer=True))
    axis.legend()
    return figure


def _over_time(title: str, history: Any, rows: list[tuple[str, list[tuple[str, np.ndarray]]]]) -> "Figure":
    return draw_over_time(title, history.reference.t, history.full, rows)


def draw_over_time(
    title: str,
    t: np.ndarray,
    full: np.ndarray,
    rows: list[tuple[str, list[tuple[str, np.ndarray]]]],
    file: str | os.PathLike[str] | None = None,
) -> "Figure":
    """An axis for each of rows, with lines over t (N,) in mm or mrad; samples `full` (N,), applied in full, are shaded."""
    import matplotlib.pyplot as plt

    if file is not None:
        check_suffix(file)

    figure, axes = plt.subplots(
        len(rows), 1, figsize=(7.0, 1.9 * len(rows) + 0.6), layout="constrained", sharex=True, squeeze=False
    )
    within = t[full]
    for axis, (name, lines) in zip(axes[:, 0], rows, strict=True):
        axis.axvspan(within[0], within[-1], color="0.94", label="judged")
        for label, values in lines:
            axis.plot(t, MILLI * values, label=label)
        axis.set_ylabel(f"{name} [m{unit_of([name])}]")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside right upper")
    axes[0, 0].set_title(title)
    axes[-1, 0].set_xlabel("time [s]")
    return finished(figure, file)


def _ends(history: Any) -> list[int]:
    return sorted({0, len(history) - 1})


def _error(history: Any) -> "Figure":
    return _over_time(
        "errors of what is learnt from",
        history,
        [
            (name, [(f"run {k}", history.error(k)[:, i]) for k in _ends(history)])
            for i, name in enumerate(history.names)
        ],
    )


def _input(history: Any) -> "Figure":
    shown = sorted({min(1, len(history) - 1), len(history) - 1})
    return _over_time(
        "corrections",
        history,
        [
            (name, [(f"run {k}", history.inputs[k][:, i]) for k in shown])
            for i, name in enumerate(history.names)
        ],
    )


def _tool(history: Any) -> "Figure":
    return _over_time(
        "errors of the tool",
        history,
        [
            (f"tool {'xyz'[i]}", [(f"run {k}", history.tool_error(k)[:, i]) for k in _ends(history)])
            for i in history.reference.moving
        ],
    )


def _path(history: Any) -> "Figure":
    import matplotlib.pyplot as plt

    centre = history.reference.r[0]
    lines = [("reference", history.reference.r), *((f"run {k}", history.tool[k]) for k in _ends(history))]
    if len(history.reference.moving) == 1:  # to and fro on one line, which would hide itself
        (k,) = history.reference.moving
        rows = [(f"{'xyz'[k]} from the start", [(label, (r - centre)[:, k]) for label, r in lines])]
        return _over_time("way of the tool", history, rows)
    first, second = np.sort(np.argsort(-np.ptp(history.reference.r, axis=0), kind="stable")[:2])
    figure, axis = plt.subplots(figsize=(5.2, 4.8), layout="constrained")
    for (label, r), colour in zip(lines, ("0.6", "C0", "C1"), strict=False):
        axis.plot(*(MILLI * (r - centre)[:, (first, second)].T), color=colour, label=label)
    axis.set(xlabel=f"{'xyz'[first]} from the start [mm]", ylabel=f"{'xyz'[second]} from the start [mm]")
    axis.set_aspect("equal")
    axis.legend()
    return figure


PICTURES = {"errors": _errors, "error": _error, "input": _input, "tool": _tool, "path": _path}
