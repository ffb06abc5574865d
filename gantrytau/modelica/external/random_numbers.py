"""Generators of Modelica.Math.Random, xorshift64*, 128+ and 1024* (Vigna 2014), on numbers and on expressions alike.

A word of 64 bits is two Integers of 32 bits with their signs, the lower one first, as in a state of the generators. Sums and
products modulo 2^64 are taken in four digits of 16 bits, so that all numbers stay whole and exact in floating point.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np

DIGITS, DIGIT = 4, 16
STAR_64, STAR_1024 = 2685821657736338717, 1181783497276652981
Bits = list[Any]  # 64 numbers 0 or 1, the lowest first


def _bits(pair: Sequence[Any]) -> Bits:
    found: Bits = []
    for half in pair:
        rest = half - 2.0**32 * ca.floor(half / 2.0**32)  # without sign
        found += _lowest(rest, 32)
    return found


def _lowest(number: Any, count: int) -> Bits:
    """The lowest bits of a whole number."""
    halved = [ca.floor(number / 2.0**k) for k in range(count + 1)]
    return [one - 2 * further for one, further in pairwise(halved)]


def _number(bits: Sequence[Any]) -> Any:
    return reduce(lambda found, bit: 2 * found + bit, reversed(bits), 0)


def _pair(bits: Bits) -> list[Any]:
    halves = (bits[:32], bits[32:])
    return [_number(one) - 2.0**32 * one[-1] for one in halves]


def _xor(a: Bits, b: Bits) -> Bits:
    return [x + y - 2 * x * y for x, y in zip(a, b, strict=True)]


def _moved(bits: Bits, places: int) -> Bits:
    """The word shifted to the left; to the right by places below zero."""
    return [0] * places + bits[: 64 - places] if places > 0 else bits[-places:] + [0] * -places


def _digits(bits: Bits) -> list[Any]:
    return [_number(bits[DIGIT * k : DIGIT * (k + 1)]) for k in range(DIGITS)]


def _carried(columns: Sequence[Any]) -> Bits:
    """The word whose digits, lowest first, are these sums, modulo 2^64."""
    found: Bits = []
    carry: Any = 0
    for column in columns:
        whole = column + carry
        carry = ca.floor(whole / 2.0**DIGIT)
        found += _lowest(whole - 2.0**DIGIT * carry, DIGIT)
    return found


def _times(a: Bits, factor: int) -> Bits:
    digits, factors = _digits(a), [factor >> DIGIT * k & 0xFFFF for k in range(DIGITS)]
    return _carried([sum(digits[j] * factors[k - j] for j in range(k + 1)) for k in range(DIGITS)])


def _fraction(bits: Bits) -> Any:
    """The number above 0 up to 1 of a word with its sign."""
    low, high = _pair(bits)
    unsigned = low + 2.0**32 * bits[31]
    return (high + unsigned / 2.0**32) / 2.0**32 + 0.5


def _xorshift64(state: Any) -> tuple[Any, Any]:
    x = _bits(state)
    for places in (-12, 25, -27):
        x = _xor(x, _moved(x, places))
    x = _times(x, STAR_64)
    return _state(_pair(x)), _value(_fraction(x))


def _xorshift128(state: Any) -> tuple[Any, Any]:
    s1, s0 = _bits(state[:2]), _bits(state[2:])
    s1 = _xor(s1, _moved(s1, 23))
    mixed = reduce(_xor, (s1, s0, _moved(s1, -17), _moved(s0, -26)))
    mixed = _carried([x + y for x, y in zip(_digits(mixed), _digits(s0), strict=True)])
    return _state([*state[2:], *_pair(mixed)]), _value(_fraction(mixed))


def _xorshift1024(state: Any) -> tuple[Any, Any]:
    *words, place = state
    place = place - 16 * ca.floor(place / 16)
    following = ca.if_else(place > 14.5, 0, place + 1)
    s0, s1 = (_bits([_picked(words[k::2], at) for k in (0, 1)]) for at in (place, following))
    s1 = _xor(s1, _moved(s1, 31))
    s1, s0 = _xor(s1, _moved(s1, -11)), _xor(s0, _moved(s0, -30))
    mixed = _xor(s0, s1)
    new = _pair(mixed)
    kept = [ca.if_else(_is(following, n // 2), new[n % 2], word) for n, word in enumerate(words)]
    return _state([*kept, following]), _value(_fraction(_times(mixed, STAR_1024)))


def _is(place: Any, k: int) -> Any:
    return ca.logic_and(place > k - 0.5, place < k + 0.5)


def _picked(words: Sequence[Any], place: Any) -> Any:
    return sum(ca.if_else(_is(place, k), word, 0) for k, word in enumerate(words))


def _value(found: Any) -> Any:
    plain = not isinstance(found, ca.SX) or found.is_constant()
    return float(found) if plain else found


def _state(found: Sequence[Any]) -> np.ndarray:
    made = np.empty(len(found), dtype=object)
    made[:] = [int(one) if isinstance(one := _value(x), float) else one for x in found]
    return made


FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    "ModelicaRandom_xorshift64star": _xorshift64,
    "ModelicaRandom_xorshift128plus": _xorshift128,
    "ModelicaRandom_xorshift1024star": _xorshift1024,
}
