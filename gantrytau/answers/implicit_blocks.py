"""Blocks without closed form inside a CasADi function: linear ones solved outright, others by Newton's method.

Positions are led from the start to the arguments in a few steps, so that the function stays on the branch where
the start lies: one Newton iteration over the whole way may end in another way to assemble the mechanism.
Where there is no solution the results are NaN.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from gantrytau.compiler.blocks.solution import Block
from gantrytau.language.symbols import split_derivative

STEPS = 16  # from the start to the arguments
SOLVED = 1e-8  # residual above which an iteration found nothing
NEWTON = {"abstol": 1e-13, "abstolStep": 1e-15, "max_iter": 50, "error_on_fail": False}


@dataclass(frozen=True, eq=False)
class Implicit:
    """A block that is left implicit, its residuals in the arguments and in unknowns of the blocks before it.

    start: numbers of its unknowns where the model starts.
    """

    block: Block
    residual: ca.SX
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
        if part.block.kind == "linear":
            found = _linear(part.residual, y, known, values)
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


def _linear(f: ca.SX, y: ca.SX, known: ca.SX, values: ca.MX) -> ca.MX:
    parts = [ca.jacobian(f, y), ca.substitute(f, y, ca.SX.zeros(*y.shape))]
    matrix, right = ca.Function("linear", [known], parts, {"cse": True})(values)
    found = ca.solve(matrix, -right, "qr")
    # a singular matrix leaves numbers of rounding, which do not satisfy the equations
    # (sums of squares, as the largest of NaN and a number is the number)
    left = ca.sumsqr(ca.mtimes(matrix, found) + right)
    return ca.if_else(left <= 1e-12 * (1 + ca.sumsqr(right)), found, ca.MX.nan(*y.shape))


def _newton(name: str, part: Implicit, y: ca.SX, known: ca.SX, way: tuple[ca.DM, ca.MX], steps: int) -> ca.MX:
    residual = ca.Function("residual", [y, known], [part.residual], {"cse": True})
    solve = ca.rootfinder(name, "newton", residual, NEWTON)
    begin, end = way
    found = ca.MX(part.start)
    for step in range(1, steps + 1):
        share = step / steps
        values = end if step == steps else ca.MX(begin) + share * (end - begin)
        found = solve(found, values)
    left = ca.sumsqr(residual(found, end))
    return ca.if_else(left <= SOLVED**2, found, ca.MX.nan(*y.shape))
