"""Reads the equations of Base Modelica with pymoca, an independent parser, and evaluates its equations at given numbers.

A robot has thousands of lines that differ in nothing but quoted names and strings. Each of these is one token,
whatever it says, so lines that are alike otherwise are parsed once, and the names put back into copies.
"""

import math
import operator
import re
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
    """A quoted identifier without its quotes, and without the sign before names that are made."""
    bare = name[1:-1].replace("\\'", "'").replace("\\\\", "\\") if name.startswith("'") else name
    return bare.removeprefix("=")


def read_modelica(text: str) -> ModelicaClass:
    """The one class in `text`, parsed as a whole; an error of syntax fails the test."""
    # pymoca's cache would outlive the test in the home folder
    tree = parser.parse(text, bypass_cache=True)
    assert tree is not None, "pymoca found an error of syntax"
    places = [tree, *tree.classes.values()]
    (found,) = (c for at in places for c in at.classes.values() if c.type == "model")
    return ModelicaClass(found)


NAMES = re.compile(r"'(?:[^'\\]|\\.)*'|\"(?:[^\"\\]|\\.)*\"")  # quoted identifiers and strings
SECTIONS = ("initial equation", "equation")


def read_by_lines(text: str) -> ModelicaClass:
    """Like `read_modelica`, but fast, from a long text with one declaration or equation on each line."""
    _, heading, *body, end, _ = [
        line
        for line in text.splitlines()
        if not re.match(r"//|  (  |//|when |elsewhen |end when|assert\()", line)
    ]
    alike: dict[tuple[str, str], int] = {}  # number of a line without its names, by its section
    lines: list[tuple[str, int, list[str]]] = []
    section = ""
    for line in body:
        if line in SECTIONS:
            section = line
            continue
        own = list(dict.fromkeys(NAMES.findall(line)))
        bare = NAMES.sub(lambda found, own=own: _quoted_like(found[0], f"{own.index(found[0])}"), line)
        lines.append((section, alike.setdefault((section, bare), len(alike)), own))
    short = [heading]
    for section in ("", *SECTIONS):
        rows = [(number, bare) for (place, bare), number in alike.items() if place == section]
        short += [section] if section and rows else []
        short += [NAMES.sub(lambda x, n=n: _quoted_like(x[0], f"{n}.{x[0][1:-1]}"), row) for n, row in rows]
    tree = read_modelica("\n".join([*short, end])).tree
    first = [*tree.symbols.values(), *tree.initial_equations, *tree.equations]
    copies: dict[str, list[Any]] = {section: [] for section in ("", *SECTIONS)}
    for section, number, own in lines:
        copies[section].append(_renamed(first[number], _names(number, own)))
    declared, tree.initial_equations, tree.equations = copies.values()
    tree.symbols = {symbol.name: symbol for symbol in declared}
    return ModelicaClass(tree)


def _quoted_like(example: str, content: str) -> str:
    return f"{example[0]}{content}{example[0]}"


def _names(number: int, own: list[str]) -> dict[str, str]:
    """What stands for the stand-ins of one line; pymoca keeps the quotes of identifiers, not those of strings."""
    found = {f"{number}.{k}": name[1:-1] for k, name in enumerate(own)}
    return found | {f"'{stand_in}'": f"'{name}'" for stand_in, name in found.items()}


def _renamed(node: Any, names: Mapping[str, str]) -> Any:
    """A copy of a syntax tree with other names."""
    if isinstance(node, str):
        return names.get(node, node)
    if isinstance(node, list):
        return [_renamed(x, names) for x in node]
    if isinstance(node, ast.Class) or not isinstance(node, ast.Node):
        return node
    new = object.__new__(type(node))
    vars(new).update({key: _renamed(value, names) for key, value in vars(node).items()})
    return new


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
