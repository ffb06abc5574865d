"""Expressions as graphs of a few plain operations, in which equal subexpressions are one node.

CasADi's operators become the operations of a textbook: `sq` a power, `inv` a quotient, a sum of two
`if_else_zero` one choice. Signs move outwards and numbers to the front; no operation is reordered otherwise.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import casadi as ca

from gantrytau.border.refusal import ModelError
from gantrytau.language.instructions import computed

FUNCTIONS = {
    ca.OP_EXP: "exp", ca.OP_LOG: "log", ca.OP_SQRT: "sqrt", ca.OP_FABS: "abs", ca.OP_SIGN: "sign",
    ca.OP_SIN: "sin", ca.OP_COS: "cos", ca.OP_TAN: "tan",
    ca.OP_ASIN: "asin", ca.OP_ACOS: "acos", ca.OP_ATAN: "atan",
    ca.OP_SINH: "sinh", ca.OP_COSH: "cosh", ca.OP_TANH: "tanh",
    ca.OP_ASINH: "asinh", ca.OP_ACOSH: "acosh", ca.OP_ATANH: "atanh",
    ca.OP_FLOOR: "floor", ca.OP_CEIL: "ceil",
    ca.OP_ERF: "erf", ca.OP_ERFINV: "erfinv", ca.OP_LOG1P: "log1p", ca.OP_EXPM1: "expm1",
    ca.OP_FMIN: "min", ca.OP_FMAX: "max", ca.OP_ATAN2: "atan2", ca.OP_FMOD: "fmod",
    ca.OP_REMAINDER: "remainder", ca.OP_COPYSIGN: "copysign", ca.OP_HYPOT: "hypot",
    ca.OP_POW: "pow", ca.OP_CONSTPOW: "pow",
}  # fmt: skip
FORWARD = (ca.OP_ASSIGN, ca.OP_LIFT)  # they return their first argument
COMPARISONS = {ca.OP_LT: "<", ca.OP_LE: "<=", ca.OP_EQ: "==", ca.OP_NE: "!="}
OPPOSITE = {"<": ">=", "<=": ">", ">": "<=", ">=": "<", "==": "!=", "!=": "=="}
MIRRORED = {"<": ">", "<=": ">=", "==": "==", "!=": "!="}
BOOLEANS = frozenset((*OPPOSITE, "and", "or", "not"))
CODES = {word: code for code, word in (*FUNCTIONS.items(), *COMPARISONS.items())} | {
    "add": ca.OP_ADD, "sub": ca.OP_SUB, "mul": ca.OP_MUL, "div": ca.OP_DIV, "neg": ca.OP_NEG,
    "and": ca.OP_AND, "or": ca.OP_OR, "not": ca.OP_NOT,
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Node:
    """An operation on other nodes; operation "number" and "symbol" have a value instead."""

    operation: str
    arguments: tuple["Node", ...] = ()
    value: float | str = ""

    @property
    def boolean(self) -> bool:
        """Whether it is true or false and not a number."""
        return self.operation in BOOLEANS

    @property
    def leaf(self) -> bool:
        """Whether it is a number or a symbol."""
        return not self.arguments

    def is_number(self, value: float) -> bool:
        """Whether it is this number."""
        return self.operation == "number" and self.value == value

    @property
    def negative(self) -> bool:
        """Whether it is written with a minus in front."""
        return self.operation == "neg" or (self.operation == "number" and float(self.value) < 0)


def expressions(nodes: Iterable[Node]) -> dict[Node, ca.SX]:
    """Nodes as expressions of CasADi; nodes: each after its arguments."""
    found: dict[Node, ca.SX] = {}
    for node in nodes:
        arguments = [found[a] for a in node.arguments]
        if node.leaf:
            name = str(node.value)
            found[node] = ca.SX(float(node.value)) if node.operation == "number" else ca.SX.sym(name)
        elif node.operation == "select":
            found[node] = ca.if_else(*arguments)
        elif node.operation in (">", ">="):
            found[node] = ca.SX.binary(CODES["<" if node.operation == ">" else "<="], *reversed(arguments))
        else:
            make = ca.SX.unary if len(arguments) == 1 else ca.SX.binary
            found[node] = make(CODES[node.operation], *arguments)
    return found


def whole_power(node: Node) -> tuple[Node, float]:
    """A node as a whole power, above zero, of another."""
    if node.operation == "pow" and node.arguments[1].operation == "number":
        power = float(node.arguments[1].value)
        if power > 0 and power.is_integer():
            return node.arguments[0], power
    return node, 1.0


class Graph:
    """Nodes without duplicates; `nodes` has each after its arguments."""

    def __init__(self) -> None:
        self.nodes: list[Node] = []
        self._by_content: dict[tuple[object, ...], Node] = {}

    def node(self, operation: str, *arguments: Node, value: float | str = "") -> Node:
        """The node of that content, as it is."""
        content = (operation, value, *(id(a) for a in arguments))
        if content not in self._by_content:
            self._by_content[content] = Node(operation, arguments, value)
            self.nodes.append(self._by_content[content])
        return self._by_content[content]

    def number(self, value: float) -> Node:
        """A number; ModelError for nan, which no equation can hold."""
        if value != value:
            raise ModelError("found nan, expected finite numbers; correct the equation it stands in")
        return self.node("number", value=float(value) + 0.0)  # no negative zero

    def symbol(self, name: str) -> Node:
        """A variable, derivative or parameter."""
        return self.node("symbol", value=name)

    def read(self, expressions: Iterable[ca.SX]) -> list[Node]:
        """The nodes of scalar expressions; ModelError for an operator that no model can produce."""
        expressions = list(expressions)
        if not expressions:
            return []
        vector = ca.densify(ca.vertcat(*expressions))
        leaves = ca.symvar(vector)
        function = ca.Function("expressions", [ca.vertcat(*leaves)], [vector])
        names = [leaf.name() for leaf in leaves]
        (found,) = computed(function, lambda _, i: self.symbol(names[i]), self.number, self._operation)
        return [self.real(node) for node in found]

    def _operation(self, operator: int, arguments: Sequence[Node]) -> Node:
        if operator in (ca.OP_AND, ca.OP_OR, ca.OP_NOT):
            return self._logic(operator, [self.truth(a) for a in arguments])
        if operator == ca.OP_IF_ELSE_ZERO:
            condition, value = arguments
            return self.node("select", self.truth(condition), self.real(value), self.number(0.0))
        real = [self.real(a) for a in arguments]
        if operator in COMPARISONS:
            return self._comparison(COMPARISONS[operator], *real)
        if operator in FUNCTIONS:
            return self.node(FUNCTIONS[operator], *real)
        if operator in FORWARD:
            return real[0]
        return self._arithmetic(operator, real)

    def _arithmetic(self, operator: int, arguments: Sequence[Node]) -> Node:
        binary = {
            ca.OP_ADD: self.add,
            ca.OP_SUB: self.subtract,
            ca.OP_MUL: self.multiply,
            ca.OP_DIV: self.divide,
        }
        unary = {
            ca.OP_NEG: self.negate,
            ca.OP_SQ: lambda x: self.node("pow", x, self.number(2.0)),
            ca.OP_TWICE: lambda x: self.multiply(self.number(2.0), x),
            ca.OP_INV: lambda x: self.divide(self.number(1.0), x),
        }
        if operator in binary:
            return binary[operator](*arguments)
        if operator in unary:
            return unary[operator](*arguments)
        raise ModelError(
            f"found CasADi's operator number {operator}, which has no mathematical form; "
            "expected arithmetic, elementary functions and choices; leave it out of the model"
        )

    def _logic(self, operator: int, arguments: Sequence[Node]) -> Node:
        if operator == ca.OP_NOT:
            return self.opposite(arguments[0])
        neutral = self._always(operator == ca.OP_AND)
        left = [a for a in arguments if a is not neutral] or [neutral]
        return left[0] if len(left) == 1 else self.node("and" if operator == ca.OP_AND else "or", *left)

    def _always(self, value: bool) -> Node:
        """A condition that is always true, or never."""
        return self.node("!=", self.number(float(value)), self.number(0.0))

    def _comparison(self, word: str, a: Node, b: Node) -> Node:
        if a.operation == "number" and b.operation != "number":  # 0 < x reads better as x > 0
            return self._comparison(MIRRORED[word], b, a)
        if word in ("!=", "==") and b.is_number(0.0):
            return self.truth(a) if word == "!=" else self.opposite(self.truth(a))
        return self.node(word, a, b)

    def opposite(self, node: Node) -> Node:
        """Not `node`."""
        if node.operation in OPPOSITE:
            return self.node(OPPOSITE[node.operation], *node.arguments)
        return node.arguments[0] if node.operation == "not" else self.node("not", node)

    def truth(self, node: Node) -> Node:
        """A node as a condition: numbers are true unless zero; what was made one or zero of a condition is that again."""
        if node.boolean:
            return node
        if node.operation == "number":
            return self._always(node.value != 0.0)
        if (
            node.operation == "select"
            and node.arguments[1].is_number(1.0)
            and node.arguments[2].is_number(0.0)
        ):
            return node.arguments[0]
        if node.operation == "sub" and node.arguments[0].is_number(1.0):
            counted = node.arguments[1]
            if counted.operation == "select" and self.truth(counted) is counted.arguments[0]:
                return self.opposite(counted.arguments[0])
        return self.node("!=", node, self.number(0.0))

    def real(self, node: Node) -> Node:
        """A node as a number: conditions count one or zero."""
        return self.node("select", node, self.number(1.0), self.number(0.0)) if node.boolean else node

    def negate(self, a: Node) -> Node:
        """-a."""
        if a.operation == "number":
            return self.number(-float(a.value))
        if a.operation == "neg":
            return a.arguments[0]
        return self.node("sub", *reversed(a.arguments)) if a.operation == "sub" else self.node("neg", a)

    def add(self, a: Node, b: Node) -> Node:
        """The sum a + b; the two halves of a choice become one."""
        choice = self._choice(a, b)
        if choice is not None:
            return choice
        if a.is_number(0.0) or b.is_number(0.0):
            return b if a.is_number(0.0) else a
        if b.negative:
            return self.subtract(a, self.negate(b))
        return self.subtract(b, self.negate(a)) if a.operation == "neg" else self.node("add", a, b)

    def _choice(self, a: Node, b: Node) -> Node | None:
        """CasADi writes if_else(c, x, y) as a sum of what is x if c and of what is y if not c."""
        if a.operation != "select" or b.operation != "select":
            return None
        if not (a.arguments[2].is_number(0.0) and b.arguments[2].is_number(0.0)):
            return None
        if self.opposite(a.arguments[0]) is not b.arguments[0]:
            return None
        return self.node("select", a.arguments[0], a.arguments[1], b.arguments[1])

    def subtract(self, a: Node, b: Node) -> Node:
        """The difference a - b."""
        if a.is_number(0.0):
            return self.negate(b)
        if b.is_number(0.0):
            return a
        return self.node("add", a, self.negate(b)) if b.negative else self.node("sub", a, b)

    def multiply(self, a: Node, b: Node) -> Node:
        """The product a * b, a number first."""
        if a.negative or b.negative:
            product = self.multiply(*(self.negate(x) if x.negative else x for x in (a, b)))
            return product if a.negative and b.negative else self.negate(product)
        if b.operation == "number" and a.operation != "number":
            a, b = b, a
        if a.is_number(1.0) or b.is_number(0.0):
            return b
        if a.is_number(0.0):
            return a
        if b.operation == "mul" and b.arguments[0].operation == "number" and a.operation != "number":
            return self.node("mul", b.arguments[0], self.multiply(a, b.arguments[1]))
        (base, power), (other, more) = whole_power(a), whole_power(b)
        if base is other and base.operation != "number":
            return self.node("pow", base, self.number(power + more))
        return self.node("mul", a, b)

    def divide(self, a: Node, b: Node) -> Node:
        """The quotient a / b."""
        if a.negative or b.negative:
            quotient = self.divide(*(self.negate(x) if x.negative else x for x in (a, b)))
            return quotient if a.negative and b.negative else self.negate(quotient)
        if a.operation == "mul" and a.arguments[0].operation == "number":
            factor, rest = a.arguments
            if factor is b:
                return rest
            if b.operation == "mul" and factor is b.arguments[0]:
                return self.divide(rest, b.arguments[1])
        return a if b.is_number(1.0) or a.is_number(0.0) else self.node("div", a, b)
