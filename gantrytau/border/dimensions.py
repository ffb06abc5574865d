"""Units as Modelica writes them ("kg.m2", "m/s2", "N.m.s/rad"), reduced to SI dimensions.

Modelica Language Specification 3.6, chapter 19. The radian is of dimension one, as in the SI. Only
coherent units are known to models: a millimetre inside a model would be a factor of a thousand nobody
applies. At the border, in what people write and read, there are others, `OTHERS` and prefixes; `scales` brings them to SI.
"""

import re
from fractions import Fraction
from functools import cache

from gantrytau.border.refusal import ModelError

BASE = ("m", "kg", "s", "A", "K", "mol", "cd")
# whole exponents are int, which are many times as quick to add and compare
Dimension = tuple[int | Fraction, ...]

ONE: Dimension = (0,) * len(BASE)


def _dimension(**powers: int) -> Dimension:
    return tuple(powers.get(base, 0) for base in BASE)


def whole(exponent: int | Fraction) -> int | Fraction:
    """The same exponent, as an int if it is one."""
    return int(exponent) if exponent.denominator == 1 else exponent


SYMBOLS: dict[str, Dimension] = {
    "1": ONE,
    "rad": ONE,
    "sr": ONE,
    "m": _dimension(m=1),
    "kg": _dimension(kg=1),
    "s": _dimension(s=1),
    "A": _dimension(A=1),
    "K": _dimension(K=1),
    "mol": _dimension(mol=1),
    "cd": _dimension(cd=1),
    "Hz": _dimension(s=-1),
    "N": _dimension(m=1, kg=1, s=-2),
    "Pa": _dimension(m=-1, kg=1, s=-2),
    "J": _dimension(m=2, kg=1, s=-2),
    "W": _dimension(m=2, kg=1, s=-3),
    "C": _dimension(A=1, s=1),
    "V": _dimension(m=2, kg=1, s=-3, A=-1),
    "Ohm": _dimension(m=2, kg=1, s=-3, A=-2),
    "F": _dimension(m=-2, kg=-1, s=4, A=2),
    "H": _dimension(m=2, kg=1, s=-2, A=-2),
    "Wb": _dimension(m=2, kg=1, s=-2, A=-1),
    "T": _dimension(kg=1, s=-2, A=-1),
    "S": _dimension(m=-2, kg=-1, s=3, A=2),
}
# Other units -> the coherent unit that each is a multiple of, the factor, and the power of pi behind it. Those of inches and
# pounds are exact by definition (NIST SP 811, appendix B), as all here: a horsepower, of which there are several, is none.
OTHERS: dict[str, tuple[str, Fraction, int]] = {
    "g": ("kg", Fraction(1, 1000), 0),
    "t": ("kg", Fraction(1000), 0),
    "min": ("s", Fraction(60), 0),
    "h": ("s", Fraction(3600), 0),
    "d": ("s", Fraction(86400), 0),
    "deg": ("rad", Fraction(1, 180), 1),
    "arcmin": ("rad", Fraction(1, 10800), 1),
    "arcsec": ("rad", Fraction(1, 648000), 1),
    "rev": ("rad", Fraction(2), 1),
    "rpm": ("rad/s", Fraction(1, 30), 1),
    "Nm": ("N.m", Fraction(1), 0),
    "Nmm": ("N.m", Fraction(1, 1000), 0),
    "bar": ("Pa", Fraction(100_000), 0),
    "l": ("m3", Fraction(1, 1000), 0),
    "L": ("m3", Fraction(1, 1000), 0),
    "Wh": ("J", Fraction(3600), 0),
    "degC": ("K", Fraction(1), 0),
    "degF": ("K", Fraction(5, 9), 0),
    "in": ("m", Fraction(254, 10_000), 0),
    "ft": ("m", Fraction(3048, 10_000), 0),
    "lb": ("kg", Fraction(45_359_237, 100_000_000), 0),
    "lbf": ("N", Fraction(44_482_216_152_605, 10_000_000_000_000), 0),
    "psi": ("Pa", Fraction(44_482_216_152_605, 64_516 * 100_000), 0),
    "%": ("1", Fraction(1, 100), 0),
}
ZEROS = {"degC": 273.15, "degF": 459.67}  # what is added to a temperature before the factor makes it K
LOGARITHMIC = ("dB", "dBm", "Np", "pH")
PREFIXES = {
    "f": -15, "p": -12, "n": -9, "u": -6, "m": -3, "c": -2, "d": -1, "da": 1, "h": 2, "k": 3, "M": 6, "G": 9, "T": 12,
}  # fmt: skip
PREFIXED = (
    *(name for name in SYMBOLS if name not in ("1", "kg", "sr")),
    "g",
    "bar",
    "l",
    "L",
    "deg",
    "Nm",
    "Wh",
)
FACTOR = re.compile(r"(?P<symbol>[A-Za-z]+|1|%)(?P<power>[+-]?\d+)?$")


@cache
def dimension(unit: str) -> Dimension:
    """SI exponents (m, kg, s, A, K, mol, cd) of a unit; ModelError for a text that is none."""
    numerator, *denominators = unit.replace(" ", "").split("/")
    if len(denominators) > 1:
        raise ModelError(f"unit '{unit}' has {len(denominators)} '/'; write one, as in 'N.m/(rad.s)'")
    total = list(ONE)
    for text, sign in ((numerator, 1), *((part, -1) for part in denominators)):
        for factor in text.strip("()").split("."):
            for place, power in enumerate(_factor(factor, unit)):
                total[place] += sign * power
    return tuple(total)


def _factor(text: str, unit: str) -> Dimension:
    match = FACTOR.match(text)
    if match is None:
        raise ModelError(f"unit '{unit}': cannot read '{text}'; write units as in 'kg.m2/s2'")
    symbol, power = match["symbol"], int(match["power"] or 1)
    if symbol not in SYMBOLS:
        raise ModelError(
            f"unit '{unit}': '{symbol}' is not a coherent SI unit; quantities are in SI inside a model "
            "(m, kg, s, rad, N, N.m, ...), convert where the number enters, or say how to show it: unit='rad', display='deg'"
        )
    return tuple(power * exponent for exponent in SYMBOLS[symbol])


def unit_text(dimension: Dimension) -> str:
    """A dimension written out in base units, for messages: 'kg.m/s2'."""

    def product(items):
        return ".".join(f"{base}{'' if power == 1 else power}" for base, power in items)

    above = [(base, power) for base, power in zip(BASE, dimension, strict=True) if power > 0]
    below = [(base, -power) for base, power in zip(BASE, dimension, strict=True) if power < 0]
    text = product(above) or "1"
    if below:
        text += "/" + (product(below) if len(below) == 1 else f"({product(below)})")
    return text


def radians(unit: str) -> int:
    """The exponent of the radian in a unit: 1 for "rad/s", -1 for "N.m/rad"."""
    total = 0
    for sign, part in zip((1, -1), unit.replace(" ", "").split("/"), strict=False):
        for factor in part.strip("()").split("."):
            match = FACTOR.match(factor)
            if match is not None and match["symbol"] == "rad":
                total += sign * int(match["power"] or 1)
    return total


def per_second(unit: str, order: int = 1) -> str:
    """The unit of a derivative of that order, with one '/' as Modelica writes it: "rad/s2" of "rad/s", "1/s" of "1"."""
    if not unit or not order:
        return unit
    above, _, below = unit.partition("/")
    factors = [*below.strip("()").split(".")] if below else []
    times = [f for f in factors if f.rstrip("0123456789") == "s"]
    power = order + sum(int(f[1:] or 1) for f in times)
    rest = [f for f in factors if f not in times]
    joined = ".".join([*rest, "s" if power == 1 else f"s{power}"])
    return f"{above}/({joined})" if rest else f"{above}/{joined}"
