"""A component of a model as it stands there, with its modifications: values of parameters without flattening."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.border.refusal import ModelError
from gantrytau.border.units import given
from gantrytau.language.declarations import Array, Bounds, Formula, Parameter, Start, evaluate

NUMBERS = {"start", "min", "max", "nominal"}  # attributes in the unit of their quantity


@dataclass(frozen=True, eq=False)
class PlacedPart:
    """A component of a model as it stands there: its class, and its modifications, formulas computed.

    path: from the model that is asked; given: whether it is an instance, whose values are known.
    """

    kind: Any
    modifications: Mapping[str, Any]
    path: str = ""
    given: bool = True

    @cached_property
    def members(self) -> Mapping[str, Any]:
        """Declarations by name."""
        return self.kind.members()

    @cached_property
    def scope(self) -> Any:
        """Where formulas find the numbers of its parameters."""
        return _Numbers(self.members, self.modifications)

    def value(self, name: str) -> Any:
        """What a parameter or a setting has: a number, an array, or a formula without one; None if nobody said it."""
        member = self.members.get(name)
        given = self.modifications.get(name, getattr(member, "value", None))
        if isinstance(given, Mapping):
            given = given.get("value", getattr(member, "value", None))
        return in_si(number_of(given, self.scope), getattr(member, "unit", None))

    def attribute(self, name: str, key: str) -> Any:
        """An attribute of a quantity, such as its start."""
        given = self.modifications.get(name)
        if isinstance(given, (Start, Bounds)):
            given = given.attributes()
        member = self.members[name]
        declared = getattr(member, key, None)
        found = number_of(given.get(key, declared) if isinstance(given, Mapping) else declared, self.scope)
        return in_si(found, member.unit) if key in NUMBERS else found

    def parts(self, name: str) -> list["PlacedPart"]:
        """The component of that name; all of an array."""
        member, given = self.members[name], self.modifications.get(name, {})
        elements = list(member) if isinstance(member, Array) else [member]
        if isinstance(given, (list, tuple)) and len(given) == len(elements):
            each = list(given)
        else:
            each = [given] * len(elements)
        found = []
        for k, (element, one) in enumerate(zip(elements, each, strict=True)):
            at = f"{self.path}{name}" + (f"[{k}]" if isinstance(member, Array) else "")
            held: Any = one if hasattr(one, "members") else element
            if isinstance(one, Mapping) and one:
                held = element.modified(one)
            found.append(
                PlacedPart(type(held), _computed(held.modifications, self.scope), f"{at}.", self.given)
            )
        return found


class _Numbers:
    """An instance as formulas see it: its parameters are numbers."""

    def __init__(self, members: Mapping[str, Any], modifications: Mapping[str, Any]):
        self._members = members
        self._given = modifications

    def __getattr__(self, name: str) -> Any:
        member = self.__dict__["_members"].get(name)
        if not isinstance(member, Parameter):
            raise AttributeError(name)
        said = self._given.get(name, member.value)
        found = evaluate(said.get("value", member.value) if isinstance(said, Mapping) else said, self)
        found = in_si(found, member.unit)
        if found is None:
            raise AttributeError(name)  # nobody said it
        values = np.asarray(found, dtype=float)
        return float(values) if values.ndim == 0 else ca.DM(values)


def in_si(value: Any, unit: str | None) -> Any:
    """A value that was written with a unit, "700 mm", as a number in SI; all else as it is, wrong units too."""
    try:
        return given("describe", value, unit)
    except ModelError:
        return value


def number_of(value: Any, scope: Any) -> Any:
    """The value of a formula, of a function of the instance; itself where it has no numbers."""
    if not (isinstance(value, Formula) or (callable(value) and not hasattr(value, "members"))):
        return value
    try:
        found = evaluate(value, scope)
        array = np.asarray(found, dtype=float)
    except Exception:  # of a statement of whoever wrote the model, or what only an instance has
        return value
    if np.all(np.isnan(array)):
        return value
    return array.squeeze(-1) if array.ndim == 2 and array.shape[1] == 1 else array


def _computed(modifications: Mapping[str, Any], scope: Any) -> dict[str, Any]:
    """Modifications with formulas computed where they stand."""

    def computed(value: Any) -> Any:
        if isinstance(value, Mapping):
            return {key: computed(one) for key, one in value.items()}
        if isinstance(value, list):
            return [computed(one) for one in value]
        if isinstance(value, Start) and isinstance(value.value, Formula):
            return type(value)(computed(value.value))
        return number_of(value, scope) if isinstance(value, Formula) else value

    return {key: computed(value) for key, value in modifications.items()}
