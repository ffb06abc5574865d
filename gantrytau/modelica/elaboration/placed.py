"""Instances with symbols, and values of Modelica text that are computed in them."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.border.refusal import ModelError
from gantrytau.language.declarations import Discrete, Formula
from gantrytau.language.model import Connector, Declared
from gantrytau.language.statements import Connection
from gantrytau.modelica import tree
from gantrytau.modelica.conditions import BEHIND, TURN, followed_name, outer_name, sample_name
from gantrytau.modelica.elaboration import values
from gantrytau.modelica.elaboration.modifiers import Modifier
from gantrytau.modelica.elaboration.scopes import ClassScope
from gantrytau.modelica.elaboration.statements import AbsentComponent, stated
from gantrytau.modelica.elaboration.structure import Structure
from gantrytau.modelica.printer import expression_written
from gantrytau.modelica.references import connects_in


class PlacedMembers:
    """An instance with symbols, whose members an expression asks for by their names."""

    def __init__(self, instance: Any, structure: Structure | None = None):
        self.instance = instance
        self.structure = getattr(type(instance), "structure", structure)

    def has(self, name: str) -> bool:
        return name in self.names()

    @property
    def scope(self) -> ClassScope:
        """Its class."""
        if self.structure is None:
            raise ModelError(
                f"found a function of {type(self.instance).__name__}, expected one of Modelica text"
            )
        return self.structure.scope

    @property
    def around(self) -> "PlacedMembers | None":
        """The instance of which it is a component."""
        found = around(self.instance)
        return found and PlacedMembers(found)

    @property
    def instance_name(self) -> str:
        return self.structure.instance_name if self.structure else type(self.instance).__name__

    def names(self) -> Sequence[str]:
        return self.structure.names() if self.structure else [*type(self.instance).members()]

    def member(self, name: str) -> Any:
        """The value of a component."""
        one = self.structure.members[name] if self.structure else None
        if one is not None and not one.present:
            raise AbsentComponent(f"{name}, whose condition does not hold")
        if one is not None and (one.is_folded or one.is_object):
            return self.structure.member(name) if self.structure else None
        if one is not None and 0 in one.shape:
            return np.empty(one.shape, dtype=object)
        found = getattr(
            self.instance,
            outer_name(name) if one is not None and {"inner", "outer"} <= one.prefixes else name,
        )
        if isinstance(found, ca.SX):
            return values.from_casadi(found, one.shape) if one is not None else _by_size(found)
        if isinstance(found, tuple):
            each = [PlacedMembers(each) for each in found]
            return values.array(each) if one is None else values.in_rows(each, one.shape)
        return PlacedMembers(found) if isinstance(found, Declared) else found

    def shape(self, name: str) -> tuple[int, ...] | None:
        return self.structure.shape(name) if self.structure else None

    def type_of(self, reference: tree.ComponentReference) -> str:
        return "" if self.structure is None else self.structure.type_of(reference)

    def values_of(self, reference: tree.ComponentReference) -> range | None:
        return None if self.structure is None else self.structure.values_of(reference)

    def is_fixed(self, expression: tree.Expression) -> bool:
        return self.structure is not None and self.structure.is_fixed(expression)

    def before(self, name: str, asked: str) -> Any:
        own = asked == "pre" and isinstance(type(self.instance).members().get(name), Discrete)
        found = None if own else self._following(BEHIND, name)
        parts = tuple((part, ()) for part in name.split("."))
        one = self.structure.leaf(tree.ComponentReference(0, parts)) if self.structure else None
        return found if found is None or one is None else values.from_casadi(found, one.shape)

    def turn(self, name: str) -> Any:
        return self._following(TURN, name)

    def _following(self, kind: str, name: str) -> Any:
        known = getattr(type(self.instance), "_followed", ())
        return getattr(self.instance, followed_name(kind, name)) if name in known else None

    def next_sample(self, call: tree.Call) -> Any:
        name = sample_name(call)
        if not hasattr(self.instance, name):
            raise ModelError(f"found {call.function.parts[0][0]}() in a value, expected it among equations")
        return getattr(self.instance, name)

    def cardinality(self) -> int:
        """The number of connections of a connector, on both sides of the component that has it."""
        owner = self.instance
        while isinstance(owner, Connector):
            owner = around(owner)
        both = (owner, around(owner))
        return sum(_connected(one)[id(self.instance)] for one in both if one is not None)


def around(member: Any) -> Any:
    """The component of which an instance is a member; None for the outermost."""
    found = vars(member).get("_around")
    return found and found()


def _connected(component: Any) -> Counter[int]:
    """The number of connections that a component states of each connector, by the connector's id."""
    if "_connected" not in vars(component):
        structure: Structure | None = getattr(type(component), "structure", None)
        if structure is None:
            found = [one for one in component.equations() if isinstance(one, Connection)]
        else:
            members = PlacedMembers(component)
            sections = (one for one in structure.scope.sections if one.kind == "equation")
            readers = (
                (connects_in(one.items), structure.interpreter(one.scope, members)) for one in sections
            )
            found = [one for items, reader in readers for one in stated(items, reader)]
        component._connected = Counter(id(end) for one in found for end in (one.a, one.b))
    return component._connected


def _by_size(found: ca.SX) -> Any:
    shape = () if found.numel() == 1 else found.shape if found.shape[1] > 1 else (found.shape[0],)
    return values.from_casadi(found, shape)


class Bound(Formula):
    """What Modelica text says of a value, computed in the instance whose class says it. shape: of what it is the value."""

    def __init__(self, modifier: Modifier, structure: Structure, shape: tuple[int, ...] | None = None):
        super().__init__(None)  # type: ignore[arg-type]
        self.modifier, self.structure, self.shape = modifier, structure, shape

    def evaluate(self, scope: Any) -> Any:
        """The value where `scope` is that instance."""
        found = self.modifier.value
        if isinstance(found, tree.TreeNode):
            placed = PlacedMembers(scope, self.structure)
            try:
                reader = self.structure.interpreter(self.modifier.scope, placed)
                found = replace(reader, settled=True).value(found)
            except AbsentComponent as error:
                self.modifier.scope.refuse(self.modifier.at, f"found {error}, expected one that is there")
        found = self.modifier.picked(found)
        shape = np.shape(found) if isinstance(found, np.ndarray) else ()
        alike = self.shape in (None, shape) or (self.modifier.each and not shape)
        if not alike and isinstance(self.modifier.value, tree.TreeNode):
            hint = "" if shape else "; 'each' before the name takes one value for all"
            words = f"found {values.sized(found)}, expected {values.sized(np.empty(self.shape or ()))}{hint}"
            self.modifier.scope.refuse(self.modifier.at, words)
        found = values.to_casadi(found)
        return float(found) if isinstance(found, bool) else found

    def parts(self) -> tuple[str, tuple[Any, ...]]:
        return repr(self), ()

    def __repr__(self) -> str:
        found = self.modifier.value
        return expression_written(found) if isinstance(found, tree.Expression) else repr(found)
