"""Types of values and of expressions (Modelica 3.6, chapters 3.6 and 6.7), as far as the text tells them."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from gantrytau.modelica import tree
from gantrytau.modelica.elaboration.interpreter import Interpreter
from gantrytau.modelica.elaboration.scopes import ClassScope, Element
from gantrytau.modelica.elaboration.values import RELATIONS, EnumerationValue
from gantrytau.modelica.references import called_function, from_left

BOOLEANS = frozenset({"edge", "change", "initial", "terminal", "sample"})
INTEGERS = frozenset({"size", "ndims", "integer", "Integer", "cardinality"})
OF_ARGUMENT = {"pre": 0, "noEvent": 0, "smooth": 1, "homotopy": 0, "delay": 0, "abs": 0, "sum": 0, "fill": 0}


def fits(wanted: str, found: str) -> bool:
    """Whether a value of a type may stand where another is wanted; "" is a type that is not known."""
    return not wanted or not found or wanted == found or (wanted, found) == ("Real", "Integer")


def type_of_value(value: Any) -> str:
    """The type of a plain value or of the first element of an array; "" for expressions and records."""
    if isinstance(value, np.ndarray):
        value = value.flat[0] if value.size else None
    if isinstance(value, EnumerationValue):
        return value.type
    if isinstance(value, float) and value.is_integer():
        return "Integer"
    return {bool: "Boolean", int: "Integer", float: "Real", str: "String"}.get(type(value), "")


def type_of(e: Any, reader: Interpreter) -> str:
    """Real, Integer, Boolean, String or the name of an enumeration; "" where it is not known.

    Raises ModelError with the line where an operator has operands that it does not take.
    """
    if isinstance(e, tree.ComponentReference):
        return _type_of_reference(e, reader)
    if isinstance(e, tree.Call):
        return "" if e.iterators else _type_of_call(e, reader)
    if isinstance(e, tree.Unary):
        taken = ("Boolean",) if e.operator == "not" else NUMBERS
        (found,) = _operands(_typed([e.operand], reader), taken, e.operator, reader)
        return "Boolean" if e.operator == "not" else found
    if isinstance(e, tree.Binary):
        return _type_of_binary(e, reader)
    if isinstance(e, tree.Conditional):
        tests, branches = zip(*e.branches, strict=True)
        _operands(_typed(tests, reader), ("Boolean",), "if", reader)
        return _joined(_typed((*branches, e.otherwise), reader), reader)
    if isinstance(e, tree.ArrayConstructor):
        return "" if e.iterators else _joined(_typed(e.items, reader), reader)
    if isinstance(e, (tree.Number, tree.StringLiteral, tree.BooleanLiteral)):
        found = reader.value(e)
        return "Real" if isinstance(found, float) else type_of_value(found)
    return type_of(e.array, reader) if isinstance(e, tree.Subscripted) else ""


NUMBERS = ("Real", "Integer")
NOT_ENUMERATED = ("Real", "Boolean", "String")


Typed = Iterable[tuple[Any, str]]  # expressions with their types


def _typed(items: Iterable[Any], reader: Interpreter) -> list[tuple[Any, str]]:
    return [(one, type_of(one, reader)) for one in items]


def _type_of_binary(e: tree.Binary, reader: Interpreter) -> str:
    above = from_left(e)
    known = type_of(above[0].left, reader)
    for one in above:
        known = _type_of_sides(one, known, reader)
    return known


def _type_of_sides(e: tree.Binary, left: str, reader: Interpreter) -> str:
    """The type of an operator's value, that of whose left side is known."""
    sign, sides = e.operator, ((e.left, left), (e.right, type_of(e.right, reader)))
    if sign in ("and", "or"):
        _operands(sides, ("Boolean",), sign, reader)
        return "Boolean"
    if sign in RELATIONS:
        _joined(sides, reader)
        return "Boolean"
    found = _operands(sides, (*NUMBERS, "String") if sign == "+" else NUMBERS, sign, reader)
    if "" in found:
        return ""
    return "Real" if sign in ("/", "./", "^", ".^") or "Real" in found else found[0]


def _operands(items: Typed, taken: tuple[str, ...], sign: str, reader: Interpreter) -> list[str]:
    """The types of operands; TextError for one that the operator does not take."""
    for one, kind in items:
        if kind and kind not in taken:
            reader.scope.refuse(one.at, f"found {kind} beside '{sign}', expected {' or '.join(taken)}")
    return [kind for _, kind in items]


def _joined(items: Typed, reader: Interpreter) -> str:
    """The one type of several expressions; TextError for two that do not go together."""
    found = ""
    for one, kind in items:
        if not (fits(found, kind) or fits(kind, found)):
            reader.scope.refuse(one.at, f"found {kind} beside {found}, expected one type")
        found = "Real" if "Real" in (found, kind) else kind or found
    return found


def _type_of_reference(e: tree.ComponentReference, reader: Interpreter) -> str:
    name = e.parts[0][0]
    if reader.members.has(name):
        return reader.members.structure.type_of(e)
    if name in reader.local:
        return type_of_value(reader.local[name])
    return "Real" if name == "time" else type_of_value(reader.value(e))


def _type_of_call(e: tree.Call, reader: Interpreter) -> str:
    name, function = called_function(e, reader)
    if name == "Integer" and e.arguments and (found := type_of(e.arguments[0], reader)) in NOT_ENUMERATED:
        reader.scope.refuse(e.at, f"found {found} in Integer(), expected a value of an enumeration")
    if name in BOOLEANS | INTEGERS or name == "String":
        return "Boolean" if name in BOOLEANS else "String" if name == "String" else "Integer"
    if name in OF_ARGUMENT and len(e.arguments) > OF_ARGUMENT[name]:
        return type_of(e.arguments[OF_ARGUMENT[name]], reader)
    elements = function.elements if function is not None else {}
    outputs = [n for n, one in elements.items() if "output" in one.clause.prefixes]
    for one in () if e.iterators else (*e.arguments, *(value for _, value in e.named)):
        type_of(one, reader)  # what stands in it is told here
    if function is None or not outputs:
        return ""
    first = tree.ComponentReference(e.at, ((outputs[0], ()),))
    return reader.library.package(function).type_of(first)


def check_type(wanted: str, expression: Any, reader: Interpreter, what: str, at: int) -> None:
    """TextError where an expression is of a type that does not fit."""
    found = type_of(expression, reader) if isinstance(expression, tree.TreeNode) else ""
    if not fits(wanted, found):
        remedy = "; integer() makes it whole" if (wanted, found) == ("Integer", "Real") else ""
        reader.scope.refuse(at, f"found {found} for {what}, expected {wanted}{remedy}")


def _dimensions(element: Element) -> int:
    return len(element.declaration.subscripts) + len(element.clause.subscripts)


def is_longer(element: Element, value: Any) -> bool:
    """Whether a function of scalars is given an array, of which it takes each element."""
    return (
        isinstance(value, np.ndarray)
        and value.ndim == _dimensions(element) + 1
        and not is_array_type(element)
    )


def is_array_type(element: Element) -> bool:
    """Whether the type of a variable of a function has sizes of its own."""
    here: ClassScope | None = element.scope.find_class(element.clause.type, element.clause.at)
    while here is not None and here.is_primitive:
        body = here.definition.body
        if isinstance(body, tree.ShortClass) and body.subscripts:
            return True
        here = here.bases[0][0] if here.bases else None
    return False
