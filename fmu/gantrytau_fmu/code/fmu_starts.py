"""Where an FMU starts: start values in parameters, and equations for states that initialisation finds.

A start that is declared for a state, or for a multiple of one, is a formula in parameters. One that is declared for
another variable determines states only through the equations, and so becomes an initial equation.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from gantrytau import Dae
from gantrytau.border.refusal import ModelError
from gantrytau_fmu.code.arrays import column, numbers_of

HELD = 1e-9  # relative: a declared start that initialisation has kept


@dataclass(frozen=True, eq=False)
class Starts:
    """values: of states, then of held variables; equations: 0 = initial equations, which determine `solved` states;
    parameters: names of those that act during initialisation only.
    """

    values: ca.SX
    equations: ca.SX
    solved: tuple[int, ...]
    parameters: frozenset[str]


@dataclass(frozen=True, eq=False)
class _Declared:
    """The declared start of a scalar: both as expressions of the system's symbols and parameters."""

    name: str
    expression: ca.SX
    start: ca.SX
    fixed: bool


@dataclass(frozen=True, eq=False)
class _Point:
    """The symbols of a system, and their numbers where the model starts."""

    arrays: Mapping[str, ca.SX]
    numbers: Mapping[str, np.ndarray]
    residuals: ca.SX

    def at(self, expression: ca.SX) -> np.ndarray:
        """The value of an expression."""
        found = ca.Function("at", list(self.arrays.values()), [ca.densify(expression)])
        return np.array(found(*self.numbers.values()))

    def slopes(self, rows: ca.SX) -> np.ndarray:
        """By the states, through the implicit unknowns."""
        x, z = self.arrays["x"], self.arrays["z"]
        found = self.at(ca.jacobian(rows, x))
        if z.numel():
            by_z, own = self.at(ca.jacobian(rows, z)), self.at(ca.jacobian(self.residuals, z))
            found = found - by_z @ np.linalg.solve(own, self.at(ca.jacobian(self.residuals, x)))
        return found


def starts_of(
    dae: Dae,
    to_system: Callable[[Sequence[ca.SX]], list[ca.SX]],
    equations: ca.SX,
    residuals: ca.SX,
    arrays: Mapping[str, ca.SX],
) -> Starts:
    """The start of a model; to_system: leads to the symbols of the arrays; equations: those that it states itself;
    residuals: of the implicit blocks.

    Raises ModelError if initial equations do not determine states.
    """
    point = _Point(arrays, numbers_of(dae, arrays), residuals)
    declared = [d for d in _declared(dae, to_system) if _is_kept(point, d)]
    formulas = _formulas(arrays["x"].elements(), declared)
    rows = [d for d in declared if d not in [own for own, _ in formulas.values()]]
    rows = [d for d in rows if _needs_solving(d, arrays)]
    chosen, solved = _determined(dae, point, equations, rows, set(formulas))
    stated = column([equations, *(d.expression - d.start for d in chosen)])
    values = [
        formulas[k][1] if k in formulas and k not in solved else ca.SX(float(number))
        for k, number in enumerate(point.numbers["x"])
    ]
    values += _held_starts(dae, point.numbers)
    early = {leaf.name() for leaf in ca.symvar(column([*values, *(d.start for d in chosen)]))}
    return Starts(column(values), stated, solved, frozenset(early))


def _declared(dae: Dae, to_system: Callable[[Sequence[ca.SX]], list[ca.SX]]) -> list[_Declared]:
    """Starts in parameters, and those that are fixed; the fixed first."""
    known = set(dae.known)
    found = [
        (name, dae.to_reduced(start), v.fixed)
        for v in dae.flat.variables
        if v.start
        for name, start in zip(v.elements, v.start, strict=True)
        if start is not None and name not in known and (v.fixed or not start.is_constant())
    ]
    if not found:
        return []
    expressions = to_system([dae.expression(name) for name, _, _ in found])
    made = [_Declared(n, e, s, fixed) for (n, s, fixed), e in zip(found, expressions, strict=True)]
    return sorted(made, key=lambda d: not d.fixed)


def _is_kept(point: _Point, declared: _Declared) -> bool:
    """Whether initialisation found the value that was declared."""
    found, said = point.at(ca.vertcat(declared.expression, declared.start)).ravel()
    return abs(found - said) <= HELD * (1 + abs(said))


def _formulas(states: Sequence[ca.SX], declared: Sequence[_Declared]) -> dict[int, tuple[_Declared, ca.SX]]:
    """Place of a state -> the declaration that gives its start, and the start."""
    places = {s.name(): k for k, s in enumerate(states)}
    found: dict[int, tuple[_Declared, ca.SX]] = {}
    for one in declared:
        leaves = ca.symvar(one.expression)
        place = places.get(leaves[0].name()) if len(leaves) == 1 else None
        if place is None or place in found:
            continue
        slope = ca.jacobian(one.expression, states[place])
        if slope.is_constant() and float(slope) != 0:
            offset = ca.substitute(one.expression, states[place], ca.SX(0))
            found[place] = one, ca.simplify((one.start - offset) / slope)
    return found


def _needs_solving(declared: _Declared, arrays: Mapping[str, ca.SX]) -> bool:
    """Whether something that may change at initialisation moves the states which this start belongs to."""
    leaves = {leaf.name() for leaf in ca.symvar(declared.expression)}
    states, implicit = ({s.name() for s in arrays[n].elements()} for n in "xz")
    changing = (leaves - states) | {leaf.name() for leaf in ca.symvar(declared.start)}
    return bool(changing) and bool(leaves & (states | implicit))


def _determined(
    dae: Dae, point: _Point, equations: ca.SX, rows: Sequence[_Declared], spoken_for: set[int]
) -> tuple[list[_Declared], tuple[int, ...]]:
    """The rows that determine something more, and the states that they and the equations determine."""
    count = equations.numel()
    if not count and not rows:
        return [], ()
    from scipy.linalg import qr

    slopes = point.slopes(column([equations, *(d.expression - d.start for d in rows)]))
    fixed = dae.asked.fixed
    may_move = [k for k, n in enumerate(dae.choice.states) if n not in fixed]
    slopes = slopes[:, may_move] * [1e-3 if k in spoken_for else 1.0 for k in may_move]
    size = 1e-9 * max(1.0, float(np.abs(slopes).max(initial=0.0)))
    rank = int(np.linalg.matrix_rank(slopes[:count], tol=size)) if count and may_move else 0
    if rank < count:
        raise ModelError(
            f"export_fmu: {dae.name}: found {count} initial equations, of which only {rank} determine states "
            "that are not fixed; remove those that repeat others or that contradict fixed starts"
        )
    kept = list(range(count))
    for k in range(count, len(slopes)):
        if may_move and np.linalg.matrix_rank(slopes[[*kept, k]], tol=size) > len(kept):
            kept.append(k)
    if not kept:
        return [], ()
    columns = qr(slopes[kept], mode="r", pivoting=True)[-1]
    solved = tuple(sorted(may_move[k] for k in columns[: len(kept)]))
    return [rows[k - count] for k in kept[count:]], solved


def _held_starts(dae: Dae, numbers: Mapping[str, np.ndarray]) -> list[ca.SX]:
    """Of sampled variables and Discretes before their first instant: as declared, else the numbers that were found."""
    declared = {n: s for v in dae.flat.variables if v.start for n, s in zip(v.elements, v.start, strict=True)}
    names = (*(s.name for s in dae.flat.sampled), *dae.flat.discretes)
    first = len(numbers["u"]) - len(names)
    return [
        ca.SX(float(numbers["u"][first + k])) if (start := declared.get(n)) is None else dae.to_reduced(start)
        for k, n in enumerate(names)
    ]
