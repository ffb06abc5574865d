"""`describe`: what a model, a record, a result or a function is, in a few words and tables."""

import inspect
import re
from collections.abc import Iterable
from dataclasses import fields, is_dataclass
from typing import Any

from gantrytau.border.refusal import Given, ModelError, did_you_mean
from gantrytau.describing.described import Description, Listing
from gantrytau.describing.short_values import LENGTH, cut, short

HIDDEN = {"gantrytau.describing.record", "abc", "typing"}  # modules of bases that are not told


def describe(thing: Any, name: str = "") -> Description:
    """What a thing is: a class or an instance of a model, a translated model, a result, any record, class or function.

    name: of a variable or a component in it, such as "arms[0].cart.s", of which is told instead. Prints itself; notebooks
    show it as tables. Long tables are cut; `.as_mapping()` holds all rows. Raises ModelError for a name that is not there.

    A class says it in a method `__describe__(name)`, and what is said of the class itself in `__describe_class__(name)`.
    """
    if not isinstance(name, str):
        raise ModelError("expected text, as 'tool.r'", place="describe", found=Given("name", name))
    if isinstance(thing, str):
        raise ModelError(
            f"describe: found the text {short(thing)}, expected a model, a class, a result; write describe(Revolute), or "
            "describe(robot, 'tool.r') for a part"
        )
    own = isinstance(thing, type)
    said = getattr(thing if own else type(thing), "__describe_class__" if own else "__describe__", None)
    if said is not None:
        return said(name) if own else said(thing, name)
    if own:
        return class_described(thing, name)
    if inspect.isroutine(thing):
        return _function(thing, name)
    return object_described(thing, name)


def first_sentence(text: str | None) -> str:
    """The first sentence of a documentation, or its first paragraph if it ends without a point."""
    paragraph = " ".join(inspect.cleandoc(text or "").partition("\n\n")[0].split())
    return re.split(r"(?<=[^.\s]{2}[.)`])\s+(?=[A-Z`])", paragraph, maxsplit=1)[0]


def told_of(cls: type) -> dict[str, str]:
    """What the documentation of a class and its bases says of fields: `name: words` at the start of a line or behind `;`."""
    found: dict[str, str] = {}
    for base in reversed(cls.__mro__[:-1]):
        text = inspect.cleandoc(vars(base).get("__doc__") or "").partition("\n\n")[2]
        for paragraph in text.split("\n\n"):
            words = " ".join(paragraph.split())
            starts = list(re.finditer(r"(?:^|(?<=[;.] ))((?:\w+, )*\w+): ", words))
            for k, start in enumerate(starts):
                end = starts[k + 1].start() if k + 1 < len(starts) else len(words)
                for name in start[1].split(", "):
                    found[name] = words[start.end() : end].strip(" ;.")
    return found


def class_described(cls: type, name: str = "") -> Description:
    """Any class: its sentence, its fields, what can be asked of it."""
    held = {f.name: f for f in fields(cls)} if is_dataclass(cls) else {}
    members = {key: value for key, value in inspect.getmembers_static(cls) if not key.startswith("_")}
    asked = {key: value for key, value in members.items() if key not in held}
    if name:
        if name in asked:
            return _function(getattr(cls, name), "") if callable(getattr(cls, name)) else _property(cls, name)
        if name in held:
            return Description(f"{cls.__name__}.{name}", "field", told_of(cls).get(name, ""))
        words = f"{cls.__name__} has no '{name}'{did_you_mean(name, [*held, *asked])}"
        raise ModelError(words, place="describe", argument="name")
    told = told_of(cls)
    rows = [(key, _annotation(f.type), told.get(key, "")) for key, f in held.items()]
    answers = [(key + _asked(value), first_sentence(_doc(value))) for key, value in asked.items()]
    bases = [base.__name__ for base in cls.__mro__[1:-1] if base.__doc__ and base.__module__ not in HIDDEN]
    facts = (("inherits", ", ".join(bases)),) if bases else ()
    tables = (
        Listing.of("Fields", ("name", "type", "description"), rows),
        Listing.of("Answers", ("name", "description"), answers),
    )
    return Description(cls.__name__, f"class of {cls.__module__}", first_sentence(cls.__doc__), facts, tables)


def object_described(thing: Any, name: str = "") -> Description:
    """Any record or object: what it prints of itself, and its fields with their values."""
    cls = type(thing)
    names = [f.name for f in fields(thing) if f.repr] if is_dataclass(thing) else _public(vars_of(thing))
    if name:
        if name not in names and not isinstance(getattr(cls, name, None), property):
            others = [n for n, value in inspect.getmembers_static(cls) if isinstance(value, property)]
            words = f"this {cls.__name__} has no '{name}'{did_you_mean(name, [*names, *_public(others)])}"
            raise ModelError(words, place="describe", argument="name")
        found = describe(getattr(thing, name))
        words = told_of(cls).get(name, "") or first_sentence(_doc(getattr(cls, name, None)))
        return Description(name, f"of {cls.__name__}", words, (), found.tables, found.text)
    told, said = told_of(cls), _metadata(thing)
    rows = [(key, short(getattr(thing, key, None)), *said.get(key, ("", told.get(key, "")))) for key in names]
    summary = first_sentence(cls.__doc__) if names or cls.__module__.startswith("gantrytau") else ""
    tables = (Listing.of("Fields", ("name", "value", "unit", "description"), rows),)
    return Description(
        cls.__name__, "", summary, (), tables, _said(thing) if names else short(thing, 4 * LENGTH)
    )


def _metadata(thing: Any) -> dict[str, tuple[str, str]]:
    """Unit and description of fields that say them in their metadata, as those of prototypes."""
    if not is_dataclass(thing):
        return {}
    told = {f.name: f.metadata for f in fields(thing) if "unit" in f.metadata}
    return {n: ("" if m["unit"] == "1" else m["unit"], m.get("description", "")) for n, m in told.items()}


def _said(thing: Any) -> str:
    """What the class of an object has it print of itself, in its own words."""
    cls = type(thing)
    if cls.__str__ is not object.__str__:
        return str(thing)
    own = (
        not hasattr(cls.__repr__, "__wrapped__") and cls.__repr__.__module__ != "gantrytau.describing.record"
    )
    return cut(repr(thing), 4 * LENGTH) if own and cls.__repr__ is not object.__repr__ else ""


def vars_of(thing: Any) -> Iterable[str]:
    """Names of the attributes of an object that is no value of Python's own."""
    return vars(thing) if hasattr(thing, "__dict__") else ()


def _public(names: Iterable[str]) -> list[str]:
    return [name for name in names if not name.startswith("_")]


def _function(function: Any, name: str) -> Description:
    """A function: its arguments, and what its documentation says of them."""
    if name:
        raise ModelError("a function has none; leave it out", place="describe", found=Given("name", name))
    try:
        arguments = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):  # of compiled functions
        arguments = ()
    words = " ".join(inspect.cleandoc(function.__doc__ or "").split())
    rows = []
    for one in (one for one in arguments if one.name not in ("self", "cls")):
        default = "" if one.default is one.empty else f"= {short(one.default, 30)}"
        said = re.search(rf"(?:[.;:] |^){re.escape(one.name)}(?:, \w+)*: (.*?)(?:[;.] |\.?$)", words)
        rows.append((one.name, default, said[1] if said else ""))
    kind = f"function of {function.__module__}"
    tables = (Listing.of("Arguments", ("name", "value", "description"), rows),)
    return Description(function.__qualname__, kind, first_sentence(function.__doc__), (), tables)


def _property(cls: type, name: str) -> Description:
    found = inspect.getattr_static(cls, name)
    return Description(f"{cls.__name__}.{name}", "property", first_sentence(_doc(found)))


def _doc(value: Any) -> str | None:
    return value.__doc__ if inspect.isroutine(value) or _is_property(value) else None


def _is_property(value: Any) -> bool:
    return hasattr(value, "__get__") and not inspect.isroutine(value)


def _asked(value: Any) -> str:
    function = getattr(value, "__func__", value)
    return "(...)" if inspect.isroutine(function) else ""


def _annotation(text: Any) -> str:
    return text if isinstance(text, str) else getattr(text, "__name__", str(text))
