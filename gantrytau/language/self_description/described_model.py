"""What is said of models and connectors, classes and instances: parameters, connectors, variables, components, settings.

Nothing is flattened. Values of an instance are those it was given; formulas of parameters are computed where what they
need has numbers, and told as formulas where it has none.
"""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau.border.units import scale
from gantrytau.describing.describe import class_described, first_sentence
from gantrytau.describing.described import Description, Listing
from gantrytau.describing.short_values import array_words, cut, short
from gantrytau.language.declarations import (
    Array,
    Bounds,
    Formula,
    Parameter,
    Quantity,
    Start,
    StateSelect,
    is_setting,
)
from gantrytau.language.events import Mode
from gantrytau.language.self_description.placed_parts import NUMBERS, PlacedPart, in_si, number_of

HEADINGS = {  # kind of a quantity or of another row -> heading, in the order in which they are told
    "parameter": "Parameters",
    "setting": "Settings",
    "connector": "Connectors",
    "input": "Inputs",
    "output": "Outputs",
    "real": "Variables",
    "flow": "Flows",
    "propagated": "Passed along",
    "discrete": "Discrete variables",
    "component": "Components",
    "outer": "Around it",
}
ATTRIBUTES = ("start", "fixed", "min", "max", "nominal", "prefer", "undetermined", "assumed")
HIDDEN = {"drawn", "first_index", "checks_units"}  # settings of every model


def model_described(thing: Any, name: str = "") -> Description:
    """What is said of a model or a connector, class or instance, or of a part or a quantity of it by its dotted name.

    Raises ModelError for a name that is not there.
    """
    own = isinstance(thing, type)
    kind = thing if own else type(thing)
    whole = PlacedPart(kind, {} if own else getattr(thing, "modifications", {}), given=not own)
    if not name:
        return _of_part(whole, kind.__name__)
    if own and name.partition("[")[0] not in whole.members and name.isidentifier() and hasattr(kind, name):
        return class_described(thing, name)
    return _found(whole, name, kind.__name__)


def _found(part: PlacedPart, name: str, title: str) -> Description:
    """What a dotted name means within a part."""
    first, _, rest = name.partition(".")
    plain, _, index = first.partition("[")
    member = part.members.get(plain)
    if member is None:
        hint = did_you_mean(plain, [*part.members, *_settings(part.kind)])
        words = f"{part.path.rstrip('.') or title} has no '{plain}'{hint}"
        raise ModelError(words, place="describe", argument="name")
    if isinstance(member, Quantity):
        if rest:
            words = f"{plain} is a {type(member).__name__}, which has no parts; ask for '{first}'"
            raise ModelError(f"found '{name}', but ", words, place="describe", argument="name")
        return _of_quantity(part, plain)
    if not hasattr(member, "members") and not isinstance(member, Array):
        return Description(f"{part.path}{plain}", f"the {member.component.__name__} around it (outer)")
    parts = part.parts(plain)
    if isinstance(member, Array):
        if not index:
            return _of_array(part, plain, parts)
        number = index.rstrip("]")
        if not number.isdigit() or int(number) >= len(parts):
            words = f"found {first}, expected an index from 0 to {len(parts) - 1}, as {plain}[0]"
            raise ModelError(words, place="describe", argument="name")
        parts = [parts[int(number)]]
    found = parts[0]
    return _found(found, rest, title) if rest else _of_part(found, f"{part.path}{first}")


def _of_part(part: PlacedPart, title: str) -> Description:
    kind = part.kind
    what = "connector" if not hasattr(kind, "equations") else "model"
    words = f"{kind.__name__}, " if title != kind.__name__ else ""
    said = f"{words}{what} of {kind.__module__}" + (", an instance" if part.given and not words else "")
    facts = (*_inherited(kind), *_in_si(part))
    tables = [*_quantities(part), *_components(part), *_settings_of(part)]
    tables.sort(key=lambda rows: [*HEADINGS.values()].index(rows.heading))
    return Description(title, said, first_sentence(kind.__doc__), facts, tuple(tables))


def _in_si(part: PlacedPart) -> Iterator[tuple[str, str]]:
    """That numbers of a model are in SI, if what is shown is not."""
    members = [m for m in part.members.values() if isinstance(m, Quantity)]
    if shown := [m for m in members if m.display and m.display != m.unit]:
        units = ", ".join(dict.fromkeys(f"{m.display} for {m.unit}" for m in shown))
        yield "shown in", f"{units}; a number that you give is in SI, or a text: '30 {shown[0].display}'"


def _inherited(kind: Any) -> Iterator[tuple[str, str]]:
    """From which classes, and which declarations are theirs, or replace theirs."""
    bases = [base for base in kind.__mro__[1:] if getattr(base, "members", None)]
    told, seen = [], set(vars(kind))
    for base in bases:
        if base.__module__ in ("gantrytau.language.model", "gantrytau.modelica.elaboration.classes"):
            continue
        held = [name for name in base.members() if name in vars(base)]
        kept = [name for name in held if name not in seen]
        told.append(f"{base.__name__} ({', '.join(kept)})" if kept else base.__name__)
        again = [name for name in held if name in vars(kind)]
        if again:
            yield f"replaces of {base.__name__}", ", ".join(again)
        seen |= set(held)
    if told:
        yield "inherits", ", ".join(told)


def _quantities(part: PlacedPart) -> Iterator[Listing]:
    members = {name: m for name, m in part.members.items() if isinstance(m, Quantity)}
    for kind, heading in HEADINGS.items():
        names = [name for name, m in members.items() if m.kind == kind]
        column = "value" if kind == "parameter" else "start"
        rows = [(_with_shape(m := members[n]), _spoken(part, n), _unit(m), _words(part, n)) for n in names]
        if rows:
            yield Listing.of(heading, ("name", column, "unit", "description"), rows)


def _components(part: PlacedPart) -> Iterator[Listing]:
    """Components, connectors and what stands around, each with its class."""
    members = {name: m for name, m in part.members.items() if not isinstance(m, Quantity)}
    rows: dict[str, list[tuple[str, ...]]] = {"Connectors": [], "Components": [], "Around it": []}
    for name, member in members.items():
        if isinstance(member, Array):
            parts = part.parts(name)
            kinds = list(dict.fromkeys(one.kind for one in parts))
            many = f"{name}[{len(parts)}]"
            heading = "Connectors" if kinds and not hasattr(kinds[0], "equations") else "Components"
            words = first_sentence(kinds[0].__doc__) if len(kinds) == 1 else ""
            rows[heading].append((many, ", ".join(one.__name__ for one in kinds), "", words))
        elif hasattr(member, "members"):
            (one,) = part.parts(name)
            heading = "Components" if hasattr(one.kind, "equations") else "Connectors"
            rows[heading].append(
                (name, one.kind.__name__, _changes(one, 40), first_sentence(one.kind.__doc__))
            )
        else:
            kind = member.component
            rows["Around it"].append((name, kind.__name__, "", first_sentence(kind.__doc__)))
    for heading, found in rows.items():
        if found:
            yield Listing.of(heading, ("name", "class", "with", "description"), found)


def _settings(kind: Any) -> dict[str, Any]:
    """Constants of a class that shape the model, by name."""
    found: dict[str, Any] = {}
    for base in reversed(kind.__mro__):
        found |= {n: v for n, v in vars(base).items() if is_setting(v, n) and n not in HIDDEN}
    return {n: v for n, v in found.items() if n not in kind.members() and is_setting(getattr(kind, n), n)}


def _settings_of(part: PlacedPart) -> Iterator[Listing]:
    if rows := [(n, short(part.modifications.get(n, v))) for n, v in _settings(part.kind).items()]:
        yield Listing.of("Settings", ("name", "value"), rows)


def _of_array(part: PlacedPart, name: str, parts: list[PlacedPart]) -> Description:
    rows = [(f"{name}[{k}]", one.kind.__name__, _changes(one, 80)) for k, one in enumerate(parts)]
    tables = (Listing.of("Components", ("name", "class", "with"), rows),)
    return Description(f"{part.path}{name}", f"{len(parts)} components", tables=tables)


def _of_quantity(part: PlacedPart, name: str) -> Description:
    """All that is said of one quantity."""
    member: Any = part.members[name]
    rows = [("shape", str(_shape(member)))] if _shape(member) else []
    rows += [("unit", member.display or member.unit)] if member.unit else []
    rows += [("unit of numbers in models", member.unit)] if member.display not in (None, member.unit) else []
    if isinstance(member, Parameter):
        rows.append(("value", _shown(member, part.value(name))))
    for key in ATTRIBUTES:
        value = part.attribute(name, key) if hasattr(member, key) else None
        if value is None or value is False or (isinstance(value, str) and not value):
            continue
        if key == "prefer":
            if value == StateSelect.DEFAULT:
                continue
            value = StateSelect(value).name
        shown = _shown(member, value) if key in NUMBERS else _value(value)
        rows.append((key, value if isinstance(value, str) else shown))
    if modes := getattr(member, "names", None):
        rows.append(("modes", ", ".join(modes)))
    kind = f"{type(member).__name__} of {member.owner or part.kind.__name__}"
    tables = (Listing.of("Attributes", ("name", "value"), rows),)
    return Description(f"{part.path}{name}", kind, member.description, tables=tables)


def _with_shape(member: Quantity) -> str:
    shape = _shape(member)
    return f"{member.name}[{shape}]" if shape else member.name


def _shape(member: Quantity) -> str:
    shape = member.declared_shape
    if isinstance(shape, (int, np.integer)):
        return str(shape)
    if isinstance(shape, tuple):
        return ", ".join(map(str, shape))
    return "..."  # as settings say


def _unit(member: Quantity) -> str:
    unit = member.display or member.unit
    return "" if unit in (None, "1") else str(unit)


def _shown(member: Quantity, value: Any) -> str:
    """A value of a quantity, in the unit in which it is shown."""
    if not member.display or value is None or isinstance(value, (str, Formula)) or callable(value):
        return _value(value)
    try:
        return _value(scale(member.display).written(np.asarray(value, dtype=float)))
    except (ModelError, TypeError, ValueError):  # no units, values of others: what the compiler refuses
        return f"{_value(value)} {member.unit}"


def _spoken(part: PlacedPart, name: str) -> str:
    """The value of a parameter, the start of a variable."""
    member = part.members[name]
    if isinstance(member, Parameter):
        return _shown(member, part.value(name))
    given = part.modifications.get(name)
    if given is not None and not isinstance(given, (Start, Bounds, Mapping)):
        return f"== {_shown(member, in_si(number_of(given, part.scope), member.unit))}"  # an equation
    start = part.attribute(name, "start")
    if start is None:
        return ""
    if isinstance(member, Mode) and start in range(len(member.names)):
        return member.names[int(start)]
    return _shown(member, start) + (" (fixed)" if part.attribute(name, "fixed") is True else "")


def _words(part: PlacedPart, name: str) -> str:
    member = part.members[name]
    low, high = part.attribute(name, "min"), part.attribute(name, "max")
    limits = [f"at least {_shown(member, low)}"] if low is not None else []
    limits += [f"at most {_shown(member, high)}"] if high is not None else []
    return "; ".join(filter(None, [member.description, ", ".join(limits)]))


def _changes(part: PlacedPart, length: int) -> str:
    return cut(", ".join(f"{key}={_given(v)}" for key, v in part.modifications.items()), length)


def _given(value: Any) -> str:
    """A modification in few letters."""
    if isinstance(value, Mapping):
        return f"({', '.join(f'{k}={_given(v)}' for k, v in value.items())})"
    if isinstance(value, Formula):
        return formula_words(value)
    return _value(value)


def _value(value: Any) -> str:
    if value is None:
        return "(to be given)"
    if isinstance(value, Formula):
        return cut(f"= {formula_words(value)}", 40)
    if isinstance(value, Callable) and not hasattr(value, "members"):
        return "= computed"
    words = (Mapping, str, Formula)
    if isinstance(value, (list, tuple)) and not any(isinstance(one, words) for one in value):
        try:
            return array_words(np.asarray(value, dtype=float))
        except (TypeError, ValueError):  # of parts of several shapes, or no numbers
            return short(value, 40)
    return short(value, 40)


_SIGNS = {"add": "+", "sub": "-", "mul": "*", "truediv": "/", "pow": "**", "matmul": "@"}


def formula_words(formula: Any) -> str:
    """A formula of declarations as it is written in the body of a class."""
    if isinstance(formula, Quantity):
        return formula.name
    if not isinstance(formula, Formula):
        return short(formula, 30)
    kind, arguments = formula.parts()
    names = [formula_words(one) for one in arguments]
    if kind == "getitem":
        return f"{names[0]}[{names[1]}]"
    if kind == "neg":
        return f"-{names[0]}"
    if kind in _SIGNS:
        inner = [f"({text})" if " " in text else text for text in names]
        return f" {_SIGNS[kind]} ".join(inner)
    return f"{kind}({', '.join(names)})"
