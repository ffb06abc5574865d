"""TOML files of parameters: modifications of a model, so that `Robot(**read_toml(file))` has these values."""

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from gantrytau.border.refusal import ModelError
from gantrytau.border.schema import read_toml
from gantrytau.border.units import si

OF = "Parameters of "  # begins the first line of a file, which names the robot they belong to


def read_parameters(file: Path) -> dict[str, Any]:
    """The numbers of a file by their full names, as `arms[0].length`; ModelError if it cannot be read as TOML."""
    table = read_toml(file)
    found: dict[str, Any] = {}
    for name, value in _leaves("", table):
        try:
            good = _numeric(value)
        except ModelError as error:
            raise error.within(f"{file}: {name}") from error
        if not good:
            raise ModelError(f"{file}: found {name} = {value!r}, expected a number or a vector")
        found[name] = value
    if not found:
        raise ModelError(f"{file}: found no values, expected some, as m = 2.5")
    return found


def parameters_of(file: Path) -> str | None:
    """The prototype that a file says its values belong to, in its first line, as `# Parameters of GantryTau(L1)`."""
    with file.open(encoding="utf-8-sig") as opened:
        found = re.fullmatch(rf"# {OF}\S+\((\w+)\)\s*", opened.readline())
    return found[1] if found else None


def _leaves(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(value, Mapping):
        for key, part in value.items():
            yield from _leaves(f"{name}.{key}" if name else key, part)
    elif isinstance(value, list) and any(isinstance(part, Mapping) for part in value):
        for k, part in enumerate(value):
            yield from _leaves(f"{name}[{k}]", part)
    else:
        yield name, value


def _numeric(value: Any) -> bool:
    if isinstance(value, list):
        return bool(value) and all(_numeric(part) for part in value)
    if isinstance(value, str):
        si(value)  # whether it is the unit of its parameter, the model finds out
    return isinstance(value, (bool, int, float, str))


def parameter_text(modifications: Mapping[str, Any], model: str, heading: str = "") -> str:
    """The text of a file of nested modifications, numbers to the last digit.

    model: whose they are, as `GantryTau(L1)`, in the first line; heading: further lines, as comments.
    """
    comment = "".join(f"# {line}".rstrip() + "\n" for line in (f"{OF}{model}", *heading.splitlines()))
    return comment + "".join(_tables("", modifications))


def _tables(name: str, table: Mapping[str, Any]) -> Iterator[str]:
    """The plain values of a table, then the tables in it, each under its full name."""
    inner = {key: value for key, value in table.items() if _holds_tables(value)}
    for key, value in table.items():
        if key not in inner:
            yield f"{key} = {_value(value)}\n"
    for key, value in inner.items():
        full = f"{name}.{key}" if name else key
        parts = value if isinstance(value, Sequence) else [value]
        heading = f"[[{full}]]" if isinstance(value, Sequence) else f"[{full}]"
        for part in parts:
            if isinstance(value, Sequence) or not all(map(_holds_tables, part.values())):
                yield f"\n{heading}\n"
            yield from _tables(full, part)


def _holds_tables(value: Any) -> bool:
    return isinstance(value, Mapping) or (
        isinstance(value, (list, tuple)) and any(isinstance(part, Mapping) for part in value)
    )


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (list, tuple)) or getattr(value, "ndim", 0):
        return f"[{', '.join(map(_value, value))}]"
    return repr(float(value))
