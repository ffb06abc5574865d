"""Delays in FMUs: the method of steps, what simulate finds, saved states, and what is refused."""

from ctypes import c_size_t
from math import factorial

import numpy as np
import pytest

from gantrytau import (
    Input,
    Model,
    Parameter,
    Real,
    Samples,
    delay,
    der,
    fabs,
    if_else,
    pre,
    reinit,
    sampled,
    simulate,
    sin,
    time,
    when,
)
from gantrytau_fmu import check_fmu
from tests.fmu.exported import Exported, export
from tests.fmu.runtime.raw_calls import ERROR, OK, integers, reals

VERSIONS = pytest.mark.parametrize("version", [2, 3])
EVERY = 0.0997  # s, where nothing jumps


class Oscillator(Model):
    """x' = -x(t - T), x = 1 before the start."""

    x = Real(start=1.0, fixed=True, description="deflection")
    y = Real(description="twice the deflection half a delay ago")
    T = Parameter(1.0, unit="s", description="delay")

    def equations(self):
        yield der(self.x) == -delay(self.x, self.T)
        yield self.y == 2 * delay(self.x, 0.5 * self.T)


def by_steps(t: float, T: float = 1.0) -> float:
    """The oscillator by the method of steps, a polynomial more for each delay."""
    return sum((-1) ** k * max(t - (k - 1) * T, 0.0) ** k / factorial(k) for k in range(int(t / T) + 2))


@pytest.fixture(scope="module")
def oscillators(tmp_path_factory) -> dict[int, Exported]:
    folder = tmp_path_factory.mktemp("delays")
    return {v: export(Oscillator(), folder / f"late{v}.fmu", v, tolerance=1e-10) for v in (2, 3)}


def followed(run, steps: int, size: float, T: float) -> float:
    """The largest error of both variables over some steps."""
    worst = 0.0
    for _ in range(steps):
        run.step(size)
        late = by_steps(max(run.time - T / 2, 0.0), T)
        worst = max(worst, abs(run["x"] - by_steps(run.time, T)), abs(run["y"] - 2 * late))
    return worst


@VERSIONS
def test_the_delayed_oscillator_is_that_of_the_method_of_steps(oscillators, version):
    """Also with a delay that is set, and where communication points are no parts of it."""
    assert not check_fmu(oscillators[version].path, run=True)
    for size, steps, T in ((0.1, 100, 1.0), (0.37, 20, 1.0), (5.0, 2, 1.0), (0.1, 40, 0.8)):
        with oscillators[version].new().begin(T=T) as run:
            assert followed(run, steps, size, T) < 1e-9  # ten times the tolerance


def test_a_stiff_solver_remembers_as_well(tmp_path):
    with export(Oscillator(), tmp_path / "stiff.fmu", solver="rodas4", tolerance=1e-10).new().begin() as run:
        assert followed(run, 50, 0.1, 1.0) < 1e-9


@VERSIONS
def test_model_exchange_remembers_the_steps_of_the_importer(oscillators, version):
    import fmpy

    found = fmpy.simulate_fmu(
        str(oscillators[version].path),
        stop_time=10.0,
        output_interval=0.1,
        relative_tolerance=1e-10,
        fmi_type="ModelExchange",
        output=["x"],
    )
    assert max(abs(x - by_steps(t)) for t, x in zip(found["time"], found["x"], strict=True)) < 1e-6


def test_a_short_delay(oscillators):
    """The decay that a delay of 1 ms hardly changes: exp(-s t), s = exp(s T), less what the start adds."""
    T, s = 1e-3, 1.0
    for _ in range(50):
        s = np.exp(s * T)
    # the residue of 1 / p - exp(-p T) / (p (p + exp(-p T))) at p = -s; the other roots have died away
    amplitude = 1 / (s * (1 - s * T))
    with oscillators[3].new().begin(T=T) as run:
        run.step(1.0)
        assert run["x"] == pytest.approx(amplitude * np.exp(-s), abs=1e-9)


@VERSIONS
def test_states_go_on_to_the_last_bit_and_reset_begins_anew(oscillators, version):
    def points(run) -> list[float]:
        return [(run.step(0.13), run["x"], run["y"])[1] for _ in range(20)]

    with oscillators[version].new().begin() as run, oscillators[version].new() as other:
        first = points(run)
        state, now = run.instance.save(), run.time
        expected = points(run)
        assert run.instance.restore(state) == OK
        run.time = now
        assert points(run) == expected
        status, copy = other.instance.deserialize(run.instance.serialize(state))
        assert status == OK
        assert other.instance.restore(copy) == OK
        other.time = now
        assert points(other) == expected
        other.instance.forget(copy)
        damaged = bytearray(run.instance.serialize(state))
        damaged[-100] ^= 1  # within what is remembered
        status, copy = run.instance.deserialize(bytes(damaged))
        assert status == OK
        assert run.instance.restore(copy) == ERROR
        assert "checksum" in run.instance.message
        run.instance.forget(copy)
        run.instance.forget(state)
        assert run.instance("Reset") == OK
        run.begin()
        assert points(run) == first


class Relay(Model):
    x = Real(start=0.2, fixed=True, description="deflection")

    def equations(self):
        yield der(self.x) == if_else(delay(self.x, 0.25) > 0, -1.0, 1.0)


class Two(Model):
    x = Real(start=1.0, fixed=True)
    v = Real(start=0.0, fixed=True)

    def equations(self):
        yield der(self.x) == self.v
        yield der(self.v) == -2 * delay(self.x, 0.3) - delay(self.v * self.x, 0.7) - 0.3 * self.v


class Bouncing(Model):
    h = Real(start=1.0, fixed=True)
    v = Real(start=0.0, fixed=True)
    x = Real(start=0.0, fixed=True)

    def equations(self):
        yield der(self.h) == self.v
        yield der(self.v) == -9.81
        yield der(self.x) == delay(self.v, 0.2) + fabs(delay(self.v, 0.15))
        yield when(self.h <= 0, reinit(self.v, -0.8 * pre(self.v)))


class Implicit(Model):
    x = Real(start=1.0, fixed=True)
    z = Real(start=0.5)

    def equations(self):
        yield der(self.x) == -delay(self.z, 0.4)
        yield self.z + 0.3 * sin(self.z) == self.x


class Algebraic(Model):
    x = Real(description="a wave, 0.4 s ago")
    y = Real(description="looks back at itself")

    def equations(self):
        yield self.x == delay(sin(30 * time), 0.4)
        yield self.y == 1 - 0.5 * delay(self.y, 0.2) + time


class Sampling(Model):
    x = Real(start=1.0, fixed=True)
    s = Real(start=0.0)

    def equations(self):
        yield sampled(self.s, self.x, period=0.1)
        yield der(self.x) == -delay(self.s, 0.13)


@pytest.mark.parametrize(
    "model", [Relay, Two, Bouncing, Implicit, Algebraic, Sampling], ids=lambda m: m.__name__
)
def test_delays_are_those_of_simulate(model, tmp_path):
    import fmpy

    expected = simulate(model(), stop=30 * EVERY, tolerance=1e-11, points=31)
    fmu = export(model(), tmp_path / "late.fmu", tolerance=1e-11)
    with fmu.new().begin() as run:
        for _ in range(30):
            run.step(EVERY)
            assert run["x"] == pytest.approx(expected.at(run.time, "x"), abs=1e-8)
            if model is Algebraic:
                assert run["y"] == pytest.approx(expected.at(run.time, "y"), abs=1e-8)
    found = fmpy.simulate_fmu(
        str(fmu.path),
        stop_time=30 * EVERY,
        output_interval=EVERY,
        relative_tolerance=1e-11,
        fmi_type="ModelExchange",
        output=["x"],
    )
    if model is not Algebraic:  # without states an importer steps too far for a wave
        assert found["x"][-1] == pytest.approx(expected.final("x"), abs=1e-6)


def test_a_relay_with_a_delay_swings_as_far_as_the_delay(tmp_path):
    """It turns a delay after x has passed zero, so x goes to +-T, with the period 4 T."""
    with export(Relay(), tmp_path / "relay.fmu").new().begin() as run:
        seen = [(run.step(0.0125), run["x"])[1] for _ in range(400)]
    assert max(seen[80:]) == pytest.approx(0.25, abs=1e-9)
    assert min(seen[80:]) == pytest.approx(-0.25, abs=1e-9)
    np.testing.assert_allclose(seen[80:320], seen[160:400], atol=1e-9)


class Fed(Model):
    u = Input(unit="1")
    x = Real(start=0.0, fixed=True)
    T = Parameter(0.3, unit="s")

    def equations(self):
        yield der(self.x) == delay(self.u, self.T) - self.x


@VERSIONS
def test_an_input_that_jumps_does_so_a_delay_later(version, tmp_path):
    with export(Fed(), tmp_path / "fed.fmu", version, tolerance=1e-10).new().begin() as run:
        for k in range(40):
            run["u"] = 0.0 if k < 3 else 1.0
            run.step(0.1)
            gone = max(run.time - 0.6, 0.0)  # it jumps at 0.3 s
            assert run["x"] == pytest.approx(1 - np.exp(-gone), abs=1e-9)
    held = Samples([0.0, 0.3, 4.0], [0.0, 1.0, 1.0], kind="constant")
    same = simulate(Fed(), stop=4.0, inputs={"u": held})
    assert same.final("x") == pytest.approx(1 - np.exp(-3.4), abs=1e-8)


@pytest.mark.parametrize("value", [0.0, -1.0])
def test_a_delay_of_no_time_is_refused(oscillators, value):
    with oscillators[3].new().enter() as run:
        run["T"] = value
        assert run.instance("ExitInitializationMode") == ERROR
        assert f"is {value:g} s, expected one above zero" in run.instance.message
        assert "delay(x, T)" in run.instance.message


def test_communication_steps_may_be_much_shorter_than_the_delay(oscillators):
    with oscillators[3].new().begin(T=5.0) as run:
        for _ in range(12_000):
            run.step(1e-3)
        assert run["x"] == pytest.approx(by_steps(run.time, 5.0), abs=1e-9)


def test_more_jumps_than_a_delay_remembers_are_refused(tmp_path):
    with export(Fed(), tmp_path / "fed.fmu").new().begin(T=5.0) as run:
        for k in range(5000):
            run["u"] = float(k % 2)
            if run.instance.step(k * 1e-3, 1e-3) != OK:
                break
        assert "more than 4096 places within the 5 s of delay(u, T)" in run.instance.message
        assert "fewer jumps of inputs" in run.instance.message


def test_a_start_that_looks_back_at_itself_without_an_answer_is_refused(tmp_path):
    class Circle(Model):
        y = Real()
        a = Parameter(0.5)

        def equations(self):
            yield self.y == 1 + self.a * delay(self.y, 0.2)

    with export(Circle(), tmp_path / "circle.fmu").new().enter() as run:
        run["a"] = 1.0
        assert run.instance("ExitInitializationMode") == ERROR
        assert "before the start is not determined" in run.instance.message


class Held(Model):
    """A controller that samples what is as late as its own period."""

    x = Real(start=1.0, fixed=True)
    s = Real(start=0.0)

    def equations(self):
        yield sampled(self.s, delay(self.x, 0.1) + 0.5 * delay(self.s, 0.1), period=0.1)
        yield der(self.x) == -self.s


def test_sampling_at_the_instant_at_which_a_jump_arrives(tmp_path):
    expected = simulate(Held(), stop=30 * EVERY, tolerance=1e-11, points=31)
    with export(Held(), tmp_path / "held.fmu", tolerance=1e-11).new().begin() as run:
        for _ in range(30):
            run.step(EVERY)
            assert run["x"] == pytest.approx(expected.at(run.time, "x"), abs=1e-8)


@VERSIONS
def test_slopes_take_what_is_delayed_as_known(oscillators, version):
    """x' = -x(t - T) does not change with x; y does not either, once the past is another than the present."""
    with oscillators[version].new().begin() as run:
        run.step(1.3)
        references = run.fmu.references
        for unknown in ("der(x)", "y"):
            found = reals([np.nan])
            lists = integers([references[unknown]]), c_size_t(1), integers([references["x"]]), c_size_t(1)
            ends = (reals([1.0]), found) if version == 2 else (reals([1.0]), c_size_t(1), found, c_size_t(1))
            assert run.instance("GetDirectionalDerivative", *lists, *ends) == OK
            assert found[0] == 0
