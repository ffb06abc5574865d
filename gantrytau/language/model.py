"""Models and connectors: Python classes whose bodies hold declarations, and inert instances of them.

An instance remembers its modifications and nothing else; `gantrytau.flattening.instantiation` makes symbols of it.
"""

import copy
import functools
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, ClassVar, Self, TypeGuard

from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau.describing.described import Description
from gantrytau.describing.short_values import LENGTH, WHOLE, joined, short
from gantrytau.language.declarations import Array, Bounds, Fixed, Quantity, Start, is_setting
from gantrytau.language.self_description.described_model import model_described


class _Part:
    """What a class body may hold besides quantities and arrays."""


# names that are not offered behind a component
INNER = {"annotated_experiment", "checks_units", "chosen_starts", "drawn", "first_index"}
INNER |= {"inner_names", "members", "open", "shaped", "shapes"}
_PARTS = (Quantity, _Part)


def refuse_container(path: str, value: Any) -> None:
    """ModelError for a list, tuple or dict of components, which would be lost silently."""
    items = value.values() if isinstance(value, Mapping) else value
    if isinstance(value, (list, tuple, Mapping)) and any(isinstance(x, _PARTS) for x in items):
        raise ModelError(
            f"{path} is a {type(value).__name__} of declarations, which would not become part of the model; "
            "declare several components with Array(Component, count) and several numbers with Real(count)"
        )


class Declared(_Part):
    """Base of Model and Connector: declarations in the class body, modifications as keywords.

    first_index: of the elements of its arrays in names; checks_units: whether units that disagree are an error;
    inner_names: names of components that an `Outer` by name may mean.
    """

    first_index = 0
    checks_units = True
    inner_names: frozenset[str] = frozenset()

    def __init_subclass__(cls, **keywords: Any) -> None:
        super().__init_subclass__(**keywords)
        for name, value in vars(cls).items():
            refuse_container(f"{cls.__name__}.{name}", value)
            own = getattr(value, "__qualname__", "").startswith(f"{cls.__qualname__}.")
            if isinstance(value, type) and issubclass(value, Declared) and not own:
                raise ModelError(
                    f"{cls.__name__}.{name} is the class {value.__name__}, expected a component; write "
                    f"{name} = {value.__name__}()"
                )

    def __init__(self, defaults: Mapping[str, Any] | None = None, /, **modifications: Any):
        """Modify members by name; `defaults` are modifications that the keywords may override.

        Raises ModelError for a name that is not declared.
        """
        if defaults is not None and not isinstance(defaults, Mapping):
            names = [n for n, m in type(self).members().items() if isinstance(m, Quantity)]
            example = f"{type(self).__name__}({names[0] if names else 'name'}=...)"
            raise ModelError(
                f"{type(self).__name__}: found {defaults!r} without a name, expected keywords, as {example}"
            )
        self._modifications = merge(dict(defaults or {}), modifications)
        self._chosen_starts = frozenset(_starts(modifications))
        for name in self._modifications:
            check_member(type(self), name, type(self).__name__)

    @property
    def modifications(self) -> Mapping[str, Any]:
        """What was modified, by name."""
        return self._modifications

    @property
    def chosen_starts(self) -> frozenset[str]:
        """Names of variables whose start values whoever uses the class said, not its author; `carts.s` are all of them."""
        return self._chosen_starts

    def __repr__(self) -> str:
        """As it is made: `Cart(m=2.0, s=Start(0.5))`."""
        given = (f"{name}={_written(value)}" for name, value in vars(self).get("_modifications", {}).items())
        return f"{type(self).__name__}({joined(given, WHOLE)})"

    def __dir__(self) -> list[str]:
        return [name for name in super().__dir__() if name not in INNER]

    def _repr_html_(self) -> str:
        return self.__describe__().html()

    def __describe__(self, name: str = "") -> Description:
        return model_described(self, name)

    @classmethod
    def __describe_class__(cls, name: str = "") -> Description:
        return model_described(cls, name)

    @classmethod
    def open(cls, **modifications: Any) -> Self:
        """A component for a class body whose `__init__` gives it its values: its own `__init__` is left out."""
        found = cls.__new__(cls)
        Declared.__init__(found, **modifications)
        return found

    def modified(self, modifications: Mapping[str, Any], starts: Iterable[str] | None = None) -> Self:
        """The same with further modifications; ModelError for a name that is not declared.

        starts: names of variables of which they say the start values, where not all of them do.
        """
        for name in modifications:
            check_member(type(self), name, type(self).__name__)
        found = copy.copy(self)
        found._modifications = merge(dict(self._modifications), modifications)
        found._chosen_starts |= frozenset(_starts(modifications) if starts is None else starts)
        return found

    @classmethod
    def shaped(cls, modifications: Mapping[str, Any]) -> type[Self]:
        """The class of an instance with these modifications, where some say which members it has; else this class."""
        return cls

    @classmethod
    @functools.cache
    def members(cls) -> dict[str, Any]:
        """Declarations, components and arrays of the class and its bases, in order of declaration."""
        found: dict[str, Any] = {}
        for base in reversed(cls.__mro__):
            for name, value in vars(base).items():
                if isinstance(value, (Quantity, Declared, Array, Outer)):
                    found[name] = value
                elif name in found:
                    del found[name]
        return found


class Connector(Declared):
    """A set of potentials (`Real`) and flows (`Flow`) through which components are connected."""

    def closing(self, other: Any) -> Iterator[tuple[str, str, Any, Any, Any]]:
        """What makes this connector coincide with another one where a loop of propagated quantities closes.

        Words for it, the name of the flow that enforces it, the matrix that turns multipliers into that flow,
        the residual to which the multipliers belong, and its time derivative where it is zero.
        """
        yield from ()


class Model(Declared):
    """A component, a robot, a whole plant: declarations, then equations.

    Subclass it, declare quantities and components in the body, and yield the equations::

        class Oscillator(Model):
            m = Parameter(1.0, unit="kg", description="mass")
            c = Parameter(4.0, unit="N/m", description="stiffness")
            s = Real(unit="m", description="deflection", start=1.0, fixed=True)
            v = Real(unit="m/s", description="speed", start=0.0, fixed=True)

            def equations(self):
                yield der(self.s) == self.v
                yield self.m * der(self.v) == -self.c * self.s
    """

    drawn = True  # whether pictures show it and what is in it
    # what its author says of a simulation: `StopTime`, s
    annotated_experiment: ClassVar[Mapping[str, float]] = {}

    def equations(self) -> Iterator[Any]:
        """Equations (`a == b`) and connections (`connect(a, b)`), one per yield."""
        yield from ()

    def initial_equations(self) -> Iterator[Any]:
        """Equations that hold at the start only."""
        yield from ()


class Outer:
    """The component of a class that stands in this model or nearest around it: `world = Outer(World)`.

    name: of that component, where it is found by its name.
    """

    def __init__(self, component: type[Any], name: str = ""):
        self.component = component
        self.name = name

    def candidates(self, around: Any) -> list[Any]:
        """The components of an instance that it may mean."""
        found = vars(around)
        if self.name:
            return [found[self.name]] if self.name in found and self.name in type(around).inner_names else []
        return [x for x in found.values() if isinstance(x, self.component)]

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(
            f"Outer({self.component.__name__}) has no attribute '{name}' before instantiation"
        )


def outer(component: type[Any]) -> Any:
    """A reference to the nearest enclosing `component`, as Modelica's `outer`: `world = outer(World)`."""
    return Outer(component)


def merge(below: dict[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """Modifications `above` laid over those `below`; nested ones merge, all else replaces."""
    merged = dict(below)
    for name, value in above.items():
        old, value = _attributes(merged.get(name)), _attributes(value)
        if isinstance(old, Mapping) and isinstance(value, Mapping):
            value = merge(dict(old), value)
        elif isinstance(old, Declared) and isinstance(value, Mapping):
            value = old.modified(value)
        elif _elementwise(old) and _elementwise(value) and len(old) == len(value):
            value = [
                merge(dict(a), b) if isinstance(a, Mapping) and isinstance(b, Mapping) else b
                for a, b in zip(old, value, strict=True)
            ]
        elif _elementwise(old) and isinstance(value, Mapping):
            value = [merge(dict(a), value) if isinstance(a, Mapping) else value for a in old]
        merged[name] = value
    return merged


def _starts(modifications: Mapping[str, Any], path: str = "") -> Iterator[str]:
    """Dotted names of the variables whose start values are modified."""
    for key, value in modifications.items():
        name = f"{path}{key}"
        if isinstance(value, Start) or (isinstance(value, Mapping) and "start" in value):
            yield name
        elif isinstance(value, Mapping):
            yield from _starts(value, f"{name}.")
        elif isinstance(value, Declared):
            yield from (f"{name}.{inner}" for inner in value.chosen_starts)
        elif _elementwise(value):
            yield from _starts({f"{name}[{k}]": item for k, item in enumerate(value)})


def _attributes(value: Any) -> Any:
    """Start, Fixed and Bounds as the attributes that they set, so that one does not erase the other."""
    return value.attributes() if isinstance(value, (Start, Bounds)) else value


def _written(value: Any) -> str:
    """A modification as it is written, in few letters."""
    if isinstance(value, Mapping) and value.keys() <= {"start", "fixed"} and "start" in value:
        return repr((Fixed if value.get("fixed") else Start)(value["start"]))
    if isinstance(value, Mapping) and value.keys() <= {"min", "max"}:
        return repr(Bounds(**value))
    if isinstance(value, Mapping):
        return f"dict({joined((f'{name}={_written(one)}' for name, one in value.items()), LENGTH)})"
    return short(value)


def _elementwise(value: Any) -> TypeGuard[list[Any]]:
    return isinstance(value, list) and any(isinstance(item, (Mapping, Declared)) for item in value)


def check_member(cls: type[Any], name: str, path: str) -> None:
    """ModelError unless `name` is something of `cls` that a modification can set."""
    members = cls.members()
    if name in members or is_setting(getattr(cls, name, None), name):
        return

    def describe(member: str) -> str:
        found = members[member]
        return found.words() if isinstance(found, Quantity) else type(found).__name__

    raise ModelError(f"{path} has no '{name}'{did_you_mean(name, members, describe)}")
