"""Limits and conditions sorted: on the path or at a time, on one signal or on an expression, repeated or not."""

from collections.abc import Mapping
from dataclasses import replace

import casadi as ca
import numpy as np

from gantrytau import ModelError
from gantrytau.language.symbols import split_derivative
from gantrytau_optimica.control.control_problem import ControlProblem, Limit, Phase
from gantrytau_optimica.problem.symbolic_problem import ConstraintRow

BESIDE = 1e-8  # of its size: by how much an end may lie outside of a limit, as the solver's tolerance lets it


def limit_rows(
    constraint: ConstraintRow, expression: ca.SX, low: ca.SX, high: ca.SX, name: str
) -> list[Limit]:
    """A constraint with numbers as limits; a limit that varies is brought to the other side.

    expression, low, high: those of the constraint in the symbols of the control problem.
    """
    text = constraint.name
    if constraint.lower is constraint.upper:
        if low.is_constant():
            return [_numeric(expression, float(low), float(low), text, name)]
        return [Limit(expression - low, 0.0, 0.0, text)]
    ends, rows = [-np.inf, np.inf], []
    for k, bound in enumerate((low, high)):
        if bound.is_constant():
            ends[k] = float(bound)
        else:
            rows.append(Limit(expression - bound, (0.0, -np.inf)[k], (np.inf, 0.0)[k], text))
    if rows and not np.isnan(ends).any() and np.isinf(ends).all():
        return rows
    return [*rows, _numeric(expression, ends[0], ends[1], text, name)]


def _numeric(expression: ca.SX, low: float, high: float, text: str, name: str) -> Limit:
    if np.isnan(low) or np.isnan(high):
        raise ModelError(
            f"{name}: `{text}` has a limit that is not a number, expected finite or infinite numbers"
        )
    if not low <= high or low == np.inf or high == -np.inf:
        raise ModelError(
            f"{name}: `{text}` has the limits {low:g} and {high:g}, expected a lower one that is smaller; "
            "exchange or correct them"
        )
    return Limit(expression, low, high, text)


def signal_limits(phase: Phase, name: str) -> dict[str, tuple[float, float]]:
    """Limits of every signal, those that constraints put on it alone included. ModelError if they contradict."""
    limits = {s.name: (s.min, s.max) for s in phase.signals}
    who: dict[tuple[str, int], str] = {}
    for limit in phase.path_limits:
        found = bare_limit(limit, phase)
        if found is None:
            continue
        signal, *ends = found
        if ends[0] > limits[signal][0]:
            who[signal, 0] = limit.name
        if ends[1] < limits[signal][1]:
            who[signal, 1] = limit.name
        limits[signal] = (max(limits[signal][0], ends[0]), min(limits[signal][1], ends[1]))
        if limits[signal][0] > limits[signal][1]:
            raise ModelError(
                f"{name}: `{who.get((signal, 0), 'limits of ' + signal)}` and "
                f"`{who.get((signal, 1), 'limits of ' + signal)}` contradict each other, {signal} cannot be at least "
                f"{limits[signal][0]:g} and at most {limits[signal][1]:g}; correct one of them"
            )
    return limits


def bare_limit(limit: Limit, phase: Phase) -> tuple[str, float, float] | None:
    """(signal, lower, upper) where a path limit is one on a signal times a number, else None."""
    leaves = ca.symvar(limit.expression)
    if len(leaves) != 1:
        return None
    slope = ca.jacobian(limit.expression, leaves[0])
    names = {s.symbol.element_hash(): s.name for s in phase.signals}
    if not slope.is_constant() or leaves[0].element_hash() not in names or float(slope) == 0.0:
        return None
    offset = float(ca.substitute(limit.expression, leaves[0], 0))
    ends = sorted(((limit.lower - offset) / float(slope), (limit.upper - offset) / float(slope)))
    return names[leaves[0].element_hash()], ends[0], ends[1]


def with_limits(draft: ControlProblem, rows: list[Limit]) -> ControlProblem:
    """The problem with limits on paths and conditions on points, told apart by the symbols in them."""
    name = draft.name
    owners = {
        s.symbol.element_hash(): k
        for k, phase in enumerate(draft.phases)
        for s in (*phase.signals, *phase.courses)
    }
    time = draft.time.element_hash()
    points = {e.element_hash() for p in (*draft.points, *draft.sums) for e in p.symbol.elements()}
    path: list[list[Limit]] = [[] for _ in draft.phases]
    boundary: list[Limit] = []
    for row in rows:
        leaves = {leaf.element_hash() for leaf in ca.symvar(row.expression)}
        phases = {owners[h] for h in leaves if h in owners}
        running = bool(phases) or time in leaves
        if running and leaves & points:
            raise ModelError(
                f"{name}: `{row.name}` mixes a signal over the whole path with its value at one time; "
                "introduce a Free number that equals the value at that time"
            )
        if len(phases) > 1 or (running and not phases and len(draft.phases) > 1):
            raise ModelError(
                f"{name}: `{row.name}` joins signals of several phases over their whole paths, expected values at one time; "
                "write final(...) of one phase and initial(...) of the next"
            )
        if running:
            path[phases.pop() if phases else 0].append(row)
        elif leaves:
            boundary.append(row)
        elif not row.lower - 1e-9 <= float(row.expression) <= row.upper + 1e-9:
            value = float(row.expression)
            raise ModelError(
                f"{name}: `{row.name}` can never hold, its value is always {value:g}; remove or correct it"
            )
    phases = tuple(replace(p, path_limits=tuple(mine)) for p, mine in zip(draft.phases, path, strict=True))
    return replace(draft, phases=phases, boundary=_independent(draft, boundary, name))


Moment = tuple[int, str]  # number of the phase, "initial" or "final"


def _meanings(problem: ControlProblem) -> dict[int, tuple[Moment, ca.SX]]:
    """Moment and expression of every symbol that stands for a value at an end, by hash."""
    return {
        s.element_hash(): ((k, p.time), e)
        for k, phase in enumerate(problem.phases)
        for p in phase.points
        if isinstance(p.time, str)
        for s, e in zip(p.symbol.elements(), p.expression.elements(), strict=True)
    }


def _independent(draft: ControlProblem, boundary: list[Limit], name: str) -> tuple[Limit, ...]:
    """Conditions without those that follow from states which others fix at the same time.

    On a path the whole position may be given where one coordinate decides it; such repetitions would
    make the derivatives of the conditions depend on each other.
    """
    states = {s.symbol.element_hash() for phase in draft.phases for s in phase.states}
    meaning = _meanings(draft)
    fixed: dict[Moment, dict[int, float]] = {}
    kept: list[Limit] = []
    for row in boundary:
        when, value = meaning.get(row.expression.element_hash(), (None, row.expression))
        if row.lower != row.upper or when is None:
            kept.append(row)
            continue
        known = fixed.setdefault(when, {})
        leaves = ca.symvar(value)
        if all(leaf.element_hash() in known for leaf in leaves):
            found = value_at(value, known)
            if abs(found - row.lower) > 1e-7 * max(1.0, abs(row.lower)):
                raise ModelError(
                    f"{name}: `{row.name}` contradicts other conditions at the same time, from which it follows that "
                    f"the value is {found:.8g}; correct one of them"
                )
            continue
        if value.is_symbolic() and value.element_hash() in states:
            known[value.element_hash()] = row.lower
        kept.append(row)
    return tuple(kept)


def value_at(expression: ca.SX, numbers: Mapping[int, float]) -> float:
    """The value of a scalar whose symbols have these numbers, by their hashes."""
    leaves = ca.symvar(expression)
    values = ca.DM([numbers[leaf.element_hash()] for leaf in leaves])
    return float(ca.evalf(ca.substitute(expression, ca.vertcat(*leaves), values) if leaves else expression))


def values_demanded(problem: ControlProblem) -> dict[Moment, list[tuple[ca.SX, Limit]]]:
    """What is to have a number at the start or at the end of a phase, as an expression of signals, with its condition."""
    meaning = _meanings(problem)
    found: dict[Moment, list[tuple[ca.SX, Limit]]] = {}
    for row in problem.boundary:
        when, value = meaning.get(row.expression.element_hash(), (None, row.expression))
        if when is not None and row.lower == row.upper:
            found.setdefault(when, []).append((value, row))
    return found


def known_states(problem: ControlProblem) -> dict[Moment, dict[int, Limit]]:
    """Conditions that give a state a number at the start or at the end of a phase, by the hash of its symbol."""
    states = {s.symbol.element_hash() for phase in problem.phases for s in phase.states}
    found: dict[Moment, dict[int, Limit]] = {}
    for when, demanded in values_demanded(problem).items():
        for value, row in demanded:
            if value.element_hash() in states:
                found.setdefault(when, {})[value.element_hash()] = row
    return found


def check_ends(problem: ControlProblem) -> None:
    """ModelError for a condition that asks of a signal at an end what its limits exclude."""
    for (number, _), demanded in values_demanded(problem).items():
        phase = problem.phases[number]
        names = {s.symbol.element_hash(): s.name for s in phase.signals}
        limits = signal_limits(phase, problem.name)
        for value, row in demanded:
            name = names.get(value.element_hash(), "")
            low, high = limits.get(name, (-np.inf, np.inf))
            slack = BESIDE * max(abs(x) for x in (low, high, row.lower) if np.isfinite(x))
            if low < high and not low - slack <= row.lower <= high + slack:
                raise ModelError(
                    f"{problem.name}: `{row.name}` lies outside of the limits of {name}, {low:.6g} to {high:.6g}; correct "
                    "one of them"
                )


def check_symbols(draft: ControlProblem, name: str) -> None:
    """ModelError for what a problem needs but neither model nor optimiser decides, and for ends outside of limits."""
    check_ends(draft)
    known = [draft.time, *(s.symbol for s in draft.signals), *(f.symbol for f in draft.free)]
    known += [c.symbol for phase in draft.phases for c in phase.courses]
    known += [e for p in (*draft.points, *draft.sums) for e in p.symbol.elements()]
    nodes = {k.element_hash() for k in known}
    everything = ca.vertcat(
        draft.objective, *(p.expression for p in (*draft.points, *draft.sums)),
        *(e for phase in draft.phases for e in (phase.ode, phase.residuals, phase.integrand)),
        *(limit.expression for phase in draft.phases for limit in phase.path_limits),
        *(limit.expression for limit in draft.boundary),
    )  # fmt: skip
    for leaf in ca.symvar(everything):
        if leaf.element_hash() not in nodes:
            base, order = split_derivative(leaf.name())
            if order:
                raise ModelError(
                    f"{name}: needs the derivative of the input {base}, of which there are samples only, expected a course "
                    "that has one; give it in `inputs` as a function of time, or leave it out there and it is chosen"
                )
            raise ModelError(
                f"{name}: {leaf.name()} is needed but not chosen by the optimiser; make it a variable, or give it a value"
            )
    numbers = {f.symbol.element_hash() for f in draft.free}
    for point in draft.points:
        foreign = [] if isinstance(point.time, str) else ca.symvar(point.time)
        for leaf in foreign:
            if leaf.element_hash() not in numbers:
                raise ModelError(
                    f"{name}: at({point.time}, ...) depends on {leaf.name()}, expected a time of numbers, "
                    "start_time and final_time"
                )
