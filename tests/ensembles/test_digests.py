"""One number for what a study depends on: alike for alike things, another for what differs by a bit."""

import os
import subprocess
import sys
from dataclasses import dataclass
from functools import partial

import casadi as ca
import numpy as np
import pytest

from gantrytau.ensembles.digests import digest


@dataclass(frozen=True)
class Pair:
    a: float
    b: object = None


class Scaled:
    """A function with a number."""

    def __init__(self, factor):
        self.factor = factor

    def __call__(self, a):
        return self.factor * a

    def twice(self, a):
        return 2 * self.factor * a


def scaled(factor):
    return lambda a: factor * a


x = ca.SX.sym("x")
PAIRS = {
    "last bit": (1.0, np.nextafter(1.0, 2.0)),
    "kind of number": (1, 1.0),
    "arrays": (np.zeros(3), np.zeros((3, 1))),
    "arrays of bits": (np.array([1.0]), np.array([np.nextafter(1.0, 2.0)])),
    "nesting": ([[1], 2], [1, [2]]),
    "mappings": ({"a": 1}, {"a": 2}),
    "mapping or pairs": ({"a": 1}, [("a", 1)]),
    "records": (Pair(1.0), Pair(2.0)),
    "records within": (Pair(1.0, Pair(1.0)), Pair(1.0, Pair(2.0))),
    "digits of an expression": (x * 1.0000001, x * 1.0000002),
    "closures": (scaled(2.0), scaled(3.0)),
    "partials": (partial(max, 1), partial(max, 2)),
    "callables": (Scaled(2.0), Scaled(3.0)),
    "methods": (Scaled(2.0).twice, Scaled(3.0).twice),
    "functions": (lambda a: a, lambda a: a + 1),
}


@pytest.mark.parametrize("name", PAIRS)
def test_what_differs_has_another_number(name):
    a, b = PAIRS[name]
    assert digest(a) != digest(b)
    assert digest(a) == digest(a)


def test_alike_things_have_one_number():
    assert digest({"a": 1, "b": 2}) == digest({"b": 2, "a": 1})
    assert digest({"c", "a", "b"}) == digest({"b", "c", "a"})
    assert digest(scaled(2.0)) == digest(scaled(2.0))
    assert digest(ca.SX.sym("x") ** 2) == digest(ca.SX.sym("x") ** 2)


def test_things_that_hold_themselves_have_a_number():
    held: list = [1]
    held.append(held)
    assert digest(held) == digest(held)

    def power(a, n):
        return a * power(a, n - 1) if n else 1

    assert digest(power) == digest(power)


def test_the_number_is_the_same_in_another_process():
    code = (
        "from gantrytau.ensembles.digests import digest; print(digest({'a', 'b', 'c'}, {'x': [1.0, None]}))"
    )
    for seed in ("1", "2"):
        found = subprocess.run(
            [sys.executable, "-c", code],
            capture_output=True,
            text=True,
            check=True,
            env={**os.environ, "PYTHONHASHSEED": seed},
        )
        assert found.stdout.strip() == digest({"a", "b", "c"}, {"x": [1.0, None]})
