"""Sampled blocks are those of scipy.signal at every instant, and hold in between."""

from typing import Any

import numpy as np
import pytest
import scipy.signal

from gantrytau import (
    Fixed,
    Input,
    Model,
    ModelError,
    connect,
    cos,
    linearize,
    simulate,
    sin,
    translate,
    white_noise,
)
from gantrytau.blocks import (
    DiscretePid,
    DiscreteTransferFunction,
    FirstOrder,
    Limiter,
    Noise,
    Pid,
    PulseWidth,
    SampleHold,
    Sine,
    Step,
)
from gantrytau.electrical import Ground, Inductor, Resistor, VoltageSource
from tests.mechanisms.rows import in_a_row, row

signal: Any = scipy.signal  # most of it is made at run time, out of sight of type checkers
PERIOD = 0.02
ROUNDING = 1e-12


def wave(t):
    return 2.0 * sin(7 * t) + cos(31 * t)


def sampled_output(block, stop=2.0):
    """Instants but the last, and what the block gives behind each."""

    class Through(Model):
        signal = Input()
        block = SampleHold()

        def equations(self):
            yield connect(self.signal, self.block.u)

    model = type("Through", (Through,), {"block": block})()
    found = simulate(model, stop=stop, inputs={"signal": wave}, points=1001)
    instants = np.arange(round(stop / PERIOD)) * PERIOD
    return instants, np.array([found.at(t + PERIOD / 2, "block.y") for t in instants])


def test_sample_and_hold():
    t, y = sampled_output(SampleHold(period=PERIOD))
    np.testing.assert_allclose(y, 2 * np.sin(7 * t) + np.cos(31 * t), atol=ROUNDING)


@pytest.mark.parametrize(
    ("numerator", "denominator"),
    [
        ([0.1], [1.0, -0.9]),
        ([0.5, 0.5], [1.0, 0.0]),
        ([3.0, -1.0], [2.0, -1.0]),
        (*signal.butter(4, 0.1),),
        (*signal.cheby1(3, 1.0, 0.2, "highpass"),),
        ([1.0], [1.0, 0.0, 0.0, 0.0]),  # a delay
        ([1.0, 0.0], [1.0, -1.0]),  # a sum
    ],
)
def test_discrete_transfer_functions_are_those_of_scipy(numerator, denominator):
    block = DiscreteTransferFunction(numerator=list(numerator), denominator=list(denominator), period=PERIOD)
    t, y = sampled_output(block)
    u = 2 * np.sin(7 * t) + np.cos(31 * t)
    padded = np.concatenate([np.zeros(len(denominator) - len(numerator)), numerator])
    size = max(1.0, np.ptp(y))
    np.testing.assert_allclose(y, signal.lfilter(padded, denominator, u), atol=ROUNDING * size)
    _, whole = signal.dlsim(signal.dlti(np.array(numerator), np.array(denominator), dt=PERIOD), u)
    np.testing.assert_allclose(y, whole.ravel(), atol=100 * ROUNDING * size)  # by way of state space


class Loop(Model):
    """A lag in a loop with a sampled controller, and the wave as its set point."""

    wanted = Input()
    pid = DiscretePid(k=3.0, T_i=0.5, T_d=0.2, N=8.0, b=0.7, c=0.3, period=PERIOD)
    plant = FirstOrder(k=2.0, T=0.7)

    def equations(self):
        yield connect(self.wanted, self.pid.u_s)
        yield from row(self.pid, self.plant, self.pid.u_m)


def reference_loop(kind, limits, count, k=3.0, T_i=0.5, T_d=0.2, N=8.0, b=0.7, c=0.3):
    """The loop as the textbook programs it: outputs of controller and plant from instant to instant."""
    decay = np.exp(-PERIOD / 0.7)
    integral, derivative, x, last = 0.0, 0.0, 0.0, None
    rows = []
    for step in range(count):
        r = 2 * np.sin(7 * step * PERIOD) + np.cos(31 * step * PERIOD)
        wanted = c * r - x
        change = 0.0 if last is None else wanted - last
        derivative = (T_d * derivative + N * T_d * change) / (T_d + N * PERIOD) if "D" in kind else 0.0
        v = k * (b * r - x + integral + derivative)
        y = np.clip(v, *limits)
        rows.append((y, x))
        if "I" in kind:
            integral += PERIOD * ((r - x) / T_i + (y - v) / (k * T_i))
        last = wanted
        x = decay * x + (1 - decay) * 2.0 * y
    return np.array(rows).T


@pytest.mark.parametrize("limits", [None, (-2.0, 1.5)])
@pytest.mark.parametrize("kind", ["P", "PI", "PD", "PID"])
def test_a_sampled_controller_is_that_of_the_textbook(kind, limits):
    settings = dict(kind=kind) | (
        {} if limits is None else dict(actuator=Limiter(lower=limits[0], upper=limits[1]))
    )
    found = simulate(Loop(pid=settings), stop=2.0, inputs={"wanted": wave}, tolerance=1e-12, points=101)
    y, x = reference_loop(kind, limits or (-np.inf, np.inf), 100)
    instants = np.arange(100) * PERIOD
    np.testing.assert_allclose([found.at(t, "plant.y") for t in instants], x, atol=1e-9)
    held = [found.at(t + PERIOD / 2, "pid.y") for t in instants]
    np.testing.assert_allclose(held, y, atol=1e-8)  # the plant's errors, times the gains


def test_a_short_period_comes_near_the_continuous_controller():
    """The difference falls with the period, which is the order of holding a signal."""
    continuous = Pid(k=3.0, T_i=0.5, T_d=0.2, N=8.0, b=0.7, c=0.3)
    expected = simulate(type("Continuous", (Loop,), {"pid": continuous})(), stop=1.0, inputs={"wanted": wave})
    errors = []
    for period in (2e-3, 1e-3):
        found = simulate(Loop(pid=dict(period=period)), stop=1.0, inputs={"wanted": wave})
        errors.append(abs(found.final("plant.y") - expected.final("plant.y")))
    assert errors[1] < 0.01
    assert np.log2(errors[0] / errors[1]) == pytest.approx(1.0, abs=0.2)


def test_the_discrete_system_of_a_block_has_its_transfer_function():
    class Through(Model):
        signal = Input()
        block = DiscreteTransferFunction(numerator=[0.3, 0.1], denominator=[1.0, -1.2, 0.5], period=PERIOD)

        def equations(self):
            yield connect(self.signal, self.block.u)

    system = linearize(Through(), inputs=["signal"], outputs=["block.y"])
    poles = [p for p in np.atleast_1d(system.poles) if abs(p) > 1e-9]
    np.testing.assert_allclose(np.sort_complex(poles), np.sort_complex(np.roots([1.0, -1.2, 0.5])), rtol=1e-9)


def test_a_block_behind_another_is_a_period_behind():
    class Row(Model):
        first, second = SampleHold(period=PERIOD), SampleHold(period=PERIOD)
        source = Sine(frequency=3.0)

        def equations(self):
            yield from row(self.source, self.first, self.second)

    found = simulate(Row(), stop=1.0)
    for t in (0.13, 0.55, 0.99):
        assert found.at(t, "second.y") == found.at(t - PERIOD, "first.y")


@pytest.mark.parametrize("bandwidth", [50.0, 1000.0])
def test_noise_has_its_deviation_and_its_colour(bandwidth):
    """Over n numbers with a correlation time the deviation is known to sqrt(correlation time / time)."""
    period, stop = 2e-3, 8.0
    model = Noise(std=3.0, bandwidth=bandwidth, period=period)
    inputs = {"white": white_noise(1.0, period, 5)}
    found = simulate(model, stop=stop, inputs=inputs, points=round(stop / period) + 1, tolerance=1e-6)
    t = np.arange(round(10 / bandwidth / period) + 1, round(stop / period)) * period
    y = np.interp(t, found.time, found["y"])
    relative = np.sqrt(1 / (bandwidth * stop))  # of a variance, 2 / sqrt(2) of the deviation
    assert np.std(y) == pytest.approx(3.0, rel=4 * relative + 4 / np.sqrt(stop / period))
    decay = np.exp(-bandwidth * period)
    lag = round(1 / bandwidth / period)
    if lag:
        correlation = np.mean(y[lag:] * y[:-lag]) / np.mean(y * y)
        assert correlation == pytest.approx(decay**lag, abs=8 * relative)


@pytest.mark.parametrize(
    ("block", "words"),
    [
        (SampleHold(period=0.0), r"block.*period"),
        (DiscreteTransferFunction(numerator=[1.0, 2.0, 3.0], denominator=[1.0, 0.5]), "found a numerator of"),
        (DiscreteTransferFunction(numerator=[1.0], denominator=[0.0, 0.5]), "does not begin with zero"),
        (DiscreteTransferFunction(numerator=[1.0], denominator=[1.0]), "denominator of degree 0"),
    ],
)
def test_wrong_sampled_blocks(block, words):
    with pytest.raises(ModelError, match=words):
        sampled_output(block)


def test_wrong_noise_and_controllers():
    for model, words in (
        (Noise(bandwidth=0.0), "expected a bandwidth above zero"),
        (Noise(period=0.0), "expected a period above zero"),
        (Loop(pid=dict(period=0.0)), "period"),
        (Loop(pid=dict(T_d=0.0)), "expected T_d above zero"),
    ):
        with pytest.raises(ModelError, match=words):
            translate(model, events=True)


@pytest.mark.parametrize("duty", [0.0, 0.3, 1.0, 1.7])
def test_pulses_of_a_width_make_the_ripple_of_a_winding(duty):
    """After the start has died away the current goes between the two values of the periodic solution."""

    class Chopped(Model):
        duty = Input()
        pulses, source, ground = PulseWidth(amplitude=10.0, period=1e-3), VoltageSource(), Ground()
        resistor, inductor = Resistor(R=2.0), Inductor(L=1e-3, i=Fixed(0.0))

        def equations(self):
            yield from row(self.duty, self.pulses, self.source.v)
            yield from row(self.source.pin_a, self.resistor, self.inductor, self.source.pin_b)
            yield connect(self.source.pin_b, self.ground.pin)

    found = simulate(Chopped(), stop=0.02, inputs={"duty": duty}, points=201, tolerance=1e-10)
    width = min(duty, 1.0)
    lowest = 5.0 * (np.exp(2 * width) - 1) / (np.exp(2.0) - 1)  # R T / L = 2
    assert found.final("inductor.i") == pytest.approx(lowest, abs=1e-7)
    peak = found.at(0.0193, "inductor.i") if width == 0.3 else None
    if peak is not None:
        assert peak == pytest.approx(5.0 - (5.0 - lowest) * np.exp(-0.6), abs=1e-7)


def test_a_step_at_an_instant_is_seen_at_the_next():
    Switched = in_a_row("Switched", step=Step(start_time=5 * PERIOD), hold=SampleHold(period=PERIOD))

    found = simulate(Switched(), stop=0.2)
    assert found.at(4.5 * PERIOD, "hold.y") == 0.0
    assert found.at(6.5 * PERIOD, "hold.y") == 1.0
