"""From an inert model to one whose members are symbols: modifications applied, paths given, symbols made."""

import inspect
import re
import weakref
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from gantrytau.border.refusal import ModelError
from gantrytau.border.units import shape_of
from gantrytau.language.declarations import Array, Bounds, Parameter, Quantity, Start, evaluate, is_setting
from gantrytau.language.events import CurrentMode, Mode, mode_number
from gantrytau.language.model import (
    Connector,
    Declared,
    Model,
    Outer,
    check_member,
    refuse_container,
)
from gantrytau.language.symbols import Symbols, element_names, time

ATTRIBUTES = (
    "start", "fixed", "min", "max", "nominal", "prefer", "value", "unit", "display", "description",
    "undetermined", "free",
)  # fmt: skip


class Leaf(NamedTuple):
    """A modification and the instance in which its formulas are to be read.

    more: modifications of a component that replaces another, from further out.
    """

    value: Any
    scope: Any
    more: Mapping[Any, Any] = MappingProxyType({})


@dataclass(eq=False)
class Placed:
    """A quantity of the instantiated model while its attributes are still formulas."""

    path: str
    name: str
    declaration: Quantity
    shape: tuple[int, ...]
    symbol: ca.SX
    attributes: dict[str, Leaf]
    elements: list[str] = field(default_factory=list)
    chosen: bool = False  # whether the start is said by whoever uses the model


@dataclass(eq=False)
class Instance:
    """An instantiated model: the root whose members are symbols, and lists of all that is in it."""

    root: Any = None
    symbols: Symbols = field(default_factory=Symbols)
    quantities: list[Placed] = field(default_factory=list)
    components: list[tuple[str, Any]] = field(default_factory=list)
    # path, connector, path of the component it belongs to
    connectors: list[tuple[str, Any, str]] = field(default_factory=list)
    paths: dict[int, str] = field(default_factory=dict)  # id of a component or connector -> its path

    def path(self, member: Any) -> str:
        """The dotted path of a component or connector of this model."""
        return self.paths[id(member)]


def _made(kind: Any) -> Model:
    """An instance of a class whose parameters all have values."""
    try:
        inspect.signature(kind).bind()
    except TypeError as error:
        raise ModelError(
            f"{kind.__name__}: found the class, which needs arguments ({error}), expected an instance; write "
            f"{kind.__name__}(...)"
        ) from None
    return kind()


def instantiate(model: Model) -> Instance:
    """A fresh instance of `model` with symbols of its own; ModelError with the path of what is wrong."""
    if isinstance(model, type) and issubclass(model, Model):
        model = _made(model)
    if not isinstance(model, Model):
        raise ModelError(f"found {type(model).__name__}, expected a Model (an instance, or its class)")
    found = _Growing(chosen=model.chosen_starts)
    found.root = found.build(model, "", {}, None, [])
    found.resolve_outers()
    return found


@dataclass(eq=False)
class _Growing(Instance):
    """An instance while it is built. chosen: starts that whoever uses the model said; outers: references to resolve."""

    chosen: frozenset[str] = frozenset()
    outers: list[tuple[Any, str, Outer, list[Any]]] = field(default_factory=list)

    def build(self, template: Declared, path: str, outer: Mapping[Any, Any], scope: Any, around: list[Any]):
        modifications = _merge(_wrap(template.modifications, scope), outer)
        cls = type(template).shaped(modifications)
        instance = cls.__new__(cls)
        for name, value in vars(template).items():
            if name in ("_modifications", "_chosen_starts"):
                continue
            refuse_container(f"{path or cls.__name__}.{name}", value)
            if isinstance(value, (Declared, Quantity, Array)):
                raise ModelError(
                    f"{path or cls.__name__}.{name} is assigned in __init__, where it would be lost; "
                    "declare it in the class body and modify it by keyword"
                )
            instance.__dict__[name] = value
        self.paths[id(instance)] = path
        instance.__dict__["_around"] = weakref.ref(around[-1]) if around else None
        for name in modifications:
            check_member(cls, name, f"{path} ({cls.__name__})" if path else cls.__name__)
            if is_setting(getattr(cls, name), name):
                instance.__dict__[name] = _setting(modifications[name], f"{path}.{name}")
        if isinstance(instance, Connector):
            owner = next((one for one in reversed(around) if not isinstance(one, Connector)), None)
            self.connectors.append((path, instance, "" if owner is None else self.paths[id(owner)]))
        else:
            self.components.append((path, instance))
        members = cls.members()
        quantities = {name: m for name, m in members.items() if isinstance(m, Quantity)}
        for name, member in quantities.items():
            self._quantity(instance, path, name, member, modifications.get(name))
        for name, member in members.items():
            if name not in quantities:
                self._component(instance, path, name, member, modifications.get(name, {}), around)
        return instance

    def _component(
        self, instance: Any, path: str, name: str, member: Any, modification: Any, around: list[Any]
    ):
        place = f"{path}.{name}" if path else name
        scope = instance
        if isinstance(modification, Leaf):  # redeclaration
            wanted, scope = modification.value, modification.scope
            if not isinstance(wanted, (Declared, Array)) or isinstance(wanted, Array) != isinstance(
                member, Array
            ):
                raise ModelError(
                    f"{place}: found {wanted!r} as modification, expected a component that replaces "
                    f"{type(member).__name__}, or dict(...) to modify it"
                )
            member, modification = wanted, modification.more
        if isinstance(member, Outer):
            self.outers.append((instance, name, member, around if member.name else [*around, instance]))
        elif isinstance(member, Array):
            common = {key: value for key, value in modification.items() if isinstance(key, str)}
            count = 1 + max((key for key in modification if isinstance(key, int)), default=-1)
            if count not in (0, len(member)):
                raise ModelError(
                    f"{place}: found {count} modifications, expected one for each of {len(member)}"
                )
            built, places = [], member.names(place, instance.first_index)
            for index, (place, element) in enumerate(zip(places, member, strict=True)):
                one = modification.get(index, {})
                here, own = scope, one
                if isinstance(one, Leaf):
                    element, here, own = one.value, one.scope, one.more
                built.append(
                    self.build(
                        element,
                        place,
                        _merge(common, own),
                        here,
                        [*around, instance],
                    )
                )
            instance.__dict__[name] = tuple(built)
        else:
            instance.__dict__[name] = self.build(member, place, modification, scope, [*around, instance])

    def _quantity(self, instance: Any, path: str, name: str, declaration: Quantity, modification: Any):
        full = f"{path}.{name}" if path else name
        if full == time.name():
            raise ModelError(
                f"{full}: found a quantity of the outermost model with the name of the time, of which there is one in every "
                f"model; expected another name, as {full}_left"
            )
        declared = vars(declaration)
        attributes = {
            key: Leaf(declared[key], instance) for key in ATTRIBUTES if declared.get(key) is not None
        }
        if (
            isinstance(modification, Leaf)
            and isinstance(modification.value, Quantity)
            and not modification.value.name
        ):
            # an unnamed declaration replaces this one: mass=Free(9.0)
            declaration = modification.value
            said = {key: getattr(declaration, key, None) for key in ATTRIBUTES}
            stated = {
                key: x for key, x in said.items() if x is not None and not (isinstance(x, str) and x == "")
            }
            attributes |= _wrap(stated, modification.scope)
        elif modification is not None:
            changes = _attributes(modification, full)
            if isinstance(declaration, Parameter) and changes.keys() & {"start", "fixed"}:
                raise ModelError(
                    f"{full}: found a start value, but it is a parameter, which has one value; write "
                    f"{name}=... with the number"
                )
            if "free" in changes and not isinstance(declaration, Parameter):
                raise ModelError(
                    f"{full}: found 'free' for a variable, expected a parameter; declare it as Input"
                )
            attributes |= changes
        shape = _shape(declaration, attributes, instance, full)
        names = element_names(full, shape, instance.first_index)
        kind = declaration.kind
        scalars = [self.symbols.add(element, kind).sx for element in names]
        symbol = ca.vertcat(*scalars) if len(scalars) > 1 else scalars[0]
        if len(shape) == 2:
            symbol = ca.reshape(symbol, *shape)
        instance.__dict__[name] = symbol
        if isinstance(declaration, Mode):
            if "start" in attributes:
                start = attributes["start"]
                number = mode_number(full, declaration.names, start.value)
                attributes["start"] = start._replace(value=number)
            if "value" in attributes:
                raise ModelError(
                    f"{full}: found the value {attributes['value'].value!r} for a Mode, which transitions change, expected "
                    f"a start; write {name}=Start('{declaration.names[-1]}')"
                )
            instance.__dict__[name] = CurrentMode(symbol, declaration.names, full)
        chosen = bool(self.chosen) and bool({full, re.sub(r"\[\d+\]", "", full)} & self.chosen)
        self.quantities.append(Placed(path, full, declaration, shape, symbol, attributes, names, chosen))

    def resolve_outers(self) -> None:
        for instance, name, wanted, around in self.outers:
            for enclosing in reversed(around):
                found = wanted.candidates(enclosing)
                if len(found) > 1:
                    kind = wanted.component.__name__
                    raise ModelError(
                        f"{self.paths[id(enclosing)] or type(enclosing).__name__}: found "
                        f"{' and '.join(self.paths[id(x)] for x in found)}, each a {kind}, of which "
                        f"{self.paths[id(instance)]} cannot choose, expected one; other frames that do not move are Fixed"
                    )
                if found and found[0] is not instance:
                    instance.__dict__[name] = found[0]
                    break
            else:
                place = self.paths[id(instance)] or type(instance).__name__
                kind = wanted.component.__name__
                if wanted.name:
                    raise ModelError(
                        f"{place} ({type(instance).__name__}): found no 'inner' {wanted.name} in any model around it, "
                        f"expected one; declare it in {type(around[0]).__name__}"
                    )
                raise ModelError(
                    f"{place} ({type(instance).__name__}): found no {kind} in any model around it, expected one; "
                    f"declare `{kind.lower()} = {kind}()` in the body of {type(around[0]).__name__}"
                )


def _setting(modification: Any, path: str) -> Any:
    if isinstance(modification, Leaf) and isinstance(modification.value, (bool, int, float, str)):
        return modification.value
    raise ModelError(f"{path}: found a modification that is no plain value, expected a number, bool or text")


def _shape(
    declaration: Quantity, attributes: Mapping[str, Leaf], instance: Any, path: str
) -> tuple[int, ...]:
    shape = evaluate(declaration.declared_shape, instance)
    if (
        isinstance(declaration, Parameter)
        and shape == ()
        and declaration.value is None
        and "value" in attributes
    ):
        value = attributes["value"].value
        if isinstance(value, (int, float, str, list, tuple, np.ndarray)):
            shape = shape_of(value)
    if isinstance(shape, (int, np.integer)):
        shape = (int(shape),)
    if not isinstance(shape, tuple) or len(shape) > 2 or any(not isinstance(n, int) or n < 1 for n in shape):
        raise ModelError(f"{path}: found shape {shape!r}, expected (), a positive int, or two of them")
    return shape


def _attributes(modification: Any, path: str) -> dict[str, Leaf]:
    """The attributes that a modification of a variable or parameter sets."""
    if isinstance(modification, Leaf):
        if isinstance(modification.value, (Start, Bounds)):
            return _wrap_value(modification.value, modification.scope)
        if isinstance(modification.value, (Declared, Array)):
            raise ModelError(f"{path}: found a component as modification of a quantity, expected a value")
        return {"value": modification}
    unknown = set(modification) - set(ATTRIBUTES)
    if unknown:
        raise ModelError(f"{path} has no attribute '{unknown.pop()}'; there is {', '.join(ATTRIBUTES)}.")
    return dict(modification)


def _wrap(modifications: Mapping[str, Any], scope: Any) -> dict[Any, Any]:
    return {name: _wrap_value(value, scope) for name, value in modifications.items()}


def _wrap_value(value: Any, scope: Any) -> Any:
    if isinstance(value, (Start, Bounds)):  # attributes, so that one does not erase the other
        return _wrap(value.attributes(), scope)
    if isinstance(value, Mapping):
        return _wrap(value, scope)
    if isinstance(value, list) and any(isinstance(item, (Mapping, Declared)) for item in value):
        return {index: _wrap_value(item, scope) for index, item in enumerate(value)}
    return Leaf(value, scope)


def _replaces(modification: Any) -> bool:
    """Whether a modification is a component in place of another."""
    return isinstance(modification, Leaf) and isinstance(modification.value, Declared)


def _merge(below: Mapping[Any, Any], above: Mapping[Any, Any]) -> dict[Any, Any]:
    merged = dict(below)
    numbered = [key for key in below if isinstance(key, int)]
    for key, value in above.items():
        if numbered and isinstance(key, str):  # for every element of an array
            for index in numbered:
                if isinstance(merged[index], dict):
                    merged[index] = _merge(merged[index], {key: value})
        elif isinstance(merged.get(key), dict) and isinstance(value, dict):
            merged[key] = _merge(merged[key], value)
        elif _replaces(merged.get(key)) and isinstance(value, dict):
            merged[key] = merged[key]._replace(more=_merge(merged[key].more, value))
        else:
            merged[key] = value
    return merged
