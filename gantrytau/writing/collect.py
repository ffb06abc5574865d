"""Sums for readers: equal terms put together, zeros gone, numbers in front.

0.25*m + c + 0.25*m becomes c + 0.5*m, and 2*a/(2*b - 4*c) becomes a/(b - 2*c). A sum is a number for each of its
terms; sums that are multiples of one another are one sum. A sum that occurs more than once is opened only where its
terms meet their like, so that it can still be written once.
"""

from collections.abc import Collection, Sequence

from gantrytau.writing.graph import Graph, Node
from gantrytau.writing.syntax import ordered

DIGITS = 14  # of numbers that arise from others: what rounding leaves beyond is dropped
NOTHING = 1e-14  # of the largest part of a term, below which nothing but rounding is left of it
ZERO_AT_ZERO = {
    "sin", "tan", "asin", "atan", "sinh", "tanh", "asinh", "atanh", "abs", "sign", "sqrt", "expm1", "log1p",
}  # fmt: skip
Terms = dict[Node, float]


def collected(graph: Graph, roots: Sequence[Node]) -> list[Node]:
    """Nodes of the same values with their sums collected."""
    collector = _Collector(graph, roots)
    return [collector.node(*collector.factored(root)) for root in roots]


def without_factor(node: Node) -> Node:
    """The node without a sign and a number in front: zero where it is zero."""
    if node.operation == "neg":
        return without_factor(node.arguments[0])
    numbered = node.operation == "mul" and node.arguments[0].operation == "number"
    return node.arguments[1] if numbered else node


class _Collector:
    def __init__(self, graph: Graph, roots: Sequence[Node]):
        self.graph, self.one = graph, graph.number(1.0)
        order = ordered(roots)
        self.uses: dict[Node, int] = {}
        for node in (*roots, *(a for n in order for a in n.arguments)):
            self.uses[node] = self.uses.get(node, 0) + 1
        self.inside: dict[Node, Terms] = {}  # of the sums that were made
        self.known: dict[frozenset[tuple[Node, float]], tuple[float, Node]] = {}
        self.rank: dict[Node, int] = {}
        self.products: dict[frozenset[Node], Node] = {}
        self.terms: dict[Node, Terms] = {}
        for node in order:
            self.terms[node] = self._terms(node)

    def node(self, factor: float, node: Node) -> Node:
        """A node times a number, which stands in front of a quotient's numerator."""
        if node is self.one:
            return self.graph.number(factor)
        if node.operation == "div":
            above, below = node.arguments
            return self.graph.divide(self.node(factor, above), below)
        return self.graph.multiply(self.graph.number(factor), node)

    def factored(self, node: Node) -> tuple[float, Node]:
        """A number, and the rest without it."""
        terms = self.terms[node]
        if len(terms) <= 1:
            return next(((factor, one) for one, factor in terms.items()), (0.0, self.one))
        # the same sum, or a multiple of it, is the same node
        lead = terms[min(terms, key=lambda n: self.rank.setdefault(n, len(self.rank)))]
        key = frozenset((n, float(f"{f / lead:.{DIGITS}g}")) for n, f in terms.items())
        if key not in self.known:
            sizes = {abs(f) for f in terms.values()}
            common = sizes.pop() if len(sizes) == 1 else 1.0
            common = -common if all(f < 0 for f in terms.values()) else common
            made = self._sum({n: f / common for n, f in terms.items()})
            self.known[key] = lead / common, made
        other, made = self.known[key]
        return float(f"{lead / other:.{DIGITS}g}"), made

    def _sum(self, terms: Terms) -> Node:
        """Terms added up, a positive one first."""
        made, rows = self.graph.number(0.0), list(terms.items())
        first = next((k for k, (_, factor) in enumerate(rows) if factor > 0), 0)
        for node, factor in (rows[first], *rows[:first], *rows[first + 1 :]):
            made = self.graph.add(made, self.node(factor, node))
        self.inside[made] = terms
        return made

    def _terms(self, node: Node) -> Terms:
        if node.operation == "number":
            return {self.one: float(node.value)} if node.value else {}
        if node.operation in ("add", "sub", "neg"):
            signs = {"add": (1.0, 1.0), "sub": (1.0, -1.0), "neg": (-1.0,)}[node.operation]
            return self._together([(s, a) for s, a in zip(signs, node.arguments, strict=True)])
        if node.operation == "mul":
            for number, other in (node.arguments, node.arguments[::-1]):
                if number.operation == "number":
                    return self._together([(float(number.value), other)])
        if node.operation in ("mul", "div", "pow"):
            factor, made = self._product(node)
            return {made: factor} if factor else {}
        return {self._again(node): 1.0}

    def _again(self, node: Node) -> Node:
        if node.leaf:
            return node
        return self.graph.node(node.operation, *(self._argument(a) for a in node.arguments))

    def _argument(self, node: Node) -> Node:
        return self._again(node) if node.boolean else self.node(*self.factored(node))

    def _product(self, node: Node) -> tuple[float, Node]:
        (f, a), (g, b) = (self.factored(x) for x in node.arguments)
        if node.operation == "mul":
            pair = frozenset((a, b))
            return f * g, self.products.setdefault(pair, self.graph.multiply(a, b)) if f * g else self.one
        if node.operation == "div" and g:
            return f / g, self.one if a is b else self.graph.divide(a, b)
        if node.operation == "pow" and b is self.one and g == 2.0:
            return f * f, self.graph.node("pow", a, self.graph.number(2.0)) if a is not self.one else a
        return 1.0, self._again(node)

    def _together(self, parts: Sequence[tuple[float, Node]]) -> Terms:
        """Terms of a sum; what occurs only here is opened, and what is shared where its terms meet their like."""
        found: Terms = {}
        largest: Terms = {}

        def add(factor: float, node: Node) -> None:
            found[node] = found.get(node, 0.0) + factor
            largest[node] = max(largest.get(node, 0.0), abs(factor))

        for sign, node in parts:
            terms = self.terms[node]
            if self.uses[node] > 1 and len(terms) > 1:
                factor, made = self.factored(node)
                terms = {made: factor}
            for term, factor in terms.items():
                add(sign * factor, term)
        for made in [n for n in found if n in self.inside]:
            inside = self.inside[made]
            met = sum(n in found for n in inside)
            if met and len(inside) - met <= 1:  # no longer than before
                factor = found.pop(made)
                for term, share in inside.items():
                    add(factor * share, term)
        return {n: float(f"{f:.{DIGITS}g}") for n, f in found.items() if abs(f) > NOTHING * largest[n]}


def moving_part(graph: Graph, roots: Sequence[Node], rates: Collection[str]) -> list[Node]:
    """What the values are more than with all `rates` zero; friction without gravity, and no difference of equals."""
    zero = graph.number(0.0)
    still: dict[Node, Node] = {}
    moving: dict[Node, Node] = {}
    for node in ordered(roots):
        if node.operation == "symbol" and node.value in rates:
            still[node], moving[node] = zero, node
        elif all(moving[a] is zero for a in node.arguments):
            still[node], moving[node] = node, zero
        else:
            still[node] = _folded(graph, node.operation, [still[a] for a in node.arguments])
            moving[node] = _moving(graph, node, still, moving)
    return [moving[root] for root in roots]


def _moving(graph: Graph, node: Node, still: dict[Node, Node], moving: dict[Node, Node]) -> Node:
    parts = [moving[a] for a in node.arguments]
    resting = [part.is_number(0.0) for part in parts]
    if node.operation in ("add", "sub", "neg"):
        return _folded(graph, node.operation, parts)
    if node.operation == "mul" and any(resting):
        return graph.multiply(
            *(a if r else p for a, p, r in zip(node.arguments, parts, resting, strict=True))
        )
    if node.operation == "div" and resting[1]:
        return graph.divide(parts[0], node.arguments[1])
    return node if node.boolean else graph.subtract(node, still[node])


def _folded(graph: Graph, operation: str, arguments: Sequence[Node]) -> Node:
    """An operation with the zeros in it gone."""
    arithmetic = {"add": graph.add, "sub": graph.subtract, "neg": graph.negate}
    arithmetic |= {"mul": graph.multiply, "div": graph.divide}
    if operation in arithmetic:
        return arithmetic[operation](*arguments)
    if operation in ZERO_AT_ZERO and arguments[0].is_number(0.0):
        return arguments[0]
    if operation == "pow" and arguments[0].is_number(0.0) and arguments[1].operation == "number":
        return arguments[0] if float(arguments[1].value) > 0 else graph.node(operation, *arguments)
    return graph.node(operation, *arguments)
