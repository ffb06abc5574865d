"""Block lower triangular form: which unknowns are solved together, and in what order."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

from gantrytau.compiler.dulmage_mendelsohn import decompose
from gantrytau.compiler.index_reduction import Key
from gantrytau.language.symbols import Derivative, split_derivative


@dataclass(frozen=True, eq=False)
class SparsityPattern:
    """Ordered blocks, each (equations, unknowns), and what is left over.

    undetermined: wanted names that the equations do not determine; surplus: equations without an unknown.
    """

    blocks: tuple[tuple[tuple[Key, ...], tuple[str, ...]], ...]
    undetermined: tuple[str, ...]
    surplus: tuple[Key, ...]


def block_pattern(
    incidence: Mapping[Key, Collection[Derivative]],
    unknowns: Iterable[str],
    wanted: Iterable[str] | None = None,
) -> SparsityPattern:
    """The blocks that determine `wanted` (None: all unknowns), as small as possible, in the order of their solution.

    incidence: which derivatives stand in each equation; unknowns and wanted by name.
    """
    keys, names = list(incidence), list(unknowns)
    place = {name: j for j, name in enumerate(names)}
    columns_of = {split_derivative(name): j for name, j in place.items()}
    rows = [[columns_of[x] for x in incidence[k] if x in columns_of] for k in keys]
    found = decompose(rows, len(names))
    block_of = {j: k for k, (_, columns) in enumerate(found.blocks) for j in columns}
    needs = [[block_of[j] for i in own for j in rows[i] if j in block_of] for own, _ in found.blocks]
    targets = names if wanted is None else [n for n in wanted if n in place]
    undetermined = tuple(n for n in targets if place[n] not in block_of)
    needed = {block_of[place[n]] for n in targets if n not in undetermined}
    order = _in_order(sorted(needed, key=lambda k: found.blocks[k]), needs)
    blocks = (found.blocks[k] for k in order)
    return SparsityPattern(
        tuple((tuple(keys[i] for i in own), tuple(names[j] for j in columns)) for own, columns in blocks),
        undetermined,
        tuple(keys[i] for i in found.surplus),
    )


def _in_order(first: Sequence[int], needs: Sequence[Sequence[int]]) -> list[int]:
    """Blocks and all that they need, each after those it needs."""
    order: dict[int, None] = {}
    stack = [(k, False) for k in reversed(first)]
    while stack:
        k, ready = stack.pop()
        if ready:
            order[k] = None
        elif k not in order:
            stack.append((k, True))
            stack += [(other, False) for other in reversed(needs[k]) if other != k and other not in order]
    return list(order)
