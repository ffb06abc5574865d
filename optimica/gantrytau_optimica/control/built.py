"""A control problem with what leads back from it to the names of the model."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca

from gantrytau import ModelError
from gantrytau.compiler.system import Causality, System
from gantrytau.language.instructions import computed
from gantrytau.language.symbols import split_derivative, time
from gantrytau_optimica.control.control_problem import ControlProblem, Phase
from gantrytau_optimica.problem.optimization import Point
from gantrytau_optimica.problem.symbolic_problem import ConstraintRow, SymbolicProblem


@dataclass(frozen=True, eq=False)
class Built:
    """The control problem, and what leads back from it to the model's names."""

    read: SymbolicProblem
    problem: ControlProblem
    system: System
    numbers: Mapping[str, float]  # parameters that are neither free nor held
    points: tuple[Point, ...]
    constraints: tuple[ConstraintRow, ...]
    closed: Mapping[str, ca.SX]  # what gives an algebraic outright, by its name
    causality: Causality | None = None  # as it was asked for

    @property
    def causality_words(self) -> str:
        """Which way equations of motion were solved, and why, in a line; "" where there was no choice."""
        system, asked = self.system, "as asked for" if self.causality else ""
        if system.inverse:
            tears, forward = (sum(getattr(i, n) for i in system.inverse) for n in ("tears", "forward"))
            why = asked or f"{tears} unknowns are found together instead of {forward}"
            forces = ", ".join(n for i in system.inverse for n in i.inputs)
            return f"Inverse causality, {why}: accelerations are found, {forces} follow."
        why = asked or "; ".join(system.forward)
        return f"Forward causality: {why}." if why else ""

    def expressed(self, names: Sequence[str]) -> ca.SX:
        """Variables of the model, scalar names, in signals, courses, time and free numbers of the problem.

        Raises ModelError for derivatives that the problem does not hold.
        """
        found = self.system.to_system([self.read.dae.expression(name) for name in names])
        column = ca.vertcat(ca.SX(0, 1), *with_values(found, self.read, self.numbers))
        problem = self.problem
        own = [problem.time, problem.numbers, *(s.symbol for s in problem.signals)]
        own += [c.symbol for phase in problem.phases for c in phase.courses]
        inside = {e.element_hash() for e in ca.vertcat(*own).elements()}
        for leaf in ca.symvar(column):
            if leaf.element_hash() not in inside:
                raise ModelError(
                    f"{problem.name}: {', '.join(names[:3])} needs {leaf.name()}, which is not part of the problem; mention "
                    "it there, in a constraint or an equation"
                )
        return column

    def in_closed_form(self, phase: Phase, expressions: list[ca.SX]) -> list[ca.SX]:
        """Expressions with closed forms for the algebraics of a phase that have them."""
        closed = [(a.symbol, self.closed[a.name]) for a in phase.algebraics if a.name in self.closed]
        forms = with_values([ca.densify(form) for _, form in closed], self.read, self.numbers)
        return (
            ca.substitute_inplace([s for s, _ in closed], forms, expressions, False)[1]
            if closed
            else expressions
        )


def with_values(expressions: list[ca.SX], read: SymbolicProblem, numbers: Mapping[str, float]) -> list[ca.SX]:
    """Parameters that are not free replaced by their numbers, inputs by their courses where these are expressions."""
    old = [read.dae.parameter_symbols[n] for n in numbers]
    new = [ca.SX(x) for x in numbers.values()]
    expressions = _with_courses(expressions, read)
    if read.dae.flat.ranges:
        expressions = _without_ends(expressions)
    return ca.substitute(expressions, [ca.vertcat(*old)], [ca.vertcat(*new)]) if old else expressions


def _without_ends(expressions: list[ca.SX]) -> list[ca.SX]:
    """Tables that are not defined beyond their ends, defined there as well: limits keep their arguments inside.

    Such a table is a product with sqrt(1 - 2 beyond), the only roots of what is constant piece by piece.
    """
    column = ca.vertcat(ca.SX(0, 1), *(ca.vec(ca.densify(e)) for e in expressions))
    symbols = ca.vertcat(ca.SX(0, 1), *ca.symvar(column))

    def apply(operator: int, operands: list[ca.SX]) -> ca.SX:
        step = operator == ca.OP_SQRT and not operands[0].is_constant()
        if step and ca.jacobian(operands[0], symbols).is_zero():
            return ca.SX(1.0)
        return (ca.SX.binary if len(operands) == 2 else ca.SX.unary)(operator, *operands)

    function = ca.Function("tables", [symbols], [column])
    (found,) = computed(function, lambda _, i: symbols[i], ca.SX, apply)
    parts = iter(found)
    return [
        ca.reshape(ca.vertcat(ca.SX(0, 1), *(next(parts) for _ in range(e.numel()))), *e.shape)
        for e in expressions
    ]


def _with_courses(expressions: list[ca.SX], read: SymbolicProblem) -> list[ca.SX]:
    """Inputs and their derivatives replaced by courses that are expressions of time."""
    courses = {name: course for name, course in read.courses.items() if isinstance(course, ca.SX)}
    if not courses or not expressions:
        return expressions
    old, new = [], []
    for leaf in ca.symvar(ca.vertcat(*(ca.vec(ca.densify(e)) for e in expressions))):
        base, order = split_derivative(leaf.name())
        if base in courses:
            value = courses[base]
            for _ in range(order):
                value = ca.jacobian(value, time)
            old.append(leaf)
            new.append(ca.densify(value))
    return ca.substitute(expressions, [ca.vertcat(*old)], [ca.vertcat(*new)]) if old else expressions
