"""Sensitivities of an optimum: how its objective, its free numbers and its signals change with parameters."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from gantrytau import ModelError, heeding_interrupts
from gantrytau.compiler.request import names
from gantrytau.describing.record import Record
from gantrytau_optimica.answers.optimum import Optimum
from gantrytau_optimica.studies.boundary_arcs import with_free_ends
from gantrytau_optimica.studies.held_parameters import holding
from gantrytau_optimica.studies.kkt import ActiveSet, Slopes, objective_slopes, slopes
from gantrytau_optimica.studies.signal_slopes import Movement

PREDICTED = "predicted to first order, not solved"


@dataclass(frozen=True, eq=False)
class Sensitivities(Record):
    """Derivatives of an optimum with respect to `parameters` (scalar names), with the limits that bind now.

    slopes: of the program's unknowns; one column per parameter.
    """

    optimum: Optimum
    parameters: tuple[str, ...]
    slopes: Slopes

    @property
    def defined(self) -> bool:
        """Whether signals have one derivative; if not, the one given lies between those of both sides."""
        return self.slopes.defined and not self.weak

    @cached_property
    def objective(self) -> dict[str, Any]:
        """Derivative of the objective by parameter, from the multipliers, as exact as the mesh; where limits on states bind,
        with the ends of these arcs free to move. Of a vector (k,) by its name too.
        """
        found = dict(zip(self.parameters, self.slopes.objective.tolist(), strict=True))
        return {**found, **{name: self.slopes.objective[columns] for name, columns in self._vectors.items()}}

    @cached_property
    def free(self) -> dict[tuple[str, str], float]:
        """Derivatives of the free numbers by (number, parameter)."""
        problem, places = self.optimum.program.problem, self.optimum.program.places.free
        return {
            (number.name, parameter): float(self.slopes.unknowns[place, column])
            for number, place in zip(problem.free, places, strict=True)
            if not number.held
            for column, parameter in enumerate(self.parameters)
        }

    @cached_property
    def weak(self) -> tuple[str, ...]:
        """Limits that bind without a multiplier, with their times: beyond them derivatives differ to both sides."""
        return tuple(_weakly_binding(self.optimum, self.slopes.bounds, self.slopes.rows))

    def signal(self, name: str, parameter: str) -> Callable[[Any], np.ndarray]:
        """Derivative of a variable at a fixed time as a vectorised function of time (n,) -> (n,) or (n, k).

        With a parameter that is a vector of m elements: (n, m) or (n, k, m). Where an input jumps at a time that
        depends on the parameter, this is the derivative beside the jump.
        """
        columns = self._columns(parameter)
        elements = self.optimum.dae.expand(name)
        whole = elements != (name,)
        movements = [Movement(self.optimum, elements, self.slopes.unknowns[:, c]) for c in columns]

        def value(times: Any) -> np.ndarray:
            times = np.asarray(times, dtype=float)
            rows = np.array([movement.at(np.atleast_1d(times)) for movement in movements])  # (m, k, n)
            found = np.transpose(rows, (2, 1, 0))
            found = found if whole else found[:, 0]
            found = found if parameter in self._vectors else found[..., 0]
            return found if times.ndim else found[0]

        return value

    def predict(self, parameters: Mapping[str, Any]) -> Optimum:
        """The optimum for other values of parameters to first order; parameters that are not named stay.

        It is an Optimum with `success` False, so that its signals can be looked up and it can be a `guess`; its
        objective is the first-order one. Values are kept within their limits.
        """
        step = np.zeros(len(self.parameters))
        for name, value in parameters.items():
            columns = self._columns(name)
            numbers = np.asarray(value, dtype=float).ravel(order="F")
            if numbers.size != len(columns) or not np.all(np.isfinite(numbers)):
                raise ModelError(f"predict {name}: found {value!r}, expected {len(columns)} finite numbers")
            step[columns] = numbers - [self._values[self.parameters[c]] for c in columns]
        return _moved(
            self.optimum, self.slopes.unknowns @ step, float(self.slopes.objective @ step), self._values
        )

    def report(self) -> str:
        """Per parameter its value and what 1 % more of it changes; limits that bind weakly."""
        lines = [
            f"{self.optimum.name}: objective {self.optimum.objective:.8g}; with 1 % more of a parameter, or 0.01 of one "
            "that is zero:"
        ]
        ranked = sorted(self.parameters, key=lambda n: -abs(self.objective[n] * self._percent(n)))
        for name in ranked:
            change = self.objective[name] * self._percent(name)
            share = f" ({change / self.optimum.objective:+.3%})" if self.optimum.objective else ""
            lines.append(
                f"  {name} = {self._values[name]:.6g}: objective {change:+.4g}{share}, derivative {self.objective[name]:.6g}"
            )
        if not self.slopes.defined:
            lines.append(
                "The limits that bind depend on each other: signals have different derivatives to both sides."
            )
        if self.weak:
            lines.append("Limits that bind weakly, where signals have different derivatives to both sides:")
            lines += [f"  {line}" for line in self.weak[:12]]
        return "\n".join(lines)

    def _percent(self, name: str) -> float:
        return 0.01 * (self._values[name] or 1.0)

    @cached_property
    def _values(self) -> dict[str, float]:
        numbers = self.optimum.numbers
        return {name: numbers[name] for name in self.parameters}

    @cached_property
    def _vectors(self) -> dict[str, list[int]]:
        """Columns of vectors whose elements are all here."""
        place = {name: column for column, name in enumerate(self.parameters)}
        return {
            name: [place[e] for e in vector.elements]
            for name, vector in self.optimum.dae.vectors.items()
            if tuple(vector.elements) != (name,) and all(e in place for e in vector.elements)
        }

    def _columns(self, parameter: str) -> list[int]:
        if parameter in self.parameters:
            return [self.parameters.index(parameter)]
        if parameter in self._vectors:
            return self._vectors[parameter]
        self.optimum.dae.expand(parameter)
        raise ModelError(
            f"{self.optimum.name}: {parameter} is not among the parameters {', '.join(self.parameters)} of these "
            "sensitivities; name it in sensitivities(optimum, [...])"
        )


@heeding_interrupts()
def sensitivities(optimum: Optimum, parameters: Sequence[str] | None = None) -> Sensitivities:
    """Derivatives of an optimum with respect to parameters, at most one sparse factorisation for all.

    parameters: names, vectors too; default: those named in `prepare`. Others are held at their declared values, and
    the optimum is solved again from where it stands only if that changes the rows of the program. Raises ModelError for
    what is no parameter or not solved, SolveError if the optimum is not found again.
    """
    if not optimum.success:
        raise ModelError(
            f"{optimum.name}: {optimum.status}; sensitivities are those of a solution, expected one: solve it first"
        )
    numbers = optimum.program.problem.free
    held = {n.name for n in numbers if n.held}
    if parameters is None:
        parameters = [n.name for n in numbers if n.held]
    wanted = list(dict.fromkeys(e for name in names(parameters) for e in _parameter(optimum, name)))
    if not wanted:
        raise ModelError(
            f"{optimum.name}: no parameters are named, expected some; name them in sensitivities(optimum, [...]) or in "
            "prepare(parameters=[...])"
        )
    _check_limits(optimum, wanted)
    missing = [n for n in wanted if n not in held]
    if missing:
        optimum = holding(optimum, missing)
    program = optimum.program
    place = {n.name: p for n, p in zip(program.problem.free, program.places.free, strict=True)}
    found = slopes(program, optimum.solution, np.array([place[n] for n in wanted]))
    free = with_free_ends(optimum)
    if free is not None:
        program, solution = free
        place = {n.name: p for n, p in zip(program.problem.free, program.places.free, strict=True)}
        moved = objective_slopes(program, solution, np.array([place[n] for n in wanted]))
        found = replace(found, objective=moved)
    return Sensitivities(optimum, tuple(wanted), found)


def _parameter(optimum: Optimum, name: str) -> tuple[str, ...]:
    elements = tuple(optimum.dae.expand(name))
    for element in elements:
        if element in optimum.free:
            raise ModelError(
                f"{optimum.name}: {element} is chosen by the optimiser, expected a parameter; ask for the sensitivity of "
                f"{element} with `.free[{element!r}, parameter]`"
            )
        if element not in optimum.dae.parameter_symbols:
            raise ModelError(
                f"{optimum.name}: {name} is no parameter, expected one; declare it as a Parameter"
            )
    return elements


def _check_limits(optimum: Optimum, wanted: Sequence[str]) -> None:
    """ModelError where a limit of a free number follows from a parameter: the program knows its number only."""
    for parameter in optimum.dae.flat.parameters:
        for limit in (parameter.min, parameter.max) if parameter.free else ():
            leaves = (
                set()
                if limit is None
                else {leaf.name() for leaf in ca.symvar(optimum.dae.to_reduced(ca.vertcat(*limit)))}
            )
            for name in wanted:
                if name in leaves:
                    raise ModelError(
                        f"{optimum.name}: a limit of {parameter.name} follows from {name}, expected a number there; write "
                        f"the limit of {parameter.name} in `constraints`"
                    )


def _moved(optimum: Optimum, step: np.ndarray, change: float, held: Mapping[str, float]) -> Optimum:
    """The optimum with its unknowns moved by a step."""
    program, solution = optimum.program, optimum.solution
    w = solution.w + step
    free = tuple(
        replace(n, guess=float(w[p]), min=float(w[p]), max=float(w[p])) if n.name in held else n
        for n, p in zip(program.problem.free, program.places.free, strict=True)
    )
    built = replace(optimum.built, problem=replace(optimum.built.problem, free=free))
    program = program.with_numbers(built.problem)
    scale = program.places.scale
    w = np.clip(w, program.lbw * scale, program.ubw * scale)
    constraints = np.array(program.assembled.nlp(w / scale, [])[1]).ravel()
    moved = replace(
        solution,
        w=w,
        constraints=constraints,
        objective=solution.objective + change,
        success=False,
        status=PREDICTED,
        iterations=0,
        solve_time=0.0,
    )
    return replace(optimum, built=built, program=program, solution=moved)


def _weakly_binding(optimum: Optimum, bounds: ActiveSet, rows: ActiveSet) -> list[str]:
    """Weakly binding limits in the model's words, with the time of the first."""
    program, found = optimum.program, []
    for phase, layout in zip(optimum.phases.values(), program.places.layouts, strict=True):
        for number, signal in enumerate(layout.phase.signals):
            mine = layout.of(number)
            weak = bounds.weak[mine]
            if np.any(weak):
                times = phase.times(layout.moment[mine - layout.first][weak])
                found.append(f"limit of {signal.words or signal.name} {_when(times)}")
    for number, place in zip(program.problem.free, program.places.free, strict=True):
        if bounds.weak[place]:
            found.append(f"limit of {number.name}")
    phases = list(optimum.phases.values())
    for group in program.groups:
        weak = rows.weak[group.rows]
        if np.any(weak):
            timed = group.phase >= 0 and not np.any(np.isnan(group.moments))
            when = f" {_when(phases[group.phase].times(group.moments[weak]))}" if timed else ""
            found.append(f"`{group.name}`{when}")
    return found


def _when(times: np.ndarray) -> str:
    shown = ", ".join(f"{t:.4g}" for t in times[:4])
    return f"at t = {shown} s" + (f" and {times.size - 4} more times" if times.size > 4 else "")
