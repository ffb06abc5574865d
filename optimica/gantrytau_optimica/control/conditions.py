"""Conditions that the problem implies: fixed starts, initial equations, links of phases, and targets of samples."""

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca
import numpy as np

from gantrytau import Dae, ModelError, Samples
from gantrytau.language.symbols import derivative_name, split_derivative
from gantrytau_optimica.control.control_problem import Course, Phase, SampleSum
from gantrytau_optimica.control.input_rates import Rates
from gantrytau_optimica.problem.optimization import Point, Target
from gantrytau_optimica.problem.symbolic_problem import ConstraintRow, LinkedPaths, SymbolicProblem

Conditions = tuple[list[Point], list[ConstraintRow]]


def start_conditions(dae: Dae) -> Conditions:
    """Fixed starts and initial equations of the model, as conditions at the initial time."""
    points: list[Point] = []
    found: list[ConstraintRow] = []
    for variable in dae.flat.variables:
        if not variable.fixed or variable.start is None:
            continue
        for name, symbol, value in zip(
            variable.elements, variable.symbol.elements(), variable.start, strict=True
        ):
            points.append(Point(ca.SX.sym(f"initial({name})"), symbol, "initial"))
            found.append(
                ConstraintRow(points[-1].symbol, value, value, f"initial({name}) == {value} (fixed start)")
            )
    for equation in dae.flat.initial_equations:
        points.append(Point(ca.SX.sym(f"initial({equation.text})"), equation.residual, "initial"))
        zero = ca.SX(0)
        found.append(ConstraintRow(points[-1].symbol, zero, zero, f"initial equation {equation.text}"))
    return points, found


def link_conditions(read: SymbolicProblem, rates: Rates) -> Conditions:
    """States of a phase, and inputs whose rates are mentioned, that begin where those of the phase before end.

    ModelError for names that do not fit.
    """
    points: list[Point] = []
    found: list[ConstraintRow] = []
    for link in read.links:
        jumping = _jumping(read, link, rates)
        for state in _continuous(read, rates):
            base, order = split_derivative(state)
            if not base.startswith(f"{link.second}.") or _key(read.dae, state) in jumping:
                continue
            before = derivative_name(link.first + base[len(link.second) :], order)
            if state not in read.dae.states and split_derivative(before)[0] not in rates:
                continue  # an input that jumps in the phase before may do so at its end
            if split_derivative(before)[0] not in read.dae.variables:
                raise ModelError(
                    f"{read.name}: link({link.first}, {link.second}) finds no {before}, expected the same variables in both "
                    f"phases; write conditions with final(...) and initial(...), or name {state} in jump=[...]"
                )
            end, begin = ca.SX.sym(f"final({before})"), ca.SX.sym(f"initial({state})")
            points += [
                Point(end, read.dae.expression(before), "final"),
                Point(begin, read.dae.expression(state), "initial"),
            ]
            zero = ca.SX(0)
            found.append(ConstraintRow(begin - end, zero, zero, f"{state} begins where {before} ends"))
        phases = {p.name: p for p in read.phases}
        ends, begins = phases[link.first].final_time, phases[link.second].start_time
        if ends.is_constant() and begins.is_constant() and float(ends) != float(begins):
            raise ModelError(
                f"{read.name}: link({link.first}, {link.second}): {link.first} ends at {float(ends):g} s, where "
                f"{link.second} begins at {float(begins):g} s, expected one time for both; write "
                f"start_time = {float(ends):g} in {link.second}, or start_time = Free(...)"
            )
        if not begins.is_constant():
            gap = phases[link.second].start_time - phases[link.first].final_time
            zero = ca.SX(0)
            found.append(ConstraintRow(gap, zero, zero, f"{link.second} begins when {link.first} ends"))
    return points, found


def _continuous(read: SymbolicProblem, rates: Rates) -> list[str]:
    """States, and inputs with those of their rates that are states."""
    inputs = [derivative_name(name, k) for name, chain in rates.items() for k in range(len(chain))]
    return [*read.dae.states, *inputs]


def _jumping(read: SymbolicProblem, link: LinkedPaths, rates: Rates) -> set[str]:
    states = {_key(read.dae, state) for state in _continuous(read, rates)}
    found = set()
    for name in link.jump:
        for element in read.dae.expand(name):
            key = _key(read.dae, element)
            if key not in states:
                own = [n for n in _continuous(read, rates) if n.startswith(f"{link.second}.")]
                raise ModelError(
                    f"{read.name}: link, jump: {element} is no state of the phase, expected one of {', '.join(own)}"
                )
            found.add(key)
    return found


def _key(dae: Dae, name: str) -> str:
    alias = dae.root(name)
    return (alias and alias.symbol) or name


def with_targets(
    read: SymbolicProblem, number: int, phase: Phase, expressions: Sequence[ca.SX], objective: ca.SX
) -> Phase:
    """The phase with the sums over samples and integrals of errors that the objective asks of it.

    expressions: those of the targets in the symbols of the control problem.
    """
    sums: list[SampleSum] = []
    courses: list[Course] = []
    integrand = phase.integrand
    for target, expression in zip(read.targets, expressions, strict=True):
        if read.phase_of(target.expression, str(target.symbol)) != number:
            continue
        horizon = _horizon(read, phase, target)
        samples = target.samples
        samples.require(str(target.symbol), *horizon, between=target.integrated)
        for column, one in enumerate(expression.elements()):
            if not target.integrated:
                sums.append(
                    SampleSum(
                        target.symbol,
                        one,
                        samples.times,
                        samples.values[:, column],
                        samples.deviations[:, column],
                    )
                )
                continue
            measured = ca.SX.sym(f"samples of {one}"[:60])
            courses.append(_course(measured, samples, column))
            deviations = samples.deviations[:, column]
            if np.ptp(deviations) > 1e-12 * np.max(deviations):
                raise ModelError(
                    f"{read.name}: {target.symbol} has a deviation for every sample, expected one for each column in an "
                    "integral; use sum_of_squares, or one deviation"
                )
            weight = ca.jacobian(objective, target.symbol)
            integrand += weight * ((one - measured) / float(deviations[0])) ** 2
    return replace(phase, sums=tuple(sums), courses=(*phase.courses, *courses), integrand=integrand)


def _course(symbol: ca.SX, samples: Samples, column: int) -> Course:
    return Course(
        symbol.name(), symbol, lambda times: samples.at(times, column), samples.jumps(column), samples.kinks()
    )


def _horizon(read: SymbolicProblem, phase: Phase, target: Target) -> tuple[float, float]:
    if not (phase.start_time.is_constant() and phase.final_time.is_constant()):
        raise ModelError(
            f"{read.name}: {target.symbol} needs fixed times, found a free start or final time; give them as numbers"
        )
    return float(phase.start_time), float(phase.final_time)
