"""Reads an optimisation problem: the model translated, objective and constraints in its symbols."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import casadi as ca
import numpy as np

from gantrytau import Dae, InitializationError, ModelError, Parameter, Samples, StructureError, translate
from gantrytau.border.refusal import told
from gantrytau.compiler.request import names
from gantrytau.flattening.check_units import check_units
from gantrytau.flattening.flat_model import FlatModel
from gantrytau.flattening.flatten import write_out
from gantrytau.flattening.instantiation import Instance, Placed, instantiate
from gantrytau.inputs.input_signal import with_course
from gantrytau.language.functions import Between
from gantrytau.language.instructions import refuse_calls
from gantrytau.language.symbols import writing
from gantrytau.simulation.signals import read_signals
from gantrytau_optimica.problem.kept_reading import content_of, keep_reading, kept_reading
from gantrytau_optimica.problem.model_words import relation_text
from gantrytau_optimica.problem.optimization import (
    Free,
    Optimization,
    PhaseLink,
    Point,
    Target,
    initial,
    reading,
)
from gantrytau_optimica.problem.problem_checks import (
    check_constraints,
    check_integrands,
    check_objective,
    check_spelling,
    check_times,
)
from gantrytau_optimica.problem.problem_units import check_problem_units
from gantrytau_optimica.problem.start_targets import with_told_starts
from gantrytau_optimica.problem.steady_state import at_rest
from gantrytau_optimica.problem.symbolic_problem import (
    ConstraintRow,
    LinkedPaths,
    SymbolicPhase,
    SymbolicProblem,
)


def read_problem(
    problem: Optimization | type[Optimization],
    change: Callable[[FlatModel], FlatModel] | None = None,
    guess: Any = None,
) -> SymbolicProblem:
    """Read a problem class or instance. Raises ModelError with the place of what is written wrongly.

    change: applied to the model once it is written out, before it is translated; guess: first guesses of the caller, which
    with conditions at the start serve a model that has no consistent start of its own.
    """
    if isinstance(problem, type) and issubclass(problem, Optimization):
        problem = problem()
    if not isinstance(problem, Optimization):
        raise ModelError(
            f"optimize: found {problem!r}, expected a subclass of Optimization or an instance of it"
        )
    instance = instantiate(problem)
    root = instance.root
    name = type(root).__name__
    flat = write_out(instance) if change is None else change(write_out(instance))
    known = set(flat.derivatives)
    flat = at_rest(flat) if root.static else flat
    if all(one.failure for one in flat.whens):  # assertions, which a simulation of the answer tells
        flat = replace(flat, whens=())
    stages = _stages(name, instance)
    for _, one in stages:
        check_spelling(type(one))
    with writing(instance.symbols), reading() as asked:
        objective = sum(
            (_scalar(_place(name, path, "objective"), one.objective) for path, one in stages), ca.SX(0)
        )
        found = [c for path, one in stages for c in _constraints(_place(name, path, "constraints"), one)]
        flat, starts = _free_starts(flat, instance)
        phases = tuple(_phase(name, path, one) for path, one in (stages[1:] or stages))
        if stages[1:] and not _scalar(f"{name}.integrand", root.integrand).is_zero():
            raise ModelError(
                f"{name}.integrand: found an integrand beside phases, expected none; write it in the phases"
            )
    constraints = [*(c for c in found if isinstance(c, ConstraintRow)), *starts]
    mentioned = [n for n, s in instance.symbols.by_name.items() if s.order > 0 and n not in known]
    links = tuple(_link(name, instance, phases, c) for c in found if isinstance(c, PhaseLink))
    given = _given(stages, flat)
    points, targets = tuple(asked.points), tuple(asked.targets)
    said = _Said(name, flat, given, mentioned, objective, phases, tuple(constraints), points, targets)
    content = content_of(said)
    read = kept_reading(content)
    if read is None:
        read = _checked(said, instance, guess)
        if read.dae.flat is flat:  # nothing else decided on it, as starts by first guesses
            keep_reading(content, read)
    read = check_objective(replace(read, links=links, courses=_courses(name, stages, read.dae)))
    check_times(read)
    return read


@dataclass(frozen=True, eq=False)
class _Said:
    """What a problem says, before its model is translated; given and mentioned: names of variables."""

    name: str
    flat: FlatModel
    given: Sequence[str]
    mentioned: Sequence[str]
    objective: ca.SX
    phases: tuple[SymbolicPhase, ...]
    constraints: tuple[ConstraintRow, ...]
    points: tuple[Point, ...]
    targets: tuple[Target, ...]


def _checked(said: _Said, instance: Instance, guess: Any) -> SymbolicProblem:
    """What is said of a problem, checked, with its model translated; links and courses are still missing."""
    name, flat, phases, points, targets = said.name, said.flat, said.phases, said.points, said.targets
    check_units(flat)
    derivatives = {n: s.sx for n, s in instance.symbols.by_name.items() if s.order > 0}
    times = {_place(name, p.name, w): getattr(p, w) for p in phases for w in ("start_time", "final_time")}
    for one in (*points, *targets):
        refuse_calls(str(one.symbol), one.expression)
    check_constraints(said.constraints, targets)
    check_integrands(name, phases, points)
    check_problem_units(replace(flat, derivatives=derivatives), said.constraints, points, times)
    told = partial(with_told_starts, flat, said.constraints, points, guess)
    dae = _translated(flat, said.given, said.mentioned, told)
    return SymbolicProblem(name, dae, said.objective, phases, said.constraints, (), points, targets, {})


def _translated(
    flat: FlatModel, given: Sequence[str], find: Sequence[str], told: Callable[[], FlatModel | None]
) -> Dae:
    """The model translated, from the starts that the problem tells if its own are not consistent with its equations."""
    try:
        return translate(flat, units=False, given=given, find=find)
    except (InitializationError, StructureError) as error:
        started = told()
        if started is None:
            raise
        try:
            return translate(started, units=False, given=given, find=find)
        except StructureError:
            raise error from None  # what is wrong is wrong at any start


def _link(name: str, instance: Instance, phases: Sequence[SymbolicPhase], link: PhaseLink) -> LinkedPaths:
    """A link by paths. Raises ModelError for phases of another problem."""
    paths = [instance.paths.get(id(one)) for one in (link.first, link.second)]
    known = [phase.name for phase in phases]
    for path, one in zip(paths, (link.first, link.second), strict=True):
        if path is None or path not in known or path == "":
            raise ModelError(
                f"{name}: link: found {type(one).__name__}, which is no phase of this problem, expected two of "
                f"{', '.join(known) if known != [''] else 'its phases (there are none)'}; write self.name of the phase"
            )
    first, second = (str(path) for path in paths)
    return LinkedPaths(first, second, tuple(f"{second}.{n}" for n in link.jump))


def _place(name: str, path: str, which: str) -> str:
    return ".".join(part for part in (name, path, which) if part)


def _stages(name: str, instance: Instance) -> list[tuple[str, Any]]:
    """The problem itself and its phases, with their paths."""
    inner = [(path, c) for path, c in instance.components if isinstance(c, Optimization) and path]
    for path, _ in inner:
        around = [p for p, _ in inner if path.startswith(f"{p}.")]
        if around or "." in path:
            raise ModelError(
                f"{name}: the phase {path} lies inside of {around[0] if around else path.rsplit('.', 1)[0]}, expected "
                "phases as components of the problem itself; move it there"
            )
    if inner:
        lost = [
            q.name
            for q in instance.quantities
            if _varies(q) and not any(q.name.startswith(f"{p}.") for p, _ in inner)
        ]
        if lost:
            raise ModelError(
                f"{name}: {lost[0]} belongs to no phase, expected variables in phases only; declare it in one"
            )
    return [("", instance.root), *inner]


def _varies(placed: Placed) -> bool:
    return not isinstance(placed.declaration, Parameter)


def _phase(name: str, path: str, one: Any) -> SymbolicPhase:
    integrand = _scalar(_place(name, path, "integrand"), one.integrand)
    times = [_time(_place(name, path, which), getattr(one, which)) for which in ("start_time", "final_time")]
    return SymbolicPhase(path, integrand, *times)


def _given(stages: list[tuple[str, Any]], flat: FlatModel) -> tuple[str, ...]:
    """What stays known in all phases; () if no phase says."""
    if not any(names(one.given) for _, one in stages):
        return ()
    found = []
    for path, one in stages:
        own = [f"{path}.{n}" if path else n for n in names(one.given)]
        if path and not own:  # its declared inputs, as where no `given` is
            own = [n for n in flat.inputs if n.startswith(f"{path}.")]
        found += own
    return tuple(found)


def _courses(name: str, stages: list[tuple[str, Any]], dae: Dae) -> dict[str, ca.SX | tuple[Samples, int]]:
    """Known courses of inputs, as expressions of time or columns of samples."""
    found: dict[str, ca.SX | tuple[Samples, int]] = {}
    for path, one in stages:
        if not isinstance(one.inputs, Mapping):
            raise ModelError(
                f"{_place(name, path, 'inputs')}: found {one.inputs!r}, expected {{name: course}}"
            )
        for given, value in one.inputs.items():
            full = f"{path}.{given}" if path else given
            elements = dae.expand(full)
            for element in elements:
                if element not in dae.inputs:
                    raise ModelError(
                        f"{name}: {element} is no input here, expected one of {', '.join(dae.inputs)}; take it out of "
                        "`inputs`, or name it in `given`"
                    )
            place, shape = f"input {full}", dae.flat.shape(full)
            course = told(
                name, lambda f=full, v=value, s=shape, o=one: with_course(f, v, s, lambda: _horizon(f, o))
            )
            if isinstance(course, Samples):
                course.check_shape(place, shape)
                course.check_unit(place, dae.flat.unit(full))
                found.update((e, (course, k)) for k, e in enumerate(elements))
            else:
                signals = read_signals({full: course}, dae.flat, (0.0, 1.0))
                found.update({n: s for n, s in signals.items() if isinstance(s, ca.SX)})
    return found


def _horizon(name: str, one: Any) -> tuple[float, float]:
    """Start and final time of a problem or a phase, in s; ModelError unless they are numbers."""
    times = one.start_time, one.final_time
    if not all(isinstance(t, (int, float, np.number)) for t in times):
        raise ModelError(
            f"{name} is held from time to time, which needs fixed times; give start_time and final_time as numbers"
        )
    return float(times[0]), float(times[1])


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
    refuse_calls(place, value)
    return value


def _time(place: str, value: Any) -> ca.SX:
    try:
        time = ca.densify(ca.SX(value))
    except NotImplementedError:
        raise ModelError(f"{place}: found {value!r}, expected a number in s or Free(...)") from None
    if time.numel() != 1:
        raise ModelError(f"{place}: found shape {time.shape}, expected one number")
    refuse_calls(place, time)
    return time


def _constraints(where: str, problem: Any) -> list[ConstraintRow | PhaseLink]:
    found: list[ConstraintRow | PhaseLink] = []
    statements = told(where, problem.constraints)
    if not isinstance(statements, Iterable) or isinstance(statements, (ca.SX, str)):
        raise ModelError(f"{where}: found {statements!r}, expected constraints; give each out with `yield`")
    where = where.removesuffix(".constraints")
    generator = iter(statements)
    end, number = object(), 0
    while True:
        number += 1
        place = f"{where}, constraint {number}"
        statement = told(place, lambda: next(generator, end))
        if statement is end:
            return found
        found += [statement] if isinstance(statement, PhaseLink) else _constraint(place, statement)


def _constraint(place: str, statement: Any) -> list[ConstraintRow]:
    if isinstance(statement, Between):
        expression = ca.densify(ca.SX(statement.expression))
        limits = [_limit(place, bound, expression) for bound in (statement.lower, statement.upper)]
        refuse_calls(place, expression, *limits)
        if expression.is_constant() and all(limit.is_constant() for limit in limits):
            raise ModelError(
                f"{place}: found limits of {expression}, which is a number whatever is chosen (as the rate of a parameter "
                "is), expected a variable or the rate of one; limit what an input moves"
            )
        rows = zip(expression.elements(), *(limit.elements() for limit in limits), strict=True)
        return [ConstraintRow(e, low, high, f"{low} <= {e} <= {high}", place) for e, low, high in rows]
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
    refuse_calls(place, statement)
    found: list[ConstraintRow] = []
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
            found.append(ConstraintRow(right, left, left if equal else infinity, text, place))
        else:
            found.append(ConstraintRow(left, right if equal else -infinity, right, text, place))
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


def _free_starts(flat: FlatModel, instance: Instance) -> tuple[FlatModel, list[ConstraintRow]]:
    """Starts given as `Start(Free(...))` or `Fixed(Free(...))`: not fixed, within the limits of the Free."""
    found: list[ConstraintRow] = []
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
        found += [ConstraintRow(e, low, high, name) for e in point.elements()]
    variables = tuple(replace(v, fixed=False) if v.name in released else v for v in flat.variables)
    return replace(flat, variables=variables), found
