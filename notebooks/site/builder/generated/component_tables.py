"""Tables of a component: parameters, connectors, variables, parts, from the declarations of its class."""

import types
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from gantrytau import Array, Connector, Declared, Flow, Input, Output, Parameter, Real
from notebooks.site.builder.reading.docstrings import escaped

KINDS = {Input: "input", Output: "output", Flow: "flow"}


def component_tables(cls: type[Declared]) -> Iterator[str]:
    """Tables in Markdown with their headings, none of them empty."""
    members = cls.members()
    parameters = [(n, m) for n, m in members.items() if isinstance(m, Parameter)]
    quantities = [(n, m) for n, m in members.items() if hasattr(m, "unit") and not isinstance(m, Parameter)]
    parts = [(n, m) for n, m in members.items() if not hasattr(m, "unit")]
    yield table(
        "Parameters",
        ("name", "default", "unit", "description"),
        ((f"`{n}`", _default(m.value), _unit(m), escaped(m.description)) for n, m in parameters),
    )
    yield table(
        "Settings",
        ("name", "default"),
        ((f"`{name}`", f"`{value!r}`") for name, value in _settings(cls)),
    )
    yield table(
        "Connectors",
        ("name", "class"),
        ((f"`{n}`", _class(m)) for n, m in parts if _is(m, Connector)),
    )
    yield table(
        "Variables",
        ("name", "kind", "shape", "unit", "description"),
        ((f"`{n}`", _kind(m), _shape(m), _unit(m), escaped(m.description)) for n, m in quantities),
    )
    yield table(
        "Parts",
        ("name", "class"),
        ((f"`{n}`", _class(m)) for n, m in parts if not _is(m, Connector)),
    )


def table(heading: str, columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown below its heading, without columns that are empty; "" without rows."""
    lines = [tuple(cell.replace("\n", " ") for cell in row) for row in rows]
    if not lines:
        return ""
    kept = [k for k, _ in enumerate(columns) if k == 0 or any(row[k] for row in lines)]
    body = [tuple(columns), ("---",) * len(columns), *lines]
    text = "\n".join(f"| {' | '.join(row[k] for k in kept)} |" for row in body)
    return f"**{heading}**\n\n{text}" if heading else text


def _is(member: Any, kind: type) -> bool:
    component = member.component if isinstance(member, Array) else member
    return issubclass(component, kind) if isinstance(component, type) else isinstance(component, kind)


def _class(member: Any) -> str:
    if isinstance(member, Array):
        component = member.component
        name = component.__name__ if isinstance(component, type) else getattr(component, "__name__", "")
        return f"{len(member)} of `{name}`"
    component = getattr(member, "component", None)
    return f"`{component.__name__}` around it" if component is not None else f"`{type(member).__name__}`"


def _kind(member: Any) -> str:
    return next((word for kind, word in KINDS.items() if isinstance(member, kind)), "") or (
        "" if isinstance(member, Real) else type(member).__name__.lower()
    )


def _unit(member: Any) -> str:
    return escaped(member.unit or "")


def _shape(member: Any) -> str:
    shape = member.declared_shape
    if callable(shape):
        return "as set"
    return " × ".join(map(str, np.atleast_1d(shape))) if shape != () else ""


def _default(value: Any) -> str:
    if value is None:
        return "to be given"
    if isinstance(value, types.FunctionType) or callable(value):
        return "from others"
    if type(value).__name__ in ("Formula", "Parameter"):
        return "from others"
    found = np.asarray(value)
    if found.dtype == object:
        return "from others"
    text = np.array2string(found, separator=", ", threshold=12, precision=6) if found.ndim else repr(value)
    return f"`{' '.join(text.split())}`"


def _settings(cls: type[Declared]) -> Iterator[tuple[str, Any]]:
    """Plain constants of the class and its bases that shape the component, such as `order = 2`."""
    for base in cls.__mro__:
        for name, value in vars(base).items():
            if not name.startswith("_") and isinstance(value, bool | int | float | str) and name != "drawn":
                yield name, value
