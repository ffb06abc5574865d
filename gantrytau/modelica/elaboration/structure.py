"""What an instance of a class consists of, before there are symbols: members, sizes, conditions, redeclared classes.

A parameter that is asked for here shapes the model: its value is folded, and another value makes another class.
"""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau.modelica import tree
from gantrytau.modelica.buses.expandable import expand
from gantrytau.modelica.elaboration.interpreter import Interpreter
from gantrytau.modelica.elaboration.kinds import fits, type_of_value
from gantrytau.modelica.elaboration.modifiers import (
    NOTHING,
    Element,
    Modifier,
    is_false,
    merged,
    read_arguments,
)
from gantrytau.modelica.elaboration.scopes import ClassScope, TextError
from gantrytau.modelica.elaboration.values import EnumerationValue, in_rows, is_number
from gantrytau.modelica.overdetermined.records import is_drawn
from gantrytau.modelica.references import Members, references
from gantrytau.modelica.shaping import ask, ask_for_shapes, is_known


@dataclass(eq=False)
class Structure(Members):
    """An instance of a class: modifier says what is said of it from outside, whose values know their own instances.

    read: names of the parameters that shape it; folding: those whose values are asked for at the moment;
    started: initial equations that are start values of what a `when` sets; objects: values of external objects by name.
    """

    scope: ClassScope
    modifier: Modifier
    library: Any
    path: str = ""
    prefixes: frozenset[str] = frozenset()  # parameter or constant, of the record as a whole
    around: "Structure | None" = None
    read: set[str] = field(default_factory=set)
    folding: list[str] = field(default_factory=list)
    started: list[Any] = field(default_factory=list)
    objects: dict[str, Any] = field(default_factory=dict)

    @cached_property
    def members(self) -> dict[str, "ClassMember"]:
        """Its components by name, also those that are absent."""
        self.scope.check_modified(self.modifier)
        for name, one in self.modifier.inner.items():
            element = self.scope.elements.get(name)
            if element is not None and element.protected and one.scope is not None:
                words = f"found '{name}' modified, which is protected in {self.scope.name}, expected a public component"
                one.scope.refuse(one.at, f"{words}; extend {self.scope.name} to modify it")
        return {name: ClassMember(name, element, self) for name, element in self.scope.elements.items()}

    @property
    def structure(self) -> "Structure":
        return self

    def shape(self, name: str) -> tuple[int, ...] | None:
        """The sizes of a component; None where only its value has them."""
        one = self.members[name]
        return tuple(one.first_sizes) or one.shape

    @property
    def instance_name(self) -> str:
        """Its path behind the name of the whole model."""
        *_, root = self.outward()
        return f"{root.scope.definition.name}.{self.path}".rstrip(".")

    def interpreter(self, scope: ClassScope, members: Any = None) -> Interpreter:
        """What evaluates expressions of a class in this instance."""
        return Interpreter(scope, members or self, self.library)

    def folded(self, modifier: Modifier) -> Any:
        """The value of a modification."""
        found = modifier.value
        if isinstance(found, tree.TreeNode):
            found = self.interpreter(modifier.scope, modifier.node).value(found)
        return modifier.picked(found)

    def outward(self) -> "Iterator[Structure]":
        """The instance, then the instances around it, up to the whole model."""
        yield self
        if self.around is not None:
            yield from self.around.outward()

    def member(self, name: str) -> Any:
        """The value of a constant or parameter that shapes the model, or the structure of a component."""
        one = self.members[name]
        if one.is_object and name not in self.objects:
            self.objects[name] = self.folded(one.full)
        if one.primitive is None:
            return self.objects[name] if one.is_object else in_rows(one.children, one.shape)
        if not one.is_parameter:
            raise ModelError(f"found the variable '{name}', expected what is known at translation")
        if one.full.value is None:
            words = f"found '{name}', which has no value, expected one, as it shapes {self.scope.name}"
            raise ModelError(f"{words}; give {name} = ...")
        if name in self.folding:
            raise ModelError(f"found '{name}', whose value needs itself, expected values one after another")
        self.read.add(name)
        self.folding.append(name)
        try:
            found = self.folded(one.full)
        finally:
            self.folding.remove(name)
        if one.literals is not None and one.primitive is not None and isinstance(found, str):
            literal = found.rpartition(".")[2]
            if literal not in one.literals:
                raise ModelError(f"found {found!r} for '{name}'{did_you_mean(literal, one.literals)}")
            return EnumerationValue(one.literals.index(literal) + 1, literal, one.primitive.name)
        if not fits(one.type_name, type_of_value(found)):
            words, said = f"found {found!r} for '{name}', expected {one.type_name}", one.full
            raise TextError(said.scope.source.told(said.at, words)) if said.scope else ModelError(words)
        if not is_number(found):
            raise ModelError(f"found the value of '{name}' to vary, expected one known at translation")
        if isinstance(found, (int, float)) and one.kind in ("Real", "Integer"):
            return float(found) if one.kind == "Real" else int(found)
        return found

    def prepare(self) -> None:
        """Ask for all sizes, conditions and ranges, here and within, so that it is known what shapes the model."""
        self.scope.check_replaced()
        for one in self.members.values():
            if isinstance(one.full.value, tree.TreeNode) and one.present:
                ask_for_shapes(one.full.node or self, one.full.value, one.full.scope)
            if one.present and one.is_object:
                self.member(one.name)
            elif one.present and one.shape is not None:
                for child in one.children if "outer" not in one.prefixes else ():
                    child.prepare()
        for section in self.scope.sections:
            for item in section.items:
                ask(self, item, section.scope)
        if self.around is None:
            expand(self)

    def type_of(self, reference: tree.ComponentReference) -> str:
        """Real, Integer, Boolean, String or the name of an enumeration; "" for all else."""
        one = self.leaf(reference)
        return "" if one is None else one.type_name

    def values_of(self, reference: tree.ComponentReference) -> range | None:
        """The values of an Integer with min and max, 0 and 1 of a Boolean; None for another Integer."""
        one = self.leaf(reference)
        if one is None or one.kind == "Boolean":
            return range(2)
        said = [one.full.inner.get(name) for name in ("min", "max")]
        low, high = (None if limit is None else self.folded(limit) for limit in said)
        return None if low is None or high is None else range(int(low), int(high) + 1)

    def is_fixed(self, expression: Any) -> bool:
        """Whether it holds parameters and constants only."""
        return all(is_known(self, one) for one in references(expression))

    def leaf(self, reference: tree.ComponentReference) -> "ClassMember | None":
        """The number, Boolean, text or choice to which a reference leads; None for all else."""
        one = self.component(reference)
        return one if one is not None and one.primitive is not None else None

    def component(self, reference: tree.ComponentReference) -> "ClassMember | None":
        """The component to which a reference leads, a number of a record for what stands behind it; None without one."""
        one: ClassMember | None = None
        for name, _ in reference.parts:
            here = self if one is None else one.sample
            one = here.members.get(name) if here is not None else None
            if one is None or one.primitive is not None:
                break
        return one


@dataclass(eq=False)
class ClassMember:
    """A component of an instance. kind: Real, Integer, Boolean, String, or an enumeration; "" for a class.

    first_sizes: those on which its further ones depend, as in A[:, size(A, 1)].
    """

    name: str
    element: Element
    owner: Structure
    first_sizes: list[int] = field(default_factory=list)

    @cached_property
    def over(self) -> Modifier:
        """What is said of it from outside of its instance."""
        return self.owner.modifier.of_member(self.name) or NOTHING

    @cached_property
    def clause(self) -> tuple[tree.ComponentClause, ClassScope]:
        """The clause that gives its type, and the class of the names in it."""
        for said in (self.over, self.element.modifier):
            found = said.member_clause
            if found is not None and said.redeclared is not None:
                if not {"replaceable", "redeclare"} & set(self.element.clause.prefixes):
                    words = f"found '{self.name}' redeclared, expected what is declared 'replaceable'"
                    said.redeclared.scope.refuse(said.at, words)
                return found, said.redeclared.scope
        return self.element.clause, self.element.scope

    @cached_property
    def plain_type(self) -> ClassScope:
        """Its class, without what is redeclared in it."""
        clause, scope = self.clause
        found, old = scope.find_class(clause.type, clause.at), self.element
        if clause is not old.clause:
            limit = old.clause.constraint or old.clause
            found.refuse_beyond(old.scope.find_class(limit.type, limit.at), scope, clause.at)
        return found

    @cached_property
    def own(self) -> Modifier:
        """What its own class and declaration say of it."""
        said = self.element.under(self.over)
        constraint = self.element.clause.constraint
        if constraint is not None:
            said = merged(said, read_arguments(constraint.arguments, self.element.scope))
        for one in self.chain:
            for _, modifier in one.bases:  # attributes of a type are those of each element
                each = {name: replace(said_of, each=True) for name, said_of in modifier.inner.items()}
                said = merged(said, replace(modifier, inner=each))
        return said if self.over.value is not None or said.value is not None else self._begun(said)

    def _begun(self, said: Modifier) -> Modifier:
        """The same with the value that an initial equation gives to a parameter with `fixed = false`."""
        free = is_false(said.inner.get("fixed", self.over.inner.get("fixed")))
        for section in self.owner.scope.sections if free and "parameter" in self.prefixes else ():
            for item in section.items if section.kind == "initial equation" else ():
                if isinstance(item, tree.SimpleEquation) and isinstance(item.left, tree.ComponentReference):
                    named = item.left.parts == ((self.name, ()),)
                    if named and self.owner.is_fixed(item.right):
                        self.owner.started.append(item)
                        return replace(said, value=item.right, scope=section.scope, at=item.at)
        return said

    @cached_property
    def full(self) -> Modifier:
        """All that is said of it."""
        return merged(self.over, self.own.seen_from(self.owner))

    @cached_property
    def chain(self) -> list[ClassScope]:
        """The classes from its type to a number, Boolean, text or enumeration; none for another class."""
        found, here = [], self.plain_type
        while here.is_primitive:
            found.append(here)
            if not here.bases:
                break
            here = here.bases[0][0]
        return found

    @property
    def primitive(self) -> ClassScope | None:
        """The class of the language that it is in the end; None for another class."""
        return self.chain[-1] if self.chain else None

    @property
    def is_object(self) -> bool:
        return self.primitive is None and self.plain_type.is_external_object

    @property
    def kind(self) -> str:
        return "" if self.primitive is None else self.primitive.definition.name

    @property
    def type_name(self) -> str:
        """Real, Integer, Boolean, String or the full name of an enumeration."""
        return "" if self.primitive is None else self.primitive.name

    @cached_property
    def prefixes(self) -> set[str]:
        """Words before its type, those of the names of its type among them."""
        bodies = (one.definition.body for one in self.chain)
        found = {word for body in bodies if isinstance(body, tree.ShortClass) for word in body.prefixes}
        return found | {*self.element.clause.prefixes, *self.clause[0].prefixes, *self.owner.prefixes}

    @property
    def literals(self) -> list[str] | None:
        """Names of the values of an enumeration; None for all else."""
        return None if self.primitive is None else self.primitive.literals

    @property
    def is_parameter(self) -> bool:
        stated = bool({"parameter", "constant"} & self.prefixes) and not (self.is_solved or self.follows)
        return stated or self.kind == "String"

    @cached_property
    def is_solved(self) -> bool:
        """Whether it is a parameter whose value initial equations determine: `fixed = false`."""
        return (
            is_false(self.full.inner.get("fixed"))
            and "parameter" in self.prefixes
            and self.full.value is None
        )

    @cached_property
    def follows(self) -> bool:
        """Whether its value is computed from that of such a parameter."""
        vars(self)["follows"] = False  # while it is asked for: circles are told with their values
        said = self.full
        found = references(said.value) if isinstance(said.value, tree.TreeNode) else []
        leaves = [(said.node or self.owner).leaf(one) for one in found]
        return any(one is not None and (one.is_solved or one.follows) for one in leaves)

    @property
    def is_folded(self) -> bool:
        """Whether its value is no symbol: a constant, a text, a choice, or what shapes the model."""
        shapes = self.name in self.owner.read or self.literals is not None
        return "constant" in self.prefixes or self.kind == "String" or (self.is_parameter and shapes)

    @cached_property
    def present(self) -> bool:
        """Whether its condition holds."""
        condition = self.element.declaration.condition
        if self.primitive is None and is_drawn(self.plain_type):
            return False
        if condition is None:
            return True
        if not isinstance(found := self.owner.interpreter(self.element.scope).value(condition), bool):
            self.element.scope.refuse(condition.at, f"found {found!r} as a condition, expected true or false")
        return found

    @cached_property
    def shape(self) -> tuple[int, ...]:
        """Its sizes."""
        clause, scope = self.clause
        sizes = [(s, self.element.scope) for s in self.element.declaration.subscripts]
        if clause is not self.element.clause:
            sizes = [(s, scope) for s in clause.components[0].subscripts] or sizes
        sizes += [(s, scope) for s in clause.subscripts]
        for one in self.chain:
            body = one.definition.body
            sizes += [(s, one) for s in body.subscripts] if isinstance(body, tree.ShortClass) else []
        for k, (size, scope) in enumerate(sizes):
            self.first_sizes.append(self._size(size, scope, k))
        return tuple(self.first_sizes)

    @property
    def sample(self) -> Structure | None:
        """The structure of one of its elements; None without any, as where only a call of a function tells the sizes."""
        with suppress(ModelError):
            return next(iter(self.children), None)

    def _size(self, size: tree.Expression, scope: ClassScope, dimension: int) -> int:
        if isinstance(size, tree.Mark) and size.word == ":":
            if self.full.value is None:
                words = f"found ':' as a size of '{self.name}' without a value, expected a value or a size"
                scope.refuse(size.at, words)
            listed = self.full.value if not (dimension or self.full.path) else None
            if isinstance(listed, tree.ArrayConstructor) and not listed.iterators:
                return len(listed.items)
            before = set(self.owner.read)
            found = np.shape(self.owner.folded(self.full))
            self.owner.read.intersection_update(before)
            return found[dimension]
        found = self.owner.interpreter(scope).value(size)
        if isinstance(found, np.ndarray) and found.size and isinstance(found.flat[0], EnumerationValue):
            return found.size  # an enumeration
        if isinstance(found, bool) or not isinstance(found, int) or found < 0:
            words = f"found {found!r} as a size of '{self.name}', expected a whole number of zero or more"
            scope.refuse(size.at, words)
        return found

    @cached_property
    def children(self) -> list[Structure]:
        """The structures of its elements, one for a scalar; none for what has no members."""
        if self.primitive is not None:
            return []
        if (meant := self._inner()) is not None:
            return meant.children
        clause, scope = self.clause
        kind = self.plain_type.redeclared(self.full)
        if "partial" in kind.definition.prefixes and "outer" not in self.prefixes:
            words = "which is partial, expected a class that extends it"
            scope.refuse(clause.at, f"found a component of {kind.name}, {words}")
        path = f"{self.owner.path}.{self.name}".lstrip(".")
        prefixes = frozenset({"parameter", "constant", "flow"} & self.prefixes)
        if any(one.scope.definition is kind.definition for one in self.owner.outward()):
            scope.refuse(clause.at, f"found a component of {kind.name} in itself, expected another class")
        return [
            Structure(kind, one, self.owner.library, path, prefixes, self.owner)
            for one in self.full.of_elements(self.shape)
        ]

    def _inner(self) -> "ClassMember | None":
        """The component that an `outer` means."""
        if self.owner.around is None or "outer" not in self.prefixes or "inner" in self.prefixes:
            return None
        known = (one.members[self.name] for one in self.owner.around.outward() if one.has(self.name))
        return next((one for one in known if "inner" in one.prefixes), None)
