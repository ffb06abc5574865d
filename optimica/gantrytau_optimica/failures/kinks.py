"""Kinks in a problem, named where a solve gets stuck: Ipopt steps along slopes, which jump there."""

from collections.abc import Iterator

import casadi as ca

from gantrytau.language.instructions import computed
from gantrytau_optimica.control.control_problem import ControlProblem

KINKED = {ca.OP_FABS: "fabs", ca.OP_FMAX: "fmax", ca.OP_FMIN: "fmin", ca.OP_SIGN: "sign"}
WAY_OUT = (
    "Write fabs(x) as p + n with inputs p, n >= 0 and x == p - n, fmax(x, y) as a number or an input that is at least both, "
    "or round them, as sqrt(x**2 + small**2)"
)


def kinks(problem: ControlProblem) -> list[str]:
    """Where fabs, fmax, fmin and sign stand, each as written, once."""
    found: dict[str, str] = {}
    for words, expression in _expressions(problem):
        for kink in _in(expression):
            found.setdefault(kink, f"`{kink}` in {words}")
    return list(found.values())


def _expressions(problem: ControlProblem) -> Iterator[tuple[str, ca.SX]]:
    yield "the objective", problem.objective
    for limit in problem.boundary:
        yield f"`{limit.name}`", limit.expression
    for phase in problem.phases:
        yield "the integrand", phase.integrand
        for limit in phase.path_limits:
            yield f"`{limit.name}`", limit.expression
        for point in phase.points:
            yield "the objective or a condition", point.expression
        yield "the equations", ca.vertcat(phase.ode, phase.residuals)


def _in(expression: ca.SX) -> list[str]:
    """Its operations that have a kink, as text."""
    symbols = ca.vertcat(ca.SX(0, 1), *ca.symvar(expression))
    found: list[str] = []

    def apply(operator: int, operands: list[ca.SX]) -> ca.SX:
        if operator in KINKED and not all(one.is_constant() for one in operands):
            found.append(f"{KINKED[operator]}({', '.join(_text(one) for one in operands[:2])})")
        return (ca.SX.binary if len(operands) == 2 else ca.SX.unary)(operator, *operands)

    function = ca.Function("kinks", [symbols], [ca.densify(expression)])
    computed(function, lambda _, i: symbols[i], ca.SX, apply)
    return found


def _text(operand: ca.SX) -> str:
    text = str(operand)
    return text if len(text) <= 40 and "@" not in text else "..."
