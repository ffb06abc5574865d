"""An optimal-control problem as plain CasADi expressions: what the transcription consumes.

minimise    objective(points, free) + sum over phases of the integrals of their integrands
subject to  x' = ode(t, x, z, u, free), 0 = residuals(t, x, z, u, free)        in every phase
            lower <= path limits(t, x, z, u, free) <= upper                    in every phase
            lower <= boundary(points, free) <= upper
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Literal

import casadi as ca
import numpy as np


@dataclass(frozen=True)
class Pieces:
    """How an input is made.

    kind: "free" at every point, "ramps" (a straight line in each element, which may jump at borders), or "constant" or
    "linear" (and continuous) over groups of elements; elements: in each group; borders: of the groups, shares of the
    horizon, instead; max_step: largest change from one value to the next; step_penalty: weight of the squares of these
    changes in the objective. Ramps with borders jump at these only.
    """

    kind: Literal["free", "ramps", "constant", "linear"] = "free"
    elements: int = 1
    borders: tuple[float, ...] = ()
    max_step: float | None = None
    step_penalty: float = 0.0


@dataclass(frozen=True, eq=False)
class Signal:
    """A scalar over time: symbol, limits, typical size, and guess as a function of shares of the horizon (n,) -> (n,)."""

    name: str
    symbol: ca.SX
    min: float
    max: float
    nominal: float
    guess: Callable[[np.ndarray], np.ndarray]
    words: str = ""  # what it is at a limit, where the name says nothing to the user
    pieces: Pieces = Pieces()

    @property
    def is_root(self) -> bool:
        """Whether it is a square root: zero, or a margin above it, is a limit of its own; others have those of the user."""
        return self.min >= 0.0


@dataclass(frozen=True, eq=False)
class Course:
    """A symbol whose values are known: value(times (n,) in s) -> (n,); jumps: times in s at which it jumps;
    kinks: at which it is not smooth.
    """

    name: str
    symbol: ca.SX
    value: Callable[[np.ndarray], np.ndarray]
    jumps: np.ndarray = field(default_factory=lambda: np.zeros(0))
    kinks: np.ndarray = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True, eq=False)
class FreeNumber:
    """A number that is chosen, or held at its guess for one solve and changed for the next.

    nominal: its typical size, by the guess where it is not given.
    """

    name: str
    symbol: ca.SX
    min: float
    max: float
    guess: float
    held: bool = False
    nominal: float | None = None

    @property
    def size(self) -> float:
        """Its typical size."""
        return self.nominal or abs(self.guess) or 1.0


@dataclass(frozen=True, eq=False)
class PointValue:
    """Symbols (k,) that stand for expressions (k,) of the signals of a phase at a time.

    time: "initial", "final", or a number or expression of free numbers in s.
    """

    symbol: ca.SX
    expression: ca.SX
    time: str | ca.SX


@dataclass(frozen=True, eq=False)
class SampleSum:
    """`symbol` stands for the sum over samples of ((expression(t_k) - value_k) / deviation_k)^2."""

    symbol: ca.SX
    expression: ca.SX
    times: np.ndarray
    values: np.ndarray
    deviations: np.ndarray


@dataclass(frozen=True, eq=False)
class Limit:
    """lower <= expression <= upper, scalar; on a path an expression of signals, else of points and numbers.

    size: how much it changes when what stands in it changes by its typical size.
    """

    expression: ca.SX
    lower: float
    upper: float
    name: str
    size: float = 1.0


@dataclass(frozen=True, eq=False)
class Phase:
    """A stretch of time with equations, limits and a clock of its own; `name` is "" where there is only one.

    ode, residuals: one row per state and algebraic, expressions of time, signals, courses and free numbers;
    residual_sizes: how much they change when what stands in them changes by its typical size.
    """

    name: str
    start_time: ca.SX
    final_time: ca.SX
    states: tuple[Signal, ...]
    algebraics: tuple[Signal, ...]
    inputs: tuple[Signal, ...]
    courses: tuple[Course, ...]
    ode: ca.SX
    residuals: ca.SX
    residual_names: tuple[str, ...]
    integrand: ca.SX
    path_limits: tuple[Limit, ...] = ()
    points: tuple[PointValue, ...] = ()
    sums: tuple[SampleSum, ...] = ()
    residual_sizes: tuple[float, ...] = ()

    @property
    def signals(self) -> tuple[Signal, ...]:
        """States, algebraics and inputs."""
        return (*self.states, *self.algebraics, *self.inputs)


@dataclass(frozen=True, eq=False)
class ControlProblem:
    """Phases, the numbers they share, the objective beside the integrals, and conditions on points; following: names
    of those that were left out, as others decide them.
    """

    name: str
    time: ca.SX
    phases: tuple[Phase, ...]
    free: tuple[FreeNumber, ...]
    objective: ca.SX
    boundary: tuple[Limit, ...]
    following: tuple[str, ...] = ()

    @property
    def numbers(self) -> ca.SX:
        """Symbols of the free numbers, (k,)."""
        return ca.vertcat(ca.SX(0, 1), *(n.symbol for n in self.free))

    @property
    def signals(self) -> tuple[Signal, ...]:
        """Signals of all phases."""
        return tuple(s for phase in self.phases for s in phase.signals)

    def with_signals(self, change: Callable[[Phase, Signal], Signal]) -> "ControlProblem":
        """The problem with every signal changed."""

        def changed(phase: Phase) -> Phase:
            parts = (phase.states, phase.algebraics, phase.inputs)
            states, algebraics, inputs = (tuple(change(phase, s) for s in part) for part in parts)
            return replace(phase, states=states, algebraics=algebraics, inputs=inputs)

        return replace(self, phases=tuple(changed(phase) for phase in self.phases))

    @property
    def points(self) -> tuple[PointValue, ...]:
        """Points of all phases."""
        return tuple(p for phase in self.phases for p in phase.points)

    @property
    def moving_times(self) -> list[str]:
        """Free numbers that choose the times of points, but not those of a horizon."""
        times = ca.vertcat(ca.SX(0, 1), *(p.time for p in self.points if not isinstance(p.time, str)))
        ends = ca.vertcat(*(end for phase in self.phases for end in (phase.start_time, phase.final_time)))
        free = [n for n in self.free if not n.held and not ca.depends_on(ends, n.symbol)]
        return [n.name for n in free if ca.depends_on(times, n.symbol)]

    @property
    def sums(self) -> tuple[SampleSum, ...]:
        """Sums over samples of all phases."""
        return tuple(s for phase in self.phases for s in phase.sums)
