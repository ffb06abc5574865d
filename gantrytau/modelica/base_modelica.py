"""Base Modelica (Modelica Change Proposal MCP-0031): guess values as the attributes `start` and `fixed` of Modelica.

`parameter equation guess(x) = value` is `x(start = value)`, and the initial equation `x = guess(x)` is `x(fixed = true)`.
Priorities, `prioritize(x, 2)`, are left out.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace

from gantrytau.modelica import tree
from gantrytau.modelica.conditions import is_call

GUESSES = "parameter equation"  # the section of a single guess value, between declarations
RESERVED = frozenset({"time", "Real", "Integer", "Boolean", "String"})
Item = tree.Element | tree.EquationOrStatement


def decoded(name: str) -> str:
    """A quoted identifier without its quotes: 'a.b[1]' is the name a.b[1], and no word of the language."""
    plain = re.sub(r"\\(.)", r"\1", name[1:-1])
    return name if plain in RESERVED else plain


def without_guesses(sections: Iterable[tree.ClassSection]) -> tuple[tree.ClassSection, ...]:
    """The sections of a model or record with attributes in the place of guess values."""
    kept: list[tree.ClassSection] = []
    said: dict[str, tuple[tree.Argument, ...]] = {}
    for section in sections:
        left = []
        for item in section.items:
            found = _attribute(item) if section.kind in (GUESSES, "initial equation") else None
            if found is not None:
                name, argument = found
                said[name] = (*said.get(name, ()), argument)
            elif not is_call(getattr(item, "call", None), "prioritize"):
                left.append(item)
        if not section.kind and kept and not kept[-1].kind:
            kept[-1] = replace(kept[-1], items=(*kept[-1].items, *left))
        elif section.kind != GUESSES:
            kept.append(replace(section, items=tuple(left)))
    if not said:
        return tuple(kept)
    return tuple(replace(one, items=tuple(_with_attributes(i, said) for i in one.items)) for one in kept)


def _attribute(item: object) -> tuple[str, tree.Argument] | None:
    """The name of a variable in an equation of its guess value, and what that says of the variable."""
    if not isinstance(item, tree.SimpleEquation):
        return None
    left, right = item.left, item.right
    if is_call(left, "guess"):
        value = right.arguments[0] if is_call(right, "prioritize") else right
        return _argument(left.arguments[0], "start", value)
    variable = left.arguments[0] if is_call(left, "pre") else left
    if is_call(right, "guess") and right.arguments[0] == variable:
        return _argument(variable, "fixed", tree.BooleanLiteral(item.at, True))
    return None


def _argument(
    variable: tree.Expression, name: str, value: tree.Expression
) -> tuple[str, tree.Argument] | None:
    if not isinstance(variable, tree.ComponentReference) or any(
        subscripts for _, subscripts in variable.parts
    ):
        return None
    (first, _), *members = variable.parts
    at = variable.at
    found = tree.Argument(at, (), name, tree.Modification(at, None, value), None)
    for member, _ in reversed(members):
        found = tree.Argument(at, (), member, tree.Modification(at, (found,), None), None)
    return first, found


def _with_attributes(item: Item, said: Mapping[str, tuple[tree.Argument, ...]]) -> Item:
    if not isinstance(item, tree.ComponentClause):
        return item
    components = []
    for one in item.components:
        more, old = said.get(one.name, ()), one.modification or tree.Modification(one.at, None, None)
        modification = replace(old, arguments=(*(old.arguments or ()), *more)) if more else one.modification
        components.append(replace(one, modification=modification))
    return replace(item, components=tuple(components))
