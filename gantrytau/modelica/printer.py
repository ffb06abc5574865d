"""A tree as Modelica text, which reads back as an equal tree: a form for each part, filled with the texts of its fields."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from gantrytau.modelica import tree
from gantrytau.modelica.expressions import AND, OR, PRECEDENCE, RELATION, SUM, TERM
from gantrytau.modelica.tokens import spelled

OPERAND = 8  # above all operators
FORMS: Mapping[
    type, str
] = {  # {name: before} is a field with a text before it, or nothing where there is none
    tree.Number: "{text}",
    tree.StringLiteral: '"{text}"',
    tree.BooleanLiteral: "{value}",
    tree.Mark: "{word}",
    tree.Call: "{function}({inside})",
    tree.PartialCall: "function {function}({inside})",
    tree.ArrayConstructor: "{{{inside}}}",
    tree.Matrix: "[{rows}]",
    tree.OutputList: "({inside})",
    tree.Argument: "{prefixes}{name}{modification}{description}",
    tree.Omission: "break {left_out}",
    tree.Modification: "{arguments}{value: = }",
    tree.ComponentDeclaration: "{name}{subscripts}{modification}{condition: if }{about}",
    tree.ConstrainedBy: "constrainedby {type}{arguments}{about}",
    tree.ComponentClause: "{prefixes}{type}{subscripts} {components}{constraint: }",
    tree.ShortClass: "{prefixes}{type}{subscripts}{arguments}",
    tree.Enumeration: "enumeration({literals})",
    tree.DerivativeClass: "der({function}, {inputs})",
    tree.EnumerationLiteral: "{name}{about}",
    tree.Import: "import {alias}{name}{names}{about}",
    tree.Extends: "extends {type}{arguments}{annotation}",
    tree.ExternalFunction: "external{language}{result: }{function: }{called}{annotation}",
    tree.SimpleEquation: "{left} {relation} {right}{about}",
    tree.ConnectEquation: "connect({a}, {b}){about}",
    tree.ProcedureCall: "{call}{about}",
    tree.Assignment: "{targets} := {value}{about}",
    tree.Leave: "{word}{about}",
    tree.ForLoop: "for {iterators} loop{items}end for{about}",
    tree.WhileLoop: "while {condition} loop{items}end while{about}",
    tree.Branching: "{branches}end {word}{about}",
}


def written(file: tree.StoredDefinition) -> str:
    """The text of a tree; `parse` makes an equal tree of it."""
    lines = ["//! base 3.6.0"] if file.source.base else []
    lines += [] if file.within is None else [f"within {file.within};".replace(" ;", ";")]
    return "\n".join([*lines, *(f"{_text(one)};\n" for one in file.classes)])


def expression_written(e: tree.Expression, least: int = -1) -> str:
    """An expression, in parentheses where it binds less than `least`."""
    text, binds = _expression(e)
    return text if binds >= least else f"({text})"


def _expression(e: tree.Expression) -> tuple[str, int]:
    """The text of an expression and how strongly its outermost operator binds."""
    write = expression_written
    if isinstance(e, tree.ComponentReference):
        return ".".join(spelled(name) + _bracketed(subscripts) for name, subscripts in e.parts), OPERAND
    if isinstance(e, tree.Binary):
        level, behind = PRECEDENCE[e.operator], []
        chains = level in (OR, AND, SUM, TERM)  # but not a < b and a ^ b
        while True:  # a sum of a thousand terms is as deep
            behind.append(f" {e.operator} {write(e.right, level + 1)}")
            if not (chains and isinstance(e.left, tree.Binary) and PRECEDENCE[e.left.operator] == level):
                return "".join((write(e.left, level + (not chains)), *reversed(behind))), level
            e = e.left
    if isinstance(e, tree.Unary):
        if e.operator == "not":
            return f"not {write(e.operand, RELATION)}", RELATION - 1
        return f"{e.operator}{write(e.operand, TERM)}", SUM
    if isinstance(e, tree.Conditional):
        pairs = (f"if {write(condition)} then {write(value)}" for condition, value in e.branches)
        return f"{' else'.join(pairs)} else {write(e.otherwise)}", -1
    if isinstance(e, tree.RangeExpression):
        parts = [part for part in (e.start, e.step, e.stop) if part is not None]
        return ":".join(write(part, 1) for part in parts), 0
    if isinstance(e, tree.Subscripted):
        array = write(e.array) if isinstance(e.array, tree.OutputList) else f"({write(e.array)})"
        return array + _bracketed(e.subscripts), OPERAND
    return FORMS[type(e)].format_map(Fields(e)), OPERAND


class Field(str):
    """A text with a prefix when it is formatted; an empty text stays empty, without the prefix."""

    def __format__(self, before: str) -> str:
        return before + self if self else ""


@dataclass(frozen=True)
class Fields:
    """The texts of the fields of a part of a tree, by name; depth: of its lines."""

    node: Any
    depth: int = 0

    def __getitem__(self, name: str) -> Field:
        return Field(self._text(name, getattr(self.node, name, None)))

    def _text(self, name: str, value: Any) -> str:
        node = self.node
        match name:
            case "about":
                return self["description"] + self["annotation"]
            case "inside":
                return _inside(node)
            case "called":
                return f"({_inside(node)})" if node.function else ""
            case "name":
                dotted = isinstance(node, (tree.Argument, tree.Import))  # else one name, which may have dots
                return ".".join(map(spelled, value.split("."))) if dotted else spelled(value)
            case "left" if node.relation != "=":
                return expression_written(value, SUM)
            case _ if value is None:
                return ":" if name == "literals" else ""
            case "prefixes":
                return "".join(f"{word} " for word in value)
            case "subscripts":
                return _bracketed(value)
            case "arguments":
                return f"({_listed(value)})"
            case "annotation":
                return f" annotation({_listed(value)})"
            case "description" | "language":
                return f' "{value}"'
            case "alias":
                return f"{value} = "
            case "result":
                return f"{_text(value)} ="
            case "names":
                return ".*" if value == ("*",) else f".{{{_listed(value)}}}"
            case "iterators":
                return _iterators(value)
            case "rows":
                return "; ".join(map(_listed, value))
            case "targets":
                return f"({_listed(value)})" if node.several else _listed(value)
            case "items":
                return _lines(value, self.depth + 1) + _begun(self.depth)
            case "branches":
                pairs = [f"{node.word} {_text(test)} then{self._text('items', x)}" for test, x in value]
                last = () if node.otherwise is None else (self._text("items", node.otherwise),)
                return "else".join((*pairs, *last))
            case _:
                return _listed(value) if isinstance(value, tuple) else _text(value, self.depth)


def _text(one: Any, depth: int = 0) -> str:
    """The text of a part of a tree, or of a plain value; depth: of its lines."""
    match one:
        case None | str():
            return one or ""
        case bool():
            return "true" if one else "false"
        case tree.Expression():
            return expression_written(one)
        case tree.ClassDefinition():
            return _class(one, depth)
        case tree.Redeclaration():
            element = one.element
            k = int(element.prefixes[:1] == ("redeclare",))
            each = ("each",) * one.each
            return _text(replace(element, prefixes=(*element.prefixes[:k], *each, *element.prefixes[k:])))
        case _:
            return FORMS[type(one)].format_map(Fields(one, depth))


def _class(one: tree.ClassDefinition, depth: int) -> str:
    """A class without the semicolon behind it."""
    fields, body = Fields(one, depth), one.body
    words = f"{fields['prefixes']}{one.kind}"
    if not isinstance(body, tree.Composition):
        return f"{words} {fields['name']} = {_text(body)}{fields['about']}{fields['constraint']: }"
    extends = "extends " if body.extends else ""
    found = f"{words} {extends}{fields['name']}{Fields(body)['arguments']}{fields['description']}"
    for section in body.sections:
        found += (_begun(depth) + section.kind if section.kind else "") + _lines(section.items, depth + 1)
    found += _lines([body.external] if body.external else [], depth + 1)
    found += "" if one.annotation is None else f"{_begun(depth)} {fields['annotation']};"
    return f"{found}{_begun(depth)}end {fields['name']}{fields['constraint']: }"


def _begun(depth: int) -> str:
    """The begin of a new line."""
    return "\n" + "  " * depth


def _lines(items: Iterable[Any], depth: int) -> str:
    """Items in lines of their own; what goes on in strings stays where it is."""
    return "".join(f"{_begun(depth)}{_text(one, depth)};" for one in items)


def _inside(node: Any) -> str:
    """What stands between the brackets of a call or an array."""
    texts = [_text(one) for one in getattr(node, "items", None) or getattr(node, "arguments", ())]
    texts += [f"{spelled(name)} = {_text(value)}" for name, value in getattr(node, "named", ())]
    iterators = getattr(node, "iterators", ())
    return ", ".join(texts) + (f" for {_iterators(iterators)}" if iterators else "")


def _iterators(iterators: Iterable[tree.Iterator]) -> str:
    """`i in 1:3, j`."""
    return _listed(name if over is None else f"{name} in {_text(over)}" for name, over in iterators)


def _bracketed(subscripts: tuple[tree.Expression, ...]) -> str:
    """`[1, :]`, or nothing."""
    return f"[{_listed(subscripts)}]" if subscripts else ""


def _listed(items: Iterable[Any]) -> str:
    """Parts with commas between them."""
    return ", ".join(map(_text, items))
