"""A trade-off as a picture and as a table on file, from columns by name: the weight first."""

import csv
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gantrytau import ModelError
from gantrytau.results.figures import finished
from gantrytau.whole_files import replacing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Columns = Mapping[str, np.ndarray]


def draw(
    title: str, columns: Columns, units: Mapping[str, str], file: str | os.PathLike[str] | None
) -> "Figure":
    """The first quantity over each of the others, or over the weight where there is only one."""
    import matplotlib.pyplot as plt

    weight, first, *others = columns
    others = others or [weight]
    labels = {name: f"{name} [{units[name]}]" if name in units else name for name in columns}
    figure, axes = plt.subplots(
        1, len(others), squeeze=False, figsize=(1.0 + 6.0 * len(others), 4.6), layout="constrained"
    )
    for axis, other in zip(axes[0], others, strict=True):
        x, y = columns[other], columns[first]
        order = x.argsort()
        axis.plot(x[order], y[order], "-", color="0.7", zorder=1)
        axis.plot(x, y, "o", color="C0", markersize=4)
        for k, value in enumerate(columns[weight]):
            axis.annotate(
                f"{value:.3g}",
                (x[k], y[k]),
                (4, 4),
                textcoords="offset points",
                fontsize="small",
                rotation=40,  # neighbours at the knee stand close
                rotation_mode="anchor",
            )
        axis.set_xlabel(labels[other])
        axis.set_ylabel(labels[first])
        axis.margins(0.1)
        axis.grid(alpha=0.3)
    figure.suptitle(title)
    return finished(figure, file)


def write(columns: Columns, path: str | os.PathLike[str]) -> Path:
    """Columns as CSV with a header."""
    path = Path(path)
    if path.suffix.lower() != ".csv":
        raise ModelError(f"{path}: found the suffix '{path.suffix}', expected .csv")
    with replacing(path) as partial, partial.open("w", newline="", encoding="utf-8") as stream:
        rows = csv.writer(stream)
        rows.writerow(columns)
        rows.writerows(zip(*(column.tolist() for column in columns.values()), strict=True))
    return path
