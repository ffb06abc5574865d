"""What stands between the parentheses of a name: the signature as its author wrote it."""

import ast
import dataclasses
import inspect
import textwrap
from typing import Any


def signature(value: Any) -> str:
    """Arguments and result of a function, or the arguments of a class; "" for what is called with names of its own."""
    if isinstance(value, property):
        return ""
    if isinstance(value, type):
        return _of_class(value)
    return _written(inspect.unwrap(getattr(value, "__func__", value)))


def arguments(value: Any) -> list[str]:
    """Names of arguments of a function or a class, and of the fields of a record."""
    fields: list[str] = list(getattr(value, "__dataclass_fields__", ()))
    fields += list(getattr(value, "__annotations__", ())) if isinstance(value, type) else []
    try:
        return [*fields, *(name for name in inspect.signature(value).parameters if name != "self")]
    except (TypeError, ValueError):
        return fields


def result_of(value: property) -> str:
    """The type of a property, as it is written."""
    node = _definition(value.fget) if value.fget else None
    return ast.unparse(node.returns).strip("'\"") if node and node.returns else ""


def _of_class(value: type) -> str:
    init = value.__dict__.get("__init__")
    if dataclasses.is_dataclass(value) or (init is None and hasattr(value, "_fields")):
        return _without_types(value)
    for base in value.__mro__:
        init = base.__dict__.get("__init__")
        if init is not None and base.__module__.startswith("gantrytau"):
            return _written(init).partition(" -> ")[0]
    return ""


def _without_types(value: type) -> str:
    parts, starred = [], False
    for one in inspect.signature(value).parameters.values():
        if one.kind is one.KEYWORD_ONLY and not starred:
            parts.append("*")
            starred = True
        default = "" if one.default is one.empty else f"={_shown(one.default)}"
        parts.append(one.name + default)
    return f"({', '.join(parts)})"


def _shown(value: Any) -> str:
    """A default, or `...` where it is none that a reader wants to see."""
    text = repr(value)
    plain = value is None or isinstance(value, bool | int | float | str | tuple)
    return text if plain and len(text) < 40 and "<" not in text else "..."


def _written(function: Any) -> str:
    node = _definition(function)
    if node is None:
        try:
            return str(inspect.signature(function))
        except (TypeError, ValueError):
            return "(...)"
    arguments = node.args
    for group in (arguments.posonlyargs, arguments.args):
        if group and group[0].arg in ("self", "cls"):
            del group[0]
            break
    returns = f" -> {ast.unparse(node.returns)}" if node.returns else ""
    text = f"({ast.unparse(arguments)}){returns}"
    return text.removeprefix("(/, ") if text.startswith("(/, ") else text


def _definition(function: Any) -> ast.FunctionDef | ast.AsyncFunctionDef | None:
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    except (OSError, TypeError, SyntaxError):
        return None
    found = tree.body[0] if tree.body else None
    return found if isinstance(found, ast.FunctionDef | ast.AsyncFunctionDef) else None
