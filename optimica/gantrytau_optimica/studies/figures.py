"""A trade-off as a picture and as a table on file."""

import csv
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gantrytau import ModelError
from gantrytau.results.figures import finished
from gantrytau.whole_files import replacing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from gantrytau_optimica.studies.pareto import TradeOff


def draw(found: "TradeOff", file: str | os.PathLike[str] | None) -> "Figure":
    """The first quantity over each of the others, or over the weight where there is only one."""
    import matplotlib.pyplot as plt

    first, *others = found.quantities
    others = others or [found.weight]
    figure, axes = plt.subplots(
        1, len(others), squeeze=False, figsize=(1.0 + 6.0 * len(others), 4.6), layout="constrained"
    )
    for axis, other in zip(axes[0], others, strict=True):
        x, y = found[other], found[first]
        order = x.argsort()
        axis.plot(x[order], y[order], "-", color="0.7", zorder=1)
        axis.plot(x, y, "o", color="C0", markersize=4)
        for k, weight in enumerate(found.weights):
            axis.annotate(
                f"{weight:.3g}",
                (x[k], y[k]),
                (4, 4),
                textcoords="offset points",
                fontsize="small",
                rotation=40,  # neighbours at the knee stand close
                rotation_mode="anchor",
            )
        axis.set_xlabel(_label(found, other))
        axis.set_ylabel(_label(found, first))
        axis.margins(0.1)
        axis.grid(alpha=0.3)
    figure.suptitle(f"{found.name}: points labelled with their {found.weight}")
    return finished(figure, file)


def _label(found: "TradeOff", name: str) -> str:
    return f"{name} [{found.units[name]}]" if name in found.units else name


def write(found: "TradeOff", path: str | os.PathLike[str]) -> Path:
    """Weights, quantities, objectives and iterations as CSV with a header."""
    path = Path(path)
    if path.suffix.lower() != ".csv":
        raise ModelError(f"{path}: found the suffix '{path.suffix}', expected .csv")
    heads: list[str] = [found.weight, *found.quantities]
    more: dict[str, list[Any]] = {
        "objective": [point.objective for point in found.points],
        "iterations": [point.iterations for point in found.points],
    }
    more = {head: column for head, column in more.items() if head not in heads}
    columns = [*(found[head].tolist() for head in heads), *more.values()]
    with replacing(path) as partial, partial.open("w", newline="", encoding="utf-8") as stream:
        rows = csv.writer(stream)
        rows.writerow([*heads, *more])
        rows.writerows(zip(*columns, strict=True))
    return path
