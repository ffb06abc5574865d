"""The results of all cases as one dataset with named axes."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from gantrytau.border.refusal import ModelError
from gantrytau.ensembles.case_table import FAILURE
from gantrytau.ensembles.cases import CASE, SEED, Axes, Case
from gantrytau.results.files import extra_module
from gantrytau.results.result import Result

if TYPE_CHECKING:
    import xarray


def labelled(
    axes: Axes, cases: Sequence[Case], values: Sequence[Any], title: str, failures: Mapping[int, str]
) -> "xarray.Dataset":
    """The dataset of a study; values: of each case, None where there is none; failures: why, by its number.

    Raises ModelError for what is no number.
    """
    xarray: Any = extra_module("xarray")
    first = next((v for v in values if v is not None), None)
    if first is None:
        raise ModelError(f"{title}: no case has a result; look at .failures")
    variables = _of_results(axes, values) if isinstance(first, Result) else _of_values(axes, values, title)
    coordinates = _coordinates(axes, first if isinstance(first, Result) else None)
    if isinstance(first, Result):
        coordinates["time"] = ("time", common_times(values), {"units": "s", "long_name": "time"})
    if failures:
        told = np.array([failures.get(case.number, "") for case in cases])
        about = {"long_name": "why a case has no result"}
        coordinates[_free(FAILURE, variables, coordinates)] = (axes.names, told.reshape(axes.shape), about)
    return xarray.Dataset(variables, coords=coordinates, attrs={"title": title})


def common_times(values: Sequence[Any]) -> np.ndarray:
    """Times at which all results are compared: those of the longest, each once."""
    grids = [v.time for v in values if v is not None]
    if all(np.array_equal(grid, grids[0]) for grid in grids):
        return grids[0]
    longest = max(grids, key=lambda grid: (grid[-1], -grid.size))
    return np.unique(longest)


def on_times(result: Result, name: str, times: np.ndarray) -> np.ndarray:
    """A variable (times, ...) at given times: of a jump what is behind it, NaN after the end."""
    own, values = result.time, result[name]
    if np.array_equal(own, times):
        return values
    kept = np.append(own[1:] > own[:-1], True)  # the last of each time
    own, values = own[kept], values[kept]
    columns = values.reshape(own.size, -1)
    found = np.stack([np.interp(times, own, column, right=np.nan) for column in columns.T], axis=1)
    return found.reshape(times.size, *values.shape[1:])


def _of_results(axes: Axes, values: Sequence[Any]) -> dict[str, Any]:
    """Every variable of the model, (axes..., time, ...)."""
    times = common_times(values)
    first: Result = next(v for v in values if v is not None)
    elements = {str(element) for names in first.arrays.values() for element in names.flat}
    found: dict[str, Any] = {}
    for name in (*first.arrays, *(n for n in first.names if n not in elements)):
        if name in axes.over and axes.label(name) == name:
            continue  # a parameter that varies is a coordinate
        shape = (times.size, *first[name].shape[1:])
        table = [np.full(shape, np.nan) if v is None else on_times(v, name, times) for v in values]
        inner = tuple(f"axis{k}_{n}" for k, n in enumerate(shape[1:]))
        attributes = {"units": first.unit(name), "long_name": first.description(name)}
        told = {key: text for key, text in attributes.items() if text}
        found[name] = ((*axes.names, "time", *inner), np.array(table).reshape(*axes.shape, *shape), told)
    return found


def _of_values(axes: Axes, values: Sequence[Any], title: str) -> dict[str, Any]:
    """What a function returned: numbers, arrays of one shape, or mappings of these."""
    first = next(v for v in values if v is not None)
    if not isinstance(first, Mapping):
        return {"value": _column(axes, values, title, "")}
    names = dict.fromkeys(name for value in values if value is not None for name in value)
    rows = {name: [None if v is None else v.get(name) for v in values] for name in names}
    return {str(name): _column(axes, column, title, f" '{name}'") for name, column in rows.items()}


def _column(axes: Axes, values: Sequence[Any], title: str, name: str) -> Any:
    try:
        arrays = [None if v is None else np.asarray(v, dtype=float) for v in values]
    except (TypeError, ValueError):
        kind = type(next(v for v in values if v is not None)).__name__
        raise ModelError(
            f"{title}: found values{name} of type {kind}, expected numbers, arrays of them or mappings; take .values"
        ) from None
    shapes = {a.shape for a in arrays if a is not None}
    if len(shapes) > 1:
        raise ModelError(
            f"{title}: found values{name} of shapes {sorted(shapes)}, expected one; take .values"
        )
    shape = shapes.pop()
    table = np.array([np.full(shape, np.nan) if a is None else a for a in arrays])
    inner = tuple(f"axis{k}_{n}" for k, n in enumerate(shape))
    return ((*axes.names, *inner), table.reshape(*axes.shape, *shape))


def _free(name: str, *taken: Mapping[str, Any]) -> str:
    """A name that nothing else has."""
    while any(name in names for names in taken):
        name += "_"
    return name


def _coordinates(axes: Axes, first: Result | None) -> dict[str, Any]:
    """The values along each axis: numbers by the name itself, vectors by "name values"; with units, if of a model."""
    found: dict[str, Any] = {}
    for name, values in axes.over.items():
        label = axes.label(name)
        axis = label if axes.combine == "grid" else CASE
        try:
            array = np.asarray(values, dtype=float)
        except (TypeError, ValueError):
            array = np.array([str(value) for value in values])
        known = (
            {"units": first.unit(name), "long_name": first.description(name)}
            if first and name in first
            else {}
        )
        told = {key: text for key, text in known.items() if text and array.dtype.kind == "f"}
        if array.ndim == 1:
            found[label] = (axis, array, told)
        else:
            inner = tuple(f"axis{k}_{n}" for k, n in enumerate(array.shape[1:]))
            found[f"{label} values"] = ((axis, *inner), array, told)
    if axes.combine == "zip" and axes.over:
        found[CASE] = (CASE, np.arange(axes.shape[0]))
    if axes.seeds is not None:
        found[SEED] = (SEED, np.array(axes.seeds))
    return found
