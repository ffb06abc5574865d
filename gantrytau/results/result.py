"""What a simulation or an optimisation found: every variable of the model by name, over time, drawn and saved."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Self

from gantrytau.border.refusal import ModelError
from gantrytau.describing.described import Description
from gantrytau.results.data_frames import data_frame
from gantrytau.results.described_result import series_described
from gantrytau.results.display_units import DECLARED, Display, shown_units
from gantrytau.results.figures import draw
from gantrytau.results.files import dataset, save
from gantrytau.results.run_statistics import RunStatistics
from gantrytau.results.series import Series, Values

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.figure import Figure


class Result(Series):
    """The variables of a model at the output times of a simulation or an optimum, see `Series`, with figures and files."""

    _statistics: RunStatistics | None = None

    def __describe__(self, name: str = "") -> Description:
        return series_described(self, name)

    def _repr_html_(self) -> str:
        return self.__describe__().html()

    @property
    def statistics(self) -> RunStatistics:
        """What the simulation took: steps, events by condition, seconds, and the states that limit its step. ModelError if
        this is no result of `simulate`.
        """
        if self._statistics is None:
            raise ModelError(
                f"{self.title or 'Result'}: found no statistics, expected the result of simulate; those of optima and files "
                "have none"
            )
        return self._statistics.of(self)

    def with_statistics(self, found: RunStatistics) -> Self:
        """This result with what its simulation took."""
        self._statistics = found
        return self

    def plot(
        self, *names: str, file: str | os.PathLike[str] | None = None, display: Display = None
    ) -> "Figure":
        """Draw variables over time, one axis for each unit, and return the figure.

        names: scalars or vectors; none means all, if they are few.
        file: also save the figure there, in the format that its suffix names.
        display: units to draw them in, in place of those of their declarations: "deg" for all that it measures,
        {"crank.phi": "deg", "m": "mm", "time": "ms"} by name or by the unit that it replaces, or "SI". Raises ModelError for
        a unit that measures something else.
        """
        return draw(self, names, file, display)

    def shown(self, *names: str, display: Display = None) -> dict[str, tuple[Values, str]]:
        """Values and unit of variables, as figures and tables show them; display: as of `plot`."""
        found = shown_units(self, names, display, DECLARED, "shown")
        return {name: (found[name].of(self[name]), found[name].unit) for name in names}

    def save(self, path: str | os.PathLike[str], *, display: Display = None) -> Path:
        """Write all variables to a file and return its path; the suffix chooses the format.

        .csv: a column for each scalar, the header `name [unit]`, numbers that read back exactly; in SI, or with display=
        in other units, as `plot` takes them, or "declared", which readers bring back to SI;
        .nc: netCDF with units, vectors whole; .parquet: a column for each scalar, its unit as metadata;
        .mat: a trajectory of Dymola (and OpenModelica), read by their tools.
        An existing file is replaced only when the new one is complete.
        """
        return save(self, path, display)

    def to_pandas(self, *names: str, display: Display = None) -> "pandas.DataFrame":
        """The variables as a table: a row for each time, which is the index, a column for each scalar, `tool.r[0]`.

        names: scalars, vectors, or none for all. display: units, as `plot` takes them, in place of SI. `frame.attrs` has
        "units" and "descriptions" by name, "title", "ended", and "modes", the names of the values of modes. Where something
        jumps a time stands twice. Raises ModelError for unknown names, GantryTauError without pandas (extra `results`).
        """
        return data_frame(self, names, display)

    def to_xarray(self) -> "xarray.Dataset":
        """The variables as a dataset with the coordinate `time`, vectors whole, units as attributes."""
        return dataset(self)
