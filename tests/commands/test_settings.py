"""`--set NAME=VALUE`: numbers, vectors, and what is neither."""

import pytest

from gantrytau.commands.arguments.values import number, split
from gantrytau.commands.printing.reporting import CommandError


@pytest.mark.parametrize(
    ("text", "value"),
    [("2", 2), ("-1e-3", -1e-3), (".5", 0.5), ("[1, 2.5]", [1, 2.5]), ("1,2", [1, 2]), ("true", True)],
)
def test_numbers_and_vectors(text, value):
    assert number("--set", "m", text) == value


@pytest.mark.parametrize("text", ["x", "[1, a]", "[]", "'text'", "None", "nan", "{1: 2}", "(" * 300])
def test_what_is_no_number(text):
    with pytest.raises(CommandError, match=r"--set m=.*: expected a number as 2.5, one with its unit as"):
        number("--set", "m", text)


@pytest.mark.parametrize("text", ["700 mm", "[1, 2, 3] mm", "90 deg", "-5 degC", "30 %", ".5 in"])
def test_values_with_units_are_left_to_the_model(text):
    assert number("--set", "m", text) == text


def test_what_is_no_value_with_a_unit_is_told_with_its_option():
    with pytest.raises(CommandError, match=r"^--set m=700 MM: unit 'MM': there is no unit 'MM'; did you"):
        number("--set", "m", "700 MM")


@pytest.mark.parametrize("text", ["m", "=2", "m=", "m= "])
def test_what_is_no_setting(text):
    with pytest.raises(CommandError, match=r"expected NAME=VALUE, as --set m=2.5"):
        split("--set", text)


def test_a_setting_reaches_the_model(answer, fails):
    """A pendulum of 4 m falls from where it is put: its tension per length tells its start."""
    found = answer(
        "simulate", "Pendulum", "--stop", "1e-9", "--set", "L=5", "--set", "x.start=3", "--set", "y.start=-4"
    )
    assert found["final"]["tension"] == pytest.approx(9.81 * 4 / 5**2, rel=1e-6)  # m g cos(phi) / L
    assert "Pendulum has no 'LL'" in fails(2, "check", "Pendulum", "--set", "LL=1")
    assert "expected NAME=VALUE" in fails(2, "check", "Pendulum", "--set", "L")
