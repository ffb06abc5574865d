"""An optimum read from its file: it answers like the one that was saved, without the model."""

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from gantrytau import Dae, ModelError
from gantrytau.border.refusal import did_you_mean
from gantrytau.describing.record import Record
from gantrytau.language.symbols import derivative_name, split_derivative
from gantrytau_optimica.answers.answer import Answer
from gantrytau_optimica.control.first_guesses.guesses import Stretched
from gantrytau_optimica.transcription.layout import Track, lagrange
from gantrytau_optimica.transcription.mesh import Mesh

Sparse = Any  # a matrix of scipy.sparse
NEAR = 1e-9  # of an element, within which a time stands for a node: its value is taken, not a polynomial's


class MissingGuess(UserWarning):
    """A saved solution given as guess lacks variables of the problem; these start from their default guess."""


@dataclass(frozen=True, eq=False)
class SavedPhase(Record):
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


@dataclass(frozen=True, eq=False, repr=False)
class SavedOptimum(Answer):
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
    display_units: Mapping[str, str] = field(default_factory=dict)

    @property
    def displays(self) -> Mapping[str, str]:
        """The units in which variables are shown, where they were declared, by name."""
        return self.display_units

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
        given = {"", *(alias.symbol for n in found if (alias := dae.root(n)) is not None)}
        wanted = {n: dae.root(n) for n in (*dae.states, *dae.inputs)}
        missing = [n for n, alias in wanted.items() if alias is not None and alias.symbol not in given]
        if missing:
            some = ", ".join(missing[:8]) + (f" and {len(missing) - 8} more" if len(missing) > 8 else "")
            warnings.warn(
                f"guess: the saved {self.name} has no {some}; they start from their default guess",
                MissingGuess,
                stacklevel=2,
            )
        found.update((n, value) for n, value in self.free.items() if n in dae.parameters)
        return found

    def _elements(self, name: str) -> tuple[str, ...]:
        base, order = split_derivative(name)
        elements = tuple(derivative_name(n, order) for n in self.vectors.get(base, (base,)))
        known = (e in self.parameters or e in self.phases[self.path_of(e)].rows for e in elements)
        if name != "time" and not all(known):
            choice = (*self.names, *self.vectors, *self.parameters)
            raise ModelError(f"{self.name} has no variable or parameter '{name}'{did_you_mean(base, choice)}")
        return elements

    def _variables(self, path: str) -> list[str]:
        return [n for n in self.phases[path].names if not split_derivative(n)[1]]

    def _labels(self) -> tuple[Mapping[str, str], Mapping[str, str]]:
        return self.units, self.descriptions

    def _rows(self, names: Sequence[str], path: str) -> Callable[[np.ndarray], np.ndarray]:
        phase = self.phases[path]
        if names == ("time",):
            return lambda times: times[None, :]
        if names and names[0] in self.parameters:
            values = np.array([[self.parameters[n]] for n in names])
            return lambda times: np.repeat(values, times.size, axis=1)
        return lambda times: phase.values(names, times)
