"""Equations of motion the other way round: accelerations are guessed, and reactions and driving forces follow.

    M(q) a + W(q) n + c(q, v) = B(q) u          forwards one block for (a, n), with a known a chain of small ones for (n, u)

A solver that has accelerations a, reactions n and driving forces u side by side does not mind which of them the others
follow from; but eliminations are shorter and better conditioned this way: those of recursive Newton-Euler algorithms
(Featherstone, Rigid Body Dynamics Algorithms, 2008, chapter 5) instead of a factorisation of M.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, islice

import casadi as ca
import numpy as np

from gantrytau.compiler.blocks.pattern import block_pattern
from gantrytau.compiler.blocks.pivots import Guide
from gantrytau.compiler.blocks.solution import Block, solve_blocks
from gantrytau.compiler.index_reduction import Key
from gantrytau.language.symbols import Derivative

MOST_TRIED = 20  # ways to choose accelerations behind those of a block
SINGULAR = 1e-8  # smallest singular value of a scaled block relative to its largest, at the start


@dataclass(frozen=True, eq=False)
class Inverse:
    """A block with its accelerations as what is guessed: the blocks that are left, which solve for the inputs as well.

    members: places of the blocks that it stands for, that of the accelerations and those that lead from inputs to it;
    forward: how many unknowns these find together.
    """

    rates: tuple[str, ...]
    inputs: tuple[str, ...]
    blocks: tuple[Block, ...]
    members: frozenset[int]
    forward: int

    @property
    def tears(self) -> int:
        """How many unknowns are found together: accelerations, and what is torn behind them."""
        torn = [y.name() for b in self.blocks for y in torn_of(b)]
        return len(self.rates) + sum(name not in self.inputs for name in torn)


@dataclass(frozen=True, eq=False)
class SortedEquations:
    """All equations of a model and its blocks in the order of their solution.

    symbols: of all unknowns and inputs, by name; inputs: their scalar names.
    """

    blocks: tuple[Block, ...]
    residuals: Mapping[Key, ca.SX]
    incidence: Mapping[Key, Collection[Derivative]]
    symbols: Mapping[str, ca.SX]
    inputs: tuple[str, ...]

    @cached_property
    def leaves(self) -> tuple[frozenset[str], ...]:
        """Names in the equations of each block."""
        return tuple(
            frozenset(x.name for key in block.equations for x in self.incidence[key]) for block in self.blocks
        )

    @cached_property
    def needs(self) -> tuple[frozenset[int], ...]:
        """Places of the blocks that each block needs directly."""
        owner = {name: k for k, block in enumerate(self.blocks) for name in block.unknowns}
        return tuple(
            frozenset(owner[n] for n in names if n in owner) - {k} for k, names in enumerate(self.leaves)
        )

    @cached_property
    def fed(self) -> frozenset[int]:
        """Places of the blocks whose unknowns depend on inputs."""
        found: set[int] = set()
        for k, needed in enumerate(self.needs):
            if needed & found or self.leaves[k] & set(self.inputs):
                found.add(k)
        return frozenset(found)

    def needs_any(self, number: int, others: Collection[int]) -> bool:
        """Whether a block needs one of some others, directly or not."""
        return bool(self.leading_to([number]) & set(others))

    def leading_to(self, ends: Collection[int]) -> frozenset[int]:
        """Places of some blocks and of those on the way from inputs to them."""
        found, queue = set(ends), list(ends)
        for k in queue:
            queue += [m for m in self.needs[k] if m not in found]
            found |= self.needs[k]
        return frozenset(found & (self.fed | set(ends)))


def torn_of(block: Block) -> tuple[ca.SX, ...]:
    """What of a block stays an unknown with an equation of its own, where only what follows outright is inserted."""
    several = len(block.tears) > 1 and block.kind in ("linear", "spheres")
    return block.tears if block.solution is None or several else ()


def inverse_of(every: SortedEquations, number: int, guide: Callable[[], Guide]) -> Inverse | str:
    """The inverse form of a block, or why it has none. guide: makes one that knows no block yet."""
    rates = guide().rates
    core = every.leading_to([number])
    own = [n for k in sorted(core) for n in every.blocks[k].unknowns if n in rates]
    inputs = _among(every, core)
    # further accelerations may follow from those of the block
    behind = [
        k
        for k in sorted(every.fed)
        if k > number and rates & set(every.blocks[k].unknowns) and number in every.leading_to([k])
    ]
    missing = len(inputs) - len(own)
    if missing < 0 or missing > len(behind):
        return f"{len(own) + len(behind)} accelerations of states and {len(inputs)} inputs that drive them"
    why = ""
    for more in islice(combinations(behind, missing), MOST_TRIED):
        members = every.leading_to([number, *more])
        found = _inverse(every, members, guide())
        if isinstance(found, Inverse):
            return found
        why = why or found
    return why


def _among(every: SortedEquations, members: Collection[int]) -> tuple[str, ...]:
    """Inputs in the equations of some blocks."""
    leaves = frozenset().union(*(every.leaves[k] for k in members))
    return tuple(n for n in every.inputs if n in leaves)


def _inverse(every: SortedEquations, members: frozenset[int], guide: Guide) -> Inverse | str:
    """The inverse form of some blocks together, or why there is none."""
    inside = [every.blocks[k] for k in sorted(members)]
    unknowns = [n for block in inside for n in block.unknowns]
    rates, inputs = tuple(n for n in unknowns if n in guide.rates), _among(every, members)
    if len(rates) != len(inputs):
        return f"{len(rates)} accelerations of states and {len(inputs)} inputs that drive them"
    for k, block in enumerate(every.blocks[: max(members)]):
        if k not in members and not every.needs_any(k, members):
            block.enter(guide)
    keys = [key for block in inside for key in block.equations]
    wanted = [*(n for n in unknowns if n not in rates), *inputs]
    pattern = block_pattern({key: every.incidence[key] for key in keys}, wanted)
    if pattern.undetermined or pattern.surplus:
        return f"with the accelerations given, {', '.join(pattern.undetermined[:3])} stay undetermined"
    found = solve_blocks(pattern.blocks, every.residuals, every.symbols, guide).blocks
    if any(b.kind not in ("linear", "explicit") or _singular(b, guide) for b in found):
        return "with the accelerations given, the forces are not determined at the start"
    together = sum(len(torn_of(block)) for block in inside)
    return Inverse(rates, inputs, found, members, together)


def _singular(block: Block, guide: Guide) -> bool:
    """Whether equations of a linear block depend on each other at the start, rows and columns by their sizes."""
    if block.slopes is None:
        return False
    matrix = guide.at_start(block.slopes)
    if not np.all(np.isfinite(matrix)):
        return True
    for axis in (1, 0, 1):
        sizes = np.max(np.abs(matrix), axis=axis, keepdims=True)
        matrix = matrix / np.where(sizes > 0, sizes, 1.0)
    values = np.linalg.svd(matrix, compute_uv=False)
    return bool(values[-1] <= SINGULAR * values[0])
