"""What a study found: the result of every case by what was chosen, those that failed, an array of all, a picture."""

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau.describing.record import Record
from gantrytau.ensembles.case_table import case_table
from gantrytau.ensembles.cases import SEED, Axes, Case, FailedCase, equal, spoken
from gantrytau.ensembles.ensemble_plot import draw_fan
from gantrytau.ensembles.labelled_array import labelled
from gantrytau.ensembles.workers.worker import Outcome
from gantrytau.results.display_units import Display
from gantrytau.results.files import extra_module
from gantrytau.results.result import Result
from gantrytau.whole_files import replacing

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False, repr=False)
class Study(Record):
    """All cases of a study and what came of them.

    title: of the model or function; axes: what varies; cases: in their order, the seed fastest; outcomes: by the number of
    their case; one that is missing was not finished.
    """

    title: str
    axes: Axes
    cases: tuple[Case, ...]
    outcomes: Mapping[int, Outcome]

    def __len__(self) -> int:
        return len(self.cases)

    def __iter__(self) -> Iterator[tuple[Case, Any]]:
        """Cases that have a result, with it."""
        return ((c, self.outcomes[c.number].value) for c in self.cases if self._good(c))

    def __repr__(self) -> str:
        names = " x ".join(f"{n} ({k})" for n, k in zip(self.axes.names, self.axes.shape, strict=True))
        failed, left = len(self.failures), len(self.cases) - len(self.outcomes)
        more = f", {failed} failed" if failed else ""
        more += f", {left} not finished" if left else ""
        return f"<Study {self.title}: {len(self)} cases over {names}{more}>"

    @property
    def values(self) -> tuple[Any, ...]:
        """What each case gave, in the order of `cases`; None where it failed."""
        return tuple(self.outcomes[c.number].value if self._good(c) else None for c in self.cases)

    @property
    def failures(self) -> tuple[FailedCase, ...]:
        """The cases that failed, with the words and the class of their errors."""
        found = (self.outcomes.get(c.number) for c in self.cases)
        return tuple(FailedCase(self.cases[o.number], o.error, o.kind) for o in found if o and not o.good)

    def result(self, **chosen: Any) -> Any:
        """The result of the one case with these values, as result(m=2.0, seed=3) or result(**{"body.m": 2.0}).

        Names that are left out may be those with one value only. Raises ModelError for unknown names, values that are none
        of the study, several cases, and a case that failed, whose error it tells.
        """
        case = self._case(chosen)
        outcome = self.outcomes.get(case.number)
        if outcome is None:
            raise ModelError(f"{self.title}: {case} was not finished; call study again with its folder=")
        if not outcome.good:
            raise ModelError(f"{self.title}: {case} failed: {outcome.kind}: {outcome.error}")
        return outcome.value

    def to_xarray(self) -> "xarray.Dataset":
        """All results as one dataset: an axis for each varied name, "seed", and time; units as attributes.

        Of a model: on the times of the first case, on which others are interpolated if theirs differ; NaN where a case
        failed and after its end. Of a function: its values as "value", numbers or arrays of one shape, or by name where it
        returns mappings. With combine="zip" there is one axis, "case", along which names have coordinates. Where some case
        has no result, the coordinate "failure" says why, "" for all others.
        """
        return labelled(self.axes, self.cases, self.values, self.title, self._unfinished)

    def to_pandas(self, *names: str) -> "pandas.DataFrame":
        """The cases as a table: a row for each, columns of what varies, "seed", and "failure", "" where there is a result.

        names: scalars and vectors of a model, whose last values stand in columns of their own; of a function that returns
        mappings some of their keys, by default all; NaN where a case has no result. `frame.attrs["units"]` by name.
        Raises ModelError for unknown names, GantryTauError without pandas (extra `results`).
        """
        return case_table(self.axes, self.cases, self.values, self._unfinished, names)

    @property
    def _unfinished(self) -> dict[int, str]:
        """What came of cases without a result, by number."""
        found = {case.number: "not finished" for case in self.cases if case.number not in self.outcomes}
        return found | {failed.case.number: f"{failed.kind}: {failed.message}" for failed in self.failures}

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write `to_xarray()` as netCDF, .nc; an existing file is replaced only when the new one is complete."""
        path = Path(path)
        if path.suffix != ".nc":
            raise ModelError(
                f"{path}: found the suffix '{path.suffix}', expected .nc; name it {path.stem}.nc"
            )
        for module in ("h5netcdf", "h5py"):
            extra_module(module)
        table = self.to_xarray()
        with replacing(path) as partial:
            table.to_netcdf(partial, engine="h5netcdf")
        return path

    def plot(
        self, *names: str, file: str | os.PathLike[str] | None = None, display: Display = None
    ) -> "Figure":
        """Draw variables of all cases over time: a line for each, or the middle and bands that hold 50 and 90 % of many.

        names: scalars or vectors. file: also save the figure there, in the format that its suffix names. display: units, as
        of `Result.plot`.
        """
        return draw_fan(self._results(), names, file, self.title, display)

    def _results(self) -> list[tuple[Case, Result]]:
        found = [(case, value) for case, value in self if isinstance(value, Result)]
        if not found:
            raise ModelError(f"{self.title}: found no result to draw, expected those of a model over time")
        return found

    def _good(self, case: Case) -> bool:
        outcome = self.outcomes.get(case.number)
        return outcome is not None and outcome.good

    def _case(self, chosen: Mapping[str, Any]) -> Case:
        names = (*self.axes.over, *((SEED,) if self.axes.seeds is not None else ()))
        left: tuple[Case, ...] = self.cases
        for name, value in chosen.items():
            if name not in names:
                raise ModelError(
                    f"{self.title}: nothing varies by the name '{name}'{did_you_mean(name, names)}"
                )
            left = tuple(c for c in left if equal(c.names[name], value))
            if not left:
                values: Sequence[Any] | None = self.axes.seeds if name == SEED else self.axes.over[name]
                there = ", ".join(spoken(v) for v in (values or ())[:12])
                raise ModelError(
                    f"{self.title}: found {name}={spoken(value)}"
                    + (f" with {', '.join(n for n in chosen if n != name)}" if len(chosen) > 1 else "")
                    + f", expected a value of the study; there is {there}"
                )
        if len(left) > 1:
            missing = [n for n in names if n not in chosen]
            more = f"say {', '.join(missing)} too" if missing else "they are in .cases and .values"
            raise ModelError(f"{self.title}: {len(left)} cases have these values; {more}")
        return next(iter(left))
