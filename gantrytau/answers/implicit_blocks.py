"""Blocks without closed form inside a CasADi function: linear ones solved outright, others by Newton's method.

The unknowns are led from the start to the arguments along one branch, so that the function does not end in another way
to assemble the mechanism, and are made exact there. Where there is no solution on that branch the results are NaN.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.answers.branch_follower import follow
from gantrytau.compiler.blocks.pivots import Scales, extent
from gantrytau.compiler.blocks.solution import Block
from gantrytau.language.piecewise import switched
from gantrytau.language.term_sizes import term_sizes

SINGULAR = 1e-12  # of a matrix with rows and columns of size one: below, rounding decides on the solution
SIGNS = np.array([1.0, -1.0, -1.0])
STEPS = 16  # from the start to the arguments
SOLVED = 1e-9  # of the terms of an equation, above which an iteration found nothing
NEWTON = {
    "abstol": 1e-15,
    "abstolStep": 0.0,
    "max_iter": 8,  # from a guess of some digits: more only where rounding does not let it end
    "error_on_fail": False,
    "linear_solver_options": {"eps": 0.0},
}


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
        every = ca.vertcat(q, before)
        used = which_stand_in([part.residual, part.rows], every)
        known, values, first = (picked(x, used) for x in (every, ca.vertcat(here, solved), begin))
        if part.block.scales is not None:
            found = _linear(part, part.block.scales, y, known, values)
        else:
            found = _newton(f"newton{number}", part, y, known, (first, values))
        solved, before, begin = (
            ca.vertcat(solved, found),
            ca.vertcat(before, y),
            ca.vertcat(begin, part.start),
        )
    rest = ca.Function("rest", [q, before], list(targets), {"cse": True})
    found = rest(here, solved)
    found = list(found) if isinstance(found, (tuple, list)) else [found]
    return ca.Function(name, x, found, list(inside), list(outside))


def which_stand_in(expressions: Sequence[ca.SX], known: ca.SX) -> list[int]:
    """Indices of the known symbols in expressions: a NaN of any other argument must not spoil a block."""
    there = {leaf.name() for leaf in ca.symvar(ca.veccat(*expressions))}
    return [k for k, leaf in enumerate(known.elements()) if leaf.name() in there]


def picked(column: Any, used: list[int]) -> Any:
    """Elements of a column, as a column even where there are none."""
    return column[used] if used else type(column).zeros(0, 1)


def _linear(part: Implicit, scales: Scales, y: ca.SX, known: ca.SX, values: ca.MX) -> ca.MX:
    """Solution of linear equations by orthogonal factors of the matrix in the sizes of its rows and columns.

    A singular matrix leaves numbers of rounding. An arbitrary right-hand side beside that of the equations tells it: its
    solution is as large as the inverse.
    """
    parts, sizes, other, columns = linear_parts(part.residual, part.rows, scales, y, known)
    (a, b), row = parts(values), sizes(values)
    both = ca.solve(ca.mtimes(ca.diag(row), a), ca.horzcat(row * b, other), "qr", {"eps": 0.0})
    return both[:, 0] / columns * one_where(ca.sumsqr(both[:, 1]) <= SINGULAR**-2)


def linear_parts(residual: ca.SX, extents: ca.SX, scales: Scales, y: ca.SX, known: ca.SX):
    """Functions of what is known, to the equations (matrix, right-hand side) and to sizes of rows; another right-hand side;
    units of y.
    """
    size = y.numel()
    matrix, right = ca.jacobian(residual, y), -ca.substitute(residual, y, ca.SX.zeros(size))
    matrix = matrix @ ca.diag(1 / scales.columns)
    rows = [1 / ca.fmax(extent(matrix[i, :], np.ones(size)), extents[i]) for i in range(size)]
    sizes = ca.Function("sizes", [known], [ca.vertcat(*rows)], {"cse": True, "is_diff_out": [False]})
    parts = ca.Function("linear", [known], [matrix, ca.densify(right)], {"cse": True})
    other = ca.DM(np.random.default_rng(0).uniform(0.5, 1.0, size) * SIGNS[np.arange(size) % len(SIGNS)])
    return parts, sizes, other, scales.columns


def one_where(condition: ca.MX) -> ca.MX:
    """1, and NaN where a condition does not hold: a factor, so that derivatives are NaN there as well."""
    return ca.if_else(condition, 1.0, ca.MX.nan())


def _newton(name: str, part: Implicit, y: ca.SX, known: ca.SX, way: tuple[ca.DM, ca.MX]) -> ca.MX:
    """Solution on the branch of the start by Newton's method, to some roundings of the terms of the equations."""
    residual = ca.Function("residual", [y, known], [part.residual], {"cse": True})
    begin, end = way
    if switched([part.residual], {leaf.name() for leaf in y.elements()}).switches:
        near, arrived = _in_steps(name, residual, part.start, begin, end), ca.MX(1)
    else:
        near, arrived = follow(f"follow_{name}", residual, part.start, begin, end)
    rows, columns = _sizes(part.residual, y, known)(near, end)
    sizes = ca.SX.sym("rows", y.numel()), ca.SX.sym("columns", y.numel())
    z, at = ca.SX.sym("z", y.numel()), ca.SX.sym("at", known.numel())
    scaled = residual(z * sizes[1], at) / sizes[0]
    scaled = ca.Function("scaled", [z, ca.vertcat(at, *sizes)], [scaled], {"cse": True})
    given = ca.vertcat(end, rows, columns)
    found = ca.rootfinder(name, "fast_newton", scaled, NEWTON)(near / columns, given)
    holds = ca.logic_and(arrived, ca.sumsqr(scaled(found, given)) <= SOLVED**2)
    return found * columns * one_where(holds)


def _sizes(residual: ca.SX, y: ca.SX, known: ca.SX) -> ca.Function:
    """(y, known) -> sizes of the terms of equations, and units of unknowns in which the Jacobian has columns of size one."""
    size = y.numel()
    rows = ca.vertcat(*(ca.if_else(terms > 0, terms, 1.0) for terms in term_sizes(residual.elements())))
    matrix = ca.densify(ca.jacobian(residual, y))
    columns = [1 / extent((matrix[:, j] / rows).T, np.ones(size)) for j in range(size)]
    options = {"cse": True, "is_diff_out": [False, False]}
    return ca.Function("sizes", [y, known], [rows, ca.vertcat(*columns)], options)


def _in_steps(name: str, residual: ca.Function, start: ca.DM, begin: ca.DM, end: ca.MX) -> ca.MX:
    """Newton's method from one of some points on the way to the next, for equations whose derivatives jump."""
    solve = ca.rootfinder(f"steps_{name}", "fast_newton", residual, {**NEWTON, "max_iter": 50})
    found = ca.MX(start)
    for share in np.linspace(0, 1, STEPS + 1)[1:]:
        found = solve(found, ca.MX(begin) + share * (end - begin))
    return found
