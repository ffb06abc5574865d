"""Declarations: names, units and limits before values, and what is refused of these."""

from typing import Any

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau_fmu.controller.channels import Channel, Declaration

NOTHING: Any = None
TEXTS: Any = ["q"]
MOTION = Declaration([Channel("q", "m", 3, -1.0, 2.0), Channel("speed", "m/s")])


def test_a_vector_comes_back_by_name_bit_by_bit():
    values = {"q": [0.1, 1 / 3, 2.0], "speed": -1e300}
    vector = MOTION.vector(values)
    assert vector.dtype == np.float64
    assert MOTION.elements == ("q[0]", "q[1]", "q[2]", "speed")
    assert {name: part.tolist() for name, part in MOTION.by_name(vector).items()} == {
        "q": values["q"],
        "speed": [values["speed"]],
    }


def test_a_scalar_may_be_a_vector_of_one():
    assert np.array_equal(MOTION.vector({"q": np.zeros(3), "speed": [4.0]}), [0, 0, 0, 4])


def test_limits_belong_to_the_range_and_the_next_number_does_not():
    assert not MOTION.refusal(np.array([-1.0, 2.0, 0.0, 1e308]))
    beyond = np.array([-1.0, np.nextafter(2.0, 3.0), 0.0, 0.0])
    assert MOTION.refusal(beyond) == "found q[1] = 2 m, expected a number in [-1, 2]"


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("place", range(4))
def test_what_is_not_finite_is_refused_at_every_place(bad, place):
    vector = np.zeros(4)
    vector[place] = bad
    assert MOTION.elements[place] in MOTION.refusal(vector)


@pytest.mark.parametrize("wrong", [np.zeros(3), np.zeros((4, 1)), np.array(0.0)])
def test_another_shape_is_refused(wrong):
    assert "expected (4,)" in MOTION.refusal(wrong)


@pytest.mark.parametrize(
    "wrong", [[0.0] * 4, None, "abcd", np.array(list("abcd")), np.zeros(4, dtype=complex)]
)
def test_what_is_no_array_of_numbers_is_refused(wrong):
    assert "expected an array of numbers" in MOTION.refusal(wrong)


def test_nothing_is_a_declaration_too():
    assert Declaration().size == 0
    assert not Declaration().refusal(Declaration().vector({}))


@pytest.mark.parametrize(
    ("make", "argument", "words"),
    [
        (lambda: Channel("", "m"), "name", "that can be printed"),
        (lambda: Channel("q\n", "m"), "name", "that can be printed"),
        (lambda: Channel("q", "metre"), None, "metre"),
        (lambda: Channel("q", NOTHING), "unit", "as 'm/s', or '1'"),
        (lambda: Channel("q", "m", 0), "size", "at least 1"),
        (lambda: Channel("q", "m", 1, 2.0, 1.0), "minimum", "below the maximum, 1"),
        (lambda: Declaration(TEXTS), "channels", "Channel(name, unit)"),
        (lambda: Declaration([Channel("q", "m")] * 2), None, "'q' twice"),
        (lambda: Declaration([Channel("q", "m", 4097)]), None, "found 4097 numbers, expected 4096 at most"),
        (lambda: MOTION["sped"], None, "there is no channel 'sped'; did you mean 'speed'?"),
        (lambda: MOTION.vector({"q": np.zeros(3)}), None, "speed: found no value, expected one number"),
        (lambda: MOTION.vector({"q": 1.0, "speed": 0.0}), None, "q: found 1.0, expected 3 numbers in m"),
        (lambda: MOTION.vector({"q": "abc", "speed": 0.0}), None, "q: found 'abc', expected 3 numbers in m"),
        (lambda: MOTION.vector({"w": 1.0}), None, "there is no channel 'w'; there is q, speed."),
    ],
)
def test_wrong_declarations_say_what_is_expected(make, argument, words):
    with pytest.raises(ModelError) as error:
        make()
    assert error.value.argument == argument
    assert words in str(error.value)


def test_an_infinite_limit_is_none():
    channel = Channel("q", "m", minimum=-np.inf, maximum=np.inf)
    assert (channel.minimum, channel.maximum) == (-np.inf, np.inf)
