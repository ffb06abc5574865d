"""One number for whatever a computation depends on, alike for alike things on every run and every machine."""

import hashlib
import inspect
import textwrap
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields, is_dataclass
from functools import partial
from types import CodeType, ModuleType
from typing import Any

import casadi as ca
import numpy as np


def digest(*things: Any) -> str:
    """One number for arrays, records, numbers, words, expressions and functions; numbers count to their last bit.

    A function is its source, what it closes over and its defaults; what it calls is not looked at.
    """
    found = hashlib.sha256()
    _feed(found, things, frozenset())
    return found.hexdigest()


def _feed(found: Any, thing: Any, around: frozenset[int]) -> None:
    """around: what the thing is a part of."""
    if id(thing) in around:
        found.update(b"circle;")
        return
    whole, around = _whole(thing), around | {id(thing)}
    if whole is not None:
        found.update(whole)
        return
    words, parts = _parts(thing)
    found.update(words.encode())
    for part in parts:
        _feed(found, part, around)


def _whole(thing: Any) -> bytes | None:
    """What has no parts, as bytes."""
    if isinstance(thing, ca.Function):
        return f"function {thing.serialize()};".encode()
    if isinstance(thing, (ca.SX, ca.MX)):
        return f"expression {_written(thing)};".encode()
    if isinstance(thing, np.ndarray) and thing.dtype != object:
        return f"array {thing.dtype.str} {thing.shape};".encode() + np.ascontiguousarray(thing).tobytes()
    parts = isinstance(thing, (list, tuple, np.ndarray, Mapping, set, frozenset)) or hasattr(
        thing, "__dict__"
    )
    if not parts or isinstance(thing, (type, ModuleType)):
        return f"{type(thing).__name__} {thing!r};".encode()
    return None


def _parts(thing: Any) -> tuple[str, Iterable[Any]]:
    """Words for a thing, and what it consists of."""
    if isinstance(thing, (list, tuple, np.ndarray)):
        return f"sequence {len(thing)};", thing
    if isinstance(thing, Mapping):
        return f"mapping {len(thing)};", [(name, thing[name]) for name in sorted(thing, key=str)]
    if isinstance(thing, (set, frozenset)):
        return f"set {len(thing)};", sorted(thing, key=repr)
    if isinstance(thing, partial):
        return "partial;", (thing.func, thing.args, thing.keywords)
    if inspect.isfunction(thing) or inspect.ismethod(thing):
        return "function;", _function(thing)
    words = f"{type(thing).__qualname__};"
    if is_dataclass(thing):
        return words, [(field.name, getattr(thing, field.name)) for field in fields(thing)]
    return words, [_source(type(thing)) if callable(thing) else "", vars(thing)]  # a record of the user's own


def _written(expression: Any) -> str:
    """An expression as CasADi writes a function of its symbols: with whole numbers, where text has six digits."""
    return ca.Function("expression", ca.symvar(expression), [expression]).serialize()


def _function(function: Callable[..., Any]) -> list[Any]:
    """The source of a function, what it closes over, its defaults, and of a method its object."""
    inner = getattr(function, "__func__", function)
    cells = [cell.cell_contents for cell in inner.__closure__ or ()]
    owner = getattr(function, "__self__", None)
    return [_source(inner), cells, inner.__defaults__, inner.__kwdefaults__, owner]


def _source(thing: Any) -> str:
    """The text of a function or a class; of one without a name, or typed at a prompt, what it was compiled to."""
    code = getattr(thing, "__code__", None)
    try:
        text = textwrap.dedent(inspect.getsource(thing))
    except (OSError, TypeError):
        return thing.__qualname__ if code is None else _compiled(code)
    return text + _compiled(code) if code is not None and code.co_name == "<lambda>" else text


def _compiled(code: CodeType) -> str:
    inner = [_compiled(each) if isinstance(each, CodeType) else repr(each) for each in code.co_consts]
    return f"{code.co_code.hex()} {code.co_names} {inner}"
