"""Operators on operator records (Modelica 3.6, chapter 14): the function of the record that an operator means."""

from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from typing import Any

import numpy as np

from gantrytau.border.refusal import ModelError
from gantrytau.modelica import tree
from gantrytau.modelica.elaboration import values
from gantrytau.modelica.elaboration.scopes import ClassScope, Element
from gantrytau.modelica.records.record_values import RecordValue

SIGNS = {"sum": "+", "product": "*"}
Call = Callable[[ClassScope, Sequence[Any], Mapping[str, Any]], Any]


def operator_record(value: Any) -> ClassScope | None:
    """The operator record that a value, or each element of an array, belongs to; None for another value."""
    if isinstance(value, np.ndarray):
        return operator_record(value.flat[0]) if value.size else None
    holder = value if isinstance(value, RecordValue) else getattr(value, "structure", value)
    scope = getattr(holder, "scope", None)
    return _plain(scope) if scope is not None else None


def _plain(scope: ClassScope) -> ClassScope | None:
    """The operator record behind names for it."""
    while isinstance(scope.definition.body, tree.ShortClass):
        scope = scope.bases[0][0]
    return scope if "operator" in scope.definition.prefixes else None


def operated(sign: str, operands: Sequence[Any], call: Call) -> Any:
    """The value of an operator on one or two operands."""
    if any(operator_record(one) is not None for one in operands):
        return overloaded(sign, operands, call)
    return values.unary(sign, *operands) if len(operands) == 1 else values.binary(sign, *operands)


def called(name: str, arguments: Sequence[Any], named: Mapping[str, Any], call: Call) -> Any:
    """The value of a function of the language; sum and product of operator records by their operators."""
    items: Any = np.ravel(arguments[0]) if name in SIGNS and len(arguments) == 1 else ()
    if len(items) and operator_record(items[0]) is not None:
        return reduce(lambda a, b: overloaded(SIGNS[name], [a, b], call), items)
    return values.called(name, arguments, named)


def overloaded(sign: str, operands: Sequence[Any], call: Call) -> Any:
    """The value of an operator of which at least one operand is of an operator record.

    Where no function takes a number as it is, the record's constructor converts it; arrays are taken element by element.
    Raises ModelError where the record has no function for the operands.
    """
    record = next(found for one in operands if (found := operator_record(one)) is not None)
    function = function_for(record, sign, operands)
    if function is not None:
        return call(function, operands, {})
    plain = [k for k, one in enumerate(operands) if operator_record(one) is None]
    arrays = [one for one in operands if isinstance(one, np.ndarray)]
    if arrays and (len(operands) == 1 or len(arrays) == 1 or (sign in "+-" and _alike(arrays))):
        count = range(len(arrays[0]))
        rows = [[one[k] if isinstance(one, np.ndarray) else one for one in operands] for k in count]
        return values.array([overloaded(sign, row, call) for row in rows])
    if plain and not arrays:
        (k,) = plain
        converted = [call(record, [one], {}) if j == k else one for j, one in enumerate(operands)]
        return overloaded(sign, converted, call)
    raise ModelError(
        f"found operands of '{sign}' that {record.name} has no function for, expected those it defines"
    )


def function_for(record: ClassScope, sign: str, operands: Sequence[Any]) -> ClassScope | None:
    """The function of an operator record that takes these operands; None where there is none."""
    found = record.inherited_class(f"'{sign}'")
    if found is None:
        return None
    functions = [found] if found.definition.kind == "function" else list(found.classes.values())
    return next((one for one in functions if _takes(one, operands, record)), None)


def _takes(function: ClassScope, operands: Sequence[Any], record: ClassScope) -> bool:
    inputs = [one for one in function.elements.values() if "input" in one.clause.prefixes]
    needed = sum(one.modifier.value is None for one in inputs)
    pairs = zip(inputs, operands, strict=False)
    return needed <= len(operands) <= len(inputs) and all(_fits(*pair, record) for pair in pairs)


def _fits(taken: Element, operand: Any, record: ClassScope) -> bool:
    kind = _plain(taken.scope.find_class(taken.clause.type, taken.clause.at))
    dimensions = len(taken.declaration.subscripts) + len(taken.clause.subscripts)
    given = len(values.all_sizes(operand))
    same = (kind is not None and kind.definition is record.definition) == (
        operator_record(operand) is not None
    )
    return same and dimensions == given


def _alike(arrays: Sequence[Any]) -> bool:
    return len({len(one) for one in arrays}) == 1
