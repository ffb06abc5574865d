"""From a problem in the model's symbols to a control problem in states, algebraics and inputs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from typing import Any

import casadi as ca
import numpy as np

from gantrytau import Dae, ModelError
from gantrytau.compiler.symbol_spaces import together
from gantrytau.compiler.system import Causality, System
from gantrytau.flattening.flat_model import FlatVariable
from gantrytau.language.symbols import time
from gantrytau_optimica.control.built import Built, with_values
from gantrytau_optimica.control.cancellation import without_cancelled
from gantrytau_optimica.control.conditions import link_conditions, start_conditions, with_targets
from gantrytau_optimica.control.constant_algebraics import without_constants
from gantrytau_optimica.control.control_problem import (
    ControlProblem,
    Course,
    FreeNumber,
    Limit,
    Phase,
    Pieces,
    PointValue,
    Signal,
)
from gantrytau_optimica.control.first_guesses.duration_guess import at_pace
from gantrytau_optimica.control.first_guesses.guesses import first_guesses, horizon, number_guess
from gantrytau_optimica.control.input_rates import Rates, check_pieces, check_reached, input_rates, lifted
from gantrytau_optimica.control.limits import check_symbols, limit_rows, with_limits
from gantrytau_optimica.control.root_margins import with_margins
from gantrytau_optimica.control.sizes import with_sizes
from gantrytau_optimica.problem.model_words import algebraic_words
from gantrytau_optimica.problem.symbolic_problem import ConstraintRow, SymbolicProblem


def build(
    read: SymbolicProblem,
    guess: Mapping[str, Any],
    held: Sequence[str] = (),
    controls: Mapping[str, Pieces] | None = None,
    causality: Causality | None = None,
) -> Built:
    """Bring a problem into the form that is transcribed.

    held: scalar parameters that stay symbols; controls: how inputs are made, by scalar name; causality: see Dae.system.
    Raises ModelError where it cannot be brought into that form.
    """
    dae, system = read.dae, read.dae.system("lifted", causality)
    chosen = _free_numbers(dae, guess, held)
    open_names = {n.name for n in chosen}
    numbers = {n: dae.parameter_values[n] for n in dae.adjustable if n not in open_names}
    rates = input_rates(read, [*system.to_system(_statements(read)), system.ode, system.residuals])
    check_pieces(rates, controls or {})
    conditions = (start_conditions(dae), link_conditions(read, rates))
    points = (*read.points, *(p for more, _ in conditions for p in more))
    constraints = (*read.constraints, *(c for _, more in conditions for c in more))
    limits = (*constraints, *_declared_limits(dae))

    rows, values, times, (objective, *targets), stages = _resolved(read, system, numbers, limits, points)
    split = _split(read, system, numbers, dict(controls or {}), rates)
    phases = []
    for k, (integrand, start_time, final_time) in enumerate(zip(*[iter(stages)] * 3, strict=True)):
        mine = [i for i, p in enumerate(points) if read.phase_of(p.expression, f"`{p.symbol}`") == k]
        phase = replace(
            split.phase(k),
            start_time=start_time,
            final_time=final_time,
            integrand=integrand,
            points=tuple(PointValue(points[i].symbol, values[i], times[i]) for i in mine),
        )
        _check_courses(read, k, phase)
        phases.append(with_targets(read, k, phase, targets, objective))
    integrated = [t.symbol for t in read.targets if t.integrated]
    if integrated:
        objective = ca.substitute(objective, ca.vertcat(*integrated), ca.SX.zeros(len(integrated), 1))
    draft = ControlProblem(read.name, time, tuple(phases), chosen, objective, ())
    found = iter(rows)
    sorted_rows = [
        row for c in limits for row in limit_rows(c, next(found), next(found), next(found), read.name)
    ]
    draft = with_limits(draft, [*sorted_rows, *_in_order(draft)])
    check_symbols(draft, read.name)
    check_reached(draft, zip(limits, rows[::3], strict=True))
    outright = {a.name: a.closed for a in system.algebraics if a.closed is not None}
    closed = dict(zip(outright, with_values([*outright.values()], read, {}), strict=True))
    built = Built(read, draft, system, numbers, points, constraints, closed, causality)
    built = at_pace(without_constants(built, guess), guess)
    return replace(built, problem=with_margins(with_sizes(with_guesses(built, guess))))


def _resolved(
    read: SymbolicProblem,
    system: System,
    numbers: Mapping[str, float],
    limits: Sequence[Any],
    points: Sequence[Any],
) -> tuple[list[ca.SX], list[ca.SX], list[Any], list[ca.SX], list[ca.SX]]:
    """In symbols of the system: expressions and bounds of limits, values and times of points, objective and targets, and
    integrand, start and final time of each phase.
    """
    said = (
        [e for c in limits for e in (c.expression, c.lower, c.upper)],
        [p.expression for p in points],
        [p.time for p in points if not isinstance(p.time, str)],
        [read.objective, *(t.expression for t in read.targets)],
        [e for stage in read.phases for e in (stage.integrand, stage.start_time, stage.final_time)],
    )
    reduced = together(read.dae.to_reduced, [ca.SX(e) for part in said for e in part])
    resolved = iter(with_values(system.to_system(reduced), read, numbers))
    rows, values, moments, costs, stages = (list(islice(resolved, len(part))) for part in said)
    moving = iter(moments)
    times = [p.time if isinstance(p.time, str) else next(moving) for p in points]
    return rows, values, times, costs, stages


def _split(
    read: SymbolicProblem,
    system: System,
    numbers: Mapping[str, float],
    controls: dict[str, Pieces],
    rates: Rates,
) -> "_Split":
    """The equations with these numbers."""
    equations = with_values([system.ode, system.residuals], read, numbers)
    if any(a.min >= 0.0 for a in system.algebraics):  # positions that follow from roots w leave x - (x - w)
        equations = without_cancelled(equations)
    ode, residuals = equations
    return _Split(read, system, ode, residuals, controls, rates)


def _statements(read: SymbolicProblem) -> list[ca.SX]:
    """All expressions of the problem beside the model, in reduced symbols."""
    found = [read.objective, *(phase.integrand for phase in read.phases)]
    found += [e for c in read.constraints for e in (c.expression, c.lower, c.upper)]
    found += [one.expression for one in (*read.points, *read.targets)]
    return together(read.dae.to_reduced, [ca.SX(e) for e in found])


def _check_courses(read: SymbolicProblem, number: int, phase: Phase) -> None:
    """ModelError for samples of inputs that do not cover the phase or have gaps."""
    if not (phase.states and phase.start_time.is_constant() and phase.final_time.is_constant()):
        return  # without states nothing is needed between the samples; free times are refused where they are read
    for name, course in read.courses.items():
        if not isinstance(course, ca.SX) and (len(read.phases) == 1 or read.phases[number].owns(name)):
            what = f"{read.name}, input {name}"
            course[0].require(what, float(phase.start_time), float(phase.final_time), between=True)


def _in_order(draft: ControlProblem) -> list[Limit]:
    """Ends after starts, of phases whose times are free and could change places."""
    found = []
    low = ca.DM([n.min if np.isfinite(n.min) else -1e20 for n in draft.free])
    high = ca.DM([n.max if np.isfinite(n.max) else 1e20 for n in draft.free])
    for phase in draft.phases:
        length = phase.final_time - phase.start_time
        slope = ca.jacobian(length, draft.numbers)
        if length.is_constant() or not slope.is_constant():
            continue
        offset = float(ca.substitute(length, draft.numbers, ca.DM.zeros(len(draft.free))))
        slope = ca.DM(slope)
        least = offset + float(ca.sum2(ca.fmin(slope * low.T, slope * high.T)))
        if least <= 0:
            start, stop = horizon(draft, phase)
            name = f"the end of {phase.name or draft.name} comes after its start"
            found.append(Limit(length, 1e-6 * (stop - start), np.inf, name))
    return found


def with_guesses(built: Built, guess: Mapping[str, Any]) -> ControlProblem:
    """The control problem with first guesses along its free and held numbers as they are."""
    guesses = first_guesses(built, guess)
    return built.problem.with_signals(lambda _, signal: replace(signal, guess=guesses[signal.name]))


@dataclass(frozen=True, eq=False)
class _Split:
    """The system of equations split by phases."""

    read: SymbolicProblem
    system: System
    ode: ca.SX
    residuals: ca.SX
    controls: dict[str, Pieces]
    rates: Rates

    def phase(self, number: int) -> Phase:
        """The dynamics of one phase; its times, costs and points are still missing."""
        system, words = self.system, algebraic_words(self.read.dae)
        nominal = {n: x for v in self.read.dae.flat.variables for n, x in _nominals(v, self.read.dae)}
        states = [k for k, name in enumerate(system.states) if self._owner(name) == number]
        algebraics = [k for k, a in enumerate(system.algebraics) if self._owner(a.name) == number]
        inputs, courses, moved = [], [], []
        for name, symbol in zip(system.inputs, system.u.elements(), strict=True):
            if self._owner(name) != number:
                continue
            course = self.read.courses.get(name)
            if course is None:
                states_of, name, symbol = lifted(name, symbol, self.rates)
                moved += [(_signal(n, x, nominal.get(n, np.nan)), rate) for n, x, rate in states_of]
                pieces = self.controls.get(name, Pieces())
                inputs.append(_signal(name, symbol, nominal.get(name, np.nan), pieces))
            elif not isinstance(course, ca.SX):
                samples, column = course
                courses.append(
                    Course(
                        name,
                        symbol,
                        partial(samples.at, column=column),
                        samples.jumps(column),
                        samples.kinks(),
                    )
                )
        return Phase(
            name=self.read.phases[number].name,
            start_time=ca.SX(0),
            final_time=ca.SX(1),
            states=(
                *(
                    _signal(system.states[k], system.x[k], nominal.get(system.states[k], np.nan))
                    for k in states
                ),
                *(signal for signal, _ in moved),
            ),
            algebraics=tuple(
                replace(_signal(a.name, a.symbol), min=a.min, words=words.get(a.name, ("", a.name))[1])
                for a in (system.algebraics[k] for k in algebraics)
            ),
            inputs=tuple(inputs),
            courses=tuple(courses),
            ode=ca.vertcat(self.ode[states] if states else ca.SX(0, 1), *(rate for _, rate in moved)),
            residuals=self.residuals[algebraics] if algebraics else ca.SX(0, 1),
            residual_names=tuple(
                words.get(a.name, (f"the equation of {a.name}", ""))[0]
                for a in (system.algebraics[k] for k in algebraics)
            ),
            integrand=ca.SX(0),
        )

    def _owner(self, name: str) -> int:
        """Number of the phase of a variable, a derivative, or the square root in one."""
        if len(self.read.phases) == 1:
            return 0
        while (bare := name.removeprefix("sqrt(").removeprefix("der(")) != name:
            name = bare
        return next(k for k, phase in enumerate(self.read.phases) if phase.owns(name))


def _signal(name: str, symbol: ca.SX, nominal: float = np.nan, pieces: Pieces | None = None) -> Signal:
    return Signal(name, symbol, -np.inf, np.inf, nominal, np.zeros_like, pieces=pieces or Pieces())


def _nominals(variable: FlatVariable, dae: Dae) -> list[tuple[str, float]]:
    """Declared typical sizes by scalar name."""
    if variable.nominal is None:
        return []
    numbers = (abs(dae.number(x)) for x in variable.nominal)
    return [(n, x) for n, x in zip(variable.elements, numbers, strict=True) if x > 0]


def _free_numbers(dae: Dae, guess: Mapping[str, Any], held: Sequence[str]) -> tuple[FreeNumber, ...]:
    """Numbers that the optimiser chooses, and parameters that are held for one solve."""
    values, symbols = dae.parameter_values, dae.parameter_symbols
    found = []
    for parameter in dae.flat.parameters:
        for k, name in enumerate(parameter.elements):
            if parameter.free and name in dae.adjustable:
                low, high = _range(parameter, k, dae, held)
                start = number_guess(name, guess, values[name])
                found.append(FreeNumber(name, symbols[name], low, high, start))
            elif name in held:
                if name not in dae.adjustable:
                    raise ModelError(
                        f"parameters: {name} follows from others or shapes the equations, expected one that can "
                        "change; change what it follows from, or build a new problem for each value"
                    )
                value = values[name]
                found.append(FreeNumber(name, symbols[name], value, value, value, held=True))
    return tuple(found)


def _declared_limits(dae: Dae) -> list[ConstraintRow]:
    """Min and max of every variable of the model, eliminated ones included, and ends of tables with outside="error"."""
    found = []
    for variable in dae.flat.variables:
        if variable.min is None and variable.max is None:
            continue
        for k, (name, symbol) in enumerate(zip(variable.elements, variable.symbol.elements(), strict=True)):
            low = variable.min[k] if variable.min is not None else ca.SX(-ca.inf)
            high = variable.max[k] if variable.max is not None else ca.SX(ca.inf)
            found.append(ConstraintRow(symbol, low, high, f"limits of {name}"))
    for one in dae.flat.ranges:
        words = f"{one.name} between the ends of its table, {one.low:g} and {one.high:g}"
        found.append(ConstraintRow(one.expression, ca.SX(one.low), ca.SX(one.high), words))
    return found


def _range(parameter: FlatVariable, k: int, dae: Dae, held: Sequence[str]) -> tuple[float, float]:
    for limit in (parameter.min, parameter.max):
        leaves = {leaf.name() for leaf in ca.symvar(dae.to_reduced(limit[k]))} if limit is not None else set()
        for name in leaves & set(held):
            raise ModelError(
                f"{parameter.name}: its limits depend on {name}, which is to change, expected numbers; write the limit in "
                "constraints()"
            )
    low = -np.inf if parameter.min is None else dae.number(parameter.min[k])
    high = np.inf if parameter.max is None else dae.number(parameter.max[k])
    if not low <= high:
        raise ModelError(f"{parameter.name}: limits {low:g} and {high:g} cross; make min the smaller")
    return low, high
