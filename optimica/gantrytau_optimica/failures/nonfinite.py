"""Values and derivatives that are no finite numbers: in which equation, when, and what is wrong there.

Ipopt says that a number is invalid. Here every equation of the model, limit and cost is evaluated by itself, with its
first and second derivatives, in the order in which the model solves them; where one is not finite, its operations
are searched for the first whose operand lies outside of its domain.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from gantrytau.language.instructions import computed
from gantrytau_optimica.control.built import Built, with_values
from gantrytau_optimica.failures.constraint_labels import signal_words
from gantrytau_optimica.problem.model_words import definition_words, motion_words
from gantrytau_optimica.transcription.trajectory import Trajectory

KINDS = ("value", "derivative", "curvature")
TINY = 1e-100  # whose negative powers, as in derivatives of roots, are beyond all numbers
LONG = 60  # characters of an operand that are still read


@dataclass(frozen=True)
class NotFinite:
    """An expression whose value, first or second derivative is no finite number: words, times in s and the cause."""

    where: str
    kind: str  # "value", "derivative" or "curvature"
    variable: str  # with respect to which it is derived, or ""
    time: float | None
    cause: str  # the operation and its operand, or ""
    values: tuple[tuple[str, float], ...]  # variables of an operand that is no variable itself
    variables: tuple[str, ...]  # those that the cause, or else the expression, depends on

    def __str__(self) -> str:
        subject = {
            "value": f"{self.where} is not finite",
            "derivative": f"{self.where}: its derivative with respect to {self.variable} is not finite",
            "curvature": f"{self.where}: its second derivative with respect to {self.variable} is not finite",
        }[self.kind]
        when = "" if self.time is None else f" at t = {self.time:.4g} s"
        numbers = ", ".join(f"{name} = {value:.4g}" for name, value in self.values)
        why = f", because of {self.cause}" if self.cause else ""
        return f"{subject}{when}{why}{', where ' + numbers if numbers else ''}"


@dataclass(frozen=True, eq=False)
class _Table:
    """Symbols with their names, and their values in columns, one for each of `times` (None: at no one time)."""

    symbols: ca.SX
    names: Sequence[str]
    values: np.ndarray
    times: Sequence[float | None]


def not_finite(built: Built, phases: Sequence[Trajectory]) -> list[NotFinite]:
    """What is not finite along these trajectories; one cause is told once, by the equation from which it comes."""
    faults = [
        (one, origin)
        for e, words, table, origin in _expressions(built, phases)
        if (one := _fault(e, words, table))
    ]
    # of other definitions nothing in the program depends
    used = {one.cause for one, origin in faults if not origin}
    found: dict[str, NotFinite] = {}
    for one, origin in sorted(faults, key=lambda fault: KINDS.index(fault[0].kind)):
        if not origin or (one.cause and one.cause in used):
            found.setdefault(one.cause or one.where, one)
    return list(found.values())


def _expressions(built: Built, phases: Sequence[Trajectory]) -> Iterator[tuple[ca.SX, str, _Table, bool]]:
    """What the program evaluates, with words and values of its symbols; first the definitions inserted in it (True)."""
    problem, dae = built.problem, built.read.dae
    motions = motion_words(dae)
    words = definition_words(dae)
    symbols = [symbol for symbol, _ in built.system.definitions]
    resolved = (
        with_values(
            built.system.to_system([e for _, e in built.system.definitions]), built.read, built.numbers
        )
        if symbols
        else []
    )
    values: list[tuple[ca.SX, float]] = []
    for trajectory in phases:
        phase, table = trajectory.phase, _table(trajectory)
        mine = {s.element_hash() for s in table.symbols.elements()}
        origins = [(e, str(words.get(s.name()) or s.name())) for s, e in zip(symbols, resolved, strict=True)]
        pairs = list(
            zip(phase.residuals.elements(), (n.removesuffix(",") for n in phase.residual_names), strict=True)
        )
        pairs += [
            (e, motions.get(s.name, f"the motion of {s.name}"))
            for s, e in zip(phase.states, phase.ode.elements(), strict=True)
        ]
        pairs += [(limit.expression, f"`{limit.name}`") for limit in phase.path_limits]
        pairs.append((phase.integrand, f"the integrand{f' of {phase.name}' if phase.name else ''}"))
        for k, (expression, text) in enumerate([*origins, *pairs]):
            if all(leaf.element_hash() in mine for leaf in ca.symvar(expression)):
                yield expression, text, table, k < len(origins)
        for point in phase.points:
            when = trajectory.moment(point.time)
            at = trajectory.values(point.expression, np.array([when]))[:, 0]
            values += zip(point.symbol.elements(), at, strict=True)
    free = zip(problem.free, phases[0].numbers, strict=True)
    values += [(n.symbol, value) for n, value in free]
    sums = [(s.symbol, 0.0) for s in problem.sums]
    column = ca.vertcat(ca.SX(0, 1), *(s for s, _ in (*values, *sums)))
    table = _Table(
        column,
        [s.name() for s in column.elements()],
        np.array([[v] for _, v in (*values, *sums)]).reshape(-1, 1),
        [None],
    )
    yield problem.objective, "the objective", table, False
    for limit in problem.boundary:
        yield limit.expression, f"`{limit.name}`", table, False


def _table(trajectory: Trajectory) -> _Table:
    """Time, signals, courses and free numbers of a phase at its collocation points."""
    phase, problem = trajectory.phase, trajectory.problem
    element, place = trajectory.layout.points
    times = trajectory.times(trajectory.mesh.borders[element] + place * trajectory.mesh.widths[element])
    numbers = np.repeat(trajectory.numbers[:, None], times.size, axis=1)
    names = [
        "time",
        *(signal_words(phase, k) for k in range(len(phase.signals))),
        *(c.name for c in phase.courses),
    ]
    symbols = [problem.time, *(s.symbol for s in (*phase.signals, *phase.courses)), problem.numbers]
    values = np.vstack([times[None, :], trajectory.at(element, place, times), numbers])
    return _Table(ca.vertcat(*symbols), [*names, *(n.name for n in problem.free)], values, times.tolist())


def _fault(expression: ca.SX, words: str, table: _Table) -> NotFinite | None:
    """The first value, else derivative, else second derivative of a scalar that is not finite."""
    slope = ca.jacobian(expression, table.symbols)
    stages: list[tuple[str, Callable[[], ca.SX]]] = [
        ("value", lambda: ca.densify(expression)),
        ("derivative", lambda: slope),
        (
            "curvature",
            lambda: (
                ca.jacobian(ca.vec(slope.nz[:]), table.symbols)
                if slope.nnz()
                else ca.SX(1, table.symbols.numel())
            ),
        ),
    ]
    for kind, make in stages:
        matrix = make()
        if matrix.nnz() == 0:
            return None
        found = _evaluated(ca.vec(matrix.nz[:]), table)  # vec: entries of a row come as a row
        bad = ~np.isfinite(found)
        if not bad.any():
            continue
        copy = int(np.argmax(bad.any(axis=0)))
        entry = int(np.argmax(bad[:, copy]))
        variable = "" if kind == "value" else str(table.names[matrix.sparsity().get_triplet()[1][entry]])
        cause, leaves, root = _cause(expression, table, copy, kind)
        hashes = [leaf.element_hash() for leaf in table.symbols.elements()]
        values = [(table.names[k], float(table.values[k, copy])) for k, h in enumerate(hashes) if h in leaves]
        inside = leaves or {
            leaf.element_hash() for leaf in ca.symvar(root if root is not None else expression)
        }
        variables = tuple(table.names[k] for k, h in enumerate(hashes) if h in inside)
        return NotFinite(words, kind, variable, table.times[copy], cause, tuple(values[:4]), variables)
    return None


def _evaluated(column: ca.SX, table: _Table) -> np.ndarray:
    """Values (k, n)."""
    found = np.array(ca.Function("values", [table.symbols], [ca.densify(column)])(table.values))
    count = table.values.shape[1]
    return found if found.shape[1] == count else np.repeat(found, count, axis=1)


def _cause(expression: ca.SX, table: _Table, copy: int, kind: str) -> tuple[str, set[int], ca.SX | None]:
    """The first operation whose operand lies outside of its domain at a copy, in words, and the symbols of the operand."""
    candidates = _operations(expression, table.symbols)
    if not candidates:
        return "", set(), None
    operands = ca.vertcat(*(x for _, first, second in candidates for x in (first, second)))
    one = _Table(table.symbols, table.names, table.values[:, copy : copy + 1], [None])
    numbers = _evaluated(operands, one)[:, 0].reshape(-1, 2)
    for (operation, first, second), (a, b) in zip(candidates, numbers, strict=True):
        if not (np.isfinite(a) and np.isfinite(b)):
            continue
        words = _DOMAINS[operation](float(a), float(b), kind != "value", kind == "curvature")
        if words:
            operand, value = (second, b) if operation == ca.OP_DIV else (first, a)
            leaves = set() if operand.is_symbolic() else {leaf.element_hash() for leaf in ca.symvar(operand)}
            return words.format(_named(operand, float(value), table)), leaves, operand
    return "", set(), None


def _named(operand: ca.SX, value: float, table: _Table) -> str:
    """`tank.h - 2` = -1, in the model's names, or the value alone where the operand is long."""
    spoken = ca.vertcat(*(ca.SX.sym(name) for name in table.names))
    text = str(ca.substitute(operand, table.symbols, spoken)).strip("()" if operand.n_dep() == 2 else "")
    return f"`{text}` = {value:.4g}" if len(text) <= LONG and "@" not in text else f"{value:.4g}"


def _operations(expression: ca.SX, symbols: ca.SX) -> list[tuple[int, ca.SX, ca.SX]]:
    """Operations that have a domain, with their operands, in the order of evaluation."""
    found: list[tuple[int, ca.SX, ca.SX]] = []

    def apply(operator: int, operands: list[ca.SX]) -> ca.SX:
        if operator in _DOMAINS:
            found.append((operator, operands[0], operands[-1]))
        return (ca.SX.binary if len(operands) == 2 else ca.SX.unary)(operator, *operands)

    computed(ca.Function("steps", [symbols], [expression]), lambda _, i: symbols[i], ca.SX, apply)
    return found


def _root(a: float, b: float, first: bool, second: bool) -> str:
    if a < 0:
        return "the square root of {}"
    return "the square root of {}, infinitely steep there" if first and a < TINY else ""


def _logarithm(a: float, b: float, first: bool, second: bool) -> str:
    return "the logarithm of {}" if a <= 0 else ""


def _division(a: float, b: float, first: bool, second: bool) -> str:
    return "the division by {}" if b == 0 else ""


def _inverse(a: float, b: float, first: bool, second: bool) -> str:
    return _division(b, a, first, second)


def _power(a: float, b: float, first: bool, second: bool) -> str:
    whole = b == round(b)
    if (a < 0 and not whole) or (a == 0 and b < 0):
        return f"{{}} to the power of {b:.4g}"
    if a == 0 and not whole and ((first and b < 1) or (second and b < 2)):
        return f"{{}} to the power of {b:.4g}, too steep there"
    return ""


def _arc(a: float, b: float, first: bool, second: bool) -> str:
    if abs(a) > 1:
        return "the arcsine or arccosine of {}, beyond -1 to 1"
    return "the arcsine or arccosine of {}, infinitely steep there" if first and abs(a) == 1 else ""


def _exponential(a: float, b: float, first: bool, second: bool) -> str:
    return "the exponential of {}, too large a number" if a > 700 else ""


_DOMAINS: dict[int, Callable[[float, float, bool, bool], str]] = {
    ca.OP_SQRT: _root,
    ca.OP_LOG: _logarithm,
    ca.OP_DIV: _division,
    ca.OP_INV: _inverse,
    ca.OP_POW: _power,
    ca.OP_CONSTPOW: _power,
    ca.OP_ASIN: _arc,
    ca.OP_ACOS: _arc,
    ca.OP_EXP: _exponential,
}
