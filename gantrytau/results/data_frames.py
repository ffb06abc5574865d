"""Results as tables of pandas: a row for each time, a column for each scalar, units beside."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from gantrytau.border.refusal import ModelError
from gantrytau.results.display_units import SI, Display, shown_units
from gantrytau.results.files import extra_module
from gantrytau.results.series import Series

if TYPE_CHECKING:
    import pandas


def data_frame(result: Series, names: Sequence[str], display: Display = None) -> "pandas.DataFrame":
    """A result as a table; see `Result.to_pandas`."""
    frames: Any = extra_module("pandas")
    columns = scalars(result, names)
    shown = shown_units(result, ("time", *columns), display, SI, "to_pandas")
    values = np.empty((result.time.size, len(columns)))
    for k, name in enumerate(columns):
        values[:, k] = shown[name].of(result[name])
    index = frames.Index(shown["time"].of(result.time), name="time")
    frame = frames.DataFrame(values, index=index, columns=columns)
    units = {name: unit for name in ("time", *columns) if (unit := shown[name].unit)}
    words = {name: text for name in columns if (text := result.description(name))}
    frame.attrs |= {"title": result.title, "units": units, "descriptions": words, "ended": result.ended}
    modes = {name: list(told) for name, told in result.modes.items() if name in columns}
    frame.attrs |= {"modes": modes} if modes else {}
    return frame


def scalars(result: Series, names: Iterable[str]) -> list[str]:
    """Names of scalars, each once: all, or those that are named and elements of vectors; ModelError for an unknown name."""
    if isinstance(names, str) or not all(isinstance(name, str) for name in names):
        words = f"found {names!r}, expected names one by one, as to_pandas('x', 'tool.r')"
        raise ModelError(words, place="to_pandas", argument="names")
    found: dict[str, None] = {}
    for name in names or result.names:
        result.unit(name)  # an unknown name raises
        elements = result.arrays[name].flat if name in result.arrays else [name]
        found.update((str(element), None) for element in elements)
    found.pop("time", None)
    return list(found)
