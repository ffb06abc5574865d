"""Blocks without closed form inside a CasADi function: linear ones solved outright, others by Newton's method.

Positions are led from the start to the arguments in a few steps, so that the function stays on the branch where
the start lies: one Newton iteration over the whole way may end in another way to assemble the mechanism.
Where there is no solution the results are NaN.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from gantrytau.compiler.blocks.pivots import Scales, extent
from gantrytau.compiler.blocks.solution import Block
from gantrytau.language.symbols import split_derivative

SINGULAR = 1e-12  # of a matrix with rows and columns of size one: below, rounding decides on the solution
SIGNS = np.array([1.0, -1.0, -1.0])
STEPS = 16  # from the start to the arguments
SOLVED = 1e-8  # residual above which an iteration found nothing
NEWTON = {"abstol": 1e-13, "abstolStep": 1e-15, "max_iter": 50, "error_on_fail": False}


@dataclass(frozen=True, eq=False)
class Implicit:
    """A block that is left implicit, its residuals in the arguments and in unknowns of the blocks before it.

    rows: extents of the equations of a linear block, in the same symbols; start: numbers of its unknowns where the model
    starts.
    """

    block: Block
    residual: ca.SX
    rows: ca.SX
    start: ca.DM


def solved_one_by_one(
    name: str,
    implicit: Sequence[Implicit],
    targets: Sequence[ca.SX],
    arguments: Sequence[ca.SX],
    start: ca.DM,
    names: tuple[Sequence[str], Sequence[str]],
) -> ca.Function:
    """A function from the arguments to the targets; start: numbers of all arguments where the model starts."""
    inside, outside = names
    q = ca.vertcat(*arguments)
    x = [ca.MX.sym(n, a.shape[0]) for n, a in zip(inside, arguments, strict=True)]
    here = ca.vertcat(*x)
    before, solved, begin = ca.SX(0, 1), ca.MX(0, 1), start
    for number, part in enumerate(implicit):
        y = ca.vertcat(*part.block.tears)
        known, values = ca.vertcat(q, before), ca.vertcat(here, solved)
        if part.block.scales is not None:
            found = _linear(part, part.block.scales, y, known, values)
        else:
            positions = all(split_derivative(n)[1] == 0 for n in part.block.unknowns)
            found = _newton(f"newton{number}", part, y, known, (begin, values), STEPS if positions else 1)
        solved, before, begin = (
            ca.vertcat(solved, found),
            ca.vertcat(before, y),
            ca.vertcat(begin, part.start),
        )
    rest = ca.Function("rest", [q, before], list(targets), {"cse": True})
    found = rest(here, solved)
    found = list(found) if isinstance(found, (tuple, list)) else [found]
    return ca.Function(name, x, found, list(inside), list(outside))


def _linear(part: Implicit, scales: Scales, y: ca.SX, known: ca.SX, values: ca.MX) -> ca.MX:
    """Solution of linear equations by orthogonal factors of the matrix in the sizes of its rows and columns.

    A singular matrix leaves numbers of rounding. An arbitrary right-hand side beside that of the equations tells it: its
    solution is as large as the inverse.
    """
    f, size = part.residual, y.numel()
    matrix, right = ca.jacobian(f, y), -ca.substitute(f, y, ca.SX.zeros(size))
    matrix = matrix @ ca.diag(1 / scales.columns)
    rows = [1 / ca.fmax(extent(matrix[i, :], np.ones(size)), part.rows[i]) for i in range(size)]
    sizes = ca.Function("sizes", [known], [ca.vertcat(*rows)], {"cse": True, "is_diff_out": [False]})
    parts = ca.Function("linear", [known], [matrix, ca.densify(right)], {"cse": True})
    (a, b), row = parts(values), sizes(values)
    other = ca.DM(np.random.default_rng(0).uniform(0.5, 1.0, size) * SIGNS[np.arange(size) % len(SIGNS)])
    both = ca.solve(ca.mtimes(ca.diag(row), a), ca.horzcat(row * b, other), "qr", {"eps": 0.0})
    return both[:, 0] / scales.columns * one_where(ca.sumsqr(both[:, 1]) <= SINGULAR**-2)


def one_where(condition: ca.MX) -> ca.MX:
    """1, and NaN where a condition does not hold: a factor, so that derivatives are NaN there as well."""
    return ca.if_else(condition, 1.0, ca.MX.nan())


def _newton(name: str, part: Implicit, y: ca.SX, known: ca.SX, way: tuple[ca.DM, ca.MX], steps: int) -> ca.MX:
    residual = ca.Function("residual", [y, known], [part.residual], {"cse": True})
    solve = ca.rootfinder(name, "fast_newton", residual, NEWTON)
    begin, end = way
    found = ca.MX(part.start)
    for step in range(1, steps + 1):
        share = step / steps
        values = end if step == steps else ca.MX(begin) + share * (end - begin)
        found = solve(found, values)
    return found * one_where(ca.sumsqr(residual(found, end)) <= SOLVED**2)
