"""From a problem in the model's symbols to a control problem in states, algebraics and inputs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from gantrytau import Dae, ModelError
from gantrytau.flat_model import FlatVariable
from gantrytau.symbols import time
from gantrytau.system import System
from gantrytau_optimica.guesses import first_guesses, typical_size
from gantrytau_optimica.optimization import Point
from gantrytau_optimica.reading import Constraint, ReadProblem
from gantrytau_optimica.records import ControlProblem, FreeNumber, PointValue, Signal
from gantrytau_optimica.sorting import check_symbols, limit_rows, signal_limits, sorted_limits
from gantrytau_optimica.wording import algebraic_words


@dataclass(frozen=True, eq=False)
class Built:
    """The control problem, and what leads back from it to the model's names."""

    read: ReadProblem
    problem: ControlProblem
    system: System
    numbers: Mapping[str, float]  # parameters that are neither free nor held
    points: tuple[Point, ...]
    constraints: tuple[Constraint, ...]


def build(read: ReadProblem, guess: Mapping[str, Any], held: Sequence[str] = ()) -> Built:
    """Bring a problem into the form that is transcribed; `held`: parameters that stay symbols, scalars.

    Raises ModelError where it cannot be brought into that form.
    """
    dae = read.dae
    system = dae.system("lifted")
    numbers_chosen = _free_numbers(dae, guess, held)
    open_names = {n.name for n in numbers_chosen}
    numbers = {n: dae.table.values[n] for n in dae.table.independent if n not in open_names}
    more_points, more = _start_conditions(dae)
    points = (*read.points, *more_points)
    constraints = (*read.constraints, *more)
    limits = (*constraints, *_declared_limits(dae))
    expressions = [
        *(read.objective, read.integrand, read.start_time, read.final_time),
        *(p.expression for p in points),
        *(p.time for p in points if not isinstance(p.time, str)),
        *(e for c in limits for e in (c.expression, c.lower, c.upper)),
    ]
    found = iter(_numbered(system.express([ca.SX(e) for e in expressions]), dae, numbers))
    objective, integrand, start_time, final_time = (next(found) for _ in range(4))
    values = [next(found) for _ in points]
    times = [p.time if isinstance(p.time, str) else next(found) for p in points]
    rows = [row for c in limits for row in limit_rows(c, next(found), next(found), next(found), read.name)]
    ode, residuals = _numbered([system.ode, system.residuals], dae, numbers)
    words = algebraic_words(dae)
    draft = ControlProblem(
        time=time,
        start_time=start_time,
        final_time=final_time,
        states=_signals(system.states, system.x.elements()),
        algebraics=tuple(
            Signal(a.name, a.symbol, a.min, np.inf, 1.0, np.zeros_like, words.get(a.name, ("", a.name))[1])
            for a in system.algebraics
        ),
        inputs=_signals(system.inputs, system.u.elements()),
        free=numbers_chosen,
        ode=ode,
        residuals=residuals,
        residual_names=tuple(
            words.get(a.name, (f"the equation of {a.name}", ""))[0] for a in system.algebraics
        ),
        integrand=integrand,
        objective=objective,
        path_limits=(),
        boundary=(),
        points=tuple(PointValue(p.symbol, v, t) for p, v, t in zip(points, values, times, strict=True)),
    )
    path, boundary = sorted_limits(draft, rows, read.name)
    draft = replace(draft, path_limits=path, boundary=boundary)
    check_symbols(draft, read.name)
    built = Built(read, draft, system, numbers, points, constraints)
    return replace(built, problem=_with_sizes(with_guesses(built, guess), read.name))


def with_guesses(built: Built, guess: Mapping[str, Any]) -> ControlProblem:
    """The control problem with first guesses along its free and held numbers as they are."""
    draft = built.problem
    guesses = first_guesses(
        built.read, draft, built.system, built.numbers, built.points, built.constraints, guess
    )

    def done(signals: tuple[Signal, ...]) -> tuple[Signal, ...]:
        return tuple(replace(s, guess=guesses[s.name]) for s in signals)

    return replace(
        draft, states=done(draft.states), algebraics=done(draft.algebraics), inputs=done(draft.inputs)
    )


def _with_sizes(draft: ControlProblem, name: str) -> ControlProblem:
    bounds = signal_limits(draft, name)

    def done(signals: tuple[Signal, ...]) -> tuple[Signal, ...]:
        return tuple(replace(s, nominal=typical_size(s.guess, bounds[s.name])) for s in signals)

    return replace(
        draft, states=done(draft.states), algebraics=done(draft.algebraics), inputs=done(draft.inputs)
    )


def _signals(names: Sequence[str], symbols: Sequence[ca.SX]) -> tuple[Signal, ...]:
    return tuple(
        Signal(n, s, -np.inf, np.inf, 1.0, np.zeros_like) for n, s in zip(names, symbols, strict=True)
    )


def _free_numbers(dae: Dae, guess: Mapping[str, Any], held: Sequence[str]) -> tuple[FreeNumber, ...]:
    """Numbers that the optimiser chooses, and parameters that are held for one solve."""
    table = dae.table
    found = []
    for parameter in dae.flat.parameters:
        for k, name in enumerate(parameter.elements):
            if parameter.free and name in table.independent:
                low, high = _range(parameter, k, dae)
                start = number_guess(name, guess, table.values[name])
                found.append(FreeNumber(name, table.symbols[name], low, high, start))
            elif name in held:
                if name not in table.independent:
                    raise ModelError(
                        f"parameters: {name} follows from others or shapes the equations, expected one that can "
                        "change; change what it follows from, or build a new problem for each value"
                    )
                value = table.values[name]
                found.append(FreeNumber(name, table.symbols[name], value, value, value, held=True))
    return tuple(found)


def number_guess(name: str, guess: Mapping[str, Any], otherwise: float) -> float:
    """The guess of a free number; ModelError if it is none."""
    if name not in guess:
        return otherwise
    try:
        value = float(np.asarray(guess[name], dtype=float).item())
    except (TypeError, ValueError):
        raise ModelError(f"guess {name}: found {guess[name]!r}, expected a number") from None
    if not np.isfinite(value):
        raise ModelError(f"guess {name}: found {value}, expected a finite number")
    return value


def _numbered(expressions: list[ca.SX], dae: Dae, numbers: Mapping[str, float]) -> list[ca.SX]:
    """Parameters that are not free replaced by their numbers."""
    if not numbers:
        return expressions
    symbols = ca.vertcat(*(dae.table.symbols[n] for n in numbers))
    return ca.substitute(expressions, [symbols], [ca.SX(ca.DM(list(numbers.values())))])


def _start_conditions(dae: Dae) -> tuple[list[Point], list[Constraint]]:
    """Fixed starts and initial equations of the model, as conditions at the initial time."""
    points: list[Point] = []
    found: list[Constraint] = []
    for variable in dae.flat.variables:
        if not variable.fixed or variable.start is None:
            continue
        for name, symbol, value in zip(
            variable.elements, variable.symbol.elements(), variable.start, strict=True
        ):
            points.append(Point(ca.SX.sym(f"initial({name})"), symbol, "initial"))
            found.append(
                Constraint(points[-1].symbol, value, value, f"initial({name}) == {value} (fixed start)")
            )
    for equation in dae.flat.initial_equations:
        points.append(Point(ca.SX.sym(f"initial({equation.text})"), equation.residual, "initial"))
        zero = ca.SX(0)
        found.append(Constraint(points[-1].symbol, zero, zero, f"initial equation {equation.text}"))
    return points, found


def _declared_limits(dae: Dae) -> list[Constraint]:
    """Min and max of every variable of the model, eliminated ones included."""
    found = []
    for variable in dae.flat.variables:
        if variable.min is None and variable.max is None:
            continue
        for k, (name, symbol) in enumerate(zip(variable.elements, variable.symbol.elements(), strict=True)):
            low = variable.min[k] if variable.min is not None else ca.SX(-ca.inf)
            high = variable.max[k] if variable.max is not None else ca.SX(ca.inf)
            found.append(Constraint(symbol, low, high, f"limits of {name}"))
    return found


def _range(parameter: FlatVariable, k: int, dae: Dae) -> tuple[float, float]:
    low = -np.inf if parameter.min is None else float(dae.table.number(parameter.min[k])[0])
    high = np.inf if parameter.max is None else float(dae.table.number(parameter.max[k])[0])
    if not low <= high:
        raise ModelError(f"{parameter.name}: limits {low:g} and {high:g} cross; make min the smaller")
    return low, high
