"""The cases of a study as one table of pandas: a row for each, with what varies and what came of it."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from gantrytau.border.refusal import ModelError
from gantrytau.ensembles.cases import CASE, SEED, Axes, Case
from gantrytau.results.data_frames import scalars
from gantrytau.results.files import extra_module
from gantrytau.results.result import Result

if TYPE_CHECKING:
    import pandas

FAILURE = "failure"


def case_table(
    axes: Axes,
    cases: Sequence[Case],
    values: Sequence[Any],
    failures: Mapping[int, str],
    names: Sequence[str],
) -> "pandas.DataFrame":
    """A table of cases; see `Study.to_pandas`. failures: what came of those without a result, by number."""
    frames: Any = extra_module("pandas")
    columns: dict[str, list[Any]] = {axes.label(name): [c.chosen[name] for c in cases] for name in axes.over}
    if axes.seeds is not None:
        columns[SEED] = [case.seed for case in cases]
    first = next((value for value in values if value is not None), None)
    units: dict[str, str] = {}
    if isinstance(first, Result):
        whose = {axes.label(name): name for name in axes.over if name in first}
        for name in scalars(first, names) if names else ():
            column = _free(name, columns)
            columns[column] = [np.nan if v is None else v.final(name) for v in values]
            whose[column] = name
        units = {column: unit for column, name in whose.items() if (unit := first.unit(name))}
    elif first is not None:
        columns |= _values(values, names)
    elif names:
        raise ModelError(
            f"to_pandas: no case has a result; look at .failures, or leave out {', '.join(names)}"
        )
    columns[FAILURE] = [failures.get(case.number, "") for case in cases]
    frame = frames.DataFrame(columns, index=frames.Index([case.number for case in cases], name=CASE))
    frame.attrs |= {"units": units}
    return frame


def _free(name: str, columns: Mapping[str, Any]) -> str:
    """A name for a column beside those there are: a parameter that varies is one already."""
    return f"final {name}" if name in columns else name


def _values(values: Sequence[Any], names: Sequence[str]) -> dict[str, list[Any]]:
    """What a function returned, as it is, or by name where it returns mappings."""
    good = [value for value in values if value is not None]
    if not all(isinstance(value, Mapping) for value in good):
        if names:
            raise ModelError(
                f"to_pandas: found the names {', '.join(names)}, but the function returned {type(good[0]).__name__}, "
                "which has none; leave them out",
                argument="names",
            )
        return {"value": [np.nan if value is None else value for value in values]}
    there = list(dict.fromkeys(str(name) for value in good for name in value))
    for name in names:
        if name not in there:
            raise ModelError(
                f"to_pandas: found '{name}', expected one of {', '.join(there)}", argument="names"
            )
    return {name: [np.nan if v is None else v.get(name, np.nan) for v in values] for name in names or there}
