"""A result that was saved before, read again: where the search for an optimum starts, or what is to be seen."""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gantrytau.commands.printing.reporting import CommandError

if TYPE_CHECKING:
    from gantrytau import Result

_MODES = re.compile(r": (0 \w+(?:, \d+ \w+)+)$")  # of a description, as Mode writes it
TEXT = 24  # bytes of a number in a CSV file


@dataclass
class _Saved:
    """What a file holds of a result by name. wanted: variables, and components, that are read, all if none."""

    option: str
    wanted: Sequence[str]
    most: float
    values: dict[str, Any] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    words: dict[str, str] = field(default_factory=dict)
    displays: dict[str, str] = field(default_factory=dict)
    known: list[str] = field(default_factory=list)

    def reads(self, name: str) -> bool:
        """Whether a name is wanted: itself, its vector, or a component around it; a derivative counts as its variable."""
        self.known.append(name)
        if not self.wanted or name == "time":
            return True
        plain = name.rstrip(")").rpartition("der(")[2]
        return any(
            one in (name, plain) or plain.startswith((f"{one}.", f"{one}[")) or one.startswith(f"{name}[")
            for one in self.wanted
        )

    def told(self, name: str, unit: str, words: str) -> None:
        """Say the unit and the description of a variable."""
        self.units |= {name: unit} if unit else {}
        self.words |= {name: words} if words else {}

    def check_size(self, numbers: float, remedy: str = "choose variables, --names tool.r,carts[0]") -> None:
        """CommandError, before they are read, for more numbers than a memory should hold."""
        if numbers > self.most:
            size, most = (f"{8e-6 * count:,.0f} MB" for count in (numbers, self.most))
            raise CommandError(f"{self.option}: found {size} of numbers, expected at most {most}; {remedy}")


def read_result(
    file: Path, option: str = "--guess", wanted: Sequence[str] = (), most: float = np.inf
) -> "Result":
    """The variables of a file as `Result.save` writes it, with units and descriptions where the format has them.

    wanted: variables and components that are read, all if none; most: numbers that may be read. CommandError naming the
    option for what cannot be read.
    """
    from gantrytau import ModelError, Result, did_you_mean

    place = f"{option} {file}".strip()
    reader = FORMATS.get(file.suffix.lower())
    if reader is None:
        raise CommandError(
            f"{place}: found the suffix '{file.suffix}', expected a result saved as {_OFFERED}"
        )
    if not file.is_file():
        raise CommandError(f"{place}: there is no such file; check its path")
    saved = _Saved(place, wanted, most)
    try:
        reader(file, saved)
        time = saved.values.pop("time")
        if time.size < 2 or not np.ptp(time) > 0:
            raise CommandError(f"{place}: found {time.size} times, expected a motion over some time")
        if wanted and not saved.values:
            near = "".join(did_you_mean(name, saved.known) for name in wanted[:1])
            raise CommandError(f"--names {','.join(wanted)}: found none of them in {file}{near}")
        modes = {name: _modes(words) for name, words in saved.words.items() if _MODES.search(words)}
        return Result(
            time,
            saved.values,
            units=saved.units,
            descriptions=saved.words,
            title=file.name,
            modes=modes,
            held=modes,
            displays=saved.displays,
        )
    except KeyError as error:
        raise CommandError(f"{place}: found no {error}, expected a result over time") from error
    except ImportError as error:
        raise CommandError(
            f"{place}: {file.suffix} needs what is not installed; pip install 'gantrytau[results]'"
        ) from error
    except (OSError, ValueError, ModelError) as error:
        raise CommandError(f"{place}: cannot be read as a result ({error})") from error


def _modes(words: str) -> list[str]:
    found = _MODES.search(words)
    return [one.split()[1] for one in found[1].split(", ")] if found else []


def _csv(file: Path, saved: _Saved) -> None:
    from gantrytau import Columns

    saved.check_size(file.stat().st_size / TEXT, "save it as .nc, and choose variables")
    table = Columns.read(file)
    for name in filter(saved.reads, table.names):
        saved.values[name] = table.column(name)
        saved.told(name, table.si_unit(name), "")
        saved.displays[name] = table.unit(name) or ""


def _parquet(file: Path, saved: _Saved) -> None:
    import pyarrow.parquet as parquet

    with parquet.ParquetFile(file) as opened:
        names = [name for name in opened.schema_arrow.names if saved.reads(name)]
        saved.check_size(opened.metadata.num_rows * len(names))
        table = opened.read(columns=names)
        for name in names:
            saved.values[name] = np.asarray(table.column(name).to_numpy(), float)
            said = table.schema.field(name).metadata or {}
            saved.told(name, said.get(b"units", b"").decode(), said.get(b"long_name", b"").decode())


def _netcdf(file: Path, saved: _Saved) -> None:
    """Vectors and matrices are written whole."""
    import h5netcdf  # noqa: F401 - xarray would tell of an unknown engine
    import xarray

    with xarray.open_dataset(file, engine="h5netcdf") as opened:
        kept = {str(name): array for name, array in opened.variables.items() if saved.reads(str(name))}
        saved.check_size(sum(array.size for array in kept.values()))
        for name, array in kept.items():
            saved.told(name, array.attrs.get("units", ""), array.attrs.get("long_name", ""))
            saved.values.update(_scalars(name, np.asarray(array.values, float)))


def _dymola(file: Path, saved: _Saved) -> None:
    """A trajectory 1.1 of Dymola or OpenModelica: data_1 has constants, data_2 signals, dataInfo says where each name is."""
    from scipy.io import loadmat

    saved.check_size(file.stat().st_size / 8, "save fewer variables")
    try:
        found = loadmat(file, chars_as_strings=False)
    except Exception as error:  # of the versions of MATLAB's files, each has a reader with errors of its own
        raise ValueError(str(error)) from error
    across = "binTrans" in _texts(found["Aclass"], False)
    names, words = (_texts(found[key], across) for key in ("name", "description"))
    info, held = (found[key] if across else found[key].T for key in ("dataInfo", "data_1"))
    moving = found["data_2"] if across else found["data_2"].T
    for name, said, (matrix, row, *_) in zip(names, words, info.T.tolist(), strict=True):
        name = "time" if name.lower() == "time" else name
        if saved.reads(name):
            signal = held[abs(row) - 1][0] if matrix == 1 else moving[abs(row) - 1]
            saved.values[name] = np.sign(row) * signal
            text, _, unit = said.rpartition(" [") if said.endswith("]") else (said, "", "")
            saved.told(name, unit.rstrip("]").partition("|")[0], text)


def _texts(letters: np.ndarray, across: bool) -> list[str]:
    """Texts of a matrix of letters, a column each where they stand across, else a row."""
    rows = letters.T if across else letters
    return ["".join(row.tolist()).rstrip("\0 ") for row in rows]


def _scalars(name: str, array: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """The elements of a vector or matrix over time, (times, ...), by the names that the model has for them."""
    inside = name.rstrip(")")  # der(r) has the elements der(r[0]), der(r[1]), ...
    for index in np.ndindex(*array.shape[1:]):
        place = f"[{','.join(map(str, index))}]" if index else ""
        yield f"{inside}{place}{name[len(inside) :]}", array[(slice(None), *index)]


FORMATS: dict[str, Callable[[Path, _Saved], None]] = {
    ".csv": _csv,
    ".nc": _netcdf,
    ".parquet": _parquet,
    ".mat": _dymola,
}
*_FIRST, _LAST = FORMATS
_OFFERED = f"{', '.join(_FIRST)} or {_LAST}"
