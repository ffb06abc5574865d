"""Where the solver ended on a control problem: the unknowns it left, by the names of the model."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from gantrytau import Dae
from gantrytau.language.self_description.appearance import Shape
from gantrytau.simulation.to_result import displays, labels
from gantrytau_optimica.answers.answer import Answer
from gantrytau_optimica.control.built import Built
from gantrytau_optimica.solving.ipopt import Solution
from gantrytau_optimica.transcription.program import Program
from gantrytau_optimica.transcription.trajectory import Trajectory


@dataclass(frozen=True, eq=False, repr=False)
class ProgramAnswer(Answer):
    """A solved program, or one that was not solved, as an answer; build_time in s.

    refinement: how it was refined, if it was; search: the branches found from several first guesses, if there were;
    left: how many maxima and saddles the solver left on its way here.
    """

    name: str
    built: Built
    program: Program
    solution: Solution
    build_time: float
    refinement: Any = None
    search: Any = None
    left: int = 0

    @property
    def dae(self) -> Dae:
        """The translated model."""
        return self.built.read.dae

    @property
    def shapes(self) -> Sequence[Shape]:
        """What the components of the model look like, by the names of their places."""
        return self.dae.flat.shapes

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
    def numbers(self) -> dict[str, float]:
        """The free and the held numbers by name."""
        values = self.solution.w[self.program.places.free].tolist()
        return dict(zip((n.name for n in self.program.problem.free), values, strict=True))

    @property
    def free(self) -> dict[str, float]:
        """The free numbers by name."""
        return {n.name: self.numbers[n.name] for n in self.program.problem.free if not n.held}

    @cached_property
    def parameters(self) -> dict[str, float]:
        """Values of all parameters by scalar name."""
        names, first = list(self.dae.parameters), next(iter(self.phases.values()))
        values = first.values(self.built.expressed(names), first.time[:1])[:, 0] if names else np.zeros(0)
        return dict(zip(names, values.tolist(), strict=True))

    @cached_property
    def phases(self) -> dict[str, Trajectory]:
        """Horizon, times and signals of every phase by its name; "" where there is only one."""
        numbers = self.solution.w[self.program.places.free]
        return {
            layout.phase.name: Trajectory(self.program.problem, layout, self.solution.w, numbers)
            for layout in self.program.places.layouts
        }

    def integral(self, name: str) -> float:
        """The integral of a variable over its phase, by the quadrature of the collocation, in its unit times s."""
        (name,) = self.dae.expand(name)
        return float(self.phases[self.path_of(name)].integral(self.built.expressed([name]))[0])

    def _elements(self, name: str) -> tuple[str, ...]:
        return tuple(self.dae.expand(name))

    def _variables(self, path: str) -> list[str]:
        return [n for n in self.dae.variables if not path or n.startswith(f"{path}.")]

    def _labels(self) -> tuple[Mapping[str, str], Mapping[str, str]]:
        return labels(self.dae)

    @property
    def displays(self) -> Mapping[str, str]:
        """The units in which variables are shown, where they are declared, by name."""
        return displays(self.dae)

    def _rows(self, names: Sequence[str], path: str) -> Callable[[np.ndarray], np.ndarray]:
        phase, expressions = self.phases[path], self.built.expressed(names)
        return lambda times: phase.values(expressions, times)
