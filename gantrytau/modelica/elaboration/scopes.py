"""Where names are looked up (Modelica 3.6, chapter 5): classes, what they inherit and import, and what lies around them."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NoReturn, cast

from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau.modelica import tree
from gantrytau.modelica.conditions import bound_pulses, is_call, read_section
from gantrytau.modelica.elaboration.modifiers import (
    Element,
    Modifier,
    StatementSection,
    merged,
    read_arguments,
    read_constraint,
    read_modification,
)
from gantrytau.modelica.optimizations import HORIZON
from gantrytau.modelica.parser import ELEMENT_SECTIONS
from gantrytau.modelica.source import SourceText


class TextError(ModelError):
    """A ModelError with the line of a text in its message."""


@dataclass(eq=False)
class ClassScope:
    """A class as a place of names. around: the class in which it stands; replaced: its redeclared classes by name.

    more: what a folder adds to a package, as a function of a name; predefined: whether it is of the language, as Real;
    limit: the class that it replaces, whose constraint modifies it where it has none of its own; is_implied: whether it is
    a package that a `within` names, but that is not read yet; heir: the package that inherits it and has its constants.
    """

    definition: tree.ClassDefinition
    source: SourceText
    around: "ClassScope | None"
    replaced: Mapping[str, "ClassScope"] = field(default_factory=dict)
    more: Callable[[str], "ClassScope | None"] | None = None
    predefined: bool = False
    limit: "ClassScope | None" = None
    is_implied: bool = False
    heir: "ClassScope | None" = None
    busy: bool = field(default=False, init=False)

    def refuse(self, at: int, words: str) -> NoReturn:
        """TextError with the line of an offset."""
        raise TextError(self.source.told(at, words))

    @cached_property
    def literals(self) -> list[str] | None:
        """Names of the values of an enumeration; None for another class."""
        body = self.definition.body
        if isinstance(body, tree.Enumeration):
            return [one.name for one in body.literals or ()]
        return self.bases[0][0].literals if isinstance(body, tree.ShortClass) else None

    @cached_property
    def name(self) -> str:
        """Full name of the class, with dots."""
        around = self.around.name if self.around else ""
        return f"{around}.{self.definition.name}".lstrip(".")

    @cached_property
    def root(self) -> "ClassScope":
        """The outermost scope, which holds the classes of all files."""
        return self.around.root if self.around else self

    @cached_property
    def items(self) -> tuple[tree.Element, ...]:
        """What the class itself declares."""
        return tuple(item for item, _ in self._items)

    @cached_property
    def _items(self) -> tuple[tuple[tree.Element, bool], ...]:
        """The same, each with whether it is protected."""
        body = self.definition.body
        sections = body.sections if isinstance(body, tree.Composition) else ()
        own = ((i, s.kind == "protected") for s in sections if s.kind in ELEMENT_SECTIONS for i in s.items)
        return tuple((i, protected) for i, protected in own if isinstance(i, tree.Element))

    @cached_property
    def classes(self) -> dict[str, "ClassScope"]:
        """The classes that stand in it."""
        own = (i for i in self.items if isinstance(i, tree.ClassDefinition))
        found = {i.name: ClassScope(i, self.source, self) for i in own}
        new = self.replaced
        return found | {name: replace(new[name], limit=old) for name, old in found.items() if name in new}

    @cached_property
    def declared(self) -> dict[str, Element]:
        """The components that the class itself declares."""
        found: dict[str, Element] = {}
        clauses = ((i, hidden) for i, hidden in self._items if isinstance(i, tree.ComponentClause))
        for clause, protected in clauses:
            for one in clause.components:
                if one.name in found:
                    self.refuse(one.at, f"found a second component '{one.name}' of {self.name}, expected one")
                said = read_modification(one.modification, self, final="final" in clause.prefixes)
                said = (
                    replace(said, value=None) if is_call(said.value, "sample") else said
                )  # a section has it
                found[one.name] = Element(clause, one, self, said, protected)
        return found

    @cached_property
    def bases(self) -> tuple[tuple["ClassScope", Modifier], ...]:
        """The classes that it extends, with the modifications of each."""
        if self.busy:
            self.refuse(self.definition.at, f"found {self.name} among its own bases, expected no circle")
        self.busy = True
        try:
            found = tuple(self._inherited())
            for base, _ in found:
                base.bases  # noqa: B018  (a circle is told here)
            return found
        finally:
            self.busy = False

    def _inherited(self) -> Iterator[tuple["ClassScope", Modifier]]:
        body = self.definition.body
        if isinstance(body, tree.ShortClass):
            yield self._base(body.type, body.at, body.arguments)
        elif self.extends_its_name:
            yield self._former()
        for item in self.items:
            if isinstance(item, tree.Extends):
                yield self._base(item.type, item.at, item.arguments)

    @property
    def extends_its_name(self) -> bool:
        """Whether it is declared by `redeclare class extends`."""
        return isinstance(self.definition.body, tree.Composition) and self.definition.body.extends

    def _former(self) -> tuple["ClassScope", Modifier]:
        """The class of its name that the class around it inherits, with the modifications of it."""
        name, at = self.definition.name, self.definition.at
        inherited = (base.inherited_class(name) for base, _ in (self.around.bases if self.around else ()))
        found = next((one.limit or one for one in inherited if one is not None), None)
        if found is None:
            return self.refuse(at, f"found '{name}' behind 'extends', expected an inherited class")
        if not {"replaceable", "redeclare"} & set(found.definition.prefixes):
            self.refuse(at, f"found {found.name} extended anew, expected a class declared 'replaceable'")
        modifier = read_arguments(cast(tree.Composition, self.definition.body).arguments, self)
        return found.redeclared(modifier), modifier

    def _base(
        self, name: str, at: int, arguments: tuple[tree.AnyArgument, ...] | None
    ) -> tuple["ClassScope", Modifier]:
        start = self.around if isinstance(self.definition.body, tree.ShortClass) and self.around else self
        base = start.find_class(name, at, inherited=False)
        limits = (self, self.limit) if isinstance(self.definition.body, tree.ShortClass) else ()
        modifier = merged(read_arguments(arguments, start), read_constraint(*limits))
        own = self.classes.items()
        anew = {n: x for n, x in own if "redeclare" in x.definition.prefixes or x.extends_its_name}
        found = base.redeclared(modifier).with_replaced({**anew, **self.replaced})
        if base.definition.kind == "package" and (modifier.inner or self.declared or self.heir):
            found = replace(found, heir=self.heir or self)
        return found, modifier

    def with_replaced(self, classes: Mapping[str, "ClassScope"]) -> "ClassScope":
        """The class with others in the place of those that it holds or inherits under these names."""
        return replace(self, replaced={**self.replaced, **classes}) if classes else self

    def redeclared(self, modifier: Modifier) -> "ClassScope":
        """The class as a modification that redeclares classes in it makes it."""
        found = {}
        for name, one in modifier.inner.items():
            if one.redeclared is not None and isinstance(one.redeclared.element, tree.ClassDefinition):
                scope = one.redeclared.scope
                self._check_replaceable(name, one, scope)
                found[name] = ClassScope(one.redeclared.element, scope.source, scope)
        return self.with_replaced(found)

    def _check_replaceable(self, name: str, one: Modifier, scope: "ClassScope") -> None:
        old = self.inherited_class(name)
        if old is None:
            scope.refuse(
                one.at,
                f"found '{name}' redeclared, expected a class of {self.name}{did_you_mean(name, self.names())}",
            )
        if not {"replaceable", "redeclare"} & set(old.definition.prefixes):
            scope.refuse(one.at, f"found {old.name} redeclared, expected a class declared 'replaceable'")

    def refuse_beyond(self, limit: "ClassScope", place: "ClassScope", at: int) -> None:
        """TextError where this class lacks a public component of the class that constrains what may replace it."""
        for name, one in limit.elements.items():
            if not one.protected and name not in self.elements:
                words = f"found {self.name} for what {limit.name} constrains, but it has no '{name}'"
                place.refuse(at, f"{words}, expected a class with all components of {limit.name}")

    def check_replaced(self) -> None:
        """TextError for a redeclared class, here or in what it extends, that its constraint does not allow."""
        plain = ClassScope(self.definition, self.source, self.around, more=self.more)
        for name, new in self.replaced.items():
            old = plain.inherited_class(name)
            if old is not None and old.definition is not new.definition and old.around is not None:
                constraint = old.definition.constraint
                limit = old if constraint is None else old.around.find_class(constraint.type, constraint.at)
                new.refuse_beyond(limit, new, new.definition.at)
        for base, _ in self.bases:
            base.check_replaced()

    @cached_property
    def elements(self) -> dict[str, Element]:
        """All components in the order of their declarations, inherited ones with their modifications."""
        found: dict[str, Element] = {}
        hidden = [False] * self.extends_its_name
        hidden += [protected for item, protected in self._items if isinstance(item, tree.Extends)]
        for k, (base, modifier) in enumerate(self.bases):
            for name, element in base.elements.items():
                over = modifier.inner.get(name)
                if over is not None:
                    element = replace(element, modifier=merged(over, element.under(over)))
                if name in found and found[name].scope.definition.name != HORIZON:
                    self._check_same(found[name], element)
                found[name] = replace(element, protected=True) if any(hidden[k : k + 1]) else element
            base.check_modified(modifier)
        for name, element in self.declared.items():
            old = found.get(name)
            if old is not None and "redeclare" in element.clause.prefixes:
                element = replace(element, modifier=merged(element.modifier, old.modifier))
            elif old is not None:
                self._check_same(old, element)
            found[name] = element
        return found

    def _check_same(self, one: Element, other: Element) -> None:
        """TextError for two declarations of one name that say different things."""
        said = one.stated == other.stated and one.modifier.says_the_same(other.modifier)
        kinds = [x.scope.find_class(x.clause.type, x.clause.at) for x in (one, other)] if said else []
        if not said or kinds[0].definition != kinds[1].definition:
            at = other.declaration.at if other.scope is self else self.definition.at
            self._refuse_different(one.declaration.name, one.scope, other.scope, at)

    def _refuse_different(self, name: str, one: "ClassScope", other: "ClassScope", at: int) -> NoReturn:
        words = f"found '{name}' declared differently in {one.name} and in {other.name}"
        self.refuse(at, f"{words}, expected one declaration; rename one, or modify it where it is inherited")

    def check_modified(self, modifier: Modifier) -> None:
        """TextError for a modification of what the class does not have."""
        for name, one in modifier.inner.items():
            a_class = one.redeclared is not None and one.member_clause is None
            if not (name in self.elements or a_class or one.scope is None or self.is_primitive):
                hint = did_you_mean(name, self.elements)
                one.scope.refuse(one.at, f"found '{name}' modified, which {self.name} lacks{hint}")

    @cached_property
    def is_primitive(self) -> bool:
        """Whether it is a number, a Boolean, a text or an enumeration, by whatever names."""
        if self.predefined or isinstance(self.definition.body, tree.Enumeration):
            return True
        return len(self.bases) == 1 and self.bases[0][0].is_primitive and not self.declared

    @cached_property
    def is_external_object(self) -> bool:
        return any(base.definition.name == "ExternalObject" for base, _ in self.bases)

    @cached_property
    def sections(self) -> tuple[StatementSection, ...]:
        """Equations and algorithms, those of bases first."""
        found = [section for base, _ in self.bases for section in base.sections]
        body = self.definition.body
        for one in body.sections if isinstance(body, tree.Composition) else ():
            if one.kind not in ELEMENT_SECTIONS:
                found.append(StatementSection(*read_section(one), self))
        if pulses := tuple(bound_pulses(self.declared)):
            found.append(StatementSection("equation", pulses, self))
        return tuple(found)

    def names(self) -> list[str]:
        """Names of classes and components, for messages."""
        inherited = (name for base, _ in self.bases for name in base.names())
        return [*dict.fromkeys((*self.classes, *self.declared, *inherited))]

    def own_class(self, name: str) -> "ClassScope | None":
        """The class of that name that stands in it."""
        found = self.classes.get(name)
        if found is None and self.more is not None:
            found = self.more(name)
            if found is not None:
                found = found if self.heir is None else replace(found, around=self)
                self.classes[name] = found
        return found

    def inherited_class(self, name: str) -> "ClassScope | None":
        """The class of that name in it or in what it extends."""
        if (found := self.own_class(name)) is not None:
            return found
        inherited = [x for base, _ in self.bases if (x := base.inherited_class(name)) is not None]
        other = next((x for x in inherited if x.definition != inherited[0].definition), None)
        if other is not None and inherited[0].around and other.around:
            self._refuse_different(name, inherited[0].around, other.around, self.definition.at)
        return next(iter(inherited), None)

    @cached_property
    def _imports(self) -> list[tree.Import]:
        found = [one for one in self.items if isinstance(one, tree.Import)]
        return sorted(found, key=lambda one: one.names == ("*",))

    def imports(self, name: str) -> Iterator[tuple["ClassScope", str, tree.Import]]:
        """What imports may make of a name: a class, the name in it, and the import; those of single names first."""
        for item in self._imports:
            package, _, last = item.name.rpartition(".")
            if item.names is not None and (name in item.names or item.names == ("*",)):
                yield self.find_class(f".{item.name}", item.at), name, item
            elif item.names is None and name == (item.alias or last):
                yield self.find_class(f".{package}", item.at) if package else self.root, last, item

    def imported(self, name: str) -> "ClassScope | None":
        """The class that an import makes of a name."""
        self._check_imports(name)
        for owner, inner, item in self.imports(name):
            found = owner.inherited_class(inner)
            if found is not None:
                return found
            if item.names != ("*",) and inner not in owner.elements and inner not in (owner.literals or ()):
                hint = did_you_mean(inner, owner.names())
                self.refuse(item.at, f"found '{inner}', which {owner.name} does not have{hint}")
        return None

    def imported_literal(self, name: str) -> "tuple[ClassScope, str] | None":
        """The enumeration and the name of its value that an import, here or further out, means by a name."""
        return next(
            ((one, inner) for one, inner in self._places(name) if inner in (one.literals or ())), None
        )

    def _check_imports(self, name: str) -> None:
        """TextError where two imports of one kind, of single names or of all names, make different things of a name."""
        found: dict[bool, tuple[ClassScope, str]] = {}
        for owner, inner, item in self.imports(name) if len(self._imports) > 1 else ():
            general = item.names == ("*",)
            if general and owner.inherited_class(inner) is None and inner not in owner.elements:
                continue
            other, called = found.setdefault(general, (owner, inner))
            if (other, called) != (owner, inner):
                self.refuse(
                    item.at,
                    f"found '{name}' imported as {other.name}.{called} and as {owner.name}.{inner}, expected one; "
                    f"write the whole name, or import one under another name, as 'import {name}2 = {owner.name}.{inner}'",
                )

    def first(self, name: str, inherited: bool = True) -> "ClassScope | None":
        """The class that a simple name means here or further out."""
        return next(self._meanings(name, inherited), None)

    def _meanings(self, name: str, inherited: bool) -> Iterator["ClassScope"]:
        """The classes of a simple name here and further out, the innermost first."""
        here: ClassScope | None = self
        while here is not None:
            found = here.own_class(name) or here.imported(name)
            if found is None and (inherited or here is not self) and not here.busy:
                found = here.inherited_class(name)
            if found is not None:
                yield found
            here = here.root if "encapsulated" in here.definition.prefixes and here.around else here.around

    def constant(self, name: str) -> "tuple[ClassScope, Element] | None":
        """The component that a simple name means in a class around this one, and that class."""
        known = ((one.heir or one, inner) for one, inner in self._places(name) if inner in one.elements)
        return next(((one, one.elements[inner]) for one, inner in known), None)

    def _places(self, name: str) -> Iterator[tuple["ClassScope", str]]:
        """The classes in which a simple name may mean a constant, with its name there: here, by imports, further out."""
        here: ClassScope | None = self
        while here is not None:
            here._check_imports(name)
            yield here, name
            yield from ((owner, inner) for owner, inner, _ in here.imports(name))
            here = here.around

    def find_class(self, name: str, at: int, inherited: bool = True) -> "ClassScope":
        """The class that a name with dots means; ModelError with the line of an offset where there is none."""
        start, name = (self.root, name[1:]) if name.startswith(".") else (self, name)
        first, *rest = [name] if self.source.base and self.first(name) else name.split(".")
        wrong: tuple[ClassScope, str] | None = None
        for found in start._meanings(first, inherited):
            left = rest  # where one is missing, a class further out is meant
            while left and (inner := found.inherited_class(left[0])) is not None:
                found, left = inner, left[1:]
            if not left:
                return found
            wrong = wrong or (found, left[0])
        if wrong is not None:
            hint = did_you_mean(wrong[1], wrong[0].names())
            words = f", but {wrong[0].name} has no class '{wrong[1]}'{hint}"
        else:
            hint = did_you_mean(first, near) if (near := start.known_names()) else "."
            words = f", expected the name of a class{hint} A library is given by its folder: libraries=[...], --library"
        return self.refuse(at, f"found '{name}'{words}")

    def known_names(self) -> list[str]:
        """Names of classes that can be said here, for messages."""
        return [*dict.fromkeys((*self.classes, *(self.around.known_names() if self.around else ())))]
