"""What a target language has to say about operations; and how a graph is written in it."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Protocol

from gantrytau.border.refusal import ModelError
from gantrytau.writing.graph import BOOLEANS, Node

# how tightly an operation holds its arguments together
CHOICE, OR, AND, NOT, RELATION, SUM, PRODUCT, POWER, ATOM = range(9)
LEVELS = {
    "select": CHOICE, "or": OR, "and": AND, "not": NOT, "add": SUM, "sub": SUM, "neg": SUM,
    "mul": PRODUCT, "div": PRODUCT, "pow": POWER,
    **dict.fromkeys(BOOLEANS - {"and", "or", "not"}, RELATION),
}  # fmt: skip


@dataclass(frozen=True)
class Written:
    """A text and how tightly it holds together; `signed` if it begins with a minus."""

    text: str
    level: int = ATOM
    signed: bool = False


class Syntax(Protocol):
    """A target language: numbers, names, operations, parentheses."""

    name: str

    def number(self, value: float) -> Written:
        """A number, which may be negative."""
        ...

    def symbol(self, name: str) -> Written:
        """A variable, derivative or parameter by its name in the model."""
        ...

    def shared(self, number: int) -> Written:
        """The name of the shared subexpression of that number, from 1."""
        ...

    def enclose(self, text: str) -> str:
        """The text in parentheses."""
        ...

    def apply(self, operation: str, arguments: "Arguments") -> Written | None:
        """The operation on written arguments, or None if the language cannot say it."""
        ...


class Arguments:
    """The written arguments of an operation, put in parentheses where they need them."""

    def __init__(self, syntax: Syntax, written: tuple[Written, ...], nodes: tuple[Node, ...]):
        self._syntax, self._written, self.nodes = syntax, written, nodes

    def __len__(self) -> int:
        return len(self._written)

    def bare(self, place: int) -> str:
        """As it is, for a place that is bounded by itself."""
        return self._written[place].text

    def held(self, place: int, level: int, leading: bool = False) -> str:
        """With parentheses unless it holds at least as tightly as `level`; a sign may stand only if leading."""
        one = self._written[place]
        if one.level >= level and (leading or not one.signed):
            return one.text
        return self._syntax.enclose(one.text)

    def signed(self, place: int) -> bool:
        """Whether it begins with a minus."""
        return self._written[place].signed


def write(roots: Iterable[Node], syntax: Syntax, names: Mapping[Node, Written]) -> dict[Node, Written]:
    """The text of all nodes below `roots`; those in `names` are written as their names where they are used.

    The answer has the expressions of the named nodes themselves. Raises ModelError if the language has no
    words for an operation.
    """
    found: dict[Node, Written] = {}
    for node in ordered(roots):
        if node.operation == "number":
            found[node] = syntax.number(float(node.value))
        elif node.operation == "symbol":
            found[node] = syntax.symbol(str(node.value))
        else:
            written = tuple(names.get(a) or found[a] for a in node.arguments)
            new = syntax.apply(node.operation, Arguments(syntax, written, node.arguments))
            if new is None:
                raise ModelError(
                    f"found the function {node.operation}, expected one that {syntax.name} has; "
                    "write it with others, or choose another format"
                )
            found[node] = new
    return found


def ordered(roots: Iterable[Node]) -> list[Node]:
    """All nodes below `roots`, each after its arguments; without recursion, for graphs are deep."""
    order: dict[Node, None] = {}
    stack = [(root, False) for root in reversed(list(roots))]
    while stack:
        node, done = stack.pop()
        if done:
            order[node] = None
        elif node not in order:
            stack.append((node, True))
            stack += [(a, False) for a in reversed(node.arguments) if a not in order]
    return list(order)


def infix(arguments: Arguments, operation: str, words: Mapping[str, str]) -> Written | None:
    """An operation between or before its arguments, in the usual order of precedence."""
    if operation not in words:
        return None
    level, word = LEVELS[operation], words[operation]
    if operation == "neg":
        return Written(word + arguments.held(0, PRODUCT), SUM, True)
    if operation == "not":
        return Written(word + arguments.held(0, ATOM), NOT)
    if operation == "pow":
        return Written(arguments.held(0, ATOM) + word + arguments.held(1, ATOM), POWER)
    # a relation between relations is not allowed; a - (b + c) and a / (b * c) need their parentheses
    left = level + 1 if level == RELATION else level
    right = level if operation in ("add", "mul", "and", "or") and not _quotient(arguments) else level + 1
    text = arguments.held(0, left, leading=True) + word + arguments.held(1, right, leading=level <= RELATION)
    return Written(text, level, arguments.signed(0) and not text.startswith("("))


def _quotient(arguments: Arguments) -> bool:
    """The product a * (b / c) keeps its parentheses: they show what is divided."""
    return arguments.nodes[1].operation == "div"
