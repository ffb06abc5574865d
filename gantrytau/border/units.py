"""Units at the border: numbers that people write and read, "700 mm" or 90 deg, and their values in SI.

    SI value = (number + zero) * factor * pi**pis

zero is that of temperatures alone: 20 degC are 293.15 K. A unit that is made of others has none: degC/s is K/s, as a rise of
one degC is one of 1 K. Angles are told from numbers, unlike in equations: neither 5 Hz nor 5 1/s is an angular velocity in
rad/s, of which somebody has to say whether turns or radians were counted.
"""

import ast
import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np

from gantrytau.border.dimensions import (
    FACTOR,
    LOGARITHMIC,
    ONE,
    OTHERS,
    PREFIXED,
    PREFIXES,
    SYMBOLS,
    ZEROS,
    Dimension,
    dimension,
    radians,
    unit_text,
    whole,
)
from gantrytau.border.refusal import ModelError, did_you_mean

KINDS = {
    "1": "a number", "rad": "an angle", "m": "a length", "m2": "an area", "m3": "a volume", "s": "a time",
    "m/s": "a speed", "m/s2": "an acceleration", "rad/s": "an angular velocity", "rad/s2": "an angular acceleration",
    "1/s": "a frequency", "kg": "a mass", "kg.m2": "a moment of inertia", "N": "a force", "N.m": "a torque or an energy",
    "N/m": "a stiffness", "N.s/m": "a damping", "N.m/rad": "a torsional stiffness", "N.m.s/rad": "a torsional damping",
    "Pa": "a pressure", "W": "a power", "K": "a temperature", "A": "a current", "V": "a voltage", "Ohm": "a resistance",
}  # fmt: skip
USUAL = {  # what people write in place of a coherent unit, the most usual first
    "1": ("%",), "rad": ("deg", "mrad", "rev"), "m": ("mm", "cm", "um", "in"), "s": ("ms", "min", "h"),
    "m/s": ("mm/s", "km/h"), "m/s2": ("mm/s2",), "rad/s": ("rpm", "deg/s", "rev/s"), "rad/s2": ("deg/s2",),
    "kg": ("g", "t", "lb"), "kg.m2": ("kg.mm2",), "N": ("kN", "mN", "lbf"), "N.m": ("N.mm", "kN.m", "Nm"),
    "N/m": ("N/mm",), "N.m/rad": ("N.m/deg",), "Pa": ("bar", "kPa", "MPa", "psi"), "W": ("kW",), "J": ("kJ", "kWh"),
    "K": ("degC", "degF"), "A": ("mA",), "V": ("mV", "kV"), "Ohm": ("kOhm",), "H": ("mH",), "F": ("uF",),
    "Hz": ("kHz", "1/min"), "m2": ("mm2", "cm2"), "m3": ("l", "cm3"),
}  # fmt: skip
SPELLINGS = {"µ": "u", "μ": "u", "°C": "degC", "°F": "degF", "°": "deg", "Ω": "Ohm", "·": ".", "⋅": ".", "*": ".",
             "²": "2", "³": "3", "^": ""}  # fmt: skip
DIGITS = 12  # behind the first, that a number of few digits may have
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_VALUE = re.compile(rf"\s*(?P<number>{_NUMBER}|\[.*\])\s*(?P<unit>[^\d\s\[\].,+_-].*?|1/.*?)?\s*")


@dataclass(frozen=True)
class Scale:
    """A unit as it is written. angle: the exponent of the radian in it, which deg, rev and rpm hold as well."""

    text: str
    dimension: Dimension
    angle: int
    factor: Fraction
    pis: int
    zero: float = 0.0

    def si(self, numbers: Any) -> Any:
        """Numbers in this unit, an array or one, in SI, to a rounding or two; ModelError below absolute zero."""
        if self.zero and np.any(np.asarray(numbers) < -self.zero):
            low = float(np.min(numbers))
            raise ModelError(f"found {low:g} {self.text}, expected at least {-self.zero:g}, absolute zero")
        return self._si(numbers)

    def _si(self, numbers: Any) -> Any:
        if not isinstance(numbers, (int, float)) and np.asarray(numbers).dtype.kind in "iu":
            numbers = np.asarray(numbers, dtype=float)[()]  # 40 kN of 16 bits are no -25536 N
        if self.zero:
            return (numbers + self.zero) * self.slope
        if self._plain:  # 700 mm are 700 / 1000 m, which 700 * 0.001 is not
            whole = numbers if self.factor.numerator == 1 else numbers * self.factor.numerator
            return whole / self.factor.denominator
        return numbers * self.slope

    def written(self, values: Any) -> Any:
        """Values in SI, an array or one, in this unit; `si` undoes it to a rounding or two.

        Where a number of few digits is the same in SI, it is that one: 60 deg, and not 59.99999999999999.
        """
        plain = self._plain and not self.zero
        whole = np.asarray(values, dtype=float)
        found = (
            whole * self.factor.denominator / self.factor.numerator
            if plain
            else whole / self.slope - self.zero
        )
        with np.errstate(all="ignore"):
            power = 10.0 ** (DIGITS - np.floor(np.log10(np.abs(found))))
            rounded = np.round(found * power) / power
            found = np.where(self._si(rounded) == whole, rounded, found)
        return float(found) if isinstance(values, (int, float)) else found[()]

    @property
    def slope(self) -> float:
        """What a difference of one in this unit is in SI."""
        return self.factor.numerator * math.pi**self.pis / self.factor.denominator

    @property
    def coherent(self) -> str:
        """The SI unit of its values, in base units: "rad/s" for "rpm"."""
        text = unit_text(self.dimension)
        if not self.angle:
            return text
        turns = "rad" if abs(self.angle) == 1 else f"rad{abs(self.angle)}"
        above, _, below = text.partition("/")
        if self.angle > 0:
            above = turns if above == "1" else f"{above}.{turns}"
            return f"{above}/{below}" if below else above
        return f"{above}/({below.strip('()')}.{turns})" if below else f"{above}/{turns}"

    @property
    def _plain(self) -> bool:
        return self.pis == 0 and max(self.factor.numerator, self.factor.denominator) < 2**53

    def measures(self, unit: str) -> bool:
        """Whether it is a unit of what a quantity in a coherent unit is.

        A radian more or less is none where nothing else is counted, and nowhere a degree: 5 Hz are no 5 rad/s.
        """
        angle = radians(unit)
        if self.dimension != dimension(unit):
            return False
        plain = all(power == 0 for place, power in enumerate(self.dimension) if place != _SECONDS)
        return self.angle == angle or (self.pis == 0 and not plain)

    @property
    def kind(self) -> str:
        """What is measured in it, in words: "a length", "what is measured in kg/s"."""
        for unit, words in KINDS.items():
            if dimension(unit) == self.dimension and radians(unit) == self.angle:
                return words
        return f"what is measured in {self.coherent}"


_SECONDS = 2  # the place of s in a dimension


@cache
def scale(text: str) -> Scale:
    """A unit that somebody wrote: "mm", "km/h", "N.mm/deg", "°C"; ModelError for a text that is none."""
    plain = text.strip()
    for written, meant in SPELLINGS.items():
        plain = plain.replace(written, meant)
    plain = re.sub(r"\s*([./()])\s*", r"\1", plain)
    if plain in ("", "-"):
        plain = "1"
    if " " in plain:
        raise ModelError(f"unit '{text}': found a space in it, expected '.' between factors, as in 'N.m'")
    numerator, *denominators = plain.split("/")
    if len(denominators) > 1:
        raise ModelError(f"unit '{text}' has {len(denominators)} '/'; write one, as in 'N.m/(rad.s)'")
    powers, angle, factor, pis = list(ONE), 0, Fraction(1), 0
    for part, sign in ((numerator, 1), *((one, -1) for one in denominators)):
        for written in part.strip("()").split("."):
            unit, own, turns, power = _factor(written, text)
            power *= sign
            for place, exponent in enumerate(dimension(unit)):
                powers[place] += power * exponent
            angle, factor, pis = angle + power * radians(unit), factor * own**power, pis + power * turns
    return Scale(text.strip(), tuple(map(whole, powers)), angle, factor, pis, ZEROS.get(plain, 0.0))


def _factor(text: str, unit: str) -> tuple[str, Fraction, int, int]:
    """A factor of a unit: the coherent unit that it is a multiple of, the factor, the power of pi, and its power."""
    match = FACTOR.match(text)
    if match is None:
        raise ModelError(f"unit '{unit}': cannot read '{text}'; write units as in 'mm', 'km/h', 'kg.m2/s2'")
    symbol, power = match["symbol"], int(match["power"] or 1)
    if symbol in ("Nm", "Nmm", "Wh") and power != 1:
        raise ModelError(
            f"unit '{unit}': '{text}' can be read in two ways; write '.' between factors, as in 'N.m2'"
        )
    if symbol in SYMBOLS:
        return symbol, Fraction(1), 0, power
    if symbol in OTHERS:
        return *OTHERS[symbol], power
    for prefix, exponent in PREFIXES.items():
        bare = symbol.removeprefix(prefix)
        if bare != symbol and bare in PREFIXED:
            base, factor, pis = OTHERS.get(bare, (bare, Fraction(1), 0))
            return base, factor * Fraction(10) ** exponent, pis, power
    if symbol in LOGARITHMIC:
        raise ModelError(
            f"unit '{unit}': {symbol} is logarithmic, expected a multiple of an SI unit; say what it is a level of, and "
            "convert it there"
        )
    known = tuple(dict.fromkeys((*SYMBOLS, *OTHERS, *(u for units in USUAL.values() for u in units))))
    alike = [name for name in known if name.lower() == symbol.lower()]
    remedy = f"; did you mean '{alike[0]}'?" if alike else did_you_mean(symbol, known)
    raise ModelError(f"unit '{unit}': there is no unit '{symbol}'{remedy}")


def known_scale(place: str, text: Any, unit: str | None, found_as: str = "") -> Scale:
    """A unit for a quantity that is declared in `unit`; ModelError, with the place, unless it measures the same.

    found_as: the whole text, where the unit stands behind a number.
    """
    if not isinstance(text, str):
        raise ModelError(f"found {text!r}, expected a unit as text, as 'deg'", place=place)
    try:
        found = scale(text)
    except ModelError as error:
        raise error.within(place) from None
    if unit is None:
        raise ModelError(
            f"found '{found_as or text}' for what has no unit, expected none; declare its unit, as unit='m'",
            place=place,
        )
    if not found.measures(unit):
        turns = (
            " Turns are counted by 'rev/s' or 'rpm'."
            if unit == "rad/s" and found.kind == KINDS["1/s"]
            else ""
        )
        raise ModelError(
            f"found '{found_as or text}', {found.kind}, expected {_expected(unit)}; write {_examples(unit)}.{turns}",
            place=place,
        )
    return found


def _expected(unit: str) -> str:
    """What a unit measures, in words: "a length in m"."""
    kind = scale(unit).kind
    return "a number" if unit == "1" else f"{kind if kind in KINDS.values() else 'a value'} in {unit}"


def _examples(unit: str) -> str:
    """Units that a quantity in a coherent unit may be written in: "'m', 'mm' or 'cm'"."""
    first, *others = (f"'{one}'" for one in (unit, *USUAL.get(unit, ())[:3]))
    return ", ".join([first, *others[:-1]]) + f" or {others[-1]}" if others else first


def si(value: Any, unit: str | None = None) -> Any:
    """A value in SI, of a number or array and its unit, or of a text with both: `si(90, "deg")`, `si("90 deg")`.

    Raises ModelError for a text that is no unit or no value, and for temperatures below absolute zero.
    """
    if isinstance(value, str):
        if unit is not None:
            raise ModelError(
                f"si: found '{value}' and '{unit}', expected a number with its unit; write si('90 deg')"
            )
        number, written = _split("si", value, "m")
        return scale(written).si(number)
    if unit is None:
        raise ModelError(
            f"si: found {value!r} without a unit, expected one; write si(90, 'deg') or si('90 deg')"
        )
    return scale(unit).si(np.asarray(value, dtype=float) if isinstance(value, (list, tuple)) else value)


def in_unit(value: Any, unit: str) -> Any:
    """A value in SI, a number or array, written in another unit: `in_unit(result["phi"], "deg")`."""
    return scale(unit).written(np.asarray(value, dtype=float) if isinstance(value, (list, tuple)) else value)


def given(place: str, value: Any, unit: str | None) -> Any:
    """A value for a quantity that is declared in `unit`: texts in it, as "700 mm", brought to SI, all else as it is.

    Lists of texts, and texts of lists, "[1, 2, 3] mm", become lists. ModelError for a text of another kind, or of none.
    """
    if isinstance(value, str):
        number, written = _split(place, value, unit)
        try:
            found = known_scale(place, written, unit, value.strip()).si(number)
        except ModelError as error:
            raise error if error.place == place else error.within(place) from None
        return found.tolist() if isinstance(found, np.ndarray) else found
    if isinstance(value, np.ndarray) and value.dtype.kind in "UO":
        value = value.tolist()
    if isinstance(value, (list, tuple)) and _holds_text(value):
        return [given(place, one, unit) for one in value]
    return value


def shape_of(value: Any) -> tuple[int, ...]:
    """The shape of a value, of the vector in a text "[1, 2, 3] mm" too; () of a text that is none."""
    if isinstance(value, str):
        match = _VALUE.fullmatch(value)
        try:
            return np.shape(ast.literal_eval(match["number"])) if match else ()
        except (ValueError, SyntaxError):
            return ()
    return np.shape(value)


def _holds_text(value: Iterable[Any]) -> bool:
    return any(isinstance(x, str) or (isinstance(x, (list, tuple)) and _holds_text(x)) for x in value)


def _split(place: str, text: str, unit: str | None) -> tuple[Any, str]:
    """The number, or array, and the unit of a text; ModelError where it lacks one of them."""
    example = f"2.5 {USUAL.get(unit or 'm', (unit,))[0]}"
    match = _VALUE.fullmatch(text)
    number: Any = None
    if match is not None:
        try:
            number = ast.literal_eval(match["number"])
            number = np.asarray(number, dtype=float) if isinstance(number, list) else float(number)
        except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError):
            number = None
    if match is None or number is None:
        comma = "; decimals have a point" if re.search(r"\d,\d", text) else ""
        raise ModelError(
            f"found '{text}', expected a number and its unit, as '{example}'{comma}", place=place
        )
    if not match["unit"] and unit != "1":
        raise ModelError(
            f"found '{text}' in quotes and without a unit, expected '{example}', or a number without quotes, which is in SI",
            place=place,
        )
    return number, match["unit"] or "1"
