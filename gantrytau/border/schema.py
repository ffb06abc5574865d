"""Values of a TOML file with the unit that they must have: numbers are SI, texts bring theirs, as "5 mm" or "40 deg"."""

import math
import tomllib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau.border.units import USUAL, given

WORDS = {
    "m": "a length in m",
    "rad": "an angle in rad",
    "s": "a time in s",
    "m/s": "a speed in m/s",
    "1": "a number",
}
LARGEST = {"m": 50.0, "rad": 2 * math.pi, "m/s": 50.0}  # more was not written in SI
EXAMPLES = {"m": "mm", "rad": "deg", "s": "ms", "m/s": "mm/s"}
ELSEWHERE = {"table": "a table", "texts": 'a list of texts in quotes, as ["x", "y"]', "any": "a value"}


@dataclass(frozen=True)
class Value:
    """What a key holds: a number, vector or table of numbers in a unit, a whole number or a text.

    unit: of WORDS, several separated by commas, or "whole", "text", "table" (one or several), "texts" or "any", the last
    three of which are read elsewhere;
    shapes: those allowed, None for any number of rows; least: the smallest number allowed, or above: what it must exceed;
    words: of which a text must be one.
    """

    unit: str
    shapes: tuple[tuple[int | None, ...], ...] = ((),)
    least: float = -math.inf
    above: float = -math.inf
    words: tuple[str, ...] = ()

    def read(self, place: str, found: Any) -> Any:
        """The value in SI, lists as lists; ModelError for anything else."""
        if self.unit == "text":
            return self._text(place, found)
        if self.unit == "table":
            return self._tables(place, found)
        if self.unit == "texts" and not (isinstance(found, list) and all(isinstance(x, str) for x in found)):
            raise ModelError(f"{place}: found {_short(found)}, expected {self.expected()}")
        if self.unit in ("any", "bodies", "texts"):
            return found
        if not any(_has(found, shape) for shape in self.shapes):
            raise ModelError(f"{place}: found {_short(found)}, expected {self.expected()}")
        return self._numbers(place, found)

    def _tables(self, place: str, found: Any) -> Any:
        several = self.shapes != ((),)
        tables = found if several and isinstance(found, list) else [found]
        if all(isinstance(one, Mapping) for one in tables) and several == isinstance(found, list):
            return found
        name = place.rpartition(": ")[2]
        expected = f"a table for each, [[{name}]]" if several else f"a table, [{name}]"
        raise ModelError(f"{place}: found {_short(found)}, expected {expected}")

    def _text(self, place: str, found: Any) -> str:
        if not isinstance(found, str) or not found.strip():
            raise ModelError(f"{place}: found {_short(found)}, expected a text in quotes")
        if self.words and found.lower() not in self.words:
            raise ModelError(f'{place}: found "{found}"{did_you_mean(found.lower(), self.words)}')
        return found.lower() if self.words else found

    def _numbers(self, place: str, found: Any) -> Any:
        if isinstance(found, list):
            return [self._numbers(f"{place}[{k}]", part) for k, part in enumerate(found)]
        number = self._number(place, found)
        if not (math.isfinite(number) and number >= self.least and number > self.above):
            bound = f" above {self.above:g}" if self.above > -math.inf else f" of at least {self.least:g}"
            limited = self.above > -math.inf or self.least > -math.inf
            raise ModelError(f"{place}: found {found!r}, expected {self._unit()}{bound if limited else ''}")
        return int(number) if self.unit == "whole" else number

    def _number(self, place: str, found: Any) -> float:
        if isinstance(found, str):
            return self._with_unit(place, found)
        if isinstance(found, bool) or not isinstance(found, (int, float)):
            raise ModelError(f"{place}: found {_short(found)}, expected {self._unit()}")
        if self.unit == "whole" and found != int(found):
            raise ModelError(f"{place}: found {found!r}, expected a whole number")
        largest = max((LARGEST.get(unit, math.inf) for unit in self.unit.split(",")), default=math.inf)
        if abs(found) > largest:
            unit = EXAMPLES[self.unit.split(",")[0]]
            raise ModelError(
                f'{place}: found {found!r}, expected {self._unit()}, up to {largest:.3g}; write "{found:g} {unit}" if it is '
                f"in {unit}"
            )
        return float(found)

    def _with_unit(self, place: str, found: str) -> float:
        units = [unit for unit in self.unit.split(",") if unit in WORDS and unit != "1"]
        for unit in units:
            with suppress(ModelError):
                return float(given(place, found, unit))
        usual = [name for unit in units for name in (unit, *USUAL[unit])]
        known = f"; units are {', '.join(usual)}" if units else ", without a unit"
        raise ModelError(f'{place}: found "{found}", expected {self._unit()}{known}')

    def _unit(self) -> str:
        return (
            "a whole number"
            if self.unit == "whole"
            else " or ".join(WORDS[unit] for unit in self.unit.split(","))
        )

    def expected(self) -> str:
        """What it must be, in words."""
        if self.unit == "text":
            return "a text in quotes" + (f": {', '.join(self.words)}" if self.words else "")
        if self.unit in ELSEWHERE:
            return ELSEWHERE[self.unit]
        shapes = [_in_words(shape) for shape in self.shapes]
        return f"{' or '.join(shapes)}{self._unit() if shapes == [''] else f', each {self._unit()}'}"


def _has(found: Any, shape: tuple[int | None, ...]) -> bool:
    if not shape:
        return not isinstance(found, (list, Mapping))
    return (
        isinstance(found, list)
        and len(found) > 0
        and shape[0] in (None, len(found))
        and all(_has(part, shape[1:]) for part in found)
    )


def _in_words(shape: tuple[int | None, ...]) -> str:
    """A shape for a message: "[., ., .]"."""
    if not shape:
        return ""
    inner = _in_words(shape[1:]) or "."
    return f"[{inner}, {inner}, ...]" if shape[0] is None else f"[{', '.join([inner] * shape[0])}]"


def _short(found: Any) -> str:
    text = (
        f'"{found}"' if isinstance(found, str) else "a table" if isinstance(found, Mapping) else repr(found)
    )
    return text if len(text) < 60 else f"{text[:56]} ..."


def read_table(
    place: str, table: Any, keys: Mapping[str, Value], needed: tuple[str, ...] = ()
) -> dict[str, Any]:
    """All values of a table; ModelError for keys that it does not take, lacks, or that hold something else."""
    if not isinstance(table, Mapping):
        raise ModelError(f"{place}: found {_short(table)}, expected a table, [{place.rpartition(': ')[2]}]")
    for name in table:
        if name not in keys:
            raise ModelError(f"{at(place, name)}: there is no such key{did_you_mean(name, list(keys))}")
    for name in needed:
        if name not in table:
            raise ModelError(f"{at(place, name)}: found nothing, expected {keys[name].expected()}")
    return {name: keys[name].read(at(place, name), found) for name, found in table.items()}


def read_toml(file: Path) -> dict[str, Any]:
    """A file as TOML; ModelError if that is not possible."""
    try:
        return tomllib.loads(file.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        raise ModelError(f"{file}: there is no such file; check its path") from None
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ModelError(
            f'{file}: cannot be read as TOML ({error}); names as "arms[0].length" stand in quotes'
        ) from error


def at(place: str, name: str) -> str:
    """The place of a key in a table, `cell.toml: limits.strokes`."""
    return f"{place}{name}" if place.endswith(": ") else f"{place}.{name}"
