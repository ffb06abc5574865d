"""Reads an optimisation problem: the model translated, objective and constraints in its symbols."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Any

import casadi as ca

from gantrytau import Dae, ModelError
from gantrytau.flat_model import FlatModel
from gantrytau.flattening import write_out
from gantrytau.functions import Between
from gantrytau.instantiation import Instance, instantiate
from gantrytau.symbols import split_derivative, time, writing
from gantrytau.translation import names, translate_flat
from gantrytau.unit_checking import check_units
from gantrytau_optimica.optimization import Free, Optimization, Point, initial, reading
from gantrytau_optimica.problem_units import check_problem_units
from gantrytau_optimica.wording import relation_text, told


@dataclass(frozen=True, eq=False)
class Constraint:
    """lower <= expression <= upper for one scalar, in the model's symbols.

    name: as it was written; place: where it was written; lower and upper of an equation are the same object.
    """

    expression: ca.SX
    lower: ca.SX
    upper: ca.SX
    name: str
    place: str = ""


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
    _check_spelling(type(root))
    with writing(instance.symbols), reading() as points:
        objective = _scalar(f"{name}.objective", root.objective)
        integrand = _scalar(f"{name}.integrand", root.integrand)
        constraints = _constraints(name, root)
        flat, starts = _free_starts(flat, instance)
        times = [_time(f"{name}.{which}", getattr(root, which)) for which in ("start_time", "final_time")]
    mentioned = [n for n, s in instance.symbols.by_name.items() if s.order > 0 and n not in known]
    check_units(flat)
    derivatives = {n: s.sx for n, s in instance.symbols.by_name.items() if s.order > 0}
    check_problem_units(replace(flat, derivatives=derivatives), name, constraints, points, times)
    dae = translate_flat(flat, given=names(root.given), find=mentioned)
    read = ReadProblem(name, dae, objective, integrand, (*constraints, *starts), tuple(points), *times)
    _check_objective(read)
    _check_times(read)
    return read


def _scalar(place: str, evaluate: Callable[[], Any]) -> ca.SX:
    value = told(place, evaluate)
    try:
        value = ca.densify(ca.SX(value))
    except NotImplementedError:
        raise ModelError(
            f"{place}: found {value!r}, expected a number or an expression; return it from the method"
        ) from None
    if value.numel() != 1:
        raise ModelError(f"{place}: found shape {value.shape}, expected one number; sum it up or weigh it")
    return value


def _time(place: str, value: Any) -> ca.SX:
    try:
        time = ca.densify(ca.SX(value))
    except NotImplementedError:
        raise ModelError(f"{place}: found {value!r}, expected a number in s or Free(...)") from None
    if time.numel() != 1:
        raise ModelError(f"{place}: found shape {time.shape}, expected one number")
    return time


def _constraints(name: str, root: Any) -> list[Constraint]:
    found: list[Constraint] = []
    statements = told(f"{name}.constraints", root.constraints)
    if not isinstance(statements, Iterable) or isinstance(statements, (ca.SX, str)):
        raise ModelError(
            f"{name}.constraints: found {statements!r}, expected constraints; give each out with `yield`"
        )
    generator = iter(statements)
    end, number = object(), 0
    while True:
        number += 1
        place = f"{name}, constraint {number}"
        statement = told(place, lambda: next(generator, end))
        if statement is end:
            return found
        found += _constraint(place, statement)


def _constraint(place: str, statement: Any) -> list[Constraint]:
    if isinstance(statement, Between):
        expression = ca.densify(ca.SX(statement.expression))
        limits = [_limit(place, bound, expression) for bound in (statement.lower, statement.upper)]
        rows = zip(expression.elements(), *(limit.elements() for limit in limits), strict=True)
        return [Constraint(e, low, high, f"{low} <= {e} <= {high}", place) for e, low, high in rows]
    if isinstance(statement, (bool, ca.DM)) or (isinstance(statement, ca.SX) and statement.is_constant()):
        raise ModelError(
            f"{place}: found {statement}, expected a constraint; both sides were compared at once because there is "
            "no symbol of the model among them: name variables of the model, join lists with casadi.vertcat(*list)"
        )
    if not isinstance(statement, ca.SX):
        raise ModelError(
            f"{place}: found {statement!r}, expected a constraint; write `a == b`, `a <= b` or between(a, x, b) "
            "with symbols of the model, one by one or joined by casadi.vertcat(*list)"
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
        text = relation_text(left, right, "==" if equal else "<=")
        infinity = ca.SX(ca.inf)
        if left.is_constant():
            found.append(Constraint(right, left, left if equal else infinity, text, place))
        else:
            found.append(Constraint(left, right if equal else -infinity, right, text, place))
    return found


def _limit(place: str, bound: Any, expression: ca.SX) -> ca.SX:
    bound = told(
        place, lambda: ca.densify(ca.SX(ca.DM(bound) if isinstance(bound, (list, tuple)) else bound))
    )
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


def _check_spelling(problem: type[Optimization]) -> None:
    """A misspelt method would never be asked for."""
    expected = ("objective", "integrand", "constraints", "equations", "initial_equations")
    for name in dir(problem):
        if name.startswith("_") or hasattr(Optimization, name) or not callable(getattr(problem, name)):
            continue
        close = get_close_matches(name, expected, n=1, cutoff=0.85)
        if close:
            raise ModelError(
                f"{problem.__name__}.{name}: nothing asks for a method of this name; did you mean '{close[0]}'?"
            )


def _check_times(read: ReadProblem) -> None:
    free = {n for p in read.dae.flat.parameters for n in p.elements}
    for which, value in (("start_time", read.start_time), ("final_time", read.final_time)):
        for leaf in ca.symvar(value):
            if leaf.name() not in free:
                raise ModelError(
                    f"{read.name}.{which} depends on {leaf.name()}, expected a number or Free(...) and parameters"
                )


def _free_starts(flat: FlatModel, instance: Instance) -> tuple[FlatModel, list[Constraint]]:
    """Starts given as `Start(Free(...))` or `Fixed(Free(...))`: not fixed, within the limits of the Free."""
    found: list[Constraint] = []
    released: set[str] = set()
    for placed in instance.quantities:
        leaf = placed.attributes.get("start")
        if leaf is None or not isinstance(leaf.value, Free) or leaf.value.name:
            continue
        released.add(placed.name)
        limits = [ca.SX(x) for x in (leaf.value.min, leaf.value.max) if x is not None]
        if not limits:
            continue
        low = -ca.SX.inf() if leaf.value.min is None else ca.SX(leaf.value.min)
        high = ca.SX.inf() if leaf.value.max is None else ca.SX(leaf.value.max)
        point = initial(placed.symbol)
        name = f"limits of the start of {placed.name}"
        found += [Constraint(e, low, high, name) for e in point.elements()]
    variables = tuple(replace(v, fixed=False) if v.name in released else v for v in flat.variables)
    return replace(flat, variables=variables), found
