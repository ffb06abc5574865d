"""Reads an optimisation problem: the model translated, objective and constraints in its symbols."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca

from gantrytau import Dae, ModelError
from gantrytau.flattening import write_out
from gantrytau.functions import Between
from gantrytau.instantiation import instantiate
from gantrytau.symbols import split_derivative, time, writing
from gantrytau.translation import translate_flat
from gantrytau.unit_checking import check_units
from gantrytau_optimica.optimization import Optimization, Point, reading


@dataclass(frozen=True, eq=False)
class Constraint:
    """lower <= expression <= upper for one scalar, in the model's symbols; name: as it was written."""

    expression: ca.SX
    lower: ca.SX
    upper: ca.SX
    name: str


@dataclass(frozen=True, eq=False)
class ReadProblem:
    """A problem in the model's symbols. start_time, final_time: numbers or expressions of free numbers."""

    name: str
    dae: Dae
    objective: ca.SX
    integrand: ca.SX
    constraints: tuple[Constraint, ...]
    points: tuple[Point, ...]
    start_time: ca.SX
    final_time: ca.SX


def read_problem(problem: Optimization | type[Optimization]) -> ReadProblem:
    """Read a problem class or instance. Raises ModelError with the place of what is written wrongly."""
    if isinstance(problem, type) and issubclass(problem, Optimization):
        problem = problem()
    if not isinstance(problem, Optimization):
        raise ModelError(
            f"optimize: found {problem!r}, expected a subclass of Optimization or an instance of it"
        )
    instance = instantiate(problem)
    root = instance.root
    name = type(root).__name__
    flat = write_out(instance)
    known = set(flat.derivatives)
    with writing(instance.symbols), reading() as points:
        objective = _scalar(f"{name}.objective", root.objective)
        integrand = _scalar(f"{name}.integrand", root.integrand)
        constraints = _constraints(name, root)
        times = [_time(f"{name}.{which}", getattr(root, which)) for which in ("start_time", "final_time")]
    mentioned = [n for n, s in instance.symbols.by_name.items() if s.order > 0 and n not in known]
    check_units(flat)
    dae = translate_flat(flat, given=tuple(root.given), find=mentioned)
    read = ReadProblem(name, dae, objective, integrand, tuple(constraints), tuple(points), *times)
    _check_objective(read)
    return read


def _scalar(place: str, evaluate: Callable[[], Any]) -> ca.SX:
    try:
        value = ca.densify(ca.SX(_told(place, evaluate)))
    except NotImplementedError:
        raise ModelError(
            f"{place}: found no number or expression, expected one; return it from the method"
        ) from None
    if value.numel() != 1:
        raise ModelError(f"{place}: found shape {value.shape}, expected one number; sum it up or weigh it")
    return value


def _told(place: str, evaluate: Callable[[], Any]) -> Any:
    """Errors of Python and CasADi told with the place where they happened."""
    try:
        return evaluate()
    except (RuntimeError, TypeError, AttributeError, ValueError, IndexError) as error:
        text = next((line for line in str(error).splitlines() if line.strip()), type(error).__name__)
        if "truth value" in str(error):
            text = (
                "Python's chained comparison and `and` cannot work on symbols; write between(lower, x, upper)"
            )
        raise ModelError(f"{place}: {text.split(': ', 1)[-1] if '.cpp' in text else text}") from error


def _time(place: str, value: Any) -> ca.SX:
    value = ca.SX(value)
    if value.numel() != 1:
        raise ModelError(f"{place}: found shape {value.shape}, expected one number")
    return value


def _constraints(name: str, root: Any) -> list[Constraint]:
    found: list[Constraint] = []
    generator = iter(root.constraints())
    number = 0
    while True:
        number += 1
        place = f"{name}, constraint {number}"
        statement = _told(place, lambda: next(generator, None))
        if statement is None:
            return found
        found += _constraint(place, statement)


def _constraint(place: str, statement: Any) -> list[Constraint]:
    if isinstance(statement, Between):
        expression = ca.densify(ca.SX(statement.expression))
        limits = [_limit(place, bound, expression) for bound in (statement.lower, statement.upper)]
        rows = zip(expression.elements(), *(limit.elements() for limit in limits), strict=True)
        return [Constraint(e, low, high, f"{low} <= {e} <= {high}") for e, low, high in rows]
    if not isinstance(statement, ca.SX):
        raise ModelError(
            f"{place}: found {statement!r}, expected a constraint; write `a == b`, `a <= b` or between(a, x, b) "
            "with symbols of the model (casadi.vertcat joins several, a list of symbols does not)"
        )
    found: list[Constraint] = []
    for element in ca.densify(statement).elements():
        equal = element.is_op(ca.OP_EQ)
        if element.is_constant() and float(element) != 0.0:
            continue
        if not (equal or element.is_op(ca.OP_LE) or element.is_op(ca.OP_LT)):
            raise ModelError(
                f"{place}: found `{str(element)[:80]}`, expected `a == b`, `a <= b` or between(a, x, b)"
            )
        left, right = element.dep(0), element.dep(1)
        found.append(_relation(left, right, equal))
    return found


def _relation(left: ca.SX, right: ca.SX, equal: bool) -> Constraint:
    """a == b or a <= b, with a number on one side as the bound of the other."""
    infinity = ca.SX(ca.inf)
    text = f"{left} {'==' if equal else '<='} {right}"
    if right.is_constant():
        return Constraint(left, right if equal else -infinity, right, text)
    if left.is_constant():
        return Constraint(right, left, left if equal else infinity, text)
    return Constraint(left - right, ca.SX(0) if equal else -infinity, ca.SX(0), text)


def _limit(place: str, bound: Any, expression: ca.SX) -> ca.SX:
    bound = ca.densify(ca.SX(bound))
    if bound.numel() == 1:
        return ca.repmat(bound, *expression.shape)
    if bound.shape != expression.shape:
        raise ModelError(
            f"{place}: a limit has shape {bound.shape}, the expression {expression.shape}; make them equal"
        )
    return bound


def _check_objective(read: ReadProblem) -> None:
    signals = set(read.dae.variables)
    for leaf in ca.symvar(read.objective):
        base, _ = split_derivative(leaf.name())
        if base in signals or leaf.name() == time.name():
            raise ModelError(
                f"{read.name}.objective depends on {leaf.name()}, which changes over time; say at which time "
                f"with final({leaf.name()}) or initial(...), or integrate it by returning it from integrand()"
            )


def with_dae(read: ReadProblem, dae: Dae) -> ReadProblem:
    """The same problem with the model translated otherwise."""
    return replace(read, dae=dae)
