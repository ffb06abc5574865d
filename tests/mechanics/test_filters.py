"""Filters against SciPy's, against closed-form step responses, and in front of an inverse robot."""

import itertools

import numpy as np
import pytest
from scipy import signal

from gantrytau import Array, Fixed, Input, Model, ModelError, Start, connect, cos, simulate, sin, translate
from gantrytau.mechanics.filters import LowPass, coefficients
from gantrytau_models import GantryTau, prototypes

KINDS = ["critical", "bessel", "butterworth"]
TOLERANCE = 1e-10
NEAR = 1e3 * TOLERANCE  # the integrator holds its tolerance per step; over a move errors add up


class Filtered(Model):
    """A reference in m through one filter."""

    reference = Input(unit="m", description="reference")
    filter = LowPass(order=3, bandwidth=20.0, unit="m")

    def equations(self):
        yield connect(self.filter.u, self.reference)


def gain(polynomial, w):
    """|1 / polynomial(i w)|."""
    return 1 / np.abs(np.polyval(polynomial[::-1], 1j * w))


@pytest.mark.parametrize("order", range(1, 11))
def test_poles_are_those_of_scipy(order):
    for kind, poles in (
        ("bessel", signal.besselap(order, norm="mag")[1]),
        ("butterworth", signal.buttap(order)[1]),
    ):
        polynomial = np.real(np.poly(np.array(poles)))[::-1]
        # a coefficient is a sum of up to 252 products of ten poles: a thousand roundings
        np.testing.assert_allclose(coefficients(order, kind), polynomial / polynomial[0], rtol=2e-13)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("order", [1, 2, 3, 5, 10])
def test_gain_is_one_at_rest_and_3_dB_less_at_the_bandwidth(kind, order):
    found = coefficients(order, kind)
    assert gain(found, 0.0) == 1.0
    assert gain(found, 1.0) == pytest.approx(np.sqrt(0.5), rel=1e-14)
    assert np.all(np.diff(gain(found, np.linspace(0, 10, 1001))) <= 1e-15)  # falls steadily
    # far above it falls by 20 dB per decade and order
    assert gain(found, 1e7) / gain(found, 1e6) == pytest.approx(10.0**-order, rel=1e-5)


def test_a_critical_filter_has_equal_real_poles():
    for order in (1, 2, 4):
        w = 1 / np.sqrt(2 ** (1 / order) - 1)  # (1 + (1/w)^2)^n = 2
        expected = np.real(np.poly([-w] * order))
        np.testing.assert_allclose(coefficients(order, "critical"), expected[::-1] / w**order, rtol=1e-14)


@pytest.mark.parametrize("kind", KINDS)
def test_step_response_is_that_of_scipy(kind):
    # the reference is one from the start on; the filter stands at zero then
    model = Filtered(filter=dict(kind=kind, steady=False, y=Fixed(0.0)))
    found = simulate(model, stop=0.5, inputs={"reference": 1.0}, tolerance=TOLERANCE)
    denominator = (coefficients(3, kind) / 20.0 ** np.arange(4))[::-1]
    _, expected = signal.step(([1.0], denominator), T=found.time)
    np.testing.assert_allclose(found["filter.y"], expected, atol=NEAR)
    overshoot = np.max(found["filter.y"]) - 1.0
    if kind == "critical":
        assert overshoot < NEAR
    else:  # third order: 0.8 % of Bessel, 8.1 % of Butterworth
        assert overshoot == pytest.approx({"bessel": 0.0075, "butterworth": 0.0815}[kind], abs=5e-4)


def test_a_sine_at_the_bandwidth_comes_out_3_dB_lower():
    # steady state of the filter driven by cos(w t): the transient of time constant 1/39 s is over after 2 s
    found = simulate(
        Filtered(), stop=3.0, inputs={"reference": lambda t: cos(20.0 * t)}, tolerance=TOLERANCE, points=3001
    )
    late = found.time > 2.0
    transfer = 1 / np.polyval(coefficients(3, "critical")[::-1], 1j)
    assert abs(transfer) == pytest.approx(np.sqrt(0.5), rel=1e-14)
    expected = np.real(transfer * np.exp(20j * found.time))
    np.testing.assert_allclose(found["filter.y"][late], expected[late], atol=NEAR)


def test_it_starts_at_rest_at_the_first_sample_and_arrives_at_the_last():
    times = np.linspace(0.0, 3.0, 31)
    values = 0.7 + np.clip(times - 0.5, 0, 1)
    names = ["filter.y", "der(filter.y)", "der(der(filter.y))", "der(der(der(filter.y)))"]
    found = simulate(
        Filtered(), stop=3.0, inputs={"reference": (times, values)}, outputs=names, tolerance=TOLERANCE
    )
    for name, value in zip(names, [0.7, 0.0, 0.0, 0.0], strict=True):
        still = found.time <= 0.5
        np.testing.assert_allclose(found[name][still], value, atol=NEAR * 20.0**3)
    assert found.final("filter.y") == pytest.approx(1.7, abs=1e-9)  # e^-58 of the way remains
    # the delay of a ramp is the first coefficient
    ramp = (found.time > 1.3) & (found.time < 1.5)
    delay = coefficients(3, "critical")[1] / 20.0
    np.testing.assert_allclose(found["filter.y"][ramp], 0.2 + found.time[ramp] - delay, atol=1e-7)


def test_derivatives_up_to_the_order_are_the_slopes_of_y():
    names = ["filter.y", "der(filter.y)", "der(der(filter.y))", "der(der(der(filter.y)))"]
    inputs = {"reference": lambda t: sin(7 * t) + 0.5 * cos(11 * t)}
    found = simulate(Filtered(), stop=1.0, inputs=inputs, outputs=names, tolerance=TOLERANCE, points=4001)
    h = found.time[1]
    for name, rate in itertools.pairwise(names):
        slope = (found[name][2:] - found[name][:-2]) / (2 * h)
        scale = np.max(np.abs(found[rate]))
        # central differences miss h^2/6 of two derivatives more, each at first three poles of 39 rad/s: 1.4e-4
        np.testing.assert_allclose(slope, found[rate][1:-1], atol=3e-4 * scale)


def test_a_vector_is_filtered_element_by_element():
    class Three(Model):
        reference = Input(3, unit="m", description="reference")
        all = LowPass(order=2, bandwidth=30.0, size=3, unit="m", kind="bessel")
        one = LowPass(order=2, bandwidth=30.0, unit="m", kind="bessel")

        def equations(self):
            yield self.all.u == self.reference
            yield self.one.u == self.reference[1]

    times = np.linspace(0, 1, 6)
    values = np.random.default_rng(1).normal(size=(6, 3))
    found = simulate(Three(), stop=1.0, inputs={"reference": (times, values)}, tolerance=TOLERANCE)
    assert found["all.y"].shape == (501, 3)
    np.testing.assert_allclose(found["all.y"][:, 1], found["one.y"], atol=NEAR)
    np.testing.assert_allclose(found["all.y"][0], values[0], atol=NEAR)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (dict(order=0), r"filter \(LowPass\), equation 1: order: found 0"),
        (dict(order=2.5), "order: found 2.5, expected a whole number"),
        (dict(kind="elliptic"), "kind: found 'elliptic', expected one of critical, bessel, butterworth"),
        (dict(size=-1), r"filter\.u: found shape \(-1,\), expected"),
        (dict(bandwidth=-1.0), r"filter\.bandwidth: value is -1, expected at least 0"),
        (dict(y=dict(unit="rad")), "units disagree"),
    ],
)
def test_wrong_filters(settings, words):
    with pytest.raises(ModelError, match=words):
        translate(Filtered(filter=settings))


class Followed(Model):
    """The robot led along a sampled path of its tool; the forces of its carts follow."""

    robot = GantryTau(prototypes.L1)
    reference = Input(3, unit="m", description="tool position", start=[0.5, 2.8, -0.8])
    filters = Array(LowPass, 3, order=3, bandwidth=40.0, unit="m")

    def equations(self):
        for k, one in enumerate(self.filters):
            yield connect(one.u, self.reference[k])
            yield self.robot.tool.r[k] == one.y


def path():
    """A move of the tool, sampled at 100 Hz: times (101,), values (101, 3)."""
    times = np.linspace(0.0, 1.0, 101)
    way = np.clip((times - 0.1) / 0.4, 0.0, 1.0)[:, None]
    return times, np.array([0.6, 2.9, -0.8]) + way * np.array([0.3, 0.2, -0.1])


def led_and_moved(inverse, points):
    """The robot led along the path, and the robot moved by the forces found, both at `points` times."""
    led = simulate(inverse, stop=1.0, inputs={"reference": path()}, tolerance=TOLERANCE, points=points)
    begin = dict(r=Fixed(list(led["robot.tool.r"][0])), v=Fixed(0.0))
    forces = {f"carts[{k}].f": (led.time, led[f"robot.carts[{k}].f"]) for k in range(3)}
    robot = GantryTau(prototypes.L1, tool=begin)
    return led, simulate(robot, stop=1.0, inputs=forces, tolerance=TOLERANCE, points=points)


def test_forces_from_a_sampled_tool_path_move_the_robot_along_it():
    inverse = translate(Followed(), given=["reference"])
    errors = []
    for points in (501, 1001):
        led, moved = led_and_moved(inverse, points)
        errors.append(np.max(np.abs(moved["tool.r"] - led["robot.tool.r"])))
    # the forces are handed over as samples joined by straight lines: an error of second order
    assert errors[1] < 1e-5
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.2)
    # the robot starts at rest at the first sample and arrives at the last
    np.testing.assert_allclose(led["robot.tool.r"][0], path()[1][0], atol=1e-12)
    np.testing.assert_allclose(led["robot.tool.v"][0], 0.0, atol=1e-12)
    np.testing.assert_allclose(led.final("robot.tool.r"), path()[1][-1], atol=1e-5)
    # in between it has the speed of the path
    speed = np.linalg.norm(np.diff(path()[1], axis=0), axis=1) / 0.01
    found = np.linalg.norm(led["robot.tool.v"], axis=1)
    assert np.max(found) == pytest.approx(np.max(speed), rel=1e-6)


def test_forces_need_a_filter_of_the_second_order():
    second = translate(Followed(filters=dict(order=2)), given=["reference"])
    found = simulate(second, stop=0.3, inputs={"reference": path()}, points=7)
    assert np.all(np.isfinite(found["robot.carts[0].f"]))
    first = translate(Followed(filters=dict(order=1)), given=["reference"])
    with pytest.raises(ModelError, match=r"input reference\[0\] is differentiated 1 times by the model"):
        simulate(first, stop=1.0, inputs={"reference": path()})


def test_a_filter_that_does_not_start_steadily_starts_where_the_model_does():
    start = [0.6, 2.9, -0.8]
    model = Followed(filters=dict(steady=False), robot=dict(tool=dict(r=Start(start))))
    found = simulate(
        translate(model, given=["reference"]), stop=0.5, inputs={"reference": [0.7, 2.8, -0.8]}, points=6
    )
    np.testing.assert_allclose(found["robot.tool.r"][0], start, atol=1e-12)
    np.testing.assert_allclose(found["robot.tool.v"][0], 0.0, atol=1e-12)
    assert found.final("robot.tool.r") == pytest.approx([0.7, 2.8, -0.8], abs=1e-6)
