"""Instances with symbols, and values of Modelica text that are computed in them."""

from collections import Counter
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
from gantrytau.modelica.references import Members, connects_in


class PlacedMembers(Members):
    """An instance with symbols, whose members an expression asks for by their names."""

    def __init__(self, instance: Any, structure: Structure | None = None):
        found = getattr(type(instance), "structure", structure)
        if found is None:
            raise ModelError(
                f"found {type(instance).__name__}, a class of Python, expected one of Modelica text"
            )
        self.instance, self.structure = instance, found

    @property
    def scope(self) -> ClassScope:
        """Its class."""
        return self.structure.scope

    @property
    def around(self) -> "PlacedMembers | None":
        """The instance of Modelica text of which it is a component."""
        found = around(self.instance)
        return PlacedMembers(found) if hasattr(type(found), "structure") else None

    def member(self, name: str) -> Any:
        one = self.structure.members[name]
        if not one.present:
            raise AbsentComponent(f"{name}, whose condition does not hold")
        if one.is_folded or one.is_object:
            return self.structure.member(name)
        if 0 in one.shape:
            return np.empty(one.shape, dtype=object)
        found = getattr(self.instance, outer_name(name) if {"inner", "outer"} <= one.prefixes else name)
        if isinstance(found, ca.SX):
            return values.from_casadi(found, one.shape)
        if isinstance(found, tuple):
            return values.in_rows([PlacedMembers(each) for each in found], one.shape)
        return PlacedMembers(found) if isinstance(found, Declared) else found

    def before(self, name: str, asked: str) -> Any:
        own = asked == "pre" and isinstance(type(self.instance).members().get(name), Discrete)
        found = None if own else self._following(BEHIND, name)
        parts = tuple((part, ()) for part in name.split("."))
        one = self.structure.leaf(tree.ComponentReference(0, parts))
        return found if found is None or one is None else values.from_casadi(found, one.shape)

    def turn(self, name: str) -> Any:
        return self._following(TURN, name)

    def _following(self, kind: str, name: str) -> Any:
        known = getattr(type(self.instance), "_followed", ())
        return getattr(self.instance, followed_name(kind, name)) if name in known else None

    def next_sample(self, call: tree.Call) -> Any:
        name = sample_name(call)
        return getattr(self.instance, name) if hasattr(self.instance, name) else super().next_sample(call)

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
            words = f"found {values.size_words(found)}, expected {values.size_words(np.empty(self.shape or ()))}{hint}"
            self.modifier.scope.refuse(self.modifier.at, words)
        found = values.to_casadi(found)
        return float(found) if isinstance(found, bool) else found

    def parts(self) -> tuple[str, tuple[Any, ...]]:
        return repr(self), ()

    def __repr__(self) -> str:
        found = self.modifier.value
        return expression_written(found) if isinstance(found, tree.Expression) else repr(found)
