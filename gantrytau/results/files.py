"""Results on file: CSV, netCDF, Parquet and the trajectory format of Dymola."""

import csv
import importlib
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gantrytau.border.refusal import GantryTauError, Given, ModelError, did_you_mean
from gantrytau.results.display_units import SI, Display, Shown, shown_units
from gantrytau.results.series import Series
from gantrytau.whole_files import replacing

if TYPE_CHECKING:
    import xarray


def save(result: Series, path: str | os.PathLike[str], display: Display = None) -> Path:
    """Write a result in the format that the suffix of `path` names; see `Result.save`."""
    path = Path(path)
    writer = _WRITERS.get(path.suffix.lower())
    if writer is None:
        raise ModelError(
            f"found the suffix '{path.suffix}', expected one of {', '.join(_WRITERS)}"
            + did_you_mean(path.suffix.lower(), _WRITERS).partition("; there is")[0],
            place=str(path),
        )
    if writer is _write_csv:
        shown = shown_units(result, ("time", *result.names), display, SI, "save")
        with replacing(path) as partial:
            _write_csv(result, partial, shown)
        return path
    if display not in (None, SI):
        words = f"expected none: '{path.suffix}' holds SI, and the units beside the numbers; leave it out, or save a .csv"
        raise ModelError(words, place=f"{path}: save", found=Given("display", display))
    with replacing(path) as partial:
        writer(result, partial)
    return path


def dataset(result: Series) -> "xarray.Dataset":
    """A result as xarray's Dataset: coordinate `time`, vectors and matrices whole, units as attributes."""
    xarray = extra_module("xarray")
    elements = {str(element) for names in result.arrays.values() for element in names.flat}
    variables = {}
    for name in (*result.arrays, *(name for name in result.names if name not in elements)):
        values = result[name]
        dimensions = ("time", *(f"axis{k}_{n}" for k, n in enumerate(values.shape[1:])))
        variables[name] = (dimensions, values, _attributes(result, name))
    time = ("time", result.time, {"units": "s", "long_name": "time"})
    return xarray.Dataset(variables, coords={"time": time}, attrs={"title": result.title})


def _attributes(result: Series, name: str) -> dict[str, str]:
    """The CF attributes of a variable, without empty ones."""
    attributes = {"units": result.unit(name), "long_name": result.description(name)}
    return {key: text for key, text in attributes.items() if text}


def _write_csv(result: Series, path: Path, shown: Mapping[str, Shown] | None = None) -> None:
    names = ("time", *result.names)
    shown = shown or shown_units(result, names, None, SI, "save")
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(shown[name].heading(name) for name in names)
        writer.writerows(np.column_stack([shown[name].of(result[name]) for name in names]).tolist())


def _write_netcdf(result: Series, path: Path) -> None:
    extra_module("h5netcdf")
    extra_module("h5py")
    dataset(result).to_netcdf(path, engine="h5netcdf")


def _write_parquet(result: Series, path: Path) -> None:
    arrow, parquet = extra_module("pyarrow"), extra_module("pyarrow.parquet")
    names = ("time", *result.names)
    fields = [arrow.field(name, arrow.float64(), metadata=_attributes(result, name)) for name in names]
    schema = arrow.schema(fields, metadata={"title": result.title})
    parquet.write_table(arrow.table([result[name] for name in names], schema=schema), path)


def _write_dymola(result: Series, path: Path) -> None:
    """Dymola's trajectory 1.1, transposed ("binTrans"), as a MATLAB file of version 4.

    name, description: one column of letters for each variable, the abscissa Time first.
    data_1: constants, (1 + constants, 2), at the first and the last time; data_2: (1 + others, times).
    dataInfo: for each variable 1 or 2 for the matrix, its row there from 1 with the sign of an alias, 0 for
    linear interpolation, -1 for no extrapolation.
    """
    from scipy.io import savemat

    # readers take every entry of row 1 for the abscissa: what equals the time has a row of its own
    aliases = {name: to for name, to in result.aliases.items() if to.removeprefix("-") != "time"}
    rows = {1: [result.time[[0, -1]]], 2: [result.time]}
    places: dict[str, tuple[int, int]] = {}
    for name in (name for name in result.names if name not in aliases):
        values = result[name]
        matrix = 1 if np.all(values == values[0]) else 2
        rows[matrix].append(values[[0, -1]] if matrix == 1 else values)
        places[name] = (matrix, len(rows[matrix]))
    info = [(0, 1, 0, -1)]
    for name in result.names:
        target = aliases.get(name, name)
        matrix, row = places[target.removeprefix("-")]
        info.append((matrix, -row if target.startswith("-") else row, 0, -1))
    content = {
        "Aclass": np.array(["Atrajectory", "1.1", result.title or " ", "binTrans"]),
        "name": _columns_of_letters(["Time", *result.names]),
        "description": _columns_of_letters(["time [s]", *(_dymola_text(result, n) for n in result.names)]),
        "dataInfo": np.array(info, dtype=np.int32).T,
        "data_1": np.array(rows[1]),
        "data_2": np.array(rows[2]),
    }
    savemat(path, content, format="4", appendmat=False)


def _dymola_text(result: Series, name: str) -> str:
    """The description of a variable with its unit in brackets, as Dymola writes it."""
    unit = result.unit(name)
    return f"{result.description(name)} [{unit}]".strip() if unit else result.description(name)


def _columns_of_letters(texts: list[str]) -> np.ndarray:
    """The texts as columns of a matrix of letters; row k holds the k-th letter of each, Latin-1 only."""
    width = max(1, *(len(text) for text in texts))
    padded = [text.encode("latin-1", "replace").decode("latin-1").ljust(width) for text in texts]
    return np.array(["".join(letters) for letters in zip(*padded, strict=True)])


def extra_module(module: str) -> Any:
    """A module of the extra `results`; GantryTauError that says how to install it where it is missing."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise GantryTauError(
            f"{module}: not installed, but what was asked for needs it; pip install 'gantrytau[results]'"
        ) from error


_WRITERS: dict[str, Callable[[Series, Path], None]] = {
    ".csv": _write_csv,
    ".nc": _write_netcdf,
    ".parquet": _write_parquet,
    ".mat": _write_dymola,
}
