"""Modifications (Modelica 3.6, chapter 7): read from the tree, and one laid over another."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from gantrytau.modelica import tree
from gantrytau.modelica.conditions import BEFORE
from gantrytau.modelica.references import nodes_of


@dataclass(frozen=True, eq=False)
class Redeclared:
    """A class or component that replaces another, and the class in which its names are looked up."""

    element: tree.ClassDefinition | tree.ComponentClause
    scope: Any


@dataclass(frozen=True, eq=False)
class Modifier:
    """What is said of a component: its value, and what is said of its members and attributes, by name.

    value: an expression or a plain value, of which `scope` is the class of its names and `node` the instance, where that
    is not the one that declares the component; path: what chooses the part of the value that is meant: names of members, and
    indices with the number of elements; at: its offset in the text of `scope`.
    """

    value: Any = None
    scope: Any = None
    node: Any = None
    each: bool = False
    final: bool = False
    inner: Mapping[str, "Modifier"] = field(default_factory=dict)
    redeclared: Redeclared | None = None
    at: int = 0
    path: tuple[tuple[int, int] | str, ...] = ()

    @property
    def member_clause(self) -> tree.ComponentClause | None:
        """The clause that redeclares the component, if one does."""
        found = self.redeclared.element if self.redeclared else None
        return found if isinstance(found, tree.ComponentClause) else None

    def of_element(self, index: int, count: int) -> "Modifier":
        """What a modification of an array of so many components says of one of them."""
        inner = {name: one if one.each else one.of_element(index, count) for name, one in self.inner.items()}
        return replace(self, inner=inner, path=(*self.path, (index, count)) if self.value is not None else ())

    def of_elements(self, shape: tuple[int, ...]) -> list["Modifier"]:
        """What it says of each component of an array, row after row."""
        found: list[Modifier] = [self]
        for size in shape:
            found = [one.of_element(k, size) for one in found for k in range(size)]
        return found

    def of_member(self, name: str) -> "Modifier | None":
        """What is said of a member, by a modification or by the value of the whole record."""
        inner = self.inner.get(name)
        if self.value is None or (inner is not None and inner.value is not None):
            return inner
        found = replace(self, inner={}, redeclared=None, each=False, path=(*self.path, name))
        return found if inner is None else merged(inner, found)

    def says_the_same(self, other: "Modifier") -> bool:
        """Whether another modification has the same text."""
        inner = self.inner.keys() | other.inner.keys()
        return self.value == other.value and all(
            self.inner.get(name, NOTHING).says_the_same(other.inner.get(name, NOTHING)) for name in inner
        )

    def picked(self, value: Any) -> Any:
        """The part of its value that indices and names of members choose."""
        for step in self.path:
            if isinstance(step, str):
                if step not in getattr(value, "names", tuple)():
                    words = f"found a value without '{step}' for a record, expected one of its type, with all members"
                    self.scope.refuse(self.at, words)
                value = value.member(step)
                continue
            index, count = step
            if not isinstance(value, np.ndarray) or len(value) != count:
                found = f"{len(value)} values" if isinstance(value, np.ndarray) else "a scalar"
                self.scope.refuse(
                    self.at,
                    f"found {found} for an array of {count} components, expected one value for each; 'each' before the name "
                    "takes one value for all",
                )
            value = value[index]
        return value

    def seen_from(self, node: Any) -> "Modifier":
        """The same, whose values speak of an instance."""
        return replace(
            self,
            node=self.node or node,
            inner={name: one.seen_from(node) for name, one in self.inner.items()},
        )


NOTHING = Modifier()


def annotated(arguments: tree.Annotation, *names: str) -> tree.Modification | None:
    """The value of a name in an annotation, or of names inside of each other; None where the name is missing."""
    found = None
    for name in names:
        said = (one for one in arguments or () if isinstance(one, tree.Argument) and one.name == name)
        if (found := next((one.modification for one in said), None)) is None:
            return None
        arguments = found.arguments
    return found


def is_false(said: Modifier | None) -> bool:
    """Whether a modification says `false`, as `fixed = false`."""
    return said is not None and isinstance(said.value, tree.BooleanLiteral) and not said.value.value


def read_modification(
    found: tree.Modification | None, scope: Any, each: bool = False, final: bool = False
) -> Modifier:
    """The modification of a declaration in a class."""
    if found is None:
        return replace(NOTHING, each=each, final=final)
    inner = read_arguments(found.arguments, scope).inner
    return Modifier(found.value, scope, None, each, final, inner, None, found.at)


def read_arguments(arguments: tuple[tree.AnyArgument, ...] | None, scope: Any) -> Modifier:
    """The modifications in parentheses; ModelError for a name that stands there twice."""
    inner: dict[str, Modifier] = {}
    for one in arguments or ():
        if isinstance(one, tree.Omission):
            scope.refuse(one.at, "found 'break', which is not supported, expected a modification")
            continue
        if isinstance(one, tree.Redeclaration):
            name, found = _redeclaration(one, scope)
        else:
            name, _, rest = one.name.partition(".")
            said = read_modification(one.modification, scope, "each" in one.prefixes, "final" in one.prefixes)
            for part in reversed(rest.split(".") if rest else ()):
                said = replace(NOTHING, inner={part: said}, scope=scope, at=one.at)
            found = replace(said, at=one.at)
        if name in inner and (found.value is not None and inner[name].value is not None):
            scope.refuse(one.at, f"found a second modification of '{name}', expected one")
        inner[name] = merged(found, inner[name]) if name in inner else found
    return Modifier(inner=inner, scope=scope)


def read_constraint(*classes: Any) -> Modifier:
    """The modifications in the `constrainedby` of the first class that has one; None among the classes is passed over."""
    for one in classes:
        if one is not None and one.definition.constraint is not None:
            return read_arguments(one.definition.constraint.arguments, one.around)
    return NOTHING


@dataclass(frozen=True, eq=False)
class Element:
    """A declared component: its clause, the class that declares it, and how that class and its heirs modify it."""

    clause: tree.ComponentClause
    declaration: tree.ComponentDeclaration
    scope: Any
    modifier: Modifier
    protected: bool = False

    @property
    def stated(self) -> tuple[Any, ...]:
        """What its declaration says, but for description and annotation."""
        bare = replace(self.declaration, description=None, annotation=None)
        return self.clause.prefixes, self.clause.type, self.clause.subscripts, bare

    def under(self, over: Modifier) -> Modifier:
        """What stays said of it under a modification; what redeclares it keeps its constraint alone, if it has one."""
        constraint = self.clause.constraint
        if over.member_clause is None or constraint is None:
            return self.modifier
        return read_arguments(constraint.arguments, self.scope)


@dataclass(frozen=True, eq=False)
class StatementSection:
    """Equations or statements of a class, and the class in which their names are looked up."""

    kind: str
    items: tuple[tree.EquationOrStatement, ...]
    scope: Any

    @cached_property
    def asks_before(self) -> bool:
        """Whether it asks for values before an instant: calls of `pre`, `edge` and `change`."""
        calls = (one for one in nodes_of(self.items) if isinstance(one, tree.Call))
        return any(one.function.parts[0][0] in BEFORE for one in calls)


def _redeclaration(one: tree.Redeclaration, scope: Any) -> tuple[str, Modifier]:
    element = one.element
    whole = Redeclared(element, scope)
    if isinstance(element, tree.ClassDefinition):
        return element.name, Modifier(scope=scope, redeclared=whole, at=one.at)
    (component,) = element.components
    said = read_modification(component.modification, scope, one.each)
    return component.name, replace(said, scope=scope, redeclared=whole, at=one.at)


def plain(values: Mapping[str, Any]) -> Modifier:
    """Modifications by plain values, nested as mappings."""
    inner = {n: plain(v) if isinstance(v, Mapping) else Modifier(value=v) for n, v in values.items()}
    return Modifier(inner=inner)


def merged(above: Modifier, below: Modifier) -> Modifier:
    """One modification over another, which stands further in; ModelError where the inner one is final."""
    if below is NOTHING:
        return above
    if below.final and any(isinstance(step, str) for step in above.path):
        return below  # a member that has its value whatever that of the whole record is
    if below.final and (above.value is not None or above.redeclared or above.inner):
        above.scope.refuse(above.at, "found a modification of what is declared 'final', expected none")
    inner = dict(below.inner)
    for name, one in above.inner.items():
        inner[name] = merged(one, inner[name]) if name in inner else one
    value = above if above.value is not None else below
    return replace(
        value,
        inner=inner,
        redeclared=above.redeclared or below.redeclared,
        final=above.final or below.final,
        at=above.at or below.at,
        scope=value.scope or above.scope or below.scope,
    )
