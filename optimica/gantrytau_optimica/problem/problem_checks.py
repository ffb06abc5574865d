"""What can be wrong with a problem that was read, found before anything is built."""

from collections.abc import Iterable
from dataclasses import replace
from difflib import get_close_matches
from typing import Any

import casadi as ca

from gantrytau import Dae, ModelError
from gantrytau.language.symbols import split_derivative, time
from gantrytau_optimica.problem.optimization import Optimization, Point, Target
from gantrytau_optimica.problem.symbolic_problem import ConstraintRow, SymbolicPhase, SymbolicProblem


def static(dae: Dae) -> bool:
    """Whether nothing changes over time: no state, and no equation in which time occurs."""
    return not dae.states and not any(ca.depends_on(e.residual, dae.flat.time) for e in dae.flat.equations)


def _constant(course: Any) -> bool:
    return isinstance(course, ca.SX) and course.is_constant()


def one_point(read: SymbolicProblem) -> bool:
    """Whether a problem is static in its costs, limits and inputs as well, and asks for values at one time only."""
    if not static(read.dae) or any(not _constant(course) for course in read.courses.values()):
        return False
    expressions = [p.integrand for p in read.phases] + [p.expression for p in read.points]
    expressions += [e for c in read.constraints for e in (c.expression, c.lower, c.upper)]
    whole = read.dae.to_reduced(ca.vertcat(read.objective, *(ca.vec(ca.SX(e)) for e in expressions)))
    timed = ca.depends_on(whole, read.dae.flat.time)
    moved = any(
        split_derivative(leaf.name())[0] in read.dae.inputs for leaf in ca.symvar(whole) if _order(leaf)
    )
    return not timed and not moved and not read.targets and len({str(p.time) for p in read.points}) <= 1


def _order(leaf: ca.SX) -> int:
    return split_derivative(leaf.name())[1]


def check_objective(read: SymbolicProblem) -> SymbolicProblem:
    """The problem, if its objective depends on numbers only; a signal of a static problem has one value as well."""
    signals = set(read.dae.variables)
    bare = [
        leaf
        for leaf in ca.symvar(read.objective)
        if split_derivative(leaf.name())[0] in signals or leaf.name() == time.name()
    ]
    if not bare:
        return _check_targets(read)
    if not static(read.dae):
        raise ModelError(
            f"{read.name}.objective depends on {bare[0].name()}, which changes over time; say at which time "
            f"with final({bare[0].name()}) or initial(...), or integrate it by returning it from integrand()"
        )
    found = ca.vertcat(*bare)
    values = ca.vertcat(*(ca.SX.sym(f"value of {leaf.name()}") for leaf in bare))
    points = (*read.points, Point(values, found, "final"))
    return _check_targets(
        replace(read, objective=ca.substitute(read.objective, found, values), points=points)
    )


def _check_targets(read: SymbolicProblem) -> SymbolicProblem:
    """Sums over samples enter the objective times a number, and nothing else."""
    points = {e.element_hash() for p in read.points for e in p.symbol.elements()}
    for target in read.targets:
        slope = ca.jacobian(read.objective, target.symbol)
        if slope.nnz() == 0 or not slope.is_constant():
            raise ModelError(
                f"{read.name}.objective: {target.symbol} does not enter it as a sum times a number; add it, with a "
                "weight that is a number, to what objective() returns"
            )
        if any(leaf.element_hash() in points for leaf in ca.symvar(target.expression)):
            raise ModelError(
                f"{read.name}: {target.symbol} holds a value at a time, expected signals; name the variables themselves"
            )
    return read


def check_constraints(constraints: Iterable[ConstraintRow], targets: Iterable[Target]) -> None:
    """ModelError for a sum over samples in a constraint."""
    for constraint in constraints:
        whole = ca.vertcat(constraint.expression, constraint.lower, constraint.upper)
        for target in targets:
            if ca.depends_on(whole, target.symbol):
                raise ModelError(
                    f"{constraint.place}: {target.symbol} stands in a constraint, expected it in objective() only"
                )


def check_integrands(name: str, phases: Iterable[SymbolicPhase], points: Iterable[Point]) -> None:
    """ModelError for a value at a time in an integrand, which is of signals."""
    symbols = {e.element_hash() for p in points for e in p.symbol.elements()}
    for phase in phases:
        found = next((leaf for leaf in ca.symvar(phase.integrand) if leaf.element_hash() in symbols), None)
        if found is not None:
            place = ".".join(part for part in (name, phase.name, "integrand") if part)
            raise ModelError(f"{place}: found {found}, expected signals over time; name the variable itself")


def check_spelling(problem: type[Optimization]) -> None:
    """ModelError for a misspelt method, which would never be asked for."""
    expected = ("objective", "integrand", "constraints", "equations", "initial_equations")
    for name in dir(problem):
        if name.startswith("_") or hasattr(Optimization, name) or not callable(getattr(problem, name)):
            continue
        close = get_close_matches(name, expected, n=1, cutoff=0.85)
        if close:
            raise ModelError(
                f"{problem.__name__}.{name}: nothing asks for a method of this name; did you mean '{close[0]}'?"
            )


def check_times(read: SymbolicProblem) -> None:
    """ModelError for a time that is neither a number nor made of free numbers and parameters."""
    known = {n for p in read.dae.flat.parameters for n in p.elements}
    for phase in read.phases:
        for which, value in (("start_time", phase.start_time), ("final_time", phase.final_time)):
            for leaf in ca.symvar(value):
                if leaf.name() not in known:
                    raise ModelError(
                        f"{'.'.join(p for p in (read.name, phase.name, which) if p)} depends on {leaf.name()}, expected a "
                        "number or Free(...) and parameters"
                    )
