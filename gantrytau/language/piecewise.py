"""What switches in expressions: conditions, absolute values, signs, steps, each with a mode of its own.

Between two switches an expression is smooth, but CasADi's derivatives do not say so: that of fabs(x) is sign(x), which
looks as if it were the same everywhere. Written with modes, every piece has derivatives that can be trusted.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

import casadi as ca
import numpy as np

from gantrytau.language.instructions import computed
from gantrytau.language.tables.local_polynomials import polynomials

MANY = 8  # numbers with which one expression is compared, from where on one mode counts them


@dataclass(frozen=True, eq=False)
class Turn:
    """What jumps: `mode` is 1 where margin > 0 (or = 0, if `closed`), else 0; floor(margin) if it `counts`.

    mode: a symbol; margin: an expression that may hold modes of switches before.
    """

    mode: ca.SX
    margin: ca.SX
    closed: bool = False
    counts: bool = False

    @property
    def value(self) -> ca.SX:
        """The mode that belongs to the margin."""
        if self.counts:
            return ca.floor(self.margin)
        return self.margin >= 0 if self.closed else self.margin > 0


@dataclass(frozen=True, eq=False)
class Switched:
    """Expressions with modes in them, and what these modes are; a switch comes after those in its margin.

    smooth: whether there are conditions that have none, as they are said to be smooth.
    """

    expressions: tuple[ca.SX, ...]
    switches: tuple[Turn, ...]
    smooth: bool = False


def smoothly(condition: ca.SX) -> ca.SX:
    """A condition that is said to change nothing where it turns: 1 and it, which CasADi keeps as it is written."""
    return ca.logic_and(1, condition)


def switched(
    expressions: Sequence[ca.SX], names: Collection[str] | None = None, *, smooth: bool = True
) -> Switched:
    """Expressions with a mode for everything in them that switches on symbols of these names (None: on any symbol).

    smooth: also for conditions that are said to be smooth, see `smoothly`. With the value of each mode in its place they
    are what they were.
    """
    dense = [ca.densify(e) for e in expressions]
    whole = ca.vertcat(*(ca.vec(e) for e in dense)) if dense else ca.SX(0, 1)
    leaves = ca.symvar(whole)
    moving = [names is None or leaf.name() in names for leaf in leaves]
    if not any(moving):
        return Switched(tuple(expressions), ())
    if not may_switch(whole):
        return Switched(tuple(expressions), ())
    reader = _Walk(None if smooth else [])
    (found,) = computed(
        ca.Function("switched", [ca.vertcat(*leaves)], [whole], {"cse": True}),
        lambda _, i: (leaves[i], moving[i]),
        lambda value: (ca.SX(value), False),
        reader.operation,
    )
    if not reader.switches:
        return Switched(tuple(expressions), ())
    written, switches = reader.counted([e for e, _ in found])
    switches = switches if smooth else _in_use(switches, written)
    pieces = ca.vertsplit(ca.vertcat(*written), np.cumsum([0, *(e.numel() for e in dense)]).tolist())
    shaped = (ca.reshape(piece, *e.shape) for piece, e in zip(pieces, dense, strict=True))
    return Switched(tuple(shaped), switches, bool(reader.smooth))


def may_switch(expression: ca.SX) -> bool:
    """Whether an expression holds an operation that switches, on whatever symbols."""
    function = ca.Function("switched", [ca.vertcat(*ca.symvar(expression))], [expression])
    return not _SWITCHING.isdisjoint(map(function.instruction_id, range(function.n_instructions())))


_COMPARING = (ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_IF_ELSE_ZERO)
_KINKED = (ca.OP_FABS, ca.OP_FMIN, ca.OP_FMAX, ca.OP_SIGN, ca.OP_COPYSIGN)
_STEPPING = (ca.OP_FLOOR, ca.OP_CEIL, ca.OP_FMOD, ca.OP_REMAINDER)
_SWITCHING = frozenset((*_COMPARING, *_KINKED, *_STEPPING))
_Value = tuple[ca.SX, bool]  # an expression, and whether it moves with the symbols asked for


@dataclass(frozen=True, eq=False)
class _Walk:
    """Computes with expressions, and notes what switches.

    smooth: conditions that are said to be smooth, None where they switch, too; steps: of an expression by its node the
    modes that say whether it has reached a number, by that number.
    """

    smooth: list[ca.SX] | None
    switches: list[Turn] = field(default_factory=list)
    steps: dict[int, tuple[ca.SX, dict[float, ca.SX]]] = field(default_factory=dict)
    _places: dict[str, int] = field(default_factory=dict)  # of modes by name
    _modes: dict[tuple[int | bool, ...], ca.SX] = field(default_factory=dict)

    def operation(self, operator: int, operands: list[_Value]) -> _Value:
        a = operands[0][0]
        b = operands[1][0] if len(operands) > 1 else a
        if self.smooth is not None and _said_smooth(operator, a, b):
            self.smooth.append(smoothly(self._plain(b)))
            return self.smooth[-1], True
        asked = operands[:1] if operator == ca.OP_IF_ELSE_ZERO else operands
        if any(moves for _, moves in asked):
            found = self._switching(operator, a, b)
            if found is not None:
                return found, True
        apply = ca.SX.unary if len(operands) == 1 else ca.SX.binary
        return apply(operator, *(e for e, _ in operands)), any(moves for _, moves in operands)

    def _plain(self, expression: ca.SX) -> ca.SX:
        """An expression with the values of its modes."""
        own, left = set[int](), [expression]
        while left:
            names = (leaf.name() for leaf in ca.symvar(left.pop()))
            new = {self._places[n] for n in names if n in self._places} - own
            own |= new
            left += [self.switches[k].margin for k in new]
        return with_modes(Switched((), tuple(self.switches[k] for k in sorted(own))), [expression])[0]

    def _switching(self, operator: int, a: ca.SX, b: ca.SX) -> ca.SX | None:
        """What an operator is, written with modes; None for one that does not switch."""
        if operator in (ca.OP_LT, ca.OP_LE):
            mode = self._mode(b - a, closed=operator == ca.OP_LE)
            if a.is_constant() and mode.is_symbolic():
                edge = float(a) if operator == ca.OP_LE else float(np.nextafter(float(a), np.inf))
                self.steps.setdefault(b.element_hash(), (b, {}))[1].setdefault(edge, mode)
            return mode
        if operator == ca.OP_EQ:
            return self._mode(b - a, closed=True) * self._mode(a - b, closed=True)
        if operator == ca.OP_NE:
            return 1 - self._mode(b - a, closed=True) * self._mode(a - b, closed=True)
        if operator == ca.OP_IF_ELSE_ZERO and self.smooth is not None and _is_smooth(a):
            return None
        if operator == ca.OP_IF_ELSE_ZERO and not self._of_modes(a):
            return ca.if_else(self._mode(a) + self._mode(-a), b, 0)
        if operator == ca.OP_FABS:
            return ca.if_else(self._mode(a, closed=True), a, -a)
        if operator == ca.OP_FMIN:
            return ca.if_else(self._mode(b - a, closed=True), a, b)
        if operator == ca.OP_FMAX:
            return ca.if_else(self._mode(a - b, closed=True), a, b)
        if operator == ca.OP_SIGN:
            return self._mode(a) - self._mode(-a)
        if operator == ca.OP_COPYSIGN:
            size = ca.if_else(self._mode(a, closed=True), a, -a)
            return ca.if_else(self._mode(b, closed=True), size, -size)
        if operator == ca.OP_FLOOR:
            return self._mode(a, counts=True)
        if operator == ca.OP_CEIL:
            return -self._mode(-a, counts=True)
        if operator == ca.OP_FMOD:  # rounds towards zero
            ratio = a / b
            forward = self._mode(ratio, closed=True)
            size = self._mode(ca.if_else(forward, ratio, -ratio), counts=True)
            return a - b * ca.if_else(forward, size, -size)
        if operator == ca.OP_REMAINDER:
            return a - b * self._mode(a / b + 0.5, counts=True)
        return None

    def _of_modes(self, condition: ca.SX) -> bool:
        """Whether a condition is made of modes, which jump where they are noted already."""
        return all(leaf.name() in self._places for leaf in ca.symvar(condition))

    def _mode(self, margin: ca.SX, *, closed: bool = False, counts: bool = False) -> ca.SX:
        if margin.is_constant():
            return Turn(margin, margin, closed, counts).value
        parts = (margin,) if margin.is_symbolic() else (margin.dep(k) for k in range(margin.n_dep()))
        key = closed, counts, margin.op(), *(part.element_hash() for part in parts)
        if key not in self._modes:
            new = Turn(ca.SX.sym(f"(mode {len(self.switches)})"), margin, closed, counts)
            self.switches.append(new)
            self._modes[key] = new.mode
            self._places[new.mode.name()] = len(self.switches) - 1
        return self._modes[key]

    def counted(self, expressions: Sequence[ca.SX]) -> tuple[list[ca.SX], tuple[Turn, ...]]:
        """Expressions and switches, with one mode that counts how many of many numbers an expression has reached."""
        told: dict[str, tuple[ca.SX, ca.SX]] = {}  # by a mode: its symbol, and what it is of one that counts
        counts: dict[str, Turn] = {}  # by the first mode of those that it stands for
        for quantity, modes in self.steps.values():
            if len(modes) < MANY:
                continue
            edges = np.array(sorted(modes))
            mode = ca.SX.sym(f"(count {len(counts)})")
            told.update((modes[e].name(), (modes[e], mode >= k + 1)) for k, e in enumerate(edges.tolist()))
            counts[next(iter(modes.values())).name()] = Turn(mode, reached(quantity, edges), counts=True)
        if not told:
            return list(expressions), tuple(self.switches)
        symbols, values = zip(*told.values(), strict=True)
        kept = [t for t in self.switches if t.mode.name() not in told or t.mode.name() in counts]
        kept = [counts.get(t.mode.name(), t) for t in kept]
        found = ca.substitute(
            [*expressions, *(t.margin for t in kept)], [ca.vertcat(*symbols)], [ca.vertcat(*values)]
        )
        turns = [replace(t, margin=m) for t, m in zip(kept, found[len(expressions) :], strict=True)]
        return list(found[: len(expressions)]), tuple(turns)


def reached(x: ca.SX, edges: np.ndarray) -> ca.SX:
    """How many of some numbers (n,), n > 1, that rise, an expression has reached, as a smooth expression in between.

    Whole where it reaches one, and straight between two; beyond the ends it levels off, so that it counts no further.
    """
    count = np.arange(1.0, edges.size + 1)
    (value,), _ = polynomials(edges, count[:, None], "linear", "linear").at(x)
    below, above = (edges[0] - x) / (edges[1] - edges[0]), (x - edges[-1]) / (edges[-1] - edges[-2])
    value = ca.if_else(below > 0, 0.5 + 0.5 / (1 + 2 * below), value)
    return ca.if_else(above > 0, edges.size + 0.5 - 0.5 / (1 + 2 * above), value)


def _said_smooth(operator: int, a: ca.SX, b: ca.SX) -> bool:
    """Whether an operation is what `smoothly` writes."""
    return operator == ca.OP_AND and a.is_constant() and float(a) == 1.0 and not b.is_constant()


def _is_smooth(condition: ca.SX) -> bool:
    """Whether a condition is what `smoothly` writes, or its opposite."""
    inner = condition.dep(0) if condition.is_op(ca.OP_NOT) else condition
    return inner.is_op(ca.OP_AND) and _said_smooth(ca.OP_AND, inner.dep(0), inner.dep(1))


def _in_use(switches: Sequence[Turn], expressions: Sequence[ca.SX]) -> tuple[Turn, ...]:
    """The switches whose modes stand in expressions, or in the margins of those."""
    used = {leaf.name() for leaf in ca.symvar(ca.vertcat(*expressions))}
    for turn in reversed(switches):
        if turn.mode.name() in used:
            used |= {leaf.name() for leaf in ca.symvar(turn.margin)}
    return tuple(turn for turn in switches if turn.mode.name() in used)


def with_modes(found: Switched, expressions: Sequence[ca.SX]) -> list[ca.SX]:
    """Expressions that hold modes, with the values that belong to the margins in their place."""
    symbols, values = [s.mode for s in found.switches], [s.value for s in found.switches]
    if not symbols:
        return list(expressions)
    _, given = ca.substitute_inplace(symbols, values, list(expressions), False)
    return list(given)
