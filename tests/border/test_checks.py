"""Checks of arguments: what they return, and the one sentence with which they refuse."""

import pickle
from decimal import Decimal
from fractions import Fraction
from typing import Literal

import casadi as ca
import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau.border.checks import array, check_words, instance, number, one_of, whole
from gantrytau.border.refusal import Given, SolveError


def told(call, *arguments, **options):
    with pytest.raises(ModelError) as refusal:
        call("f", "x", *arguments, **options)
    assert refusal.value.argument == "x"
    return str(refusal.value)


def test_words_are_those_of_the_list():
    assert one_of("f", "x", "a", ("a", "b")) == "a"
    assert told(one_of, "linar", ("linear", "robust", "huber")) == (
        "f: found x='linar', expected 'linear', 'robust' or 'huber'; did you mean 'linear'?"
    )
    assert one_of("f", "x", np.str_("a"), ("a", 1)) == "a"
    assert one_of("f", "x", np.int64(1), ("a", 1)) == 1
    assert told(one_of, True, ("auto", 1)) == "f: found x=True, expected 'auto' or 1"
    assert told(one_of, 1, ("auto", True)) == "f: found x=1, expected 'auto' or True"
    assert told(one_of, np.zeros(2), ("a",)) == "f: found x=[0.0, 0.0], expected 'a'"


def fit(loss: Literal["linear", "robust"] = "linear", frame: Literal["base"] | None = None, n: int | str = 1):
    """A function whose annotations list its words."""
    check_words(fit, {"loss": loss, "frame": frame, "n": n})


def test_words_come_from_the_annotation():
    fit(frame=None, n="many")
    with pytest.raises(ModelError) as refusal:
        fit(frame="tool")  # type: ignore[arg-type]
    assert str(refusal.value) == "fit: found frame='tool', expected 'base' or None"


@pytest.mark.parametrize("found", [3, 3.0, np.int64(3), np.array(3.0), ca.DM(3), np.float32(3), Fraction(3)])
def test_a_number_is_what_python_calls_one(found):
    assert number("f", "x", found) == 3.0


def test_infinity_is_no_limit_where_it_may_stand():
    assert number("f", "x", np.inf, above=0, most=np.inf) == np.inf
    assert number("f", "x", -np.inf, least=-np.inf) == -np.inf
    assert told(number, -np.inf, above=0, most=np.inf) == "f: found x=-inf, expected a finite number above 0"
    assert told(number, np.inf, above=0) == "f: found x=inf, expected a finite number above 0"


def test_a_number_brings_its_unit():
    assert number("f", "x", "700 mm", unit="m") == pytest.approx(0.7)
    assert "kg" in told(number, "7 kg", unit="m")
    assert (
        told(number, -1, above=0, below=2, unit="m")
        == "f: found x=-1, expected a number above 0 and below 2 in m"
    )


@pytest.mark.parametrize(
    "found",
    [
        "3",
        True,
        np.True_,
        None,
        [3.0],
        1j,
        np.complex128(1),
        10**400,
        ca.SX.sym("u"),
        ca.DM([1, 2]),
        np.nan,
        object,
    ],
)
def test_what_is_no_number_is_refused(found):
    assert "number of at least 0" in told(number, found, least=0)
    assert "number" in told(array, found, (3,))


@pytest.mark.parametrize("found", [2.0, True, np.True_, "2", None, -1, 7])
def test_a_whole_number_is_an_integer_within_its_limits(found):
    assert whole("f", "x", np.int32(2), least=0, most=5) == whole("f", "x", np.array(2)) == 2
    assert told(whole, found, least=0, most=5).endswith(
        "expected a whole number of at least 0 and of at most 5"
    )


def test_an_array_has_its_shape_and_unit():
    assert array("f", "x", [1, 2, 3], (3,)).tolist() == [1.0, 2.0, 3.0]
    assert array("f", "x", ["1 mm", "2 mm"], (None,), unit="m").tolist() == [0.001, 0.002]
    assert (
        told(array, [[1, 2]], (3,), (None, 3), unit="m")
        == "f: found x of 1 x 2, expected 3 numbers or n x 3 numbers in m"
    )
    assert told(array, 5, (None,), (1,)) == "f: found x=5, expected a list of numbers or 1 number"
    assert told(array, [1, 2], ()) == "f: found x of 2 numbers, expected a number"
    assert array("f", "x", ca.DM([1, 2, 3]), (3,)).shape == (3,)
    assert array("f", "x", ca.DM([1, 2, 3]), (None, 1)).shape == (3, 1)
    assert array("f", "x", [Fraction(1, 2), Decimal(1)], (2,)).tolist() == [0.5, 1.0]
    assert told(array, [1, np.nan], (2,)) == "f: found x[1] = nan, expected finite numbers"
    assert np.isnan(array("f", "x", [1, np.nan], (2,), finite=False)[1])
    assert np.isnan(array("f", "x", [1, None], (2,), finite=False)[1])
    assert ", expected " in told(array, [1, None], (2,))


@pytest.mark.parametrize("found", [["a"], [1, [2, 3]], [1j], None, [True], "1", [ca.SX.sym("u"), 1]])
def test_what_holds_no_numbers_is_refused(found):
    assert ", expected " in told(array, found, (None,), finite=False)


def test_an_object_is_of_its_class():
    assert instance("f", "x", 1, (int, float)) == 1
    assert told(instance, int, (int, float)) == "f: found x=<class 'int'>, expected int or float"


def test_an_error_keeps_its_facts_on_the_way():
    error = SolveError("take ", Given("steps", 5), place="f", found=Given("x", 1), time=2.0).within("here")
    sent = pickle.loads(pickle.dumps(error))
    assert str(sent) == str(error) == "here: f: found x=1, take steps=5"
    assert (sent.time, sent.found, sent.argument) == (2.0, Given("x", 1), "x")
    assert sent.words(lambda part: f"--{part.name} {part.value}") == "take --steps 5"
