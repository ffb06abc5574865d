"""Units as Modelica writes them ("kg.m2", "m/s2", "N.m.s/rad"), reduced to SI dimensions.

Modelica Language Specification 3.6, chapter 19. The radian is of dimension one, as in the SI. Only
coherent units are known to models: a millimetre inside a model would be a factor of a thousand nobody
applies. Files, which people write, may bring another unit with a number: `FACTORS` bring it to SI.
"""

import math
import re
from fractions import Fraction
from functools import cache

from gantrytau.errors import ModelError

BASE = ("m", "kg", "s", "A", "K", "mol", "cd")
Dimension = tuple[
    int | Fraction, ...
]  # whole exponents are int, which are many times as quick to add and compare

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
FACTORS = {  # unit of a quantity -> texts that a file may write behind its number -> factor
    "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6},
    "rad": {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180},
    "s": {"s": 1.0, "ms": 1e-3},
    "m/s": {"m/s": 1.0, "mm/s": 1e-3},
    "rad/s": {"rad/s": 1.0, "deg/s": math.pi / 180, "rpm": math.pi / 30},
    "N": {"N": 1.0, "kN": 1e3},
    "N.m": {"N.m": 1.0, "Nm": 1.0, "kN.m": 1e3},
}
FACTOR = re.compile(r"(?P<symbol>[A-Za-z]+|1)(?P<power>[+-]?\d+)?$")


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
            "(m, kg, s, rad, N, N.m, ...), convert where the number enters"
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
