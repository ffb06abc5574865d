"""The answer of an optimisation, looked up by the model's own names."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from gantrytau import Dae, ModelError, Result
from gantrytau.language.symbols import split_derivative
from gantrytau.simulation.to_result import labels
from gantrytau_optimica.answers.playback.playback import Playback, play_back
from gantrytau_optimica.control.built import Built
from gantrytau_optimica.failures.failure_report import report
from gantrytau_optimica.failures.relaxation import Relaxed, relax
from gantrytau_optimica.solving.ipopt import Solution
from gantrytau_optimica.transcription.program import Program
from gantrytau_optimica.transcription.trajectory import Trajectory

Signal = Callable[[Any], np.ndarray]


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
    refinement: Any = None  # how it was refined, if it was
    search: Any = None  # the branches found from several first guesses, if there were several

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

    @property
    def free(self) -> dict[str, float]:
        """The free numbers by name."""
        return {n.name: self._numbers[n.name] for n in self.program.problem.free if not n.held}

    @cached_property
    def _numbers(self) -> dict[str, float]:
        """Free and held numbers."""
        numbers = self.program.problem.free
        values = self.solution.w[self.program.places.free].tolist()
        return dict(zip((n.name for n in numbers), values, strict=True))

    @cached_property
    def phases(self) -> dict[str, Trajectory]:
        """Horizon, times and signals of every phase by its name; "" where there is only one."""
        problem, numbers = self.program.problem, np.array(list(self._numbers.values()))
        return {
            layout.phase.name: Trajectory(problem, layout, self.solution.w, numbers)
            for layout in self.program.places.layouts
        }

    @property
    def _only(self) -> Trajectory:
        if len(self.phases) > 1:
            names = ", ".join(f"'{name}'" for name in self.phases)
            raise ModelError(
                f"{self.name} has phases with times of their own; ask one of .phases[...]: {names}"
            )
        return next(iter(self.phases.values()))

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

    def _phase(self, name: str) -> Trajectory:
        """The phase of a variable."""
        if len(self.phases) == 1:
            return self._only
        base = split_derivative(name)[0]
        for path, phase in self.phases.items():
            if base.startswith(f"{path}."):
                return phase
        return next(iter(self.phases.values()))  # a parameter is the same in all

    def time_of(self, name: str) -> np.ndarray:
        """The times in s of a variable: those of its phase."""
        return self._phase(name).time

    @property
    def result(self) -> Result:
        """All variables of the model over `time`, to plot and save."""
        return self._results[self._only.phase.name]

    @cached_property
    def _results(self) -> dict[str, Result]:
        units, words = labels(self.dae)
        found = {}
        for path, phase in self.phases.items():
            names = [n for n in self.dae.variables if not path or n.startswith(f"{path}.")]
            rows = self._values(names, phase, phase.time)
            title = f"{self.name}.{path}" if path else self.name
            found[path] = Result(
                phase.time, dict(zip(names, rows, strict=True)), units=units, descriptions=words, title=title
            )
        return found

    @property
    def names(self) -> tuple[str, ...]:
        """All names that can be asked for."""
        return (*(n for result in self._results.values() for n in result.names), *self.free)

    def __repr__(self) -> str:
        size = sum(phase.time.size for phase in self.phases.values())
        return f"<Optimum {self.name}: {self.status}, objective {self.objective:.8g}, {size} times>"

    def __contains__(self, name: object) -> bool:
        return name in self.free or any(name in result for result in self._results.values())

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __getitem__(self, name: str) -> Any:
        if name in self.free:
            return self.free[name]
        elements = self.dae.expand(name)  # raises for unknown names
        if elements[0] in self._numbers:
            return np.array([self._numbers.get(n, self.dae.table.values[n]) for n in elements])
        phase = self._phase(name)
        result = self._results[phase.phase.name]
        if name in result or name in self.dae.vectors:
            return result[name]
        return self.signal(name)(phase.time)

    def final(self, name: str) -> Any:
        """The value at the end of the horizon."""
        value = self[name]
        return value if name in self.free else value[-1]

    def integral(self, name: str) -> float:
        """The integral of a variable over its phase, by the quadrature of the collocation, in its unit times s."""
        (name,) = self.dae.expand(name)
        return float(self._phase(name).integral(self.built.expressed([name]))[0])

    def signal(self, name: str) -> Signal:
        """A variable or derivative as a vectorised function of time: (n,) -> (n,) or (n, k), from the polynomials
        of the solution; between the collocation points they need not keep to limits.
        """
        elements = self.dae.expand(name)
        whole = elements != (name,)
        phase, expressions = self._phase(elements[0]), self.built.expressed(elements)

        def value(times: Any) -> np.ndarray:
            times = np.asarray(times, dtype=float)
            rows = phase.values(expressions, np.atleast_1d(times))
            found = rows.T if whole else rows[0]
            return found if times.ndim else found[0]

        return value

    def plot(self, *names: str, file: Any = None):
        """Variables over time, as Result.plot."""
        return self.result.plot(*names, file=file)

    def save(self, path: Any):
        """Save all variables over time, as Result.save; with the ending .optimum the whole solution, for load_optimum."""
        if Path(path).suffix == ".optimum":
            from gantrytau_optimica.answers.archive.optimum_files import save_optimum

            return save_optimum(self, path)
        return self.result.save(path)

    @cached_property
    def playback(self) -> Playback:
        """The model driven anew by the inputs found, with all limits and conditions looked at between the nodes."""
        return play_back(self)

    def report(self) -> str:
        """How it ended, what remains violated or binds, and what becomes of it when played back, in the model's words."""
        found = report(self.built, self.program, self.solution, list(self.phases.values()))
        lines = [found, str(self.playback)] if self.success else [found]
        more = [str(x) for x in (self.refinement, self.search) if x is not None]
        return "\n".join([*lines, *more])

    @cached_property
    def relaxed(self) -> Relaxed:
        """Which limits and conditions would have to give for a solution, and by how much; takes some seconds."""
        return relax(self.built, self.program, self.solution)

    @property
    def nearest(self) -> "Optimum":
        """The motion of the model that violates limits and conditions least, as a guess or to look at."""
        return replace(self, solution=self.relaxed.solution)

    def _values(self, names: Sequence[str], phase: Trajectory, times: np.ndarray) -> np.ndarray:
        """Values (names, times) of scalars of the model."""
        return phase.values(self.built.expressed(names), times)
