"""Sources: exact times, exact integrals, whatever the number of points."""

import numpy as np
import pytest

from gantrytau import ModelError, simulate
from gantrytau.blocks import Integrator, Pulse, Ramp, Sine, Step
from tests.mechanisms.rows import in_a_row

TOLERANCE = 1e-10
NEAR = 1e3 * TOLERANCE  # the integrator holds its tolerance per step; over many pieces errors add up
SINE = Sine(amplitude=2.0, frequency=3.0, phase=np.pi / 2, start_time=0.25, offset=0.5)


def integral(source, stop=1.0, points=2):
    """Result of a source and its integral."""

    Integrated = in_a_row("Integrated", source=Step(), memory=Integrator())

    model = type("Integrated", (Integrated,), {"source": source})()
    return simulate(model, stop=stop, points=points, tolerance=TOLERANCE)


@pytest.mark.parametrize("points", [2, 501])
@pytest.mark.parametrize(
    ("source", "expected"),
    [
        (Step(height=3.0, offset=1.0, start_time=0.3), 1.0 + 3.0 * 0.7),
        (Step(height=3.0), 3.0),
        (Step(height=3.0, start_time=-1.0), 3.0),
        (Step(height=3.0, start_time=1.0 - 1e-9), 3e-9),
        (Ramp(height=4.0, offset=-1.0, start_time=0.2, duration=0.5), -1.0 + 4.0 * (0.25 + 0.3)),
        (Ramp(height=4.0, start_time=0.2, duration=1e-9), 4.0 * (0.8 - 0.5e-9)),
        (SINE, 0.5 + np.sin(4.5 * np.pi) / (3 * np.pi)),
        (Pulse(amplitude=2.0, period=0.1, width=0.25), 0.5),
        (Pulse(amplitude=2.0, period=0.3, width=0.25, start_time=0.1, offset=-1.0), -1.0 + 2.0 * 0.225),
        (Pulse(amplitude=2.0, period=0.1, width=0.0), 0.0),
        (Pulse(amplitude=2.0, period=0.1, width=1.0), 2.0),
        (Pulse(amplitude=1e3, period=0.25, width=1e-3, start_time=0.1), 1e3 * 4 * 0.25e-3),
    ],
)  # fmt: skip
def test_integrals_of_sources_are_exact(source, expected, points):
    assert integral(source, points=points).final("memory.y") == pytest.approx(expected, abs=NEAR)


def test_a_pulse_stands_where_it_should():
    found = integral(Pulse(amplitude=2.0, period=0.3, width=0.25, start_time=0.1), points=1001)
    inside = (found.time > 0.1) & ((found.time - 0.1) % 0.3 < 0.075)
    edges = np.min(
        np.abs(found.time[:, None] - np.ravel([[0.1 + 0.3 * k, 0.175 + 0.3 * k] for k in range(4)])), axis=1
    )
    clear = edges > 1e-9  # at a jump both sides are in the result
    np.testing.assert_array_equal(found["source.y"][clear], np.where(inside, 2.0, 0.0)[clear])


def test_a_sine_follows_its_formula():
    found = integral(Sine(amplitude=-2.0, frequency=5.0, phase=0.4, start_time=0.1, offset=1.0), points=501)
    t = found.time
    late = t > 0.1 + 1e-9
    expected = 1.0 - 2.0 * np.sin(10 * np.pi * (t - 0.1) + 0.4)
    np.testing.assert_allclose(found["source.y"][late], expected[late], atol=1e-12)
    np.testing.assert_array_equal(found["source.y"][t < 0.1 - 1e-9], 1.0)


@pytest.mark.parametrize(
    ("source", "words"),
    [
        (Pulse(period=0.0), r"source \(Pulse\): found source\.period = 0; expected a period above zero"),
        (Pulse(width=1.5), r"source\.width: value is 1.5, expected at most 1"),
        (Ramp(duration=0.0), "expected a duration above zero; a Step takes no time"),
        (Sine(frequency=dict(unit="rad/s", value=[1.0, 2.0])), r"source.frequency: value has shape \(2,\)"),
    ],
)
def test_wrong_sources(source, words):
    with pytest.raises(ModelError, match=words):
        integral(source)
