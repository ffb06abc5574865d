"""One number for whatever a computation depends on, alike for alike things on every run and every machine."""

import ast
import hashlib
import inspect
import sys
import sysconfig
import textwrap
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields, is_dataclass
from functools import partial
from types import CodeType, FunctionType, ModuleType
from typing import Any

import casadi as ca
import numpy as np

INSTALLED = tuple({sysconfig.get_path(key) for key in ("stdlib", "platstdlib", "purelib", "platlib")})
STEADY = (type, FunctionType, partial, int, float, complex, str, bytes, np.ndarray, type(None))


def digest(*things: Any) -> str:
    """One number for arrays, records, numbers, words, expressions and functions; numbers count to their last bit.

    A function counts with its source, closure and defaults, and with the functions, classes and values of the user's
    modules that it names, read the same way. Installed code counts by its name.
    """
    found = hashlib.sha256()
    _feed(found, things, frozenset(), set())
    return found.hexdigest()


def _feed(found: Any, thing: Any, around: frozenset[int], known: set[int]) -> None:
    """Feed a thing to the hash. around: containers of the thing; known: functions and classes fed already."""
    if id(thing) in around:
        found.update(b"circle;")
        return
    whole, around = _whole(thing), around | {id(thing)}
    if whole is not None:
        found.update(whole)
        return
    words, parts = _parts(thing)
    found.update(words.encode())
    if isinstance(thing, (type, FunctionType)):
        if id(thing) in known:
            return
        known.add(id(thing))
    for part in parts:
        _feed(found, part, around, known)


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
    if isinstance(thing, ModuleType) or _named(thing):
        return f"{type(thing).__name__} {getattr(thing, '__module__', '')}.{getattr(thing, '__qualname__', thing)};".encode()
    return None if parts else f"{type(thing).__name__} {thing!r};".encode()


def _named(thing: Any) -> bool:
    """Whether a class or function comes with Python or an installed package, and is told by its name."""
    if not (inspect.isclass(thing) or inspect.isfunction(thing)):
        return False
    module = sys.modules.get(thing.__module__ or "")
    file = getattr(module, "__file__", None)
    if module is None or file is None:
        return thing.__module__ != "__main__"
    return thing.__module__.partition(".")[0].startswith("gantrytau") or file.startswith(INSTALLED)


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
        return f"function {thing.__qualname__};", _function(thing)
    if inspect.isclass(thing):
        return f"class {thing.__qualname__};", _class(thing)
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
    return [
        _source(inner),
        cells,
        inner.__defaults__,
        inner.__kwdefaults__,
        owner,
        _used(inner.__globals__, _names(inner.__code__)),
    ]


def _class(owner: type) -> list[Any]:
    """The source of a class, and what its body and its methods name."""
    source, there = _source(owner), vars(sys.modules[owner.__module__])
    words = [getattr(node, "id", getattr(node, "attr", "")) for node in ast.walk(ast.parse(source))]
    return [source, _used(there, words)]


def _used(there: Mapping[str, Any], words: Iterable[str]) -> dict[str, Any]:
    """Functions, classes and values that words name in a module, and as attributes of modules that it imports."""
    names = set(words)
    used = {name: there[name] for name in names & there.keys()}
    for name, module in list(used.items()):
        if isinstance(module, ModuleType):
            del used[name]
            used |= {f"{name}.{word}": vars(module)[word] for word in names & vars(module).keys()}
    return {
        name: inspect.unwrap(thing) if callable(thing) else thing
        for name, thing in used.items()
        if _steady(thing)
    }


def _steady(thing: Any) -> bool:
    """Whether a value of a module is code or numbers. A cache, filled while a function runs, is neither."""
    if isinstance(thing, (list, tuple, dict, set, frozenset)):
        return bool(thing) and all(map(_steady, thing.values() if isinstance(thing, dict) else thing))
    return isinstance(thing, STEADY) or is_dataclass(thing) or hasattr(thing, "__wrapped__")


def _names(code: CodeType) -> list[str]:
    """All global names and attributes that code and the functions within it use."""
    inner = [name for each in code.co_consts if isinstance(each, CodeType) for name in _names(each)]
    return [*code.co_names, *inner]


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
