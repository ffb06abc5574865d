"""An optimal-control problem as plain CasADi expressions: what the transcription consumes."""

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np


@dataclass(frozen=True, eq=False)
class Signal:
    """A scalar over time: symbol, limits, typical size, and guess as a function of times (n,) -> (n,)."""

    name: str
    symbol: ca.SX
    min: float
    max: float
    nominal: float
    guess: Callable[[np.ndarray], np.ndarray]
    words: str = ""  # what it is at a limit, where the name says nothing to the user


@dataclass(frozen=True, eq=False)
class FreeNumber:
    """A number that is chosen, or held at its guess for one solve and changed for the next."""

    name: str
    symbol: ca.SX
    min: float
    max: float
    guess: float
    held: bool = False


@dataclass(frozen=True, eq=False)
class PointValue:
    """Symbols (k,) that stand for expressions (k,) of the signals at a time.

    time: "initial", "final", or a number or expression of free numbers in s.
    """

    symbol: ca.SX
    expression: ca.SX
    time: str | ca.SX


@dataclass(frozen=True, eq=False)
class Limit:
    """lower <= expression <= upper, scalar; on a path an expression of signals, else of points and numbers."""

    expression: ca.SX
    lower: float
    upper: float
    name: str


@dataclass(frozen=True, eq=False)
class ControlProblem:
    """Minimise objective + integral of integrand, subject to x' = ode and 0 = residuals, and to limits.

    ode, residuals: one row per state and algebraic, expressions of time, signals and free numbers.
    """

    time: ca.SX
    start_time: ca.SX
    final_time: ca.SX
    states: tuple[Signal, ...]
    algebraics: tuple[Signal, ...]
    inputs: tuple[Signal, ...]
    free: tuple[FreeNumber, ...]
    ode: ca.SX
    residuals: ca.SX
    residual_names: tuple[str, ...]
    integrand: ca.SX
    objective: ca.SX
    path_limits: tuple[Limit, ...]
    boundary: tuple[Limit, ...]
    points: tuple[PointValue, ...]

    @property
    def signals(self) -> tuple[Signal, ...]:
        """States, algebraics and inputs."""
        return (*self.states, *self.algebraics, *self.inputs)
