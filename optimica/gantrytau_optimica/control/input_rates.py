"""Inputs whose rates a problem mentions, in a limit, a cost or the model's own equations.

    d f / dt = der(f),   d der(f) / dt = der(der(f)),   and so on up to the highest rate that is mentioned

Such an input is a state, and so are its rates below the highest, which is what the optimiser chooses: the input is
continuous, and its rate is what the limit says at all times.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from itertools import pairwise

import casadi as ca

from gantrytau import Dae, ModelError
from gantrytau.language.symbols import derivative_name, split_derivative
from gantrytau_optimica.control.control_problem import ControlProblem, Phase, Pieces, Signal
from gantrytau_optimica.control.limits import known_states
from gantrytau_optimica.problem.symbolic_problem import ConstraintRow, SymbolicProblem

Rates = Mapping[str, tuple[ca.SX, ...]]


def input_rates(read: SymbolicProblem, expressions: Iterable[ca.SX]) -> Rates:
    """Symbols of the rates (first, second, ...) of every chosen input of which one occurs in the expressions, which are
    those of the whole problem.
    """
    found: dict[str, dict[int, ca.SX]] = {}
    chosen = {name for name in read.dae.inputs if name not in read.courses}
    for leaf in ca.symvar(ca.vertcat(ca.SX(0, 1), *(ca.vec(ca.densify(e)) for e in expressions))):
        base, order = split_derivative(leaf.name())
        if order and base in chosen:
            found.setdefault(base, {})[order] = leaf
    return {
        base: tuple(_rate(read.dae, base, k, own) for k in range(1, max(own) + 1))
        for base, own in found.items()
    }


def _rate(dae: Dae, base: str, order: int, own: Mapping[int, ca.SX]) -> ca.SX:
    """The symbol of a rate: the one that is mentioned, that of the model, or a new one."""
    name = derivative_name(base, order)
    return own[order] if order in own else dae.flat.derivatives.get(name, ca.SX.sym(name))


def lifted(name: str, symbol: ca.SX, rates: Rates) -> tuple[list[tuple[str, ca.SX, ca.SX]], str, ca.SX]:
    """An input as states (name, symbol, rate), none if no rate of it is mentioned, and name and symbol of what is chosen."""
    chain = [symbol, *rates.get(name, ())]
    states = [(derivative_name(name, k), low, high) for k, (low, high) in enumerate(pairwise(chain))]
    return states, derivative_name(name, len(states)), chain[-1]


def check_pieces(rates: Rates, controls: Mapping[str, Pieces]) -> None:
    """ModelError for pieces of an input that follows from its rate, or of a rate that is not chosen."""
    for name in controls:
        base, order = split_derivative(name)
        highest = len(rates.get(base, ()))
        top = derivative_name(base, highest)
        if order < highest:
            raise ModelError(
                f"controls: {name} follows from {top}, whose limit or cost is part of the problem, expected pieces of what "
                f"is chosen; write '{top}': where it is constant, {derivative_name(base, highest - 1)} is a straight line"
            )
        if order > highest:
            raise ModelError(
                f"controls: {name} is not part of the problem, expected '{top}'; a limit on {name} in constraints() makes "
                "it what is chosen"
            )


def check_reached(problem: ControlProblem, limits: Iterable[tuple[ConstraintRow, ca.SX]]) -> None:
    """ModelError for a limit on the rate of what nothing that is chosen moves: it holds by itself, or never.

    limits: constraints, and their expressions in the symbols of the problem, which knows its starts.
    """
    points = {e.element_hash() for p in (*problem.points, *problem.sums) for e in p.symbol.elements()}
    for constraint, expression in limits:
        names = [leaf.name() for leaf in ca.symvar(constraint.expression)]
        of_rates = [name for name in names if split_derivative(name)[1]]
        leaves = {leaf.element_hash() for leaf in ca.symvar(expression)}
        if not of_rates or leaves & points:
            continue
        owners = [
            k
            for k, phase in enumerate(problem.phases)
            if leaves & {s.symbol.element_hash() for s in phase.signals}
        ]
        number = owners[0] if owners else 0
        phase = problem.phases[number]
        fixed = known_states(problem).get((number, "initial"), {})
        chosen = [*phase.inputs, *(s for s in phase.states if s.symbol.element_hash() not in fixed)]
        moved = {s.symbol.element_hash() for s in chosen}
        moved |= {n.symbol.element_hash() for n in problem.free if not n.held}
        if _followed(phase, expression).isdisjoint(moved):
            raise ModelError(_unreached(problem, phase, constraint.name, of_rates[0]))


def _followed(phase: Phase, expression: ca.SX) -> set[int]:
    """Hashes of all symbols from which an expression follows, by the equations of its phase."""
    rates = dict(zip((s.symbol.element_hash() for s in phase.states), phase.ode.elements(), strict=True))
    implicit = {s.symbol.element_hash() for s in phase.algebraics}
    residuals = [{x.element_hash() for x in ca.symvar(e)} for e in phase.residuals.elements()]
    found: set[int] = set()
    open_ones = [x.element_hash() for x in ca.symvar(expression)]
    while open_ones:
        one = open_ones.pop()
        if one in found:
            continue
        found.add(one)
        if one in rates:
            open_ones += [x.element_hash() for x in ca.symvar(rates[one])]
        elif one in implicit:
            open_ones += [x for leaves in residuals if one in leaves for x in leaves]
    return found


def _unreached(problem: ControlProblem, phase: Phase, text: str, rate: str) -> str:
    inputs = ", ".join(f"der({split_derivative(s.name)[0]})" for s in phase.inputs)
    return (
        f"{problem.name}: `{text}` limits {rate}, which no chosen input and no free number moves: it follows from start, "
        f"time and what `inputs` gives; limit the rate of what an input moves{f', as {inputs}' if inputs else ''}, or "
        f"have what {rate} follows from chosen, as an Input that is not given, or as Free"
    )


def with_ramped_rates(problem: ControlProblem) -> ControlProblem:
    """The problem with chosen rates as straight lines in each element, which keep to limits between its points as well."""

    def changed(phase: Phase, signal: Signal) -> Signal:
        rate = signal in phase.inputs and split_derivative(signal.name)[1] > 0
        return replace(signal, pieces=Pieces("ramps")) if rate and signal.pieces.kind == "free" else signal

    return problem.with_signals(changed)
