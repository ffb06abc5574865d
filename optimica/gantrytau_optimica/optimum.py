"""The answer of an optimisation, looked up by the model's own names."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from gantrytau import Dae, Result
from gantrytau.trajectories import labels
from gantrytau_optimica.building import Built
from gantrytau_optimica.ipopt import Solution
from gantrytau_optimica.program import Program
from gantrytau_optimica.reporting import report
from gantrytau_optimica.scheme import interpolation


@dataclass(frozen=True, eq=False)
class Optimum:
    """What `optimize` found. `optimum["robot.tool.r"]` is a variable over `time`, free numbers are floats.

    `time` holds the start and all collocation points, in s; build_time and solve_time are in s.
    """

    name: str
    built: Built
    program: Program
    solution: Solution
    build_time: float

    @property
    def dae(self) -> Dae:
        """The translated model."""
        return self.built.system.dae

    @property
    def objective(self) -> float:
        """Value of the objective with all integrals."""
        return self.solution.objective

    @property
    def success(self) -> bool:
        """Whether the solver met its tolerance."""
        return self.solution.success

    @property
    def status(self) -> str:
        """How the solver ended, in words."""
        return self.solution.status

    @property
    def iterations(self) -> int:
        """Iterations of the solver."""
        return self.solution.iterations

    @property
    def solve_time(self) -> float:
        """Wall time of the solver in s."""
        return self.solution.solve_time

    @cached_property
    def free(self) -> dict[str, float]:
        """The free numbers by name."""
        return {n.name: self._numbers[n.name] for n in self.program.problem.free if not n.held}

    @cached_property
    def _numbers(self) -> dict[str, float]:
        """Free and held numbers."""
        numbers = self.program.problem.free
        return dict(
            zip((n.name for n in numbers), self.solution.w[self.program.places.free].tolist(), strict=True)
        )

    @cached_property
    def _horizon(self) -> tuple[float, float]:
        problem = self.program.problem
        numbers = ca.vertcat(*(n.symbol for n in problem.free)) if problem.free else ca.SX(0, 1)
        evaluate = ca.Function("horizon", [numbers], [problem.start_time, problem.final_time])
        start, stop = evaluate(ca.DM(list(self._numbers.values())))
        return float(start), float(stop)

    @property
    def start_time(self) -> float:
        """Start of the horizon in s."""
        return self._horizon[0]

    @property
    def final_time(self) -> float:
        """End of the horizon in s."""
        return self._horizon[1]

    @cached_property
    def time(self) -> np.ndarray:
        """The start and all collocation points in s."""
        mesh, points = self.program.places.mesh, self.program.places.scheme.points
        inside = (mesh[:-1, None] + np.diff(mesh)[:, None] * points).ravel()
        fractions = np.concatenate([[0.0], inside] if points[-1] == 1.0 else [[0.0], inside, [1.0]])
        return self.start_time + (self.final_time - self.start_time) * fractions

    @cached_property
    def breaks(self) -> np.ndarray:
        """Times in s at which inputs may jump: the borders between elements."""
        return self.start_time + (self.final_time - self.start_time) * self.program.places.mesh[1:-1]

    @cached_property
    def result(self) -> Result:
        """All variables of the model over `time`, to plot and save."""
        names = list(self.dae.variables)
        rows = self._values(names, self.time)
        units, words = labels(self.dae)
        return Result(
            self.time, dict(zip(names, rows, strict=True)), units=units, descriptions=words, title=self.name
        )

    @property
    def names(self) -> tuple[str, ...]:
        """All names that can be asked for."""
        return (*self.result.names, *self.free)

    def __repr__(self) -> str:
        return f"<Optimum {self.name}: {self.status}, objective {self.objective:.8g}, {self.time.size} times>"

    def __contains__(self, name: object) -> bool:
        return name in self.free or name in self.result

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __getitem__(self, name: str) -> Any:
        if name in self.free:
            return self.free[name]
        if name in self.result or name in self.dae.variables or name in self.dae.vectors:
            return self.result[name]
        self.dae.expand(name)  # raises for unknown names
        return self.signal(name)(self.time)

    def final(self, name: str) -> Any:
        """The value at the end of the horizon."""
        return self[name][-1]

    def integral(self, name: str) -> float:
        """The integral of a variable over the horizon, by the quadrature of the collocation."""
        mesh, scheme = self.program.places.mesh, self.program.places.scheme
        span = self.final_time - self.start_time
        fractions = mesh[:-1, None] + np.diff(mesh)[:, None] * scheme.points
        values = self.signal(name)(self.start_time + span * fractions.ravel()).reshape(fractions.shape)
        return float(span * np.sum(np.diff(mesh)[:, None] * scheme.weights * values))

    def signal(self, name: str):
        """A variable or derivative as a vectorised function of time: (n,) -> (n,) or (n, k), from the polynomials
        of the solution; between the collocation points they need not keep to limits.
        """
        elements = self.dae.expand(name)
        whole = elements != (name,)

        def value(times: Any) -> np.ndarray:
            times = np.asarray(times, dtype=float)
            rows = self._values(elements, np.atleast_1d(times))
            found = rows.T if whole else rows[0]
            return found if times.ndim else found[0]

        return value

    def plot(self, *names: str, file: Any = None):
        """Variables over time, as Result.plot."""
        return self.result.plot(*names, file=file)

    def save(self, path: Any):
        """Save all variables over time, as Result.save."""
        return self.result.save(path)

    def report(self) -> str:
        """How it ended, and what remains violated or binds, in the model's words."""
        return report(self.name, self.program, self.solution, self._horizon)

    def _values(self, names: Sequence[str], times: np.ndarray) -> np.ndarray:
        """Values (names, times) of scalars of the model."""
        problem, system = self.program.problem, self.built.system
        expressions = ca.vertcat(*(self.dae.expression(n) for n in names))
        (found,) = system.resolve([expressions])
        numbers = self.built.numbers
        if numbers:
            symbols = ca.vertcat(*(self.dae.table.symbols[n] for n in numbers))
            found = ca.substitute(found, symbols, ca.DM(list(numbers.values())))
        signals = ca.vertcat(*(s.symbol for s in problem.signals)) if problem.signals else ca.SX(0, 1)
        free = ca.vertcat(*(n.symbol for n in problem.free)) if problem.free else ca.SX(0, 1)
        function = ca.Function("values", [problem.time, signals, free], [ca.densify(found)])
        p = np.tile(np.array(list(self._numbers.values()))[:, None], (1, times.size))
        rows = np.array(function(times[None, :], self._signals(times), p))
        return rows if rows.shape[1] == times.size else np.repeat(rows, times.size, axis=1)

    def _signals(self, times: np.ndarray) -> np.ndarray:
        """States, algebraics and inputs at any times, from the polynomials of their elements."""
        program, w = self.program, self.solution.w
        span = self.final_time - self.start_time
        fraction = np.clip((times - self.start_time) / span, 0.0, 1.0)
        # a time on a border belongs to the element before it, where the limits hold at the last point
        element = np.clip(
            np.searchsorted(program.places.mesh, fraction - 1e-13, side="right") - 1,
            0,
            program.places.mesh.size - 2,
        )
        local = (fraction - program.places.mesh[element]) / np.diff(program.places.mesh)[element]
        nodes = np.concatenate([program.places.starts[:-1, None, :], program.places.states], axis=1)
        x = np.einsum("tj,tjs->st", interpolation(program.places.scheme.nodes, local), w[nodes][element])
        weights = interpolation(program.places.scheme.points, local)
        others = [
            np.einsum("tj,tjs->st", weights, w[table][element])
            for table in (program.places.algebraics, program.places.inputs)
        ]
        return np.vstack([x, *others])
