"""One number for whatever a computation depends on, alike for alike things on every run and every machine."""

import hashlib
import inspect
import textwrap
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from functools import partial
from types import ModuleType
from typing import Any

import casadi as ca
import numpy as np


def digest(*things: Any) -> str:
    """One number for arrays, records, numbers, words, expressions and functions; numbers count to their last bit.

    A function is its source, what it closes over and its defaults; what it calls is not looked at.
    """
    found = hashlib.sha256()
    _feed(found, things)
    return found.hexdigest()


def _feed(found: Any, thing: Any) -> None:
    if isinstance(thing, np.ndarray) and thing.dtype != object:
        found.update(f"array {thing.dtype.str} {thing.shape};".encode())
        found.update(np.ascontiguousarray(thing).tobytes())
    elif isinstance(thing, (list, tuple, np.ndarray)):
        found.update(f"sequence {len(thing)};".encode())
        for each in thing:
            _feed(found, each)
    elif isinstance(thing, Mapping):
        _feed(found, [[name, thing[name]] for name in sorted(thing, key=str)])
    elif isinstance(thing, (set, frozenset)):
        _feed(found, sorted(thing, key=repr))
    elif isinstance(thing, (ca.SX, ca.MX)):
        found.update(f"expression {_written(thing)};".encode())
    elif isinstance(thing, ca.Function):
        found.update(f"function {thing.serialize()};".encode())
    elif is_dataclass(thing) and not isinstance(thing, type):
        found.update(f"{type(thing).__qualname__};".encode())
        _feed(found, [[field.name, getattr(thing, field.name)] for field in fields(thing)])
    elif isinstance(thing, partial):
        _feed(found, ["partial", thing.func, thing.args, thing.keywords])
    elif inspect.isfunction(thing) or inspect.ismethod(thing):
        _feed(found, _function(thing))
    elif hasattr(thing, "__dict__") and not isinstance(
        thing, (type, ModuleType)
    ):  # a record of the user's own
        found.update(f"{type(thing).__qualname__};".encode())
        _feed(found, vars(thing))
    else:
        found.update(f"{type(thing).__name__} {thing!r};".encode())


def _written(expression: Any) -> str:
    """An expression as CasADi writes a function of its symbols: with whole numbers, where text has six digits."""
    return ca.Function("expression", ca.symvar(expression), [expression]).serialize()


def _function(function: Callable[..., Any]) -> list[Any]:
    inner = getattr(function, "__func__", function)
    try:
        source = textwrap.dedent(inspect.getsource(inner))
    except (OSError, TypeError):  # typed at a prompt
        source = inner.__code__.co_code.hex() + repr(inner.__code__.co_consts)
    cells = [cell.cell_contents for cell in inner.__closure__ or () if cell.cell_contents is not function]
    return ["function", source, cells, inner.__defaults__, inner.__kwdefaults__]
