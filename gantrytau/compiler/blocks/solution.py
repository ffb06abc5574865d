"""Solves one block of equations symbolically: in closed form where it has one, torn where it has not.

Numbers guide the symbolic choices: pivots are accepted by their values at sample points.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.compiler.alphabets import Substitution
from gantrytau.compiler.blocks.circles_and_spheres import intersection
from gantrytau.compiler.blocks.pieces import PieceChoice, in_pieces
from gantrytau.compiler.blocks.pivots import Guide, reliable
from gantrytau.compiler.blocks.quadratics import QuadraticRoot, quadratic_root
from gantrytau.compiler.blocks.tearing import switching_places, tear
from gantrytau.compiler.index_reduction import Key
from gantrytau.language.piecewise import switched, with_modes
from gantrytau.language.symbols import split_derivative

LARGEST_CLOSED_FORM = 12  # unknowns of a torn linear block that is solved by unrolled elimination


@dataclass(frozen=True, eq=False)
class Block:
    """Equations that are solved together.

    kind: "explicit", "linear", "quadratic", "spheres", "piecewise" or "nonlinear"; tears: symbols found from
    `residuals` first; inner: the other unknowns as (symbol, expression of tears and earlier unknowns), in order;
    solution: the tears in closed form, or None; root: the square root among them, or None; pieces: of a piecewise one.
    """

    kind: str
    equations: tuple[Key, ...]
    unknowns: tuple[str, ...]
    tears: tuple[ca.SX, ...]
    residuals: tuple[ca.SX, ...]
    inner: tuple[tuple[ca.SX, ca.SX], ...]
    solution: tuple[ca.SX, ...] | None
    root: QuadraticRoot | None = None
    pieces: PieceChoice | None = None
    pairs: tuple[tuple[Key, str], ...] = ()  # equations solved for one unknown each

    @property
    def definitions(self) -> list[tuple[ca.SX, ca.SX]]:
        """What is known of the unknowns in closed form, as (symbol, expression) in order of solution."""
        tears = () if self.solution is None else zip(self.tears, self.solution, strict=True)
        return [*tears, *self.inner]

    def enter(self, guide: Guide) -> None:
        """Let later blocks know this one."""
        guide.define(self.definitions)
        partners = {equation: split_derivative(name)[0] for (equation, _), name in self.pairs}
        guide.partners.update({equation: partners.get(equation, "") for equation, _ in self.equations})


@dataclass(frozen=True, eq=False)
class SolvedBlocks:
    """Blocks in the order of their solution, put together."""

    blocks: tuple[Block, ...]

    @cached_property
    def implicit(self) -> tuple[Block, ...]:
        """Those without closed form."""
        return tuple(b for b in self.blocks if b.solution is None)

    @property
    def tears(self) -> list[ca.SX]:
        """What is left to be found, by iteration or as an algebraic variable."""
        return [y for b in self.implicit for y in b.tears]

    @property
    def residuals(self) -> list[ca.SX]:
        """The equations that are left for it."""
        return [r for b in self.implicit for r in b.residuals]

    def after(self, known: Iterable[tuple[ca.SX, ca.SX]]) -> Substitution:
        """All symbols in terms of what `known` is written in, and of the tears that are left."""
        return Substitution((*known, *(pair for b in self.blocks for pair in b.definitions)))


def solve_blocks(
    pattern: Sequence[tuple[tuple[Key, ...], tuple[str, ...]]],
    residuals: Mapping[Key, ca.SX],
    symbols: Mapping[str, ca.SX],
    guide: Guide,
) -> SolvedBlocks:
    """The solutions of blocks, given as (equations, unknowns) in the order of their solution."""
    found: list[Block] = []
    for equations, unknowns in pattern:
        block = solve_block(equations, unknowns, residuals, symbols, guide)
        block.enter(guide)
        found.append(block)
    return SolvedBlocks(tuple(found))


def solve_block(
    equations: tuple[Key, ...],
    unknowns: tuple[str, ...],
    residuals: Mapping[Key, ca.SX],
    symbols: Mapping[str, ca.SX],
    guide: Guide,
) -> Block:
    """The solution of one block; `guide` have a number for every symbol in it."""
    x = ca.vertcat(*(symbols[n] for n in unknowns))
    f = ca.vertcat(*(residuals[k] for k in equations))
    smooth = switched([f], {leaf.name() for leaf in x.elements()})
    jacobian = ca.jacobian(smooth.expressions[0], x)
    linear = not ca.depends_on(ca.vertcat(*jacobian.nonzeros()), x) if jacobian.nnz() else False
    if len(unknowns) == 1:
        return _finish(equations, unknowns, (x,), (f,), (), guide, ((equations[0], unknowns[0]),))
    numbers = guide.around(ca.densify(with_modes(smooth, [jacobian])[0]))
    barred = switching_places(smooth, x)
    partners = {i: guide.partners[key[0]] for i, key in enumerate(equations) if key[0] in guide.partners}
    places = {split_derivative(name)[0]: j for j, name in enumerate(unknowns)}
    partner = {i: places.get(name, -1) for i, name in partners.items()}
    first = {j for j, name in enumerate(unknowns) if name in guide.rates}
    # pivots of parameters alone can vanish nowhere: where they serve as well, they are taken
    ways: list[dict[str, Any]] = [
        dict(first=set(), steady=guide.parameters),
        dict(first=first, steady=guide.parameters),
        dict(first=first),
    ]
    tried = []
    for way in ways:
        tried.append(tear(jacobian, numbers, x, relaxed=linear, partner=partner, barred=barred, **way))
        if len(tried[-1].tears) <= max(len(first), 1):
            break
    torn = min(tried, key=lambda one: len(one.tears))
    inner: list[tuple[ca.SX, ca.SX]] = []
    rows, columns = ca.vertsplit(f), ca.vertsplit(x)
    for i, j in torn.assignments:
        slope = jacobian[i, j]
        rest = ca.substitute(rows[i], columns[j], ca.SX(0))
        inner.append((columns[j], -rest / slope))
    tears = tuple(columns[j] for j in torn.tears)
    left = [rows[i] for i in torn.residuals]
    left = Substitution(tuple(inner)).inserted(left)
    pairs = tuple((equations[i], unknowns[j]) for i, j in torn.assignments)
    return _finish(equations, unknowns, tears, tuple(left), tuple(inner), guide, pairs)


def _finish(equations, unknowns, tears, residuals, inner, guide, pairs) -> Block:
    """Closed form for what is left after tearing, if there is one."""

    def block(kind: str, solution=None, root=None, pieces=None) -> Block:
        return Block(kind, equations, unknowns, tears, residuals, inner, solution, root, pieces, pairs)

    if not tears:
        return block("explicit", ())
    y, f = ca.vertcat(*tears), ca.vertcat(*residuals)
    smooth = switched([f], {tear.name() for tear in tears})
    if smooth.switches:
        found = in_pieces(smooth, y, guide)
        return block("nonlinear") if found is None else block("piecewise", found[0], pieces=found[1])
    jacobian = ca.jacobian(f, y)
    if not ca.depends_on(jacobian, y):
        if len(tears) == 1:
            return block("explicit" if not inner else "linear", (-_at_zero(f, y) / jacobian,))
        if len(tears) > LARGEST_CLOSED_FORM:
            return block("linear")
        found = eliminate(jacobian, -_at_zero(f, y), guide)
        return block("linear", None if found is None else tuple(found))
    curvature = ca.jacobian(ca.vec(ca.densify(jacobian)), y)
    if len(tears) == 1 and not ca.depends_on(curvature, y):
        root = quadratic_root(f, tears[0], guide)
        return block("quadratic", (root.closed,), root)
    found = intersection(f, y, guide)
    return block("nonlinear") if found is None else block("spheres", tuple(found))


def eliminate(matrix: ca.SX, right: ca.SX, guide: Guide) -> list[ca.SX] | None:
    """Solution of a small linear system by elimination, or None if it is singular at the start.

    Pivots are chosen by their numbers at the sample points.
    """
    n = matrix.shape[0]
    a = [[matrix[i, j] for j in range(n)] + [right[i]] for i in range(n)]
    numbers = guide.around(matrix)
    pivots: list[tuple[int, int]] = []
    rows, columns = list(range(n)), list(range(n))
    for _ in range(n):
        pivot = _pivot(a, numbers, rows, columns)
        if pivot is None:
            return None
        p, q = pivot
        rows.remove(p)
        columns.remove(q)
        pivots.append((p, q))
        for i in rows:
            if a[i][q].is_zero():
                continue
            factor = a[i][q] / a[p][q]
            with np.errstate(divide="ignore", invalid="ignore"):
                numbers[:, i] -= (numbers[:, i, q] / numbers[:, p, q])[:, None] * numbers[:, p]
            for j in (*columns, n):
                a[i][j] = a[i][j] - factor * a[p][j]
    x: list[ca.SX] = [ca.SX(0)] * n
    for place in reversed(range(n)):
        p, q = pivots[place]
        total = a[p][n]
        for _, other in pivots[place + 1 :]:
            total = total - a[p][other] * x[other]
        x[q] = total / a[p][q]
    return x


def _pivot(a, numbers: np.ndarray, rows: list[int], columns: list[int]) -> tuple[int, int] | None:
    """The most harmless row and column to divide by; at the start alone if none is good everywhere."""
    for seen in (numbers, numbers[:1]):
        inside = seen[:, rows][:, :, columns]
        sizes = reliable(inside, np.abs(inside).max(axis=2, keepdims=True))
        good = [(k, m) for k, m in np.ndindex(sizes.shape) if sizes[k, m] >= 0.1]
        if good:
            # the sparsest of the rows and columns with a good pivot keeps the formulas short
            best = min(
                good, key=lambda at: (_fill(a, rows, columns, rows[at[0]], columns[at[1]]), -sizes[at])
            )
            return rows[best[0]], columns[best[1]]
    return None


def _fill(a, rows, columns, p, q) -> int:
    below = sum(not a[i][q].is_zero() for i in rows) - 1
    beside = sum(not a[p][j].is_zero() for j in columns) - 1
    return below * beside


def _at_zero(expression: ca.SX, symbols: ca.SX) -> ca.SX:
    return ca.substitute(expression, symbols, ca.SX.zeros(*symbols.shape))
