"""Solves one block of equations symbolically: in closed form where it has one, torn where it has not.

Numbers guide the symbolic choices: pivots are accepted by their value at a sample point.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from gantrytau.index_reduction import Key
from gantrytau.tearing import tear

LARGEST_CLOSED_FORM = 12  # unknowns of a torn linear block that is solved by unrolled elimination


@dataclass(frozen=True, eq=False)
class Root:
    """tear = middle + side * sqrt(radicand): a quadratic whose branch is the sign `side`."""

    middle: ca.SX
    side: float
    radicand: ca.SX


@dataclass(frozen=True, eq=False)
class Block:
    """Equations that are solved together.

    kind: "explicit", "linear", "quadratic", "spheres" or "nonlinear"; tears: symbols found from `residuals`
    first; inner: the other unknowns as (symbol, expression of tears and earlier unknowns), in order;
    solution: the tears in closed form, or None; root: the square root among them, or None.
    """

    kind: str
    equations: tuple[Key, ...]
    unknowns: tuple[str, ...]
    tears: tuple[ca.SX, ...]
    residuals: tuple[ca.SX, ...]
    inner: tuple[tuple[ca.SX, ca.SX], ...]
    solution: tuple[ca.SX, ...] | None
    root: Root | None = None


def solve_block(
    equations: tuple[Key, ...],
    unknowns: tuple[str, ...],
    residuals: Mapping[Key, ca.SX],
    symbols: Mapping[str, ca.SX],
    sample: Mapping[str, float],
) -> Block:
    """The solution of one block; `sample` has a number for every symbol in it."""
    x = ca.vertcat(*(symbols[n] for n in unknowns))
    f = ca.vertcat(*(residuals[k] for k in equations))
    jacobian = ca.jacobian(f, x)
    linear = not ca.depends_on(ca.vertcat(*jacobian.nonzeros()), x) if jacobian.nnz() else False
    if len(unknowns) == 1:
        return _finish(equations, unknowns, (x,), (f,), (), sample)
    numbers = sample_values(jacobian, sample)
    torn = tear(jacobian, numbers, x, relaxed=linear)
    inner: list[tuple[ca.SX, ca.SX]] = []
    rows, columns = ca.vertsplit(f), ca.vertsplit(x)
    for i, j in torn.assignments:
        slope = jacobian[i, j]
        rest = ca.substitute(rows[i], columns[j], ca.SX(0))
        inner.append((columns[j], -rest / slope))
    tears = tuple(columns[j] for j in torn.tears)
    left = [rows[i] for i in torn.residuals]
    if inner and left:
        left = substitute_inner(inner, left)
    return _finish(equations, unknowns, tears, tuple(left), tuple(inner), sample)


def substitute_inner(inner: Sequence[tuple[ca.SX, ca.SX]], expressions: Sequence[ca.SX]) -> list[ca.SX]:
    """Expressions with assigned symbols resolved, one after the other."""
    if not inner or not expressions:
        return list(expressions)
    _, found = ca.substitute_inplace([v for v, _ in inner], [e for _, e in inner], list(expressions), False)
    return list(found)


def _finish(equations, unknowns, tears, residuals, inner, sample) -> Block:
    """Closed form for what is left after tearing, if there is one."""

    def block(kind: str, solution=None, root=None) -> Block:
        return Block(kind, equations, unknowns, tears, residuals, inner, solution, root)

    if not tears:
        return block("explicit", ())
    y, f = ca.vertcat(*tears), ca.vertcat(*residuals)
    jacobian = ca.jacobian(f, y)
    if not ca.depends_on(jacobian, y):
        if len(tears) == 1:
            return block("explicit" if not inner else "linear", (-_at_zero(f, y) / jacobian,))
        if len(tears) > LARGEST_CLOSED_FORM:
            return block("linear")
        return block("linear", tuple(eliminate(jacobian, -_at_zero(f, y), sample)))
    curvature = ca.jacobian(ca.vec(ca.densify(jacobian)), y)
    if not ca.depends_on(curvature, y):
        if len(tears) == 1:
            root = quadratic_root(f, tears[0], jacobian, curvature, sample)
            return block("quadratic", (root.middle + root.side * ca.sqrt(root.radicand),), root)
    return block("nonlinear")


def quadratic_root(f: ca.SX, x: ca.SX, slope: ca.SX, curvature: ca.SX, sample: Mapping[str, float]) -> Root:
    """The root of a quadratic on the branch where the sample lies, by completing the square."""
    middle = -_at_zero(slope, x) / curvature
    # f = f(middle) + curvature / 2 * (x - middle)^2
    value = ca.substitute(f, x, middle)
    side = float(sample_values(slope / curvature, sample)[0, 0])
    return Root(middle, 1.0 if side >= 0 else -1.0, -2 * value / curvature)


def eliminate(matrix: ca.SX, right: ca.SX, sample: Mapping[str, float]) -> list[ca.SX]:
    """Solution of a small linear system by elimination, pivots chosen by their numbers at the sample."""
    n = matrix.shape[0]
    a = [[matrix[i, j] for j in range(n)] + [right[i]] for i in range(n)]
    numbers = sample_values(ca.horzcat(matrix, right), sample)
    order: list[int] = []
    rows = list(range(n))
    columns = list(range(n))
    for _ in range(n):
        scaled = {
            (i, j): abs(numbers[i, j]) / max(np.abs(numbers[i, columns]).max(), 1e-300)
            for i in rows
            for j in columns
        }
        # the sparsest of the rows and columns with a good pivot keeps the formulas short
        p, q = min(
            (key for key, size in scaled.items() if size >= 0.1),
            key=lambda key: (_fill(a, rows, columns, *key), -scaled[key]),
        )
        rows.remove(p)
        columns.remove(q)
        order.append(p * n + q)
        for i in rows:
            if a[i][q].is_zero():
                continue
            factor = a[i][q] / a[p][q]
            number = numbers[i, q] / numbers[p, q]
            numbers[i] -= number * numbers[p]
            for j in (*columns, n):
                a[i][j] = a[i][j] - factor * a[p][j]
    x: list[ca.SX] = [ca.SX(0)] * n
    for code in reversed(order):
        p, q = divmod(code, n)
        done = order[order.index(code) + 1 :]
        total = a[p][n]
        for other in done:
            total = total - a[p][other % n] * x[other % n]
        x[q] = total / a[p][q]
    return x


def _fill(a, rows, columns, p, q) -> int:
    below = sum(not a[i][q].is_zero() for i in rows) - 1
    beside = sum(not a[p][j].is_zero() for j in columns) - 1
    return below * beside


def _at_zero(expression: ca.SX, symbols: ca.SX) -> ca.SX:
    return ca.substitute(expression, symbols, ca.SX.zeros(*symbols.shape))


def sample_values(expression: ca.SX, sample: Mapping[str, float]) -> np.ndarray:
    """The numbers of an expression at the sample point, as a dense array."""
    leaves = ca.symvar(expression)
    function = ca.Function("sample", [ca.vertcat(*leaves)], [ca.densify(expression)])
    return np.array(function(ca.DM([sample[leaf.name()] for leaf in leaves]))).reshape(expression.shape)
