"""Reads flat Modelica with pymoca, an independent parser, and evaluates its equations at given numbers."""

import math
import operator
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from pymoca import ast, parser

OPERATORS = {
    "+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv, "^": operator.pow,
    "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge,
    "and": lambda a, b: a and b, "or": lambda a, b: a or b,
}  # fmt: skip
FUNCTIONS = {
    **{n: getattr(math, n) for n in ("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh")},
    **{n: getattr(math, n) for n in ("sqrt", "exp", "log", "floor", "ceil")},
    "abs": abs, "min": min, "max": max, "rem": math.fmod, "sign": lambda x: (x > 0) - (x < 0),
}  # fmt: skip


@dataclass(frozen=True)
class ModelicaClass:
    """A class as pymoca sees it."""

    tree: Any  # pymoca's classes are looser than their annotations

    @cached_property
    def symbols(self) -> dict[str, Any]:
        return {plain(name): symbol for name, symbol in self.tree.symbols.items()}

    def named(self, *prefixes: str) -> list[str]:
        """Names of the symbols that have one of these prefixes."""
        return [n for n, s in self.symbols.items() if set(prefixes) & set(s.prefixes)]

    @property
    def unknowns(self) -> list[str]:
        given = set(self.named("parameter", "constant", "input"))
        return [n for n in self.symbols if n not in given]

    def attribute(self, name: str, attribute: str) -> Any:
        """The expression of an attribute of a declaration, its "value" too, or None."""
        symbol = self.symbols[name]
        modification = symbol.class_modification
        for argument in modification.arguments if modification else ():
            if argument.value.component.name == attribute:
                return argument.value.modifications[0]
        return symbol.value if attribute == "value" else None


def plain(name: str) -> str:
    """A quoted identifier without its quotes."""
    return name[1:-1].replace("\\'", "'").replace("\\\\", "\\") if name.startswith("'") else name


def read_modelica(text: str) -> ModelicaClass:
    """The one class in `text`; an error of syntax fails the test."""
    tree = parser.parse(text)
    assert tree is not None, "pymoca found an error of syntax"
    (found,) = (c for c in tree.classes.values() if c.type == "model")  # the others are Modelica's own types
    return ModelicaClass(found)


@dataclass
class Evaluator:
    """Numbers of expressions, from numbers of names and of derivatives (name, order)."""

    model: ModelicaClass
    values: Mapping[str, float]
    defined: Mapping[str, Any]  # names that are to be found from their own equation

    def __post_init__(self) -> None:
        self._found: dict[str, float] = {}

    def name(self, name: str) -> float:
        if name in self.values:
            return self.values[name]
        if name not in self._found:
            value = self.defined[name] if name in self.defined else self.model.attribute(name, "value")
            self._found[name] = self(value)
        return self._found[name]

    def __call__(self, node: Any) -> float:
        if isinstance(node, ast.Primary):
            number: Any = node.value
            return number
        if isinstance(node, ast.ComponentRef):
            assert not node.child, f"{node}: a dotted name, expected a quoted one"
            return self.name(plain(node.name))
        if isinstance(node, ast.IfExpression):
            for condition, value in zip(node.conditions, node.expressions, strict=False):
                if self(condition):
                    return self(value)
            return self(node.expressions[-1])
        assert isinstance(node, ast.Expression), f"found {node!r}"
        word = str(node.operator)
        if word == "der":
            (inside,) = node.operands
            assert isinstance(inside, ast.ComponentRef), "der() of an expression"
            return self.name(f"der({plain(inside.name)})")
        operands = [self(x) for x in node.operands]
        if len(operands) == 1 and word in ("+", "-", "not"):
            return {"+": operands[0], "-": -operands[0], "not": not operands[0]}[word]
        if word in OPERATORS:
            a, b = operands
            return OPERATORS[word](a, b)
        return FUNCTIONS[word](*operands)
