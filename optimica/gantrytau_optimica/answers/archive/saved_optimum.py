"""An optimum read from its file: it answers like the one that was saved, without the model."""

import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from gantrytau import Dae, ModelError, Result
from gantrytau.errors import did_you_mean
from gantrytau.language.symbols import derivative_name, split_derivative
from gantrytau_optimica.control.guesses import Stretched, derivative_symbol
from gantrytau_optimica.transcription.layout import Track, lagrange
from gantrytau_optimica.transcription.mesh import Mesh

Sparse = Any  # a matrix of scipy.sparse
NEAR = 1e-9  # of an element, within which a time stands for a node: its value is taken, not a polynomial's


class MissingGuess(UserWarning):
    """A saved solution given as guess lacks variables of the problem; these start from their default guess."""


@dataclass(frozen=True, eq=False)
class SavedPhase:
    """One phase: `signals` are its states, algebraics and inputs, polynomials of the elements.

    time: (times,) in s, the start, all collocation points and the end; borders: of elements, shares of the horizon;
    tracks: nodes and unknowns w of each signal; names: variables and their derivatives, of which `affine` are
    coefficients @ signals + offsets, and `others` have values `grid` (others, elements, nodes) at the places `nodes` of
    the elements.
    """

    name: str
    start_time: float
    final_time: float
    time: np.ndarray
    borders: np.ndarray
    states: tuple[str, ...]
    algebraics: tuple[str, ...]
    inputs: tuple[str, ...]
    tracks: tuple[Track, ...]
    w: np.ndarray
    names: tuple[str, ...]
    affine: tuple[str, ...]
    coefficients: Sparse
    offsets: np.ndarray
    others: tuple[str, ...]
    nodes: np.ndarray
    grid: np.ndarray

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of states, algebraics and inputs."""
        return (*self.states, *self.algebraics, *self.inputs)

    @cached_property
    def mesh(self) -> Mesh:
        """The elements."""
        return Mesh(self.borders)

    @property
    def breaks(self) -> np.ndarray:
        """Times in s at which inputs may jump: the borders between elements."""
        return self.times(self.borders[1:-1])

    @cached_property
    def rows(self) -> dict[str, int]:
        """Where a variable stands: first the affine, then the others."""
        return {name: i for i, name in enumerate((*self.affine, *self.others))}

    def times(self, shares: np.ndarray) -> np.ndarray:
        """Shares of the horizon as times in s."""
        return self.start_time + (self.final_time - self.start_time) * shares

    def values(self, names: Sequence[str], times: np.ndarray) -> np.ndarray:
        """Variables at times (n,) in s: (names, n). A time on a border belongs to the element before it."""
        span = self.final_time - self.start_time
        element, place = self.mesh.locate((times - self.start_time) / span)
        return np.array([self._row(self.rows[name], element, place) for name in names]).reshape(
            -1, times.size
        )

    def at(self, name: str, shares: np.ndarray) -> np.ndarray:
        """One variable at shares of the horizon."""
        return self._row(self.rows[name], *self.mesh.locate(shares))

    def _row(self, row: int, element: np.ndarray, place: np.ndarray) -> np.ndarray:
        if row < len(self.affine):
            factors = self.coefficients[[row]]
            parts = [
                c * self.tracks[i].values(self.w, element, place)
                for i, c in zip(factors.indices, factors.data, strict=True)
            ]
            return sum(parts, np.full(element.shape, self.offsets[row]))
        near = np.abs(place[:, None] - self.nodes) < NEAR
        place = np.where(near.any(axis=1), self.nodes[near.argmax(axis=1)], place)
        weights = lagrange(np.tile(self.nodes, (place.size, 1)), place)
        values = self.grid[row - len(self.affine), element]
        return np.sum(np.where(weights == 0.0, 0.0, weights * values), axis=1)


@dataclass(frozen=True, eq=False)
class _Course(Stretched):
    """A variable over shares of its horizon, as a first guess."""

    phase: SavedPhase
    name: str

    def at(self, fraction: np.ndarray) -> np.ndarray:
        return self.phase.at(self.name, np.atleast_1d(fraction))


@dataclass(frozen=True, eq=False)
class SavedOptimum:
    """What `load_optimum` read. It answers as an Optimum: `["name"]`, `.signal(name)`, `.time`, `.free`, `.report()`.

    States, algebraics, inputs and sums of them are exactly the polynomials that were found; other variables are
    exact at the collocation points, the ends of the elements and midway between them, and polynomials through these
    values elsewhere, which smooths what is steeper than an element, such as friction where a motion turns.
    As `guess=` of another problem, it gives what has the same name there. parameters: values by scalar name;
    versions: of what computed it; hashes: of the equations and of the problem (see run_record); times of work in s.
    """

    name: str
    scheme: str
    points: int
    objective: float
    success: bool
    status: str
    iterations: int
    build_time: float
    solve_time: float
    text: str
    free: Mapping[str, float]
    parameters: Mapping[str, float]
    units: Mapping[str, str]
    descriptions: Mapping[str, str]
    vectors: Mapping[str, tuple[str, ...]]
    versions: Mapping[str, str]
    hashes: Mapping[str, str]
    phases: Mapping[str, SavedPhase]
    multipliers: np.ndarray
    bound_multipliers: np.ndarray

    @property
    def _only(self) -> SavedPhase:
        if len(self.phases) > 1:
            names = ", ".join(f"'{name}'" for name in self.phases)
            raise ModelError(
                f"{self.name} has phases with times of their own; ask one of .phases[...]: {names}"
            )
        return next(iter(self.phases.values()))

    @property
    def start_time(self) -> float:
        """Start of the horizon in s; with phases, of the first."""
        return next(iter(self.phases.values())).start_time

    @property
    def final_time(self) -> float:
        """End of the horizon in s; with phases, of the last."""
        return list(self.phases.values())[-1].final_time

    @property
    def time(self) -> np.ndarray:
        """The start and all collocation points in s."""
        return self._only.time

    @property
    def breaks(self) -> np.ndarray:
        """Times in s at which inputs may jump: the borders between elements."""
        return self._only.breaks

    @property
    def result(self) -> Result:
        """All variables over `time`, to plot and save."""
        return self._results[self._only.name]

    @cached_property
    def _results(self) -> dict[str, Result]:
        found = {}
        for path, phase in self.phases.items():
            names = [n for n in phase.names if not split_derivative(n)[1]]
            rows = dict(zip(names, phase.values(names, phase.time), strict=True))
            title = f"{self.name}.{path}" if path else self.name
            found[path] = Result(
                phase.time, rows, units=self.units, descriptions=self.descriptions, title=title
            )
        return found

    @property
    def names(self) -> tuple[str, ...]:
        """All variables and free numbers; derivatives and parameters can be asked for as well."""
        return (*(n for result in self._results.values() for n in result.names), *self.free)

    def __repr__(self) -> str:
        size = sum(phase.time.size for phase in self.phases.values())
        return f"<SavedOptimum {self.name}: {self.status}, objective {self.objective:.8g}, {size} times>"

    def __contains__(self, name: object) -> bool:
        return name in self.free or any(name in result for result in self._results.values())

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __getitem__(self, name: str) -> Any:
        if name in self.free:
            return self.free[name]
        elements = self._expand(name)
        phase = self._phase(elements[0])
        result = self._results[phase.name if phase else next(iter(self.phases))]
        return result[name] if name in result else self.signal(name)(result.time)

    def final(self, name: str) -> Any:
        """The value at the end of the horizon."""
        return self[name][-1]

    def signal(self, name: str):
        """A variable or derivative as a vectorised function of time in s: (n,) -> (n,) or (n, k)."""
        elements = self._expand(name)
        phase = self._phase(elements[0])

        def value(times: Any) -> np.ndarray:
            times = np.asarray(times, dtype=float)
            flat = np.atleast_1d(times)
            if name == "time":
                rows = flat[None, :]
            elif phase is None:
                rows = np.repeat([[self.parameters[n]] for n in elements], flat.size, axis=1)
            else:
                rows = phase.values(elements, flat)
            found = rows[0] if elements == (name,) else rows.T
            return found if times.ndim else found[0]

        return value

    def plot(self, *names: str, file: Any = None):
        """Variables over time, as Result.plot."""
        return self.result.plot(*names, file=file)

    def report(self) -> str:
        """How it ended, and what remained violated or bound, in the model's words."""
        return self.text

    def guesses(self, dae: Dae) -> dict[str, Any]:
        """First guesses by name for a model: variables over shares of their horizon, and free numbers.

        Variables of the model that are missing here start from their default guess; MissingGuess names them.
        Raises ModelError if not one is here.
        """
        home = {n: phase for phase in self.phases.values() for n in phase.names if not split_derivative(n)[1]}
        found: dict[str, Any] = {n: _Course(home[n], n) for n in dae.variables if n in home}
        if not found:
            raise ModelError(
                f"guess: the saved {self.name} has none of the variables of {dae.name}; give a solution of a model with "
                "the same names"
            )
        symbols = {target[0] for n in found if (target := derivative_symbol(dae, n)) is not None}
        wanted = {n: derivative_symbol(dae, n) for n in (*dae.states, *dae.inputs)}
        missing = [n for n, target in wanted.items() if target is not None and target[0] not in symbols]
        if missing:
            some = ", ".join(missing[:8]) + (f" and {len(missing) - 8} more" if len(missing) > 8 else "")
            warnings.warn(
                f"guess: the saved {self.name} has no {some}; they start from their default guess",
                MissingGuess,
                stacklevel=2,
            )
        found.update((n, value) for n, value in self.free.items() if n in dae.parameters)
        return found

    def _expand(self, name: str) -> tuple[str, ...]:
        base, order = split_derivative(name)
        elements = tuple(derivative_name(n, order) for n in self.vectors.get(base, (base,)))
        known = [e in self.parameters or e == "time" or self._phase(e) is not None for e in elements]
        if not all(known):
            choice = (*self.names, *self.vectors, *self.parameters)
            raise ModelError(f"{self.name} has no variable or parameter '{name}'{did_you_mean(base, choice)}")
        return elements

    def _phase(self, name: str) -> SavedPhase | None:
        """The phase of a variable, None for parameters."""
        return next((phase for phase in self.phases.values() if name in phase.rows), None)
