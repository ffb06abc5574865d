"""Rows of a vector equation that say the same of each element, as one equation of whole vectors.

`r[0] == a[0] + k*b[0]` and the like for 1 and 2 are r = a + k*b: sums of vectors times scalars, nothing that acts on the
elements of two of them at once.
"""

from collections.abc import Mapping, Sequence

import casadi as ca

from gantrytau.language.symbols import derivative_name, split_derivative
from gantrytau.writing.graph import Graph, Node
from gantrytau.writing.syntax import ordered

Elements = Mapping[str, tuple[str, int, int]]  # scalar name -> whole name, place in it, how many there are


class WholeGraph(Graph):
    """A graph that reads the k-th elements of vectors as these vectors, while the rows of such are read."""

    def __init__(self, elements: Elements):
        super().__init__()
        self._elements = elements
        self._row: tuple[int, int] | None = None

    def symbol(self, name: str) -> Node:
        """A variable, derivative or parameter; a whole one for its element of the row."""
        base, order = split_derivative(name)
        whole, *place = self._elements.get(base, (base, 0, 1))
        if self._row is None or tuple(place) != self._row:
            return super().symbol(name)
        return self.node("symbol", value=derivative_name(whole, order) + VECTOR)

    def rows(self, sides: Sequence[Sequence[ca.SX]]) -> list[Node] | None:
        """The sides of an equation of whole vectors, or None where the rows are none; sides: those of each row, in order."""
        found: list[Node] | None = None
        try:
            for k, row in enumerate(sides):
                self._row = (k, len(sides))
                nodes = self.read(row)
                if found is not None and any(a is not b for a, b in zip(nodes, found, strict=True)):
                    return None
                found = nodes
        finally:
            self._row = None
        return None if found is None else self._whole(found)

    def _whole(self, roots: Sequence[Node]) -> list[Node] | None:
        """The same with the plain names of vectors; None where they are no vectors, or zero."""
        kinds: dict[Node, bool | None] = {}
        plain: dict[Node, Node] = {}
        for node in ordered(roots):
            kinds[node] = _kind(node, [kinds[a] for a in node.arguments])
            if node.operation == "symbol":
                plain[node] = super().symbol(str(node.value).removesuffix(VECTOR))
            else:
                plain[node] = self.node(node.operation, *(plain[a] for a in node.arguments), value=node.value)
        vectors = [kinds[root] for root in roots]
        fit = all(vector or root.is_number(0.0) for vector, root in zip(vectors, roots, strict=True))
        return [plain[root] for root in roots] if fit and any(vectors) else None


VECTOR = "\0"  # at the end of a name while it is known to be that of a vector


def _kind(node: Node, kinds: Sequence[bool | None]) -> bool | None:
    """Whether it is a vector (True) or a scalar (False); None for what is neither; kinds: of its arguments."""
    if node.leaf:
        return node.operation == "symbol" and str(node.value).endswith(VECTOR)
    if not any(kinds) and None not in kinds:
        return False
    if node.operation in ("add", "sub", "neg"):
        return True if all(kinds) else None
    if node.operation == "mul":
        return True if sorted(map(str, kinds)) == ["False", "True"] else None
    return True if node.operation == "div" and list(kinds) == [True, False] else None
