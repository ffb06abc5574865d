"""A problem with unknown parameters and disturbances as symbols: constants that an estimator determines.

input disturbance d of u:    the equations have u + d in the place of u, costs and limits keep u
output disturbance d of y:   costs, limits and measurements have y + d in the place of y, the equations keep y
"""

from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np

from gantrytau import Model, ModelError
from gantrytau.border.checks import array, instance
from gantrytau.border.refusal import Given, did_you_mean, meant
from gantrytau.flattening.flat_model import FlatModel, FlatParameter
from gantrytau_optimica.control.build import build
from gantrytau_optimica.control.built import Built
from gantrytau_optimica.control.control_problem import Course
from gantrytau_optimica.predictive.stages import HorizonStages
from gantrytau_optimica.problem.optimization import Optimization
from gantrytau_optimica.problem.read_problem import read_problem
from gantrytau_optimica.problem.symbolic_problem import SymbolicProblem


def disturbance_of(name: str) -> str:
    """The name of the disturbance of an input or output."""
    return f"disturbance({name})"


def with_unknowns(problem: Any, parameters: Iterable[str], disturbance: Iterable[str], place: str) -> Built:
    """The problem in states, algebraics and inputs; parameters and disturbances are its free numbers, beside its own.

    problem: an Optimization or a Model, class or instance; parameters, disturbance: names, vectors whole or by element.
    Raises ModelError for names that are none of these.
    """
    wanted, added = list(disturbance), []

    def change(flat: FlatModel) -> FlatModel:
        added.extend(_elements(flat, wanted, place))
        return _disturbed(flat, added)

    read = read_problem(_as_problem(problem, place), change if wanted else None)
    read = _with_disturbed_outputs(read, added)
    held = [e for name in parameters for e in _adjustable(read, name, place)]
    built = build(read, {}, [*held, *map(disturbance_of, added)], {}, "forward")
    if len(built.problem.phases) > 1:
        raise ModelError(
            "found phases, expected a problem of one: a horizon that moves has none", place=read.name
        )
    ends = {name: _limits(read, name) for name in held} | dict.fromkeys(
        map(disturbance_of, added), (-np.inf, np.inf)
    )
    free = tuple(
        replace(n, min=ends[n.name][0], max=ends[n.name][1]) if n.name in ends else n
        for n in built.problem.free
    )
    return replace(built, problem=replace(built.problem, free=free))


def as_courses(built: Built, parameters: Iterable[str]) -> tuple[Built, dict[str, float]]:
    """The problem with parameters and all disturbances as constant courses, and their values by name, which may change."""
    problem = built.problem
    (phase,) = problem.phases
    named = {e for name in parameters for e in built.read.dae.expand(name)}
    told = [n for n in problem.free if n.held or n.name in named]
    values = {n.name: n.guess for n in told}
    courses = [
        Course(n.name, n.symbol, lambda times, name=n.name: np.full(times.shape, values[name])) for n in told
    ]
    phase = replace(phase, courses=(*phase.courses, *courses))
    free = tuple(n for n in problem.free if n.name not in values)
    return replace(built, problem=replace(problem, phases=(phase,), free=free)), values


def named_values(
    flat: FlatModel,
    place: str,
    argument: str,
    given: Any,
    names: tuple[str, ...],
    finite: bool = True,
    alike: bool = False,
) -> dict[str, float]:
    """Values by scalar name of a mapping from names, vectors whole or by element; `names` are allowed, texts have units.

    alike: one number may stand for all elements of a vector. Raises ModelError for other names and shapes.
    """
    found: dict[str, float] = {}
    instance(place, argument, given, Mapping, "a mapping from names to values")
    for name, value in given.items():
        whole = isinstance(name, str) and name not in names
        elements = flat.expand(name) if whole else (name,)
        unknown = [one for one in elements if one not in names]
        if unknown:
            allowed = ", ".join(names) or "none: there are no such names here"
            words = f"expected some of {allowed}{meant(str(unknown[0]), names)}"
            raise ModelError(words, place=place, found=Given(argument, name))
        shapes = ([(len(elements),)] if len(elements) > 1 else []) + (
            [()] if alike or len(elements) == 1 else []
        )
        values = array(place, name, value, *shapes, unit=flat.unit(name), finite=finite)
        found.update(zip(elements, np.broadcast_to(values, len(elements)).tolist(), strict=True))
    return found


def _as_problem(problem: Any, place: str) -> Any:
    """An Optimization; a Model becomes one without costs, its names unchanged."""
    one = problem() if isinstance(problem, type) and issubclass(problem, Model) else problem
    instance(place, "problem", one, Model, "an Optimization or a Model, its class or an instance")
    if isinstance(one, Optimization):
        return one
    kind = type(one)
    found = copy(one)
    found.__class__ = type(kind.__name__, (kind, Optimization), {"__module__": kind.__module__})
    return found


def _elements(flat: FlatModel, names: Iterable[str], place: str) -> list[str]:
    """Scalar inputs and variables by their names; ModelError for parameters and unknown names."""
    known = {e for v in flat.variables for e in v.elements}
    found = list(dict.fromkeys(e for name in names for e in flat.expand(name)))
    for name in found:
        if name not in known:
            words = "expected an input or a measured variable; a parameter belongs in parameters="
            raise ModelError(words, place=place, found=Given("disturbance", name))
    return found


def _disturbed(flat: FlatModel, names: list[str]) -> FlatModel:
    """The model with a parameter for each disturbance, added to the inputs among the names in all equations."""
    owners = {e: (v, k) for v in flat.variables for k, e in enumerate(v.elements)}
    added, old, new = [], [], []
    for name in names:
        variable, k = owners[name]
        own = disturbance_of(name)
        symbol = ca.SX.sym(own)
        words = f"constant disturbance of {name}"
        zero = (ca.SX(0.0),)
        added.append(FlatParameter(own, "parameter", (), (own,), symbol, variable.unit, words, value=zero))
        if name in flat.inputs:
            old.append(variable.symbol.elements()[k])
            new.append(old[-1] + symbol)
    equations = flat.equations
    if old:
        own, other = ca.vertcat(*old), ca.vertcat(*new)
        equations = tuple(
            replace(one, left=ca.substitute(one.left, own, other), right=ca.substitute(one.right, own, other))
            for one in flat.equations
        )
    return replace(flat, parameters=(*flat.parameters, *added), equations=equations)


def _with_disturbed_outputs(read: SymbolicProblem, names: list[str]) -> SymbolicProblem:
    """Costs and limits of the outputs among the names, and of variables equal to them, as they are with disturbances."""
    dae, flat = read.dae, read.dae.flat
    shown = {n: flat.vectors[disturbance_of(n)].symbol for n in names if n not in dae.inputs}
    if not shown:
        return read
    said = [p.integrand for p in read.phases]
    said += [one.expression for one in (*read.constraints, *read.points)]
    leaves = [leaf for leaf in ca.symvar(ca.veccat(*said)) if leaf.name() in flat.scalars]
    old, new = [], []
    for name, symbol in shown.items():
        same = [leaf for leaf in leaves if ca.is_equal(dae.expression(leaf.name()), dae.expression(name), 2)]
        old += same
        new += [leaf + symbol for leaf in same]
    if not old:
        return read
    own, other = ca.vertcat(*old), ca.vertcat(*new)
    phases = tuple(replace(p, integrand=ca.substitute(p.integrand, own, other)) for p in read.phases)
    rows = tuple(replace(c, expression=ca.substitute(c.expression, own, other)) for c in read.constraints)
    points = tuple(replace(p, expression=ca.substitute(p.expression, own, other)) for p in read.points)
    return replace(read, phases=phases, constraints=rows, points=points)


def _adjustable(read: SymbolicProblem, name: str, place: str) -> tuple[str, ...]:
    """The scalars of a parameter; ModelError for one that is none or shapes the equations."""
    elements = read.dae.expand(name)
    for one in elements:
        if one not in read.dae.adjustable:
            words = "expected a parameter of the equations that follows from no other"
            guess = did_you_mean(one, [n for n in read.dae.adjustable if not n.startswith("disturbance(")])
            raise ModelError(f"{words}{guess}", place=place, found=Given("parameters", one))
    free = {e for p in read.dae.flat.parameters if p.free for e in p.elements}
    return tuple(one for one in elements if one not in free)


def _limits(read: SymbolicProblem, name: str) -> tuple[float, float]:
    """Declared limits of a scalar parameter."""
    (owner,) = (p for p in read.dae.flat.parameters if name in p.elements)
    k = owner.elements.index(name)
    low = -np.inf if owner.min is None else read.dae.number(owner.min[k])
    high = np.inf if owner.max is None else read.dae.number(owner.max[k])
    return low, high


def staged(
    problem: Any, period: float, disturbance: Sequence[str] = (), parameters: Sequence[str] = ()
) -> tuple[Any, HorizonStages, dict[str, float]]:
    """The problem in states, algebraics and inputs, its stages, and estimates by name; ModelError for what no receding
    horizon can have.
    """
    disturbance, parameters = ((one,) if isinstance(one, str) else one for one in (disturbance, parameters))
    built, estimates = as_courses(with_unknowns(problem, parameters, disturbance, "Mpc"), parameters)
    read, found = built.read, built.problem
    if found.free:
        names = ", ".join(n.name for n in found.free)
        raise ModelError(
            f"{names} is free, expected a number: a receding horizon has a fixed length and a fixed model; give it a value, "
            "as in final_time = 1.0",
            place=read.name,
        )
    if not all(phase.inputs and phase.states for phase in found.phases):
        words = (
            "there is no input to choose; declare one as Input"
            if found.phases[0].states
            else "there is no state"
        )
        raise ModelError(words, place=read.name)
    return built, HorizonStages(found, period), estimates
