"""An answer of an optimisation, looked up by the model's own names: one just found, or one read from a file."""

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from gantrytau import ModelError, Result
from gantrytau.border.checks import instance
from gantrytau.describing.described import Description
from gantrytau.describing.record import Record
from gantrytau.language.self_description.appearance import Shape
from gantrytau.language.symbols import split_derivative
from gantrytau.results.display_units import Display
from gantrytau.results.series import ONE_NAME
from gantrytau_optimica.answers.described_answer import answer_described

if TYPE_CHECKING:
    import pandas
    import xarray

Signal = Callable[[Any], np.ndarray]


class Answer(Record, ABC):
    """`answer["robot.tool.r"]` is a variable over `time`, free numbers are floats, vectors of them arrays.

    A kind of answer says what stands below, and gives names, values and labels of its variables.
    """

    name: str
    objective: Any  # a float, with all integrals
    success: Any  # whether the solver met its tolerance
    status: Any  # how it ended, in words
    iterations: Any
    build_time: Any  # s
    solve_time: Any  # s
    free: Any  # numbers that were chosen, by name
    parameters: Any  # numbers of the model, by scalar name, the chosen ones included
    phases: Any  # name -> start_time, final_time, time and breaks in s; "" where there is only one

    @abstractmethod
    def report(self) -> str:
        """How it ended, and what remains violated or binds, in the model's words."""

    @abstractmethod
    def _elements(self, name: str) -> tuple[str, ...]:
        """Scalar names of a variable, derivative or parameter. Raises ModelError for unknown names."""

    @abstractmethod
    def _variables(self, path: str) -> list[str]:
        """Scalar names of the variables of a phase."""

    @abstractmethod
    def _labels(self) -> tuple[Mapping[str, str], Mapping[str, str]]:
        """Units and descriptions by name."""

    @abstractmethod
    def _rows(self, names: Sequence[str], path: str) -> Callable[[np.ndarray], np.ndarray]:
        """Scalars of a phase as a function of times (n,): (names, n). Raises ModelError for what is not known."""

    @property
    def labels(self) -> tuple[Mapping[str, str], Mapping[str, str]]:
        """Units and descriptions by name; a name that is left out has none."""
        return self._labels()

    @property
    def shapes(self) -> Sequence[Shape]:
        """What the components of the model look like; none of an answer that was read from a file."""
        return ()

    @property
    def displays(self) -> Mapping[str, str]:
        """The units in which variables are shown, where they are declared, by name."""
        return {}

    @property
    def _only(self) -> Any:
        if len(self.phases) > 1:
            names = ", ".join(f"'{name}'" for name in self.phases)
            raise ModelError(
                f"{self.name} has phases with times of their own; ask one of .phases[...]: {names}"
            )
        return next(iter(self.phases.values()))

    def path_of(self, element: str) -> str:
        """Name of the phase of a variable; a parameter is the same in all."""
        base = split_derivative(element)[0]
        return next((path for path in self.phases if base.startswith(f"{path}.")), next(iter(self.phases)))

    @property
    def start_time(self) -> float:
        """Start of the horizon in s; with phases, the earliest."""
        return min(phase.start_time for phase in self.phases.values())

    @property
    def final_time(self) -> float:
        """End of the horizon in s; with phases, the latest."""
        return max(phase.final_time for phase in self.phases.values())

    @property
    def time(self) -> np.ndarray:
        """The start and all collocation points in s."""
        return self._only.time

    @property
    def breaks(self) -> np.ndarray:
        """Times in s at which inputs may jump: the borders between elements."""
        return self._only.breaks

    def time_of(self, name: str) -> np.ndarray:
        """The times in s of a variable: those of its phase."""
        return self.phases[self.path_of(self._elements(name)[0])].time

    @property
    def result(self) -> Result:
        """All variables of the model over `time`, to plot and save."""
        self._only  # noqa: B018 - with phases there is none
        return next(iter(self.by_phase.values()))

    @cached_property
    def by_phase(self) -> dict[str, Result]:
        """All variables of every phase over its own time, by the name of the phase; "" where there is only one."""
        units, words = self._labels()
        found = {}
        for path, phase in self.phases.items():
            names = self._variables(path)
            rows = dict(zip(names, self._rows(names, path)(phase.time), strict=True))
            title = f"{self.name}.{path}" if path else self.name
            own: dict[str, Any] = dict(shapes=self.shapes, displays=self.displays)
            found[path] = Result(phase.time, rows, units=units, descriptions=words, title=title, **own)
        return found

    @cached_property
    def _whole(self) -> Result:
        """All variables over the times of all phases; outside of its phase a variable has no value, which is NaN."""
        if len(self.by_phase) == 1:
            return self.result
        times = np.unique(np.concatenate([result.time for result in self.by_phase.values()]))
        units, words = self._labels()
        rows = {n: self._over(n, times) for result in self.by_phase.values() for n in result.names}
        return Result(times, rows, units=units, descriptions=words, title=self.name, displays=self.displays)

    def _over(self, name: str, times: np.ndarray) -> np.ndarray:
        """A scalar at times (n,), NaN outside of its phase."""
        own = self.time_of(name)
        inside = (times >= own[0]) & (times <= own[-1])
        values = np.full(times.shape, np.nan)
        values[inside] = self.signal(name)(times[inside])
        return values

    @property
    def names(self) -> tuple[str, ...]:
        """All variables and free numbers; vectors, derivatives and parameters can be asked for as well."""
        return (*(n for result in self.by_phase.values() for n in result.names), *self.free)

    def __repr__(self) -> str:
        size = sum(phase.time.size for phase in self.phases.values())
        kind = type(self).__name__
        return f"<{kind} {self.name}: {self.status}, objective {self.objective:.8g}, {size} times>"

    def __describe__(self, name: str = "") -> Description:
        return answer_described(self, name)

    def __contains__(self, name: object) -> bool:
        return name in self.free or any(name in result for result in self.by_phase.values())

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __getitem__(self, name: str) -> Any:
        chosen = self._chosen(name)
        if chosen is not None:
            return chosen
        result = self.by_phase[self.path_of(self._elements(name)[0])]
        return result[name] if name in result else self.signal(name)(result.time)

    def _ipython_key_completions_(self) -> list[str]:
        return [
            *self.free,
            *(n for result in self.by_phase.values() for n in result._ipython_key_completions_()),
        ]

    def final(self, name: str) -> Any:
        """The value at the end of the horizon; of a free number its value."""
        chosen = self._chosen(name)
        return self[name][-1] if chosen is None else chosen

    def _chosen(self, name: str) -> Any:
        """A free number, or a vector of which some elements are free; else None."""
        if instance(self.name, "name", name, str, ONE_NAME) in self.free:
            return self.free[name]
        elements = self._elements(name)
        if not any(element in self.free for element in elements):
            return None
        return np.array([self.parameters[element] for element in elements]).reshape(
            _shape(elements), order="F"
        )

    def signal(self, name: str) -> Signal:
        """A variable or derivative as a vectorised function of time: (n,) -> (n,), (n, k) or (n, rows, columns), from
        the polynomials of the solution; between the collocation points they need not keep to limits.
        """
        elements = self._elements(name)
        whole, rows = elements != (name,), self._rows(elements, self.path_of(elements[0]))

        def value(times: Any) -> np.ndarray:
            times = np.asarray(times, dtype=float)
            values = rows(np.atleast_1d(times))
            found = values.T.reshape(times.size, *_shape(elements), order="F") if whole else values[0]
            return found if times.ndim else found[0]

        return value

    def plot(self, *names: str, file: Any = None, display: Display = None):
        """Variables over time, as Result.plot, those of a phase over its own; derivatives and free numbers, too."""
        result, (units, words) = self._whole, self._labels()
        more = [n for name in names for n in self._elements(name) if n not in result and n != "time"]
        if more:
            values = {n: result[n] for n in result.names} | {n: self._drawn(n, result.time) for n in more}
            own: dict[str, Any] = dict(title=result.title, displays=self.displays)
            result = Result(result.time, values, units=units, descriptions=words, **own)
        return result.plot(*names, file=file, display=display)

    def _drawn(self, name: str, times: np.ndarray) -> Any:
        try:
            return self[name] if name in self.free else self._over(name, times)
        except ModelError as error:  # of derivatives that the problem does not hold
            raise ModelError(
                f"{name}: the equations do not determine this derivative; draw '{split_derivative(name)[0]}'"
            ) from error

    def to_pandas(self, *names: str, display: Display = None) -> "pandas.DataFrame":
        """All variables over time, or those named, as Result.to_pandas; outside of its phase a variable is NaN."""
        return self._whole.to_pandas(*names, display=display)

    def to_xarray(self) -> "xarray.Dataset":
        """All variables over time, as Result.to_xarray; outside of its phase a variable is NaN."""
        return self._whole.to_xarray()

    def save(self, path: Any, *, display: Display = None):
        """Save all variables over time, as Result.save; outside of its phase a variable is NaN."""
        return self._whole.save(path, display=display)


def _shape(elements: Sequence[str]) -> tuple[int, ...]:
    """The shape of a quantity, by the names of its elements, column after column."""
    last = re.search(r"\[(\d+),(\d+)\]\)*$", elements[-1])
    return (int(last[1]) + 1, int(last[2]) + 1) if last else (len(elements),)
