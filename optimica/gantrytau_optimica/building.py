"""From a problem in the model's symbols to a control problem in states, algebraics and inputs."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from gantrytau import Dae, ModelError
from gantrytau.flat_model import FlatVariable
from gantrytau.symbols import derivative_name, split_derivative, time
from gantrytau.system import System
from gantrytau_optimica.records import ControlProblem, FreeNumber, Limit, PointValue, Signal
from gantrytau_optimica.guesses import first_guesses, typical_size
from gantrytau_optimica.optimization import Point
from gantrytau_optimica.reading import Constraint, ReadProblem


@dataclass(frozen=True, eq=False)
class Built:
    """The control problem, and what leads back from it to the model's names."""

    problem: ControlProblem
    system: System
    numbers: Mapping[str, float]  # parameters that are not free


def build(read: ReadProblem, guess: Mapping[str, Any]) -> Built:
    """Bring a problem into the form that is transcribed. Raises ModelError where it cannot be one."""
    dae = read.dae
    system = dae.system("lifted")
    free = [p for p in dae.flat.parameters if p.free]
    names = [n for p in free for n in p.elements if n in dae.table.independent]
    numbers = {n: dae.table.values[n] for n in dae.table.independent if n not in names}
    points = (*read.points, *_start_points(dae))
    constraints = [*read.constraints, *_start_constraints(dae, points[len(read.points) :])]
    limits = _declared_limits(dae)
    expressions = [
        read.objective,
        read.integrand,
        read.start_time,
        read.final_time,
        *(p.expression for p in points),
        *(p.time for p in points if not isinstance(p.time, (str, int, float))),
        *(c.expression for c in constraints),
        *(c.expression for c in limits),
    ]
    found = iter(_numbered(system.express(expressions), dae, numbers))
    objective, integrand, start_time, final_time = (next(found) for _ in range(4))
    values = [next(found) for _ in points]
    times = [p.time if isinstance(p.time, str) else ca.SX(p.time) for p in points]
    times = [next(found) if isinstance(p.time, ca.SX) else t for p, t in zip(points, times, strict=True)]
    rows = [Limit(next(found), *_bounds(c, dae, read.name), name=c.name) for c in (*constraints, *limits)]
    ode, residuals = _numbered([system.ode, system.residuals], dae, numbers)
    chosen = tuple(
        FreeNumber(n, dae.table.symbols[n], *_range(p, k, dae), guess=_free_guess(n, guess, dae))
        for p in free
        for k, n in enumerate(p.elements)
        if n in names
    )
    draft = ControlProblem(
        time=time,
        start_time=start_time,
        final_time=final_time,
        states=_signals(system.states, system.x.elements()),
        algebraics=tuple(
            Signal(a.name, a.symbol, a.min, np.inf, 1.0, np.zeros_like) for a in system.algebraics
        ),
        inputs=_signals(system.inputs, system.u.elements()),
        free=chosen,
        ode=ode,
        residuals=residuals,
        residual_names=tuple(f"the equation of {a.name}" for a in system.algebraics),
        integrand=integrand,
        objective=objective,
        path_limits=(),
        boundary=(),
        points=tuple(PointValue(p.symbol, v, t) for p, v, t in zip(points, values, times, strict=True)),
    )
    path, boundary = _sorted_limits(draft, rows, read.name)
    draft = replace(draft, path_limits=path, boundary=boundary)
    _check_symbols(draft, read.name)
    guesses = first_guesses(read, draft, system, numbers, points, constraints, guess)
    return Built(_with_guesses(draft, guesses), system, numbers)


def _signals(names: tuple[str, ...], symbols: list[ca.SX]) -> tuple[Signal, ...]:
    return tuple(
        Signal(name, symbol, -np.inf, np.inf, 1.0, np.zeros_like)
        for name, symbol in zip(names, symbols, strict=True)
    )


def _numbered(expressions: list[ca.SX], dae: Dae, numbers: Mapping[str, float]) -> list[ca.SX]:
    """Parameters that are not free replaced by their numbers."""
    if not numbers:
        return expressions
    symbols = ca.vertcat(*(dae.table.symbols[n] for n in numbers))
    return ca.substitute(expressions, [symbols], [ca.SX(ca.DM(list(numbers.values())))])


def _start_points(dae: Dae) -> list[Point]:
    """Fixed starts of the model, as values at the initial time."""
    fixed = sorted(dae.settings["fixed"])
    found = []
    for name in fixed:
        symbol = dae.reduced.chains.named(name)
        found.append(Point(ca.SX.sym(f"initial({name})"), symbol, "initial"))
    return found


def _start_constraints(dae: Dae, points: tuple[Point, ...]) -> list[Constraint]:
    found = []
    for name, point in zip(sorted(dae.settings["fixed"]), points, strict=True):
        value = ca.SX(dae.start[name])
        found.append(
            Constraint(point.symbol, value, value, f"initial({name}) == {dae.start[name]:g} (fixed start)")
        )
    return found


def _declared_limits(dae: Dae) -> list[Constraint]:
    """min and max of every variable of the model, eliminated ones included."""
    found = []
    for variable in dae.flat.variables:
        if variable.min is None and variable.max is None:
            continue
        for k, (name, symbol) in enumerate(zip(variable.elements, variable.symbol.elements(), strict=True)):
            low = variable.min[k] if variable.min is not None else ca.SX(-ca.inf)
            high = variable.max[k] if variable.max is not None else ca.SX(ca.inf)
            found.append(Constraint(symbol, low, high, f"limits of {name}"))
    return found


def _bounds(constraint: Constraint, dae: Dae, name: str) -> tuple[float, float]:
    ends = []
    for bound in (constraint.lower, constraint.upper):
        leaves = [leaf.name() for leaf in ca.symvar(bound)]
        if any(leaf not in dae.table.values for leaf in leaves):
            raise ModelError(
                f"{name}: the limit in `{constraint.name}` changes with {leaves[0]}; write it as a difference, "
                "`x - limit <= 0`"
            )
        ends.append(float(dae.table.number(bound)[0]))
    if not ends[0] <= ends[1] or any(np.isnan(ends)):
        raise ModelError(
            f"{name}: `{constraint.name}` has limits {ends[0]:g} and {ends[1]:g}; make the lower the smaller"
        )
    return ends[0], ends[1]


def _range(parameter: FlatVariable, k: int, dae: Dae) -> tuple[float, float]:
    low = -np.inf if parameter.min is None else float(dae.table.number(parameter.min[k])[0])
    high = np.inf if parameter.max is None else float(dae.table.number(parameter.max[k])[0])
    if not low <= high:
        raise ModelError(f"{parameter.name}: limits {low:g} and {high:g} cross; make min the smaller")
    return low, high


def _free_guess(name: str, guess: Mapping[str, Any], dae: Dae) -> float:
    value = guess.get(name)
    return float(value) if isinstance(value, (int, float)) else dae.table.values[name]


def _sorted_limits(
    draft: ControlProblem, rows: list[Limit], name: str
) -> tuple[tuple[Limit, ...], tuple[Limit, ...]]:
    """Limits on paths and conditions on points, told apart by the symbols in them."""
    signals = {s.symbol.element_hash() for s in draft.signals} | {draft.time.element_hash()}
    points = {e.element_hash() for p in draft.points for e in p.symbol.elements()}
    path, boundary = [], []
    for row in rows:
        leaves = {leaf.element_hash() for leaf in ca.symvar(row.expression)}
        if leaves & signals and leaves & points:
            raise ModelError(
                f"{name}: `{row.name}` mixes a signal over the whole path with its value at one time; "
                "introduce a Free number that equals the value at that time"
            )
        if leaves & signals:
            path.append(row)
        elif leaves:
            boundary.append(row)
        elif not row.lower - 1e-9 <= float(row.expression) <= row.upper + 1e-9:
            value = float(row.expression)
            raise ModelError(
                f"{name}: `{row.name}` can never hold, its value is always {value:g}; remove or correct it"
            )
    return tuple(path), _independent(draft, boundary, name)


def _independent(draft: ControlProblem, boundary: list[Limit], name: str) -> tuple[Limit, ...]:
    """Conditions without those that follow from states which others fix at the same time.

    On a path the whole position may be given where one coordinate decides it; such repetitions would
    make the derivatives of the conditions depend on each other.
    """
    states = {s.symbol.element_hash() for s in draft.states}
    meaning = {
        s.element_hash(): (p.time, e)
        for p in draft.points
        if isinstance(p.time, str)
        for s, e in zip(p.symbol.elements(), p.expression.elements(), strict=True)
    }
    fixed: dict[str, dict[int, tuple[ca.SX, float]]] = {"initial": {}, "final": {}}
    kept: list[Limit] = []
    for row in boundary:
        when, value = meaning.get(row.expression.element_hash(), ("", row.expression))
        if row.lower != row.upper or when not in fixed:
            kept.append(row)
            continue
        known = fixed[when]
        leaves = ca.symvar(value)
        if all(leaf.element_hash() in known for leaf in leaves):
            pairs = [known[leaf.element_hash()] for leaf in leaves]
            inside, numbers = ca.vertcat(*(p[0] for p in pairs)), ca.DM([p[1] for p in pairs])
            found = float(ca.evalf(ca.substitute(value, inside, numbers))) if leaves else float(value)
            if abs(found - row.lower) > 1e-7 * max(1.0, abs(row.lower)):
                raise ModelError(
                    f"{name}: `{row.name}` contradicts other conditions at the same time, from which it follows that "
                    f"the value is {found:.8g}; correct one of them"
                )
            continue
        if value.is_symbolic() and value.element_hash() in states:
            known[value.element_hash()] = (value, row.lower)
        kept.append(row)
    return tuple(kept)


def _check_symbols(draft: ControlProblem, name: str) -> None:
    known = [draft.time, *(s.symbol for s in draft.signals), *(f.symbol for f in draft.free)]
    known += [e for p in draft.points for e in p.symbol.elements()]
    nodes = {k.element_hash() for k in known}
    everything = ca.vertcat(
        draft.ode, draft.residuals, draft.integrand, draft.objective, *(p.expression for p in draft.points),
        *(limit.expression for limit in (*draft.path_limits, *draft.boundary)),
    )  # fmt: skip
    for leaf in ca.symvar(everything):
        if leaf.element_hash() not in nodes:
            base, order = split_derivative(leaf.name())
            what = f"the derivative of the input {base}" if order else leaf.name()
            raise ModelError(
                f"{name}: {what} is needed but not chosen by the optimiser; make the derivative the input and "
                "integrate it in the model"
            )


def _with_guesses(draft: ControlProblem, guesses: Mapping[str, Any]) -> ControlProblem:
    bounds = {s.name: (s.min, s.max) for s in draft.signals}
    from gantrytau_optimica.program import _bound

    for limit in draft.path_limits:
        found = _bound(limit, draft)
        if found is not None:
            bounds[found[0]] = (max(bounds[found[0]][0], found[1]), min(bounds[found[0]][1], found[2]))

    def done(signals: tuple[Signal, ...]) -> tuple[Signal, ...]:
        return tuple(
            replace(s, guess=guesses[s.name], nominal=typical_size(guesses[s.name], bounds[s.name]))
            for s in signals
        )

    return replace(
        draft, states=done(draft.states), algebraics=done(draft.algebraics), inputs=done(draft.inputs)
    )


def derivative_symbol(dae: Dae, name: str) -> tuple[str, float, float] | None:
    """(symbol, factor, offset) with name = factor * symbol + offset, or None for a constant."""
    base, order = split_derivative(name)
    alias = dae.reduced.aliases.get(base)
    if alias is None or alias.root is None:
        return None
    offset = float(dae.table.number(dae.table.reduce(alias.offset))[0]) if order == 0 else 0.0
    return derivative_name(alias.root, alias.order + order), alias.factor, offset
