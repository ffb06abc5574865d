"""One problem solved for value after value of a parameter, each from the one before."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gantrytau import SolveError, heeding_interrupts
from gantrytau_optimica.answers.optimum import Optimum
from gantrytau_optimica.prepared import Prepared
from gantrytau_optimica.solving.ipopt import Pressed
from gantrytau_optimica.transcription.program import Program

HALVINGS = 3  # of a step that fails: at most eight steps to the next value
BETTER = 1e-6  # relative: a lower objective by more is another minimum
FEASIBLE = 1e-6  # violation of scaled rows


@dataclass(frozen=True, eq=False)
class Continuation:
    """Optima by value of the parameter, in the order asked for, what failed, and what was noticed."""

    optima: dict[float, Optimum]
    failures: dict[float, SolveError]
    findings: tuple[str, ...]


@heeding_interrupts()
def follow(prepared: Prepared, name: str, values: Sequence[float]) -> Continuation:
    """Solve for all values of the held parameter `name`; Ctrl-C ends it, and what was found so far is kept."""
    found: dict[float, Optimum] = {}
    failures: dict[float, SolveError] = {}
    findings: list[str] = []
    stopped = False
    for attempt in (values, values):  # what failed is tried again from its neighbours
        for value in attempt:
            if value in found or stopped:
                continue
            try:
                found[value] = _next(prepared, name, found, value, findings)
                failures.pop(value, None)
            except SolveError as error:
                failures[value] = error
                stopped = error.interrupted
            except KeyboardInterrupt:
                failures[value] = SolveError("interrupted")
                stopped = True
    ordered = {value: found[value] for value in values if value in found}
    if not stopped:
        try:
            findings += _onto_better(prepared, name, ordered)
        except KeyboardInterrupt:
            findings.append("interrupted before all motions were compared with those of other values")
    return Continuation(ordered, failures, tuple(findings))


def _next(
    prepared: Prepared, name: str, found: dict[float, Optimum], value: float, findings: list[str]
) -> Optimum:
    """The optimum for a value, from that of the nearest one, in smaller steps where that fails."""
    if not found:
        return prepared.solve({name: value})
    nearest = min(found, key=lambda v: abs(v - value))
    steps: list[float] = []
    optimum = _approach(prepared, name, (nearest, found[nearest]), value, HALVINGS, steps)
    if len(steps) > 1:
        between = ", ".join(f"{step:g}" for step in steps[:-1])
        findings.append(f"{name} = {value:g} was reached from {nearest:g} by way of {between} only")
    return optimum


def _approach(
    prepared: Prepared, name: str, start: tuple[float, Optimum], value: float, halvings: int, steps: list[float]
) -> Optimum:  # fmt: skip
    try:
        optimum = solve_from(prepared, name, start[1], value)
    except SolveError as error:
        middle = _between(start[0], value)
        if halvings == 0 or error.interrupted or middle in (start[0], value):
            raise
        near = _approach(prepared, name, start, middle, halvings - 1, steps)
        return _approach(prepared, name, (middle, near), value, halvings - 1, steps)
    steps.append(value)
    return optimum


def solve_from(prepared: Prepared, name: str, start: Optimum, value: float) -> Optimum:
    """Solve for a value of one held parameter, from the unknowns of an optimum of the same program."""
    program = _at(start, prepared.program, name, value)
    try:
        solution = prepared.solver.solve(program, start.solution.w)
    except Pressed as pressed:
        reached = replace(start, program=program, solution=pressed.solution)
        raise SolveError(reached.report(), optimum=reached) from pressed
    if solution.success and program.astray(solution.w):  # times of conditions moved into other elements
        return prepared.solve({name: value}, guess=start if len(start.phases) == 1 else None)
    built = replace(start.built, problem=program.problem)
    optimum = replace(start, built=built, program=program, solution=solution)
    if not solution.success:
        raise SolveError(optimum.report(), optimum=optimum)
    return optimum


def _at(optimum: Optimum, program: Program, name: str, value: float) -> Program:
    """A program of the optimum with another value of a held parameter."""
    free = tuple(
        replace(n, guess=value, min=value, max=value) if n.name == name else n
        for n in optimum.program.problem.free
    )
    return program.with_numbers(replace(optimum.program.problem, free=free))


def _between(a: float, b: float) -> float:
    """The geometric mean of weights of one sign, else the arithmetic one."""
    return math.copysign(math.sqrt(a * b), a) if a * b > 0 else (a + b) / 2


def _onto_better(prepared: Prepared, name: str, optima: dict[float, Optimum]) -> list[str]:
    """Solve again where another value's motion costs less; what is still so is told. Changes `optima`."""
    findings = []
    for value in optima:
        cost, better = _cheapest(optima, name, value)
        margin = BETTER * max(1.0, abs(optima[value].objective))
        if cost >= optima[value].objective - margin:
            continue
        try:
            again = solve_from(prepared, name, optima[better], value)
        except SolveError:
            again = optima[value]
        if again.objective < optima[value].objective:
            optima[value] = again
        if cost < optima[value].objective - margin:
            findings.append(
                f"{name} = {value:g} has the objective {optima[value].objective:.8g}, the motion of {name} = {better:g} "
                f"would have {cost:.8g} there: a local minimum; try another guess="
            )
    return findings


def _cheapest(optima: dict[float, Optimum], name: str, value: float) -> tuple[float, float]:
    """The least objective that other optima, where they are feasible, have at a value, and whose it is."""
    costs = [(math.inf, value)]
    for other, optimum in optima.items():
        if other == value:
            continue
        program = _at(optimum, optimum.program, name, value)
        w = np.clip(optimum.solution.w / program.places.scale, program.lbw, program.ubw)
        objective, rows = (np.array(x).ravel() for x in program.assembled.nlp(w, []))
        off = np.max(np.maximum(program.lbg - rows, rows - program.ubg), initial=0.0)
        if off < FEASIBLE:
            costs.append((float(objective[0]), other))
    return min(costs)
