"""A result that was saved before, read again: where the search for an optimum starts, or a motion to be seen."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gantrytau.commands.printing.reporting import CommandError

if TYPE_CHECKING:
    from gantrytau import Result

FORMATS = (".csv", ".nc")


def read_result(file: Path, option: str = "--guess") -> "Result":
    """The variables of a CSV or netCDF file as `Result.save` writes it; CommandError naming the option for another."""
    from gantrytau import ModelError, Result

    if file.suffix.lower() not in FORMATS:
        raise CommandError(
            f"{option} {file}: found the suffix '{file.suffix}', expected a result saved as {' or '.join(FORMATS)}"
        )
    if not file.is_file():
        raise CommandError(f"{option} {file}: there is no such file; check its path")
    try:
        values = _columns(file) if file.suffix.lower() == ".csv" else _netcdf(file, option)
        time = values.pop("time")
        if time.size < 2 or not np.ptp(time) > 0:
            raise CommandError(f"{option} {file}: found {time.size} times, expected a motion over some time")
        return Result(time, values, title=file.name)
    except KeyError as error:
        raise CommandError(f"{option} {file}: found no {error}, expected a result over time") from error
    except (OSError, ValueError, ModelError) as error:
        raise CommandError(f"{option} {file}: cannot be read as a result ({error})") from error


def _columns(file: Path) -> dict[str, Any]:
    """Column by name, without its unit, in SI."""
    from gantrytau import Columns

    table = Columns.read(file)
    return {name: table.column(name) for name in table.names}


def _netcdf(file: Path, option: str) -> dict[str, Any]:
    """Scalar by name; vectors and matrices are written whole."""
    try:
        import h5netcdf  # noqa: F401 - xarray would tell of an unknown engine
        import xarray

        with xarray.open_dataset(file, engine="h5netcdf") as opened:
            values = {str(name): np.asarray(array.values, float) for name, array in opened.variables.items()}
    except ImportError as error:
        raise CommandError(
            f"{option} {file}: netCDF needs what is not installed; pip install 'gantrytau[results]'"
        ) from error
    return dict(pair for name, array in values.items() for pair in _scalars(name, array))


def _scalars(name: str, array: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """The elements of a vector or matrix over time, (times, ...), by the names that the model has for them."""
    inside = name.rstrip(")")  # der(r) has the elements der(r[0]), der(r[1]), ...
    for index in np.ndindex(*array.shape[1:]):
        place = f"[{','.join(map(str, index))}]" if index else ""
        yield f"{inside}{place}{name[len(inside) :]}", array[(slice(None), *index)]
