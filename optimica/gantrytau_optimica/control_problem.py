"""The record of an optimal-control problem: what the transcription reads, free of any modelling language.

    minimise    objective(points, free, p) + integral of integrand(t, x, z, u, free, p) over [start, final]
    subject to  x' = ode(t, x, z, u, free, p)
                0 = residuals(t, x, z, u, free, p)              as many residuals as algebraics
                lower <= path_limits(t, x, z, u, free, p) <= upper
                lower <= boundary(points, free, p) <= upper

All expressions are SX in the symbols of the record. A point is the value of an expression at one time, under
a symbol of its own, which objective and boundary use. Free numbers are chosen by the optimiser; parameters
keep their value during a solve and may have another in the next.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Literal

import casadi as ca
import numpy as np
from numpy.typing import NDArray

Times = NDArray[np.float64]
Guess = Callable[[Times], NDArray[np.float64]]
Bound = float | Sequence[float] | NDArray[np.float64] | ca.SX | ca.DM


def _zero(times: Times) -> NDArray[np.float64]:
    return np.zeros_like(times)


@dataclass(frozen=True, eq=False)
class Signal:
    """A scalar function of time: a state, an algebraic variable or an input."""

    name: str
    symbol: ca.SX
    min: float = -np.inf
    max: float = np.inf
    nominal: float = 1.0  # typical magnitude; the optimiser works on value / nominal
    guess: Guess = _zero  # of physical times between start and final time
    unit: str = ""


@dataclass(frozen=True, eq=False)
class FreeNumber:
    """A number that the optimiser chooses: a time, a parameter of the model or an initial value."""

    name: str
    symbol: ca.SX
    min: float = -np.inf
    max: float = np.inf
    guess: float = 0.0
    nominal: float = 1.0
    unit: str = ""


@dataclass(frozen=True, eq=False)
class Parameter:
    """A number, or a column of numbers, that is given anew for every solve."""

    name: str
    symbol: ca.SX
    value: float | Sequence[float] | NDArray[np.float64] = 0.0


@dataclass(frozen=True, eq=False)
class PointValue:
    """`symbol` stands for the value of `expression` at one time, on the mesh or between.

    time: "initial", "final", a number, or an expression of free numbers and parameters. Algebraics and
    inputs at a point are those of the collocation polynomial of its element.
    """

    symbol: ca.SX
    expression: ca.SX
    time: Literal["initial", "final"] | float | ca.SX


@dataclass(frozen=True, eq=False)
class Limit:
    """lower <= expression <= upper, elementwise; bounds are numbers, arrays or expressions."""

    expression: ca.SX
    lower: Bound
    upper: Bound
    name: str
    unit: str = ""


@dataclass(frozen=True, eq=False)
class ControlProblem:
    """An optimal-control problem over a semi-explicit system of differential and algebraic equations."""

    states: tuple[Signal, ...]
    ode: ca.SX  # (states,)
    inputs: tuple[Signal, ...] = ()
    algebraics: tuple[Signal, ...] = ()
    residuals: ca.SX = field(default_factory=lambda: ca.SX(0, 1))
    residual_names: tuple[str, ...] = ()
    time: ca.SX = field(default_factory=lambda: ca.SX.sym("time"))
    start_time: float | ca.SX = 0.0
    final_time: float | ca.SX = 1.0
    free: tuple[FreeNumber, ...] = ()
    parameters: tuple[Parameter, ...] = ()
    integrand: ca.SX | float = 0.0
    objective: ca.SX | float = 0.0
    path_limits: tuple[Limit, ...] = ()
    boundary: tuple[Limit, ...] = ()
    points: tuple[PointValue, ...] = ()

    def __post_init__(self) -> None:
        self._require_shapes()
        self._require_unique_names()
        self._require_finite()
        self._require_known_symbols()

    @property
    def signals(self) -> tuple[Signal, ...]:
        """States, algebraics and inputs, in this order."""
        return (*self.states, *self.algebraics, *self.inputs)

    def _require_shapes(self) -> None:
        for found, expected, what in (
            (self.ode.numel(), len(self.states), "derivatives for the states"),
            (self.residuals.numel(), len(self.algebraics), "residuals for the algebraics"),
        ):
            if found != expected:
                raise ValueError(f"control problem: {found} {what}, expected {expected}, one for each")
        if self.residual_names and len(self.residual_names) != len(self.algebraics):
            raise ValueError(
                f"control problem: {len(self.residual_names)} names of residuals, "
                f"expected {len(self.algebraics)}"
            )
        for item in (*self.signals, *self.free):
            if not (item.symbol.is_scalar() and item.symbol.is_symbolic()):
                raise ValueError(f"{item.name}: expected a scalar symbol, found {item.symbol}")
        for point in self.points:
            if point.symbol.shape != point.expression.shape:
                raise ValueError(
                    f"point {point.symbol}: shape {point.symbol.shape}, "
                    f"its expression has {point.expression.shape}"
                )

    def _require_unique_names(self) -> None:
        names = [item.name for item in (*self.signals, *self.free, *self.parameters)]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(
                    f"control problem: two variables are called '{name}'; give each a name of its own"
                )

    def _require_known_symbols(self) -> None:
        numbers = [item.symbol for item in (*self.free, *self.parameters)]
        running = [*numbers, self.time, *(signal.symbol for signal in self.signals)]
        points = [*numbers, *(point.symbol for point in self.points)]
        checks = [
            ("ode", self.ode, running),
            ("residuals", self.residuals, running),
            ("integrand", self.integrand, running),
            ("objective", self.objective, points),
            ("start_time", self.start_time, numbers),
            ("final_time", self.final_time, numbers),
        ]
        checks += [
            (f"limit '{x.name}'", e, running)
            for x in self.path_limits
            for e in (x.expression, x.lower, x.upper)
        ]
        checks += [
            (f"limit '{x.name}'", e, points) for x in self.boundary for e in (x.expression, x.lower, x.upper)
        ]
        checks += [(f"point {x.symbol}", x.expression, running) for x in self.points]
        checks += [(f"time of point {x.symbol}", x.time, numbers) for x in self.points]
        for what, expression, known in checks:
            if not isinstance(expression, ca.SX):
                continue
            names = {symbol.element_hash() for part in known for symbol in ca.symvar(part)}
            strangers = [
                str(symbol) for symbol in ca.symvar(expression) if symbol.element_hash() not in names
            ]
            if strangers:
                raise ValueError(
                    f"control problem: {what} contains {', '.join(strangers)}, unknown there; "
                    + (
                        "a signal is used at a time, as a point"
                        if known is points
                        else "expected the signals, time, free numbers and parameters"
                        if known is running
                        else "expected free numbers and parameters"
                    )
                )

    def _require_finite(self) -> None:
        for item in (*self.signals, *self.free):
            if np.isnan(item.min) or np.isnan(item.max) or item.min > item.max:
                raise ValueError(f"{item.name}: min {item.min} and max {item.max} leave no value")
            if not (np.isfinite(item.nominal) and item.nominal > 0):
                raise ValueError(f"{item.name}: nominal {item.nominal}, expected a positive number")
        for number in self.free:
            if not np.isfinite(number.guess):
                raise ValueError(f"{number.name}: first guess {number.guess}, expected a finite number")
