"""The attributes of declarations as expressions of parameters: from a placed quantity to its flat record."""

from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.border.refusal import ModelError, in_words
from gantrytau.border.units import given, known_scale
from gantrytau.flattening.flat_model import FlatParameter, FlatVariable
from gantrytau.flattening.instantiation import Leaf, Placed
from gantrytau.flattening.shapes import fits, joined, numpy_shape
from gantrytau.language.declarations import Formula, Parameter, StateSelect, evaluate
from gantrytau.language.instructions import refuse_calls


def flat_variable(placed: Placed) -> FlatVariable:
    """The record of a variable. Raises ModelError for an attribute that is no number of its shape."""
    return FlatVariable(**_common(placed), prefer=_prefer(placed.attributes))


def flat_parameter(placed: Placed) -> FlatParameter:
    """The record of a parameter. Raises ModelError where it has no value."""
    if "value" not in placed.attributes:
        raise ModelError(
            f"{placed.name} ({placed.declaration.words()}) has no value, expected one; "
            f"give it where the component is declared, `{placed.name.split('.')[-1]}=...`"
        )
    declaration = placed.declaration
    assert isinstance(declaration, Parameter)
    value, given = expression(placed, "value"), placed.attributes["value"].value is not declaration.value
    assumed = "" if given else declaration.assumed
    return FlatParameter(
        **_common(placed), value=value, fold=declaration.fold, final=declaration.final, assumed=assumed
    )


def expression(placed: Placed, attribute: str) -> tuple[ca.SX, ...]:
    """An attribute as one SX per scalar of a quantity; one number may stand for all starts or limits."""
    leaf: Leaf = placed.attributes[attribute]
    value = leaf.value.value if isinstance(leaf.value, Parameter) and not leaf.value.name else leaf.value
    if leaf.scope is None and (isinstance(value, Formula) or callable(value)):
        raise ModelError(
            f"{placed.name}: {attribute}: found a formula in a modification of the outermost model, around which there is "
            "no model whose parameters it could name, expected numbers; declare it in the body of a subclass"
        )
    try:
        found = joined(given(f"{placed.name}: {attribute}", evaluate(value, leaf.scope), _unit(placed)))
    except (RuntimeError, TypeError, NotImplementedError, AttributeError, ValueError, IndexError) as error:
        why = "" if isinstance(error, NotImplementedError) else f": {in_words(error)}"
        raise ModelError(
            f"{placed.name}: {attribute} is {leaf.value!r}, expected a number, an array or an expression of "
            f"parameters{why}"
        ) from error
    if not found.is_constant():
        refuse_calls(f"{placed.name}: {attribute}", found)
    size = len(placed.elements)
    if found.numel() == 1 and (size == 1 or attribute != "value"):
        elements = found.elements() * size
    elif fits(numpy_shape(found), placed.shape):
        elements = found.elements()
    else:
        raise ModelError(
            f"{placed.name}: {attribute} has shape {numpy_shape(found)}, expected {placed.shape}"
            + ("; give rows of columns" if len(placed.shape) == 2 else "")
        )
    bad = [e for e in elements if e.is_constant() and not _allowed(float(e), attribute)]
    if bad:
        raise ModelError(f"{placed.name}: {attribute} is {bad[0]}, expected a finite number")
    return tuple(elements)


def _allowed(value: float, attribute: str) -> bool:
    infinite = value in (float("inf"), float("-inf"))
    return value == value and (attribute in ("min", "max") or not infinite)


def _common(placed: Placed) -> dict[str, Any]:
    attributes, unit = placed.attributes, _unit(placed)
    display = attributes["display"].value if "display" in attributes else ""
    if display != "":
        known_scale(f"{placed.name}: display", display, unit)
    limits = {key: expression(placed, key) for key in ("min", "max", "nominal") if key in attributes}
    return dict(
        name=placed.name,
        kind=placed.declaration.kind,
        shape=placed.shape,
        elements=tuple(placed.elements),
        symbol=placed.symbol,
        unit=unit,
        display=display,
        description=attributes["description"].value if "description" in attributes else "",
        start=expression(placed, "start") if "start" in attributes else None,
        fixed=all(fixed_elements(placed)),
        chosen=placed.chosen,
        owner=placed.path,
        free=bool(attributes["free"].value)
        if "free" in attributes
        else getattr(type(placed.declaration), "free", False),
        undetermined=attributes["undetermined"].value,
        **limits,
    )


def fixed_elements(placed: Placed) -> list[bool]:
    """Whether the start of each scalar is an initial condition, column after column."""
    found = np.asarray(placed.attributes["fixed"].value if "fixed" in placed.attributes else False)
    if found.shape not in ((), placed.shape):
        raise ModelError(
            f"{placed.name}: fixed has shape {found.shape}, expected {placed.shape}, or one True or False for all"
        )
    return [bool(one) for one in np.broadcast_to(found, placed.shape).ravel(order="F")]


def _unit(placed: Placed) -> str | None:
    return placed.attributes["unit"].value if "unit" in placed.attributes else None


def _prefer(attributes: Mapping[str, Leaf]) -> StateSelect:
    """The state preference among the attributes of a variable."""
    return StateSelect(attributes["prefer"].value) if "prefer" in attributes else StateSelect.DEFAULT
