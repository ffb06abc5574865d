"""What bounds or bends a signal, against the integral in closed form of what comes out."""

from typing import Any

import numpy as np
import pytest

from gantrytau import Fixed, Input, Model, ModelError, simulate, sin, translate
from gantrytau.blocks import DeadZone, Hysteresis, Integrator, Limiter, RateLimiter, Step
from tests.mechanisms.rows import in_a_row, row

TOLERANCE = 1e-10
NEAR = 1e3 * TOLERANCE  # the integrator holds its tolerance per step; over some seconds errors add up


def bent(block, signal, stop=1.0, points=2):
    """Result of a signal through a block and an integrator."""

    Bent = in_a_row("Bent", signal=Input(), block=Limiter(), memory=Integrator())

    model = type("Bent", (Bent,), {"block": block})()
    return simulate(model, stop=stop, inputs={"signal": signal}, tolerance=TOLERANCE, points=points)


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
def test_a_limiter_cuts_a_sine_at_exact_times(size):
    limiter = Limiter(lower=-0.25 * size, upper=0.5 * size)
    found = bent(limiter, lambda t: size * sin(2 * np.pi * t))
    # half a wave above: cut where the sine is 1/2; below: where it is 1/4
    areas = [
        (2 * (1 - np.cos(angle)) + np.sin(angle) * (np.pi - 2 * angle)) / (2 * np.pi)
        for angle in (np.arcsin(0.5), np.arcsin(0.25))
    ]
    assert found.final("memory.y") / size == pytest.approx(areas[0] - areas[1], abs=NEAR)
    assert (found["block.y"] <= 0.5 * size).all()
    assert (found["block.y"] >= -0.25 * size).all()


def test_limits_may_be_equal_and_may_not_be_crossed():
    found = translate(Limiter(lower=2.0, upper=2.0)).evaluate({"u": -7.0})
    assert found["y"] == 2.0
    for block in (Limiter, DeadZone):
        with pytest.raises(ModelError, match="expected upper >= lower; exchange the two"):
            translate(block(lower=1.0, upper=-1.0))


def test_what_a_dead_zone_and_a_limiter_pass_is_the_signal_together():
    limits: dict[str, Any] = dict(lower=-0.3, upper=0.7)
    zone, limiter = translate(DeadZone(**limits)), translate(Limiter(**limits))
    for u in (-2.0, -0.3, 0.0, 0.7, 0.9):
        passed = [one.evaluate({"u": u})["y"] for one in (zone, limiter)]
        assert passed[0] + passed[1] == u
        assert passed[0] == (u - 0.7 if u > 0.7 else u + 0.3 if u < -0.3 else 0.0)


def test_a_dead_zone_ends_at_exact_times():
    found = bent(DeadZone(lower=-1.0, upper=0.5), lambda t: sin(2 * np.pi * t))
    angle = np.pi / 6  # of the sine 1/2
    area = (2 * np.cos(angle) - np.sin(angle) * (np.pi - 2 * angle)) / (2 * np.pi)
    assert found.final("memory.y") == pytest.approx(area, abs=NEAR)


def test_a_rate_limiter_rises_and_falls_at_its_rates():
    Followed = in_a_row(
        "Followed",
        step=Step(height=2.0, start_time=0.1),
        limiter=RateLimiter(rising=4.0, falling=-1.0, T=1e-3),
    )

    found = simulate(Followed(), stop=1.0, tolerance=TOLERANCE, points=1001)
    t, y = found.time, found["limiter.y"]
    rising = (t > 0.1) & (y < 2.0 - 4e-3 * 1.01)  # the lag takes over where (2 - y) / T < 4
    np.testing.assert_allclose(y[rising], 4.0 * (t[rising] - 0.1), atol=NEAR)
    late = t > 0.1 + 0.499
    np.testing.assert_allclose(y[late], 2.0 - 4e-3 * np.exp(-(t[late] - 0.599) / 1e-3), atol=NEAR)
    down = simulate(Followed(step=dict(height=-0.5)), stop=1.0, tolerance=TOLERANCE, points=1001)
    falling = (down.time > 0.1) & (down["limiter.y"] > -0.5 + 1.01e-3)
    np.testing.assert_allclose(down["limiter.y"][falling], 0.1 - down.time[falling], atol=NEAR)


def test_a_rate_limiter_begins_at_its_input_and_lags_behind_slow_ones():
    found = bent(RateLimiter(rising=10.0, T=0.01), lambda t: 3.0 + 2.0 * t, points=101)
    expected = 3.0 + 2.0 * (found.time - 0.01 * (1 - np.exp(-found.time / 0.01)))
    np.testing.assert_allclose(found["block.y"], expected, atol=NEAR)


def test_wrong_rates():
    wrongs: list[tuple[dict[str, Any], str]] = [
        (dict(T=0.0), "expected a time constant T above zero"),
        (dict(falling=1.0), r"falling: value is 1, expected at most 0"),
        (dict(rising=-1.0, falling=-1.0), r"rising: value is -1, expected at least 0"),
    ]
    for settings, words in wrongs:
        with pytest.raises(ModelError, match=words):
            translate(RateLimiter(**settings))


class Relay(Model):
    """A relay in a loop with an integrator: a triangle between the limits."""

    relay = Hysteresis(lower=-1.0, upper=1.0, low=1.0, high=-1.0)
    memory = Integrator(y=Fixed(0.0))

    def equations(self):
        yield from row(self.relay, self.memory, self.relay)


@pytest.mark.parametrize("points", [2, 1001])
def test_a_relay_in_a_loop_makes_a_triangle(points):
    found = simulate(Relay(), stop=20.3, points=points, tolerance=TOLERANCE)
    expected = 1 - np.abs((found.time + 1) % 4 - 2)
    np.testing.assert_allclose(found["memory.y"], expected, atol=NEAR)


def test_a_relay_that_begins_outside_is_on_the_right_side_of_it():
    """From 3 down at rate one to -1, up to 1, ...; from -2 up to 1 first."""
    above = simulate(Relay(memory=dict(y=Fixed(3.0))), stop=10.0, points=1001, tolerance=TOLERANCE)
    assert above["relay.y"][0] == -1.0
    for t, y in ((3.0, 0.0), (4.0, -1.0), (5.0, 0.0), (7.0, 0.0), (9.0, 0.0)):
        assert above.at(t, "memory.y") == pytest.approx(y, abs=NEAR)
    below = simulate(Relay(memory=dict(y=Fixed(-2.0))), stop=10.0, points=1001, tolerance=TOLERANCE)
    for t, y in ((2.0, 0.0), (4.0, 0.0), (6.0, 0.0)):
        assert below.at(t, "memory.y") == pytest.approx(y, abs=NEAR)


def test_a_relay_that_begins_between_its_limits_is_low():
    found = simulate(
        Hysteresis(low=-5.0, high=5.0), stop=1.0, inputs={"u": lambda t: 2 * sin(2 * np.pi * t)}, points=2001
    )
    t, y = found.time, found["y"]
    first, second = 1 / 12, 7 / 12  # where 2 sin(2 pi t) is 1 and -1
    clear = (np.abs(t - first) > 1e-9) & (np.abs(t - second) > 1e-9)
    expected = np.where((t > first) & (t < second), 5.0, -5.0)
    np.testing.assert_array_equal(y[clear], expected[clear])


def test_limits_of_a_relay_may_not_be_crossed():
    with pytest.raises(ModelError, match="expected upper >= lower; exchange the two"):
        translate(Hysteresis(lower=1.0, upper=-1.0), events=True)
