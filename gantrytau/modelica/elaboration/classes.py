"""Classes of Modelica text as classes of the language: declarations in the body, equations that read the tree."""

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import reduce
from pathlib import Path
from typing import Any, ClassVar, Self, cast

import casadi as ca
import numpy as np

from gantrytau.border.refusal import ModelError
from gantrytau.language.declarations import Array, Discrete
from gantrytau.language.events import WhenChain
from gantrytau.language.model import Connector, Declared, Model, Outer
from gantrytau.language.symbols import der
from gantrytau.modelica import tree
from gantrytau.modelica.conditions import (
    AT_START,
    BEHIND,
    TURN,
    calls_before,
    chain_of,
    changed_in,
    checks_in,
    first_valued,
    followed_name,
    gives_value_before,
    guarded_samples,
    instants,
    is_call,
    outer_name,
    own_turn,
    sample_calls,
    sample_name,
    targets,
    whens_in,
)
from gantrytau.modelica.elaboration.algorithms import stated_by_algorithm
from gantrytau.modelica.elaboration.modifiers import Modifier, StatementSection, annotated, merged, plain
from gantrytau.modelica.elaboration.placed import Bound, PlacedMembers
from gantrytau.modelica.elaboration.quantities import add_quantity, keywords_of
from gantrytau.modelica.elaboration.scopes import ClassScope
from gantrytau.modelica.elaboration.statements import (
    AbsentComponent,
    remembers,
    stated,
)
from gantrytau.modelica.elaboration.structure import ClassMember, Structure
from gantrytau.modelica.elaboration.values import to_casadi
from gantrytau.modelica.elaboration.whens import at_start, begun, follows, set_by_whens
from gantrytau.modelica.overdetermined.records import closing, is_connector
from gantrytau.modelica.references import dotted, nodes_of, whole_name

TAKEN = "a name that is taken, expected another name"


class TextClass(Declared):
    """What classes of Modelica text have in common.

    structure: of an instance without modifications; _kinds: the restricted classes of which it is made; _taken: names that
    no component may have.
    """

    structure: ClassVar[Structure]
    _kinds: ClassVar[frozenset[str]] = frozenset({"model", "block", "connector", "record", "class"})
    _taken: ClassVar[frozenset[str]] = frozenset(
        {"equations", "initial_equations", "members", "modified"}
        | {"modifications", "chosen_starts", "shaped", "structure"}
    )
    first_index = 1
    checks_units = False

    def __init__(self, defaults: Mapping[str, Any] | None = None, /, **modifications: Any):
        super().__init__(defaults, **modifications)
        self.__class__ = type(self).shaped(self.modifications)

    def modified(self, modifications: Mapping[str, Any], starts: Iterable[str] | None = None) -> Self:
        found = super().modified(modifications, starts)
        found.__class__ = type(found).shaped(found.modifications)
        return found

    @classmethod
    def shaped(cls, modifications: Mapping[str, Any]) -> type[Self]:
        found = _shaping(cls.structure, modifications)
        if not found:
            return cls
        old = cls.structure
        above = Structure(old.scope, merged(plain(found), old.modifier), old.library, old.path)
        above.prepare()
        return class_of(above, cls)


class ModelicaModel(TextClass, Model):
    """A model, block or record of Modelica text."""

    def equations(self) -> Iterator[Any]:
        yield from _sections(self, initial=False)
        if AT_START in type(self).members():
            past = at_start((getattr(self, AT_START) == 0,))
            yield WhenChain((replace(past, waits=True),))
        for name in _followed(self.structure):
            old, turn = (getattr(self, followed_name(kind, name)) for kind in (BEHIND, TURN))
            now: Any = reduce(getattr, name.split("."), cast(Any, self))
            every = (one.elements() for one in (now, old, turn))
            yield from map(follows, *every)
        for name, one in self.structure.members.items():
            if one.present and one.is_solved and 0 not in one.shape:
                yield der(getattr(self, name)) == 0

    def initial_equations(self) -> Iterator[Any]:
        yield from _sections(self, initial=True)


class ModelicaConnector(TextClass, Connector):
    """A connector of Modelica text."""

    def closing(self, other: Any) -> Iterator[tuple[str, str, Any, Any, Any]]:
        """Residuals of a connection that closes a loop."""

        def residual(structure: Structure, one: Any, another: Any) -> Any:
            function = cast(ClassScope, structure.scope.inherited_class("equalityConstraint"))
            found = structure.library.call(function, [PlacedMembers(one), PlacedMembers(another)], {})
            return to_casadi(found) if np.size(found) else ca.SX(0, 1)

        yield from closing(self, other, residual)


def _shaping(structure: Structure, modifications: Mapping[str, Any]) -> dict[str, Any]:
    """Those of some modifications that change what shapes a model, nested."""
    found: dict[str, Any] = {}
    for name, given in modifications.items():
        one = structure.members.get(name) if isinstance(name, str) else None
        if one is None or not one.present:
            continue
        if one.own.final:
            raise ModelError(f"{structure.scope.name}: found '{name}' modified, which is final")
        value = given if isinstance(given, Mapping) else getattr(given, "value", given)
        if one.primitive is not None and one.is_folded:
            if isinstance(value, (bool, int, float, str)) and value != _known(one):
                found[name] = value
        elif one.primitive is None and isinstance(value, Mapping) and not one.shape:
            inner = _shaping(one.children[0], value)
            found |= {name: inner} if inner else {}
    return found


def _known(one: ClassMember) -> Any:
    return None if one.full.value is None else one.owner.member(one.name)


def class_of(structure: Structure, base: type[Any] | None = None) -> type[Any]:
    """The class of a structure all of whose sizes and conditions have been asked for; base: one it is a variant of."""
    scope = structure.scope
    kind: type[Any] = base or (ModelicaConnector if is_connector(structure) else ModelicaModel)
    _refuse_kind(structure, kind._kinds)
    body: dict[str, Any] = {
        "__module__": Path(scope.source.name).name,
        "structure": structure,
        "__doc__": scope.definition.description,
    }
    held = set(_held(structure))
    before = dict(_first_values(structure, held))
    for name, one in structure.members.items():
        if name in kind._taken or name.startswith("_"):
            scope.refuse(
                one.element.declaration.at,
                f"found a component '{name}', {TAKEN}",
            )
        if not one.present or one.is_object:
            body[name] = None
        elif "outer" in one.prefixes and "inner" not in one.prefixes:
            body[name] = Outer(Declared, name)
        elif one.primitive is not None:
            add_quantity(body, one, name in held, before.get(name))
        else:
            body[name] = _component(one)
            if {"inner", "outer"} <= one.prefixes:
                body[outer_name(name)] = Outer(Declared, name)
    tests = (test for item in whens_in(structure) for test, _ in item.branches)
    for call in (call for test in tests for call in sample_calls(test)):
        body[sample_name(call)] = Discrete(1e60, unit="s", description="next instant of sample()")
    guarded = map(sample_name, guarded_samples(whens_in(structure)))
    own = {n: tree.ComponentReference(0, ((n, ()),)) for n in _held_by_equations(structure)}
    integers = (own_turn(n) for n, one in own.items() if structure.values_of(one) is None)
    followed = _followed(structure)
    body["_followed"] = tuple(dict.fromkeys((*followed, *integers, *guarded)))
    for name in body["_followed"]:
        words = f"parity of the changes of {name}"
        body[followed_name(TURN, name)] = Discrete(0, shape=followed.get(name, ()), description=words)
    for name, shape in followed.items():
        body[followed_name(BEHIND, name)] = Discrete(0, shape=shape, description=f"{name} before an instant")
    taken = next((n for n in structure.members if isinstance(body.get(n), Discrete) and n not in held), None)
    if taken is not None:
        scope.refuse(structure.members[taken].element.declaration.at, f"found a component '{taken}', {TAKEN}")
    for call in (
        call for item in whens_in(structure) for _, items in item.branches for call in checks_in(items)
    ):
        body[sample_name(call)] = Discrete(0, description="1 where the run ends")
    if _asks_for_start(structure):
        body[AT_START] = Discrete(1.0, description="1 at the start, else 0")
    if not is_connector(structure):
        body["inner_names"] = frozenset(n for n, one in structure.members.items() if "inner" in one.prefixes)
        body["annotated_experiment"] = experiment_of(structure)
    return type(scope.definition.name, (kind,), body)


def _asks_for_start(structure: Structure) -> bool:
    """Whether `initial()` stands elsewhere than alone as a condition of `when`."""
    alone = {id(one) for item in whens_in(structure) for test, _ in item.branches for one in instants(test)}
    nodes = (node for section in structure.scope.sections for node in nodes_of(section.items))
    calls = (one for one in nodes if isinstance(one, tree.Call) and id(one) not in alone)
    return any(one.function.parts[0][0] == "initial" for one in calls)


def _refuse_kind(structure: Structure, kinds: Collection[str]) -> None:
    definition, name = structure.scope.definition, structure.scope.name
    streams = [n for n, one in structure.members.items() if "stream" in one.prefixes]
    if definition.kind not in kinds:
        words = " ".join((*definition.prefixes, definition.kind))
        found = f"the {words} {name}, expected a model, block, connector or record"
    elif streams:
        found = f"the stream variable '{streams[0]}', which is not supported, expected potentials and flows"
    elif structure.scope.is_external_object:
        found = f"{name}, an external object, which is not supported, expected equations"
    else:
        return
    structure.scope.refuse(definition.at, f"found {found}")


def _first_values(structure: Structure, held: Collection[str]) -> Iterator[tuple[str, Bound]]:
    """Names and values of the initial equations of what a `when` sets, as `pre(x) = 1` or `x = 1`."""
    for section in structure.scope.sections:
        for item in section.items if section.kind == "initial equation" else ():
            name = first_valued(item)
            if not isinstance(item, tree.SimpleEquation):
                continue
            names = chain_of(name, structure.scope.sections) if dotted(item.left) else [name]
            if is_call(item.right, "pre"):
                if chain_of(dotted(cast(Any, item.right).arguments[0]), structure.scope.sections)[-1] == name:
                    structure.started.append(item)  # holds by the equations between the two
            elif names[-1] in held and structure.is_fixed(item.right):
                structure.started.append(item)
                for one in filter(held.__contains__, names):
                    yield one, Bound(Modifier(item.right, section.scope, at=item.at), structure)


def _held_by_equations(structure: Structure) -> Iterator[str]:
    """Names of Booleans and Integers whose equations ask for values before."""
    if not any(one.asks_before for one in structure.scope.sections):
        return
    asked = _asked_before(structure)
    for section in _all_sections(structure):
        for item in section.items if section.kind == "equation" else ():
            left = item.left if isinstance(item, tree.SimpleEquation) else None
            if isinstance(left, tree.ComponentReference) and (
                remembers(item, structure) or left.parts[0][0] in asked
            ):
                yield left.parts[0][0]


def _held(structure: Structure) -> Iterator[str]:
    """Names of variables that a `when` or an equation with `pre` sets; of a record all members."""
    around, name = structure.around, structure.path.rpartition(".")[2]
    if around is not None and structure.scope.definition.kind == "record" and name in set(_held(around)):
        yield from structure.names()
    yield from _held_by_equations(structure)
    for item in whens_in(structure):
        for _, items in item.branches:
            yield from targets(items)


def _asked_before(structure: Structure) -> set[str]:
    """Names of the Booleans whose values before an instant are asked for."""
    tests = {id(one) for item in whens_in(structure) for test, _ in item.branches for one in instants(test)}
    running = [one for one in structure.scope.sections if one.asks_before and one.kind != "initial equation"]
    calls = (one for section in running for one in nodes_of(section.items))
    asked = [c for c in calls if isinstance(c, tree.Call) and id(c) not in tests and c.arguments]
    asked = [c.arguments[0] for c in asked if c.function.parts[0][0] == "pre"]
    names = {one.parts[0][0] for one in asked if isinstance(one, tree.ComponentReference)}
    known = (structure.members.get(name) for name in names)
    return {
        one.name for one in known if one and one.kind == "Boolean" and not one.is_parameter and not one.shape
    }


def _followed(structure: Structure) -> dict[str, tuple[int, ...]]:
    """Names and sizes of the variables that need a Discrete with their value before an instant."""
    branches = [branch for item in whens_in(structure) for branch in item.branches]
    changes = {name for test, items in branches for name in changed_in(test, items)}
    alone = {id(one) for test, _ in branches for one in instants(test)}
    said = [one.element.declaration.modification for one in structure.members.values()]
    found: dict[str, tuple[int, ...]] = {}
    for call in calls_before([said, [one.items for one in structure.scope.sections if one.asks_before]]):
        asked, name = call.function.parts[0][0], whole_name(call.arguments[0])
        one = structure.leaf(cast(tree.ComponentReference, call.arguments[0]))
        if one is None or one.is_parameter or 0 in one.shape or (asked == "edge" and id(call) in alone):
            continue
        number = one.kind == "Integer" or one.literals is not None
        beside = asked != "pre" or name in changes or ((number or one.shape) and name not in _held(structure))
        if beside and (number or one.kind == "Boolean"):
            found[name] = one.shape
    return found


def _all_sections(structure: Structure) -> Iterator[StatementSection]:
    """The sections of a class, and an equation for each value of a Boolean that is asked for before an instant."""
    yield from structure.scope.sections
    for one in map(structure.members.__getitem__, sorted(_asked_before(structure))):
        said = one.own
        if said.value is not None and one.over.value is None:
            name = tree.ComponentReference(said.at, ((one.name, ()),))
            found = tree.SimpleEquation(said.at, None, None, "=", name, said.value)
            yield StatementSection("equation", (found,), said.scope)


def _component(one: ClassMember) -> Any:
    """A component, or an array of components, with what its declaration says."""
    owner = one.owner
    if not one.shape:
        (child,) = one.children
        return _opened(class_of(child), keywords_of(child, one.own, owner))
    found = Array(Declared, 0)
    found.shape = one.shape
    first = _form(one.children[0]) if one.children else None
    for child, said in zip(one.children, one.own.of_elements(one.shape), strict=True):
        same = found.elements and _form(child) == first
        made: Any = found.component if same else class_of(child)
        found.component = found.component if found.elements else made
        found.elements.append(_opened(made, keywords_of(child, said, owner)))
    return found


def _form(structure: Structure) -> list[Any]:
    """What shapes an instance: elements of an array with equal forms are of one class."""
    found: list[Any] = []
    for name, one in structure.members.items():
        if one.primitive is None:
            found.append((name, one.present, one.shape, [*map(_form, one.children)]))
        else:
            found.append((name, str(_known(one)) if one.is_folded and one.full.value is not None else ""))
    return found


def _opened(cls: type[Any], keywords: Mapping[str, Any]) -> Any:
    found: Any = object.__new__(cls)
    Declared.__init__(found, **keywords)
    return found


def experiment_of(structure: Structure) -> dict[str, float]:
    """The numbers of the annotation `experiment`."""
    said = annotated(structure.scope.definition.annotation, "experiment")
    entries = [one for one in (said and said.arguments) or () if isinstance(one, tree.Argument)]
    found = {one.name: one.modification.value for one in entries if one.modification is not None}
    reader = structure.interpreter(structure.scope)
    return {n: float(reader.value(v)) for n, v in found.items() if isinstance(v, (tree.Number, tree.Unary))}


def _sections(instance: Any, initial: bool) -> Iterator[Any]:
    """The statements of the sections that hold at all times, or at the start."""
    structure: Structure = type(instance).structure
    held, firsts = set(_held(structure)), []
    for section in sorted(_all_sections(structure), key=lambda one: not one.kind.startswith("initial")):
        starts, steps = section.kind.startswith("initial"), section.kind.endswith("algorithm")
        items = [one for one in section.items if not any(one is other for other in structure.started)]
        if starts and not steps:
            items = (
                [i for i in items if first_valued(i) not in held and not gives_value_before(i)]
                if initial
                else set_by_whens(items, held)
            )
        if section.kind == "constraint" or (initial and not starts) or not items:
            continue
        reader = structure.interpreter(section.scope, PlacedMembers(instance))
        reader = replace(reader, settled=starts and not initial)  # pre(x) is what is set at the start
        try:
            if starts and (steps or not initial):
                named = set(targets(items)) - held if initial else held.intersection(targets(items))
                found = stated_by_algorithm(items, reader, named) if named else ()
            else:
                found = (stated_by_algorithm if steps else stated)(items, reader)
            if starts and not initial:
                firsts += found
            else:
                yield from (begun(one, firsts) for one in found)
        except AbsentComponent as error:
            raise ModelError(f"found {error} in an equation, expected a component that is there") from None
