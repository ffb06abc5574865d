"""Values in a few words: arrays by shape and range, long lists by their ends, records by their fields."""

import math
import re
from collections.abc import Callable, Iterable, Mapping, Set
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

LENGTH = 60  # letters of one value
WHOLE = 260  # letters of a record
FEW = 6  # elements that are shown one by one
ROWS = 3  # rows of a matrix that is shown


def short(value: Any, length: int = LENGTH) -> str:
    """A value in at most `length` letters, or a few more: `(30, 3) array, -0.1 to 2.5` for an array."""
    if isinstance(value, str):
        return repr(cut(value, length - 2))
    if isinstance(value, (bool, np.bool_)) or value is None:
        return str(value)
    if isinstance(value, (float, np.floating)):
        return number(float(value))
    if isinstance(value, (np.ndarray, np.number)) or type(value).__name__ == "DM":
        return array_words(np.asarray(value))
    if isinstance(value, Mapping):
        return _mapping(value, length)
    if isinstance(value, (list, tuple, Set)):
        return _several(value, length)
    if is_dataclass(value) and not isinstance(value, type):
        return record_words(value, length)
    if type(value).__module__.startswith("casadi"):
        return _expression(value, length)
    if isinstance(value, type) or (callable(value) and hasattr(value, "__qualname__")):
        return value.__qualname__.replace("<lambda>", "a function").rpartition("<locals>.")[2]
    return cut(re.sub(r"<(?:[\w.<>]+\.)?(\w+) object at 0x\w+>", r"<\1>", repr(value)), length)


def number(value: float) -> str:
    """A number as Python writes it, to eight digits: `0.3`, `2.0`, `1e-09`, `nan`."""
    rounded = float(f"{value:.8g}")
    return repr(rounded)


def cut(text: str, length: int) -> str:
    """A text in one line of at most so many letters, or its beginning and three dots."""
    line = " ".join(text.split())
    return line if len(line) <= length else line[: max(length - 3, 1)] + "..."


def array_words(values: np.ndarray) -> str:
    """Few numbers as they are, else shape and range, and how many are missing."""
    if values.ndim == 0:
        return short(values.item())
    if (values.ndim == 1 and values.size <= FEW) or (values.ndim == 2 and 0 < values.size <= ROWS**2):
        return _nested(values.tolist())
    shape = f"{values.shape} array"
    if values.dtype == bool:
        return f"{shape}, {np.count_nonzero(values)} true"
    if values.dtype.kind not in "iuf":
        return shape if values.dtype.kind != "c" else f"{shape} of complex numbers"
    finite = values[np.isfinite(values)]
    missing = values.size - finite.size
    told = f", {missing} not finite" if missing else ""
    if not finite.size:
        return f"{shape}{told}"
    low, high = finite.min(), finite.max()
    return f"{shape}, " + (f"{low:.4g} to {high:.4g}" if low < high else f"all {low:.4g}") + told


def _nested(values: Any) -> str:
    if isinstance(values, list):
        return "[" + ", ".join(_nested(one) for one in values) + "]"
    if isinstance(values, float):
        text = f"{values:.6g}"
        return text if "e" in text or "." in text or not math.isfinite(values) else f"{text}.0"
    return str(values)


def joined(parts: Iterable[str], length: int, first: int = 0) -> str:
    """Texts with commas between, as many as there is room for, then three dots; at least `first` of them."""
    found: list[str] = []
    room = length
    for k, part in enumerate(parts):
        room -= len(part) + 2
        if room < 0 and k >= first:
            return ", ".join([*found, "..."])
        found.append(part)
    return ", ".join(found)


def _mapping(value: Mapping[Any, Any], length: int) -> str:
    inner = max(length // 2, 12)
    parts = (f"{short(k, inner)}: {short(v, inner)}" for k, v in value.items())
    return _counted("{", joined(parts, length - 2), "}", len(value))


def _several(value: Any, length: int) -> str:
    opened, closed = {"list": "[]", "tuple": "()"}.get(type(value).__name__, "{}")
    if isinstance(value, tuple) and hasattr(value, "_fields"):  # a named tuple
        opened = f"{type(value).__name__}("
    parts = [short(one, max(length // 2, 12)) for one in list(value)[:50]]
    return _counted(opened, joined(parts, length - 2), closed, len(value))


def _counted(opened: str, inside: str, closed: str, count: int) -> str:
    comma = "," if count == 1 and opened == "(" else ""
    if inside.endswith("...") and count > 1:
        return f"{opened}{inside}{closed} of {count}"
    return f"{opened}{inside}{comma}{closed}"


def _expression(value: Any, length: int) -> str:
    """An expression or function of CasADi."""
    if type(value).__name__ == "Function":
        return cut(f"{value.name()}: {', '.join(value.name_in())} -> {', '.join(value.name_out())}", length)
    shape = getattr(value, "shape", ())
    text = str(value) if getattr(value, "numel", lambda: 99)() <= FEW else ""
    return text if text and len(text) <= length else f"{type(value).__name__}{shape}"


def record_words(record: Any, length: int = WHOLE, spell: Callable[[Any, int], str] = short) -> str:
    """A dataclass by its fields in one line: those of small records whole, of large ones the first."""
    shown = [f.name for f in fields(record) if f.repr]
    each = LENGTH if length >= WHOLE else max(length // 2, 12)
    parts = (f"{name}={spell(getattr(record, name, None), each)}" for name in shown)
    return f"{type(record).__qualname__}({joined(parts, length)})"
