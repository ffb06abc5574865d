"""A CasADi function through solved blocks, which chooses by value where closed forms divide by what may vanish.

Pivots that were chosen by numbers around the start are quick to divide by, and may vanish elsewhere, often at 0, 90 or
180 degrees. Where one of them is small in its row the function takes a careful way instead: the same blocks with
pivots that do not vanish, and what is left of linear ones solved by orthogonal factors. Only one of the two is computed.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import accumulate

import casadi as ca

from gantrytau.answers.implicit_blocks import Implicit, solved_one_by_one
from gantrytau.compiler.blocks.solution import SolvedBlocks
from gantrytau.compiler.symbol_spaces import column


@dataclass(frozen=True, eq=False)
class Question:
    """Arguments and results of a function.

    arguments: one column each; start: gives the numbers of all of them where the model starts; known: (symbol, expression
    of the arguments); targets: columns in symbols of the model; names: of arguments and results.
    """

    arguments: tuple[ca.SX, ...]
    start: Callable[[], ca.DM]
    known: tuple[tuple[ca.SX, ca.SX], ...]
    targets: tuple[ca.SX, ...]
    names: tuple[Sequence[str], Sequence[str]]

    def inserted(self, blocks: SolvedBlocks) -> ca.SX:
        """Residuals and extents of blocks without closed form, targets and margins below each other, in the arguments."""
        parts = [*blocks.residuals, *blocks.extents, *map(ca.densify, self.targets), *blocks.margins]
        (found,) = blocks.after(self.known).inserted([column(parts)])
        return found


def function_through(
    name: str,
    question: Question,
    quick: SolvedBlocks,
    careful: Callable[[], SolvedBlocks],
    start: Mapping[str, float],
) -> ca.Function:
    """The targets as a function of the arguments; NaN where the equations do not determine them.

    start: numbers of all symbols where the model starts; careful: makes the blocks for where `quick` cannot be trusted.
    """
    doubtful = [m > 0 for m in parted(question, quick)[-1] if not m.is_constant()]
    if not doubtful:
        return plain_function(name, question, quick, start)
    inside, outside = question.names
    first = plain_function(name, question, quick, start, trusted=doubtful)
    second = plain_function("careful", question, careful(), start)
    x = [ca.MX.sym(n, *first.size_in(n)) for n in inside]
    *found, trusted = first.call(x)
    kept = [ca.MX.sym(n, *first.size_out(n)) for n in outside]
    ways = [ca.Function("quick", [*x, *kept], kept), ca.Function("slow", [*x, *kept], second.call(x))]
    choose = ca.Function.if_else("by_value", *ways)
    return ca.Function(name, x, choose.call([trusted, *x, *found]), list(inside), list(outside))


def plain_function(
    name: str,
    question: Question,
    blocks: SolvedBlocks,
    start: Mapping[str, float],
    trusted: Sequence[ca.SX] = (),
) -> ca.Function:
    """The targets through blocks as they are solved; trusted: adds whether all these hold, 1 or 0, as the last result."""
    residuals, extents, targets, _ = parted(question, blocks)
    inside, outside = question.names
    if trusted:
        targets, outside = [*targets, reduce(ca.logic_and, trusted)], [*outside, "trusted"]
    if not blocks.implicit:
        return ca.Function(
            name, list(question.arguments), targets, list(inside), list(outside), {"cse": True}
        )
    parts, place = [], 0
    for block in blocks.implicit:
        begin, place = place, place + len(block.tears)
        numbers = ca.DM([start[y.name()] for y in block.tears])
        parts.append(Implicit(block, residuals[begin:place], extents[begin:place], numbers))
    names = (inside, outside)
    return solved_one_by_one(name, parts, targets, question.arguments, question.start(), names)


def parted(question: Question, blocks: SolvedBlocks) -> tuple[ca.SX, ca.SX, list[ca.SX], list[ca.SX]]:
    """Residuals and extents of blocks without closed form, targets and margins in the arguments."""
    count = len(blocks.tears)
    sizes = [count, count, *(t.numel() for t in question.targets), len(blocks.margins)]
    places = list(accumulate(sizes, initial=0))
    residuals, extents, *targets, margins = ca.vertsplit(question.inserted(blocks), places)
    return residuals, extents, targets, margins.elements()
