"""Solves one block of equations symbolically: in closed form where it has one, torn where it has not.

Numbers guide the symbolic choices: pivots are accepted by their values at sample points.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.compiler.blocks.circles_and_spheres import intersection
from gantrytau.compiler.blocks.pieces import in_pieces, solve_by_value
from gantrytau.compiler.blocks.pivots import Guide, Scales, reliable
from gantrytau.compiler.blocks.quadratics import QuadraticRoot, quadratic_root
from gantrytau.compiler.blocks.tearing import entry_sizes, moving, places_of, switching_places, tear
from gantrytau.compiler.index_reduction import Key
from gantrytau.compiler.symbol_spaces import Substitution, column
from gantrytau.language.piecewise import Switched, may_switch, switched, with_modes
from gantrytau.language.symbols import split_derivative

LARGEST_BY_VALUE = 8  # the same with all the ways in which its pivots can be chosen
LARGEST_CLOSED_FORM = 12  # unknowns of a torn linear block that is solved by unrolled elimination


@dataclass(frozen=True, eq=False)
class Block:
    """Equations that are solved together.

    kind: "explicit", "linear", "quadratic", "spheres", "piecewise" or "nonlinear"; tears: symbols found from
    `residuals` first; inner: the other unknowns as (symbol, expression of tears and earlier unknowns), in order;
    solution: the tears in closed form, or None; root: the square root among them, or None; held: how many pieces of a
    piecewise one hold a solution;
    margins: positive where all pivots that were divided by are large enough, of those that may vanish.
    """

    kind: str
    equations: tuple[Key, ...]
    unknowns: tuple[str, ...]
    tears: tuple[ca.SX, ...]
    residuals: tuple[ca.SX, ...]
    inner: tuple[tuple[ca.SX, ca.SX], ...]
    solution: tuple[ca.SX, ...] | None
    root: QuadraticRoot | None = None
    held: ca.SX | None = None
    pairs: tuple[tuple[Key, str], ...] = ()  # equations solved for one unknown each
    margins: tuple[ca.SX, ...] = ()
    firm: tuple[Key, ...] = ()  # equations of pairs whose pivots do not vanish
    scales: Scales | None = None  # of linear blocks with several unknowns
    slopes: ca.SX | None = None  # of residuals by tears, of explicit and linear blocks

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
        guide.firm.update(equation for equation, _ in self.firm)


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

    @property
    def extents(self) -> list[ca.SX]:
        """How large these were before tearing, where they are linear; else 1."""
        known = ((b.scales.rows if b.scales else [ca.SX(1)] * len(b.tears)) for b in self.implicit)
        return [e for rows in known for e in rows]

    @property
    def margins(self) -> list[ca.SX]:
        """Positive where the closed forms lose few digits."""
        return [m for b in self.blocks for m in b.margins]

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
    still = not may_switch(column([residuals[k] for equations, _ in pattern for k in equations]))
    for equations, unknowns in pattern:
        block = solve_block(equations, unknowns, residuals, symbols, guide, still)
        block.enter(guide)
        found.append(block)
    return SolvedBlocks(tuple(found))


def solve_anew(
    quick: SolvedBlocks, residuals: Mapping[Key, ca.SX], symbols: Mapping[str, ca.SX], guide: Guide
) -> SolvedBlocks:
    """Blocks of which those that divide by what may vanish are solved as a careful guide says."""
    found: list[Block] = []
    for block in quick.blocks:
        if block.margins:
            block = solve_block(block.equations, block.unknowns, residuals, symbols, guide)
        block.enter(guide)
        found.append(block)
    return SolvedBlocks(tuple(found))


def solve_block(
    equations: tuple[Key, ...],
    unknowns: tuple[str, ...],
    residuals: Mapping[Key, ca.SX],
    symbols: Mapping[str, ca.SX],
    guide: Guide,
    still: bool = False,
) -> Block:
    """The solution of one block. guide: a number for every symbol of the block; still: whether nothing switches."""
    x = ca.vertcat(*(symbols[n] for n in unknowns))
    f = ca.vertcat(*(residuals[k] for k in equations))
    smooth = Switched((f,), ()) if still else switched([f], set(unknowns))
    if len(unknowns) == 1:
        block = _finish(equations, unknowns, (x,), (f,), (), guide, None, bool(smooth.switches))
        return replace(block, pairs=((equations[0], unknowns[0]),), firm=equations)
    jacobian = ca.jacobian(smooth.expressions[0], x)
    linear = not ca.depends_on(ca.vertcat(*jacobian.nonzeros()), x) if jacobian.nnz() else False
    (present,) = with_modes(smooth, [jacobian])
    numbers = guide.entries_around(present)
    jumping = places_of(jacobian, [leaf for leaf in ca.symvar(jacobian) if leaf.name() in guide.modes])
    barred = switching_places(smooth, x) | jumping
    partners = {i: guide.partners[key[0]] for i, key in enumerate(equations) if key[0] in guide.partners}
    places = {split_derivative(name)[0]: j for j, name in enumerate(unknowns)}
    partner = {i: places.get(name, -1) for i, name in partners.items()}
    first = {j for j, name in enumerate(unknowns) if name in guide.rates}
    # pivots of parameters alone can vanish nowhere: where they serve as well, they are taken
    changing = moving(jacobian, guide.parameters)
    doubtful = {at for at in changing if partner.get(at[0]) != at[1] or equations[at[0]][0] not in guide.firm}
    ways: list[dict[str, Any]] = [
        dict(first=set(), barred=changing | barred),
        dict(first=first, barred=changing | barred),
        dict(first=first, barred=doubtful | barred if guide.careful else barred),
    ]
    tried, sizes = [], entry_sizes(jacobian, numbers)
    for way in ways:
        tried.append(tear(jacobian, sizes, x, relaxed=linear, partner=partner, **way))
        if len(tried[-1].tears) <= max(len(first), 1):
            break
    torn = min(tried, key=lambda one: len(one.tears))
    rows, columns = ca.vertsplit(f), ca.vertsplit(x)
    inner = [
        (columns[j], -ca.substitute(rows[i], columns[j], ca.SX(0)) / jacobian[i, j])
        for i, j in torn.assignments
    ]
    tears = tuple(columns[j] for j in torn.tears)
    left = [rows[i] for i in torn.residuals]
    left = Substitution(tuple(inner)).inserted(left)
    divided = sorted(doubtful.intersection(torn.assignments))
    whole = Scales.of(present, numbers, {*torn.residuals, *(i for i, _ in divided)})
    scales = whole.at(torn.residuals, torn.tears) if linear and not smooth.switches else None
    switching = bool(smooth.switches)
    block = _finish(equations, unknowns, tears, tuple(left), tuple(inner), guide, scales, switching)
    pivots = dict(zip(zip(*present.sparsity().get_triplet(), strict=True), numbers[0].tolist(), strict=True))
    margins = (whole.margin(i, j, present[i, j], pivots[i, j]) for i, j in divided)
    return replace(
        block,
        pairs=tuple((equations[i], unknowns[j]) for i, j in torn.assignments),
        firm=tuple(equations[i] for i, j in torn.assignments if (i, j) not in doubtful),
        margins=(*margins, *block.margins),
    )


def _finish(
    equations, unknowns, tears, residuals, inner, guide, scales: Scales | None, switching: bool
) -> Block:
    """Closed form for what is left after tearing, if there is one."""
    parts = dict(equations=equations, unknowns=unknowns, tears=tears, residuals=residuals, inner=inner)

    def block(kind: str, solution=None, **facts: Any) -> Block:
        return Block(kind, solution=solution, scales=scales, **parts, **facts)

    if not tears:
        return block("explicit", ())
    y, f = ca.vertcat(*tears), ca.vertcat(*residuals)
    smooth = switched([f], {tear.name() for tear in tears}) if switching else None
    if smooth is not None and smooth.switches:
        found = in_pieces(smooth, y, guide)
        return block("nonlinear") if found is None else block("piecewise", found[0], held=found[1])
    jacobian = ca.jacobian(f, y)
    if not ca.depends_on(jacobian, y):
        parts["slopes"] = jacobian
        if scales is None:
            return block("explicit", (-_at_zero(f, y) / jacobian,))
        if guide.careful and len(tears) <= LARGEST_BY_VALUE:
            units = ca.DM(scales.columns)
            found = solve_by_value(jacobian @ ca.diag(1 / units), -_at_zero(f, y), scales.rows) / units
            return block("linear", tuple(found.elements()))
        if len(tears) > LARGEST_CLOSED_FORM or guide.careful:
            return block("linear")
        found = eliminate(jacobian, -_at_zero(f, y), guide, scales)
        return block("linear") if found is None else block("linear", found[0], margins=found[1])
    curvature = ca.jacobian(ca.vec(ca.densify(jacobian)), y)
    if len(tears) == 1 and not ca.depends_on(curvature, y):
        root = quadratic_root(f, tears[0], guide)
        return block("quadratic", (root.closed,), root=root)
    found = intersection(f, y, guide)
    return block("nonlinear") if found is None else block("spheres", tuple(found))


def eliminate(
    matrix: ca.SX, right: ca.SX, guide: Guide, scales: Scales
) -> tuple[tuple[ca.SX, ...], tuple[ca.SX, ...]] | None:
    """Solution of a small linear system by elimination, and the margins of its pivots; None if singular at the start.

    Pivots are chosen by their numbers at the sample points. A pivot that is small in what is left of its row
    makes others grow; the last one, the only one left, is small in its equation where the equations depend on each other.
    """
    n = matrix.shape[0]
    a = [[matrix[i, j] for j in range(n)] + [right[i]] for i in range(n)]
    numbers = guide.around(matrix)
    pivots: list[tuple[int, int]] = []
    margins: list[ca.SX] = []
    rows, columns = list(range(n)), list(range(n))
    for _ in range(n):
        pivot = _pivot(a, numbers, rows, columns)
        if pivot is None:
            return None
        p, q = pivot
        left = scales if len(columns) == 1 else scales.left(a[p], numbers[0, p], columns)
        margins.append(left.margin(p, q, a[p][q], numbers[0, p, q]))
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
    return tuple(x), tuple(margins)


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
