"""A problem in the symbols of its model: what was read of a class, and what is made into a control problem."""

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca

from gantrytau import Dae, ModelError, Samples
from gantrytau.language.symbols import split_derivative
from gantrytau_optimica.problem.optimization import Point, Target


@dataclass(frozen=True, eq=False)
class ConstraintRow:
    """lower <= expression <= upper for one scalar, in the model's symbols.

    name: as it was written; place: where it was written; lower and upper of an equation are the same object.
    """

    expression: ca.SX
    lower: ca.SX
    upper: ca.SX
    name: str
    place: str = ""


@dataclass(frozen=True, eq=False)
class SymbolicPhase:
    """A phase in the model's symbols; `name` is its path, "" where there is only one."""

    name: str
    integrand: ca.SX
    start_time: ca.SX  # a number or an expression of free numbers
    final_time: ca.SX

    def owns(self, name: str) -> bool:
        """Whether a variable belongs to this phase."""
        return not self.name or name.startswith(f"{self.name}.")


@dataclass(frozen=True, eq=False)
class LinkedPaths:
    """The paths of two phases of which the second begins where the first ends, and what jumps, with its path."""

    first: str
    second: str
    jump: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class SymbolicProblem:
    """A problem in the model's symbols. courses: inputs that the optimiser does not choose, by scalar name."""

    name: str
    dae: Dae
    objective: ca.SX
    phases: tuple[SymbolicPhase, ...]
    constraints: tuple[ConstraintRow, ...]
    links: tuple[LinkedPaths, ...]
    points: tuple[Point, ...]
    targets: tuple[Target, ...]
    courses: Mapping[str, ca.SX | tuple[Samples, int]]

    def says_the_same(self, other: "SymbolicProblem") -> bool:
        """Whether another one has the same records, links and courses aside."""
        names = "name", "dae", "objective", "phases", "constraints", "points", "targets"
        return all(getattr(self, name) is getattr(other, name) for name in names)

    def phase_of(self, expression: ca.SX, what: str) -> int:
        """Number of the phase whose variables an expression holds. Raises ModelError if they are of several."""
        if len(self.phases) == 1:
            return 0
        names = [split_derivative(leaf.name())[0] for leaf in ca.symvar(expression)]
        found = {k for n in names for k, phase in enumerate(self.phases) if phase.owns(n)}
        if len(found) != 1:
            words = (
                "belongs to no phase"
                if not found
                else "joins " + " and ".join(self.phases[k].name for k in sorted(found))
            )
            raise ModelError(f"{self.name}: {what} {words}, expected variables of one phase")
        return found.pop()
