"""Units that people write: what they are in SI, how exactly they come back, and what is refused."""

import math

import numpy as np
import pytest

from gantrytau import ModelError, in_unit, si
from gantrytau.border.dimensions import OTHERS, PREFIXED, PREFIXES, SYMBOLS, dimension, per_second, radians
from gantrytau.border.units import USUAL, given, known_scale, scale

# from the definitions of the units: BIPM, SI brochure (2019), tables 8 and 7; NIST SP 811, appendix B
DEFINED = [
    ("90 deg", math.pi / 2),
    ("180°", math.pi),
    ("700 mm", 0.7),
    ("5 Mm", 5e6),
    ("2 µm", 2e-6),
    ("36 km/h", 10.0),
    ("60 rpm", 2 * math.pi),
    ("1 rev/min", math.pi / 30),
    ("1 1/min", 1 / 60),
    ("1.2e3 kN.m", 1.2e6),
    ("4 Nm", 4.0),
    ("4 N.mm", 0.004),
    ("4 N·m", 4.0),
    ("2 bar", 2e5),
    ("1 kWh", 3.6e6),
    ("30 %", 0.3),
    ("20 degC", 293.15),
    ("20 °C", 293.15),
    ("-40 degF", 233.15),
    ("6 degC/min", 0.1),  # a rise, of which zero is zero
    ("1 in", 0.0254),
    ("1 lbf", 0.45359237 * 9.80665),
    ("1 psi", 0.45359237 * 9.80665 / 0.0254**2),
    ("1 N.mm/deg", 0.18 / math.pi),
    ("5 m/s^2", 5.0),
    ("3 kg.mm2", 3e-6),
    ("-1.5e-3 m", -1.5e-3),
    ("1 min", 60.0),
    ("1 cd", 1.0),  # a candela, no hundredth of a day
    ("1 mol", 1.0),
    ("2 mT", 2e-3),
]


@pytest.mark.parametrize(("text", "value"), DEFINED)
def test_texts_are_brought_to_si(text, value):
    assert si(text) == pytest.approx(value, rel=2.3e-16, abs=0)  # a rounding


def test_decimals_are_those_of_the_decimal_number():
    """0.7 is the float next to 700 / 1000, and 700 * 0.001 is another one."""
    assert si("700 mm") == 0.7 != 700 * 0.001
    numbers = np.arange(1, 2000)
    assert np.array_equal(si(numbers, "mm"), [float(f"{k}e-3") for k in numbers])
    assert np.array_equal(si(numbers, "um"), [float(f"{k}e-6") for k in numbers])


@pytest.mark.parametrize("unit", [*OTHERS, "km/h", "mdeg", "N.mm/deg", "kg.mm2", "rev/min", "deg/s2"])
def test_what_is_written_comes_back(unit):
    values = np.random.default_rng(0).uniform(0.1, 1e3, 2000) * np.exp(
        np.random.default_rng(1).uniform(-5, 5, 2000)
    )
    back = si(in_unit(values, unit), unit)
    spacing = np.spacing(values + (273.15 if unit in ("degC", "degF") else 0.0))  # that of the larger number
    assert np.max(np.abs(back - values) / spacing) <= 2.0


@pytest.mark.parametrize("unit", SYMBOLS)
def test_coherent_units_change_nothing(unit):
    assert si(0.1, unit) == in_unit(0.1, unit) == 0.1
    assert scale(unit).measures(unit)


def test_every_prefix_stands_before_every_unit_that_takes_one():
    whole = {*SYMBOLS, *OTHERS}
    for name in PREFIXED:
        for prefix, power in PREFIXES.items():
            if prefix + name not in whole:  # cd, min and ft are units of their own
                assert scale(prefix + name).slope == pytest.approx(10.0**power * scale(name).slope, rel=1e-15)


@pytest.mark.parametrize(("unit", "others"), USUAL.items())
def test_the_units_that_messages_offer_measure_what_they_are_offered_for(unit, others):
    assert all(known_scale("x", other, unit).measures(unit) for other in others)
    assert scale(scale(others[0]).coherent).measures(unit)
    assert (dimension(scale(unit).coherent), radians(scale(unit).coherent)) == (
        dimension(unit),
        radians(unit),
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("90 Deg", r"unit 'Deg': there is no unit 'Deg'; did you mean 'deg'\?"),
        ("700 MM", r"there is no unit 'MM'; did you mean 'mm'\?"),
        ("5 KN", r"there is no unit 'KN'; did you mean 'kN'\?"),
        ("5 mmm", r"there is no unit 'mmm'"),
        ("5 dB", "dB is logarithmic, expected a multiple of an SI unit"),
        ("5 m s", r"found a space in it, expected '\.' between factors"),
        ("5 m/s/s", "has 2 '/'; write one"),
        ("5 Nm2", r"can be read in two ways; write '\.' between factors"),
        ("5 m$", "cannot read 'm\\$'"),
        ("0,7 m", "found '0,7 m', expected a number and its unit, as '2.5 mm'; decimals have a point"),
        ("1_000 mm", "expected a number and its unit"),
        ("inf m", "expected a number and its unit"),
        ("[1, [2]] mm", "expected a number and its unit"),
        ("mm", "expected a number and its unit"),
        ("", "expected a number and its unit"),
        ("5", "found '5' in quotes and without a unit, expected '2.5 mm', or a number without quotes"),
        ("-300 degC", "found -300 degC, expected at least -273.15, absolute zero"),
    ],
)
def test_texts_that_are_no_value(text, message):
    with pytest.raises(ModelError, match=message):
        si(text)


def test_a_number_has_its_unit_beside_it_and_a_text_in_it():
    with pytest.raises(ModelError, match=r"found 90 without a unit, expected one; write si\(90, 'deg'\)"):
        si(90)
    with pytest.raises(ModelError, match=r"found '90 deg' and 'deg'"):
        si("90 deg", "deg")


@pytest.mark.parametrize(
    ("value", "unit", "message"),
    [
        ("700 deg", "m", r"^arm.length: found '700 deg', an angle, expected a length in m; write 'm', 'mm', 'cm'"),
        ("5 Hz", "rad/s", r"found '5 Hz', a frequency, expected an angular velocity .* Turns are counted by 'rev/s'"),
        ("5 rpm", "Hz", "found '5 rpm', an angular velocity, expected a frequency in Hz"),
        ("5 N.m/deg", "N.m", "found '5 N.m/deg', a torsional stiffness, expected a torque or an energy"),
        ("3 mrad", "1", "found '3 mrad', an angle, expected a number; write '1' or '%'"),
        ("5 %", "rad", "found '5 %', a number, expected an angle in rad"),
        ("5 mm", None, "found '5 mm' for what has no unit, expected none; declare its unit"),
        ("10 kg.m2/s3", "kg.m2", "found '10 kg.m2/s3', a power, expected a moment of inertia in kg.m2"),
        ("[1, 2] deg", "m", r"found '\[1, 2\] deg', an angle, expected a length"),
        (["1 mm", "2 s"], "m", "found '2 s', a time, expected a length"),
        ("-300 degC", "K", "^arm.length: found -300 degC, expected at least"),
    ],
)  # fmt: skip
def test_what_measures_something_else_is_refused_in_words(value, unit, message):
    with pytest.raises(ModelError, match=message):
        given("arm.length", value, unit)


def test_a_radian_less_is_none_where_other_things_are_counted():
    """A torsional stiffness in N.m is what everybody means by N.m/rad."""
    assert given("c", "5 kN.m", "N.m/rad") == 5000.0


def test_lists_of_texts_and_texts_of_lists():
    assert given("ratio", "0.3", "1") == 0.3
    assert given("r", "[1, 2, 3] mm", "m") == [0.001, 0.002, 0.003]
    assert given("r", ["1 mm", 2, "1 in"], "m") == [0.001, 2, 0.0254]
    assert given("R", [["1 mm", 0.0], [0.0, "2 mm"]], "m") == [[0.001, 0.0], [0.0, 0.002]]
    assert given("r", np.array(["1 mm", "2 mm"]), "m") == [0.001, 0.002]
    same = [1.0, 2.0]
    assert given("r", same, "m") is same


@pytest.mark.parametrize(
    ("unit", "order", "rate"),
    [
        ("rad", 1, "rad/s"),
        ("rad/s", 1, "rad/s2"),
        ("1", 2, "1/s2"),
        ("km/h", 1, "km/(h.s)"),
        ("N.m/(rad.s)", 1, "N.m/(rad.s2)"),
        ("", 1, ""),
        ("m", 0, "m"),
    ],
)
def test_units_of_derivatives(unit, order, rate):
    assert per_second(unit, order) == rate


@pytest.mark.parametrize("kind", [np.int8, np.uint8, np.int16, np.int32, np.int64])
def test_whole_numbers_of_few_bits_do_not_run_over(kind):
    assert si(np.array([40, 100], dtype=kind), "kN").tolist() == [40e3, 100e3]
    assert si(kind(100), "kWh") == 3.6e8
    assert si(np.array([100], dtype=kind), "degC").tolist() == [373.15]
