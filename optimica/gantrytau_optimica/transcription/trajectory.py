"""One phase of a solution over time: its horizon, its times, and its signals anywhere between."""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from gantrytau_optimica.control.control_problem import ControlProblem, Phase
from gantrytau_optimica.transcription.layout import Layout
from gantrytau_optimica.transcription.mesh import Mesh


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Unknowns w of a program read as signals of one phase over time in s."""

    problem: ControlProblem
    layout: Layout
    w: np.ndarray
    numbers: np.ndarray  # free and held, in the order of the problem

    def __repr__(self) -> str:
        name = self.phase.name or self.problem.name
        return f"<Trajectory of {name}: {self.start_time:g} to {self.final_time:g} s, {self.time.size} times>"

    @property
    def phase(self) -> Phase:
        """The phase in states, algebraics and inputs."""
        return self.layout.phase

    @cached_property
    def mesh(self) -> Mesh:
        """The elements where the optimiser placed them."""
        return self.layout.placed(self.w)

    @cached_property
    def horizon(self) -> tuple[float, float]:
        """Start and end in s."""
        evaluate = ca.Function(
            "horizon", [self.problem.numbers], [self.phase.start_time, self.phase.final_time]
        )
        start, stop = evaluate(ca.DM(self.numbers))
        return float(start), float(stop)

    @property
    def start_time(self) -> float:
        """Start in s."""
        return self.horizon[0]

    @property
    def final_time(self) -> float:
        """End in s."""
        return self.horizon[1]

    def moment(self, time: str | ca.SX) -> float:
        """The time in s of a point: "initial", "final", or an expression of free numbers."""
        if isinstance(time, str):
            return self.start_time if time == "initial" else self.final_time
        return float(ca.Function("time", [self.problem.numbers], [time])(ca.DM(self.numbers)))

    def times(self, shares: np.ndarray) -> np.ndarray:
        """Shares of the horizon as times in s."""
        return self.start_time + (self.final_time - self.start_time) * shares

    @cached_property
    def fractions(self) -> np.ndarray:
        """The start, all collocation points and the end, as shares of the horizon."""
        points = self.layout.scheme.points[self.layout.scheme.points > 0.0]
        inside = (self.mesh.borders[:-1, None] + self.mesh.widths[:, None] * points).ravel()
        return np.concatenate([[0.0], inside] if points[-1] == 1.0 else [[0.0], inside, [1.0]])

    @cached_property
    def time(self) -> np.ndarray:
        """The start, all collocation points and the end, in s."""
        return self.times(self.fractions)

    @cached_property
    def breaks(self) -> np.ndarray:
        """Times in s at which inputs may jump: the borders between elements."""
        return self.times(self.mesh.borders[1:-1])

    def signals(self, times: np.ndarray) -> np.ndarray:
        """States, algebraics, inputs and known courses (k, n) at times (n,), from the polynomials of their elements.

        A time on a border belongs to the element before it, where the limits hold at the last point.
        """
        element, place = self.mesh.locate((times - self.start_time) / (self.final_time - self.start_time))
        return self.at(element, place, times)

    def at(self, element: np.ndarray, place: np.ndarray, times: np.ndarray | None = None) -> np.ndarray:
        """The same at places of elements."""
        if times is None:
            times = self.times(self.mesh.borders[element] + place * self.mesh.widths[element])
        bases = self.layout.bases(element, place)
        rows = [
            track.weighted(basis, self.w, element)
            for track, basis in zip(self.layout.tracks, bases, strict=True)
        ]
        at_start = (element == 0) & (place <= 0.0)
        if self.layout.begin.size and np.any(at_start):
            for k, unknown in enumerate(self.layout.begin, len(self.phase.states)):
                rows[k] = np.where(at_start, self.w[unknown], rows[k])
        inside = 1e-9 * self.mesh.widths[element] * (0.5 - place) * (self.final_time - self.start_time)
        rows += [course.value(times + inside) for course in self.phase.courses]  # on its own side of a jump
        return np.array(rows).reshape(len(rows), times.size)

    def function(self, expressions: ca.SX, name: str = "values") -> ca.Function:
        """(times (1, n), signals (k, n)) -> expressions (m, n), with the free numbers of this solution."""
        signals = ca.vertcat(ca.SX(0, 1), *(s.symbol for s in (*self.phase.signals, *self.phase.courses)))
        if self.problem.free:
            expressions = ca.substitute(expressions, self.problem.numbers, ca.DM(self.numbers))
        return ca.Function(name, [self.problem.time, signals], [ca.densify(expressions)])

    def values(self, expressions: ca.SX, times: np.ndarray) -> np.ndarray:
        """Expressions of the phase's symbols (m,) at times (n,): (m, n)."""
        rows = np.array(self.function(expressions)(times[None, :], self.signals(times)))
        return rows if rows.shape[1] == times.size else np.repeat(rows, times.size, axis=1)

    def integral(self, expressions: ca.SX) -> np.ndarray:
        """Integrals of expressions over the phase, by the quadrature of the collocation, (m,)."""
        element, place = self.layout.points
        times = self.times(self.mesh.borders[element] + place * self.mesh.widths[element])
        rows = np.array(self.function(expressions)(times[None, :], self.at(element, place, times)))
        weights = (self.mesh.widths[:, None] * self.layout.scheme.weights).ravel()
        return (self.final_time - self.start_time) * (
            rows @ weights if rows.shape[1] == weights.size else rows[:, 0]
        )
