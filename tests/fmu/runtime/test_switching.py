"""What switches on states or time is an event of an FMU: exact solutions, in both versions and both interfaces."""

import math

import casadi as ca
import numpy as np
import pytest

from gantrytau import Input, Model, Output, Real, der, fabs, floor, fmin, if_else, sin, sqrt, time
from gantrytau_fmu import check_fmu, cosimulate, export_fmu
from tests.families import first_of
from tests.fmu.exported import export

VERSIONS = pytest.mark.parametrize("version", [2, 3])
TOLERANCE = 1e-10


class Relay(Model):
    """x' = 1 below 0.3, else 2: a kink in x."""

    x = Real(start=0.0, fixed=True, description="level")

    def equations(self):
        yield der(self.x) == if_else(self.x < 0.3, 1.0, 2.0)


class Pulses(Model):
    """x' = y - x, with y = 1 in the first 30 ms of every 0.1 s, else 0."""

    x = Real(start=0.0, fixed=True, description="level")
    y = Real(description="pulse")

    def equations(self):
        yield self.y == if_else(ca.fmod(time, 0.1) < 0.03, 1.0, 0.0)
        yield der(self.x) == self.y - self.x


class Stairs(Model):
    """x' = 1 + floor(3 x) / 3."""

    x = Real(start=0.0, fixed=True, description="level")

    def equations(self):
        yield der(self.x) == 1 + floor(3 * self.x) / 3


class Diode(Model):
    """A current that switches on itself: 2 i = drop where i > 0, 11 i = drop elsewhere, drop = 1 - 2 t."""

    i = Real(description="current")
    charge = Real(start=0.0, fixed=True, description="charge")

    def equations(self):
        yield self.i + if_else(self.i > 0, self.i, 10 * self.i) == 1 - 2 * time
        yield der(self.charge) == self.i


class Dip(Model):
    """n grows while x, a parabola that dips to -1e-4 at t = 0.5, is below zero: 0.02 s."""

    n = Real(start=0.0, fixed=True, description="time below zero")

    def equations(self):
        yield der(self.n) == if_else((time - 0.5) ** 2 < 1e-4, 1.0, 0.0)


class Tank(Model):
    """Torricelli: the level is (1 - t / 2)^2 until 2 s, then zero."""

    h = Real(start=1.0, fixed=True, description="level")

    def equations(self):
        yield der(self.h) == if_else(self.h > 0, -sqrt(self.h), 0.0)


def pulsed(t: float) -> float:
    x = 0.0
    for _ in range(round(t / 0.1)):
        x = 1 + (x - 1) * math.exp(-0.03)
        x *= math.exp(-0.07)
    return x


def staired(t: float) -> float:
    x, rate, now = 0.0, 1.0, 0.0
    while now + 1 / 3 / rate < t:
        now, x, rate = now + 1 / 3 / rate, x + 1 / 3, rate + 1 / 3
    return x + rate * (t - now)


EXACT = {
    Relay: ("x", lambda t: t if t < 0.3 else 0.3 + 2 * (t - 0.3)),
    Pulses: ("x", pulsed),
    Stairs: ("x", staired),
    Diode: ("charge", lambda t: (t - t**2) / 2 if t < 0.5 else 0.125 - (t - 0.5) ** 2 / 11),
    Dip: ("n", lambda t: 0.02),
    Tank: ("h", lambda t: max(1 - t / 2, 0.0) ** 2),
}


@pytest.fixture(scope="module")
def fmus(tmp_path_factory):
    """Each model, also with the solver for stiff models."""
    folder = tmp_path_factory.mktemp("switching")
    return {
        (model, solver): export_fmu(
            model(), folder / f"{model.__name__}{solver}.fmu", solver=solver, tolerance=TOLERANCE
        )
        for model in EXACT
        for solver in ("dopri5", "rodas4")
    }


@pytest.mark.parametrize("model", EXACT, ids=lambda model: model.__name__)
@pytest.mark.parametrize("solver", ["dopri5", "rodas4"])
@pytest.mark.parametrize("step", [0.1, 3.0])
def test_a_switch_is_located_whatever_the_step(fmus, model, solver, step):
    name, exact = EXACT[model]
    found = cosimulate({"m": fmus[model, solver]}, stop=3.0, step=step)
    assert found.final(f"m.{name}") == pytest.approx(exact(3.0), abs=3e-9)  # thirty times the tolerance


@pytest.mark.parametrize(
    ("fmi", "model"),
    first_of(
        [
            *(("2.0", Relay), ("3.0", Pulses), ("2.0", Stairs), ("3.0", Diode)),
            *(("3.0", Relay), ("2.0", Pulses), ("3.0", Stairs), ("2.0", Diode)),
        ],
        4,
    ),
    ids=lambda one: getattr(one, "__name__", one),
)
def test_model_exchange_turns_at_the_same_instants(tmp_path, model, fmi):
    import fmpy

    name, exact = EXACT[model]
    path = export_fmu(model(), tmp_path / "model.fmu", fmi=fmi)
    assert not check_fmu(path, run=True)
    found = fmpy.simulate_fmu(
        str(path), stop_time=3.0, output_interval=0.1, relative_tolerance=1e-9, fmi_type="ModelExchange"
    )
    assert found[name][-1] == pytest.approx(exact(3.0), abs=3e-8)  # CVode's global error at 1e-9


class Saturated(Model):
    """An input at its limits, which a motion depends on and an output shows."""

    u = Input(start=0.0, description="input")
    y = Output(description="limited")
    size = Output(description="absolute value, that no motion depends on")
    x = Real(start=0.0, fixed=True, description="integral")

    def equations(self):
        yield self.y == fmin(self.u, 1.0)
        yield self.size == fabs(self.u)
        yield der(self.x) == self.y


@VERSIONS
def test_outputs_follow_inputs_between_steps_and_steps_what_they_begin_with(tmp_path, version):
    fmu = export(Saturated(), tmp_path / "limits.fmu", version)
    with fmu.new().begin(u=-2.0) as run:
        for u in (-2.0, 0.5, 3.0, 0.9, 7.0):
            run["u"] = u
            assert run["y"] == min(u, 1.0)
            assert run["size"] == abs(u)
            before = run["x"]
            run.step(0.25)
            assert run["x"] - before == pytest.approx(0.25 * min(u, 1.0), abs=1e-12)


class Gate(Model):
    """A clock that runs while an input is above a half."""

    u = Input(start=0.0, description="input")
    x = Real(start=0.0, fixed=True, description="time above")

    def equations(self):
        yield der(self.x) == if_else(self.u > 0.5, 1.0, 0.0)


@VERSIONS
def test_a_ramp_of_an_input_that_is_located_at_the_turn_itself_turns_within_a_step(tmp_path, version):
    """Model Exchange does not know the rate of an input, so that exactly zero says nothing of what comes."""
    import fmpy

    path = export_fmu(Gate(), tmp_path / "gate.fmu", fmi="2.0" if version == 2 else "3.0")
    ramp = np.array([(0.0, 0.0), (1.0, 1.0)], dtype=[("time", float), ("u", float)])
    found = fmpy.simulate_fmu(
        str(path), stop_time=1.0, output_interval=0.01, fmi_type="ModelExchange", input=ramp, output=["x"]
    )
    assert found["x"][-1] == pytest.approx(0.5, abs=0.0101)


def test_what_only_outputs_look_at_is_no_event(tmp_path):
    class Looked(Model):
        x = Real(start=1.0, fixed=True, description="oscillates")
        v = Real(start=0.0, fixed=True, description="its rate")
        up = Real(description="whether it is above zero")

        def equations(self):
            yield der(self.x) == self.v
            yield der(self.v) == -self.x
            yield self.up == if_else(self.x > 0, 1.0, 0.0)

    fmu = export(Looked(), tmp_path / "looked.fmu")
    assert fmu.described.numberOfEventIndicators == 0
    found = cosimulate({"m": fmu.path}, stop=6.0, step=0.01)
    assert np.array_equal(found["m.up"], (found["m.x"] > 0) * 1.0)


@VERSIONS
def test_states_saved_before_an_event_lead_over_it_bit_by_bit(tmp_path, version):
    fmu = export(Stairs(), tmp_path / "stairs.fmu", version)
    with fmu.new().begin() as run:
        run.step(0.3)
        saved = run.instance.save()
        run.step(0.5)
        first = run["x"]
        run.instance.restore(saved)
        run.time = 0.3
        run.step(0.5)
        assert run["x"] == first


def test_a_switch_on_which_the_motion_would_slide_is_named(tmp_path):
    class Slides(Model):
        x = Real(start=0.5, fixed=True, description="slides at zero")

        def equations(self):
            yield der(self.x) == if_else(self.x > 0, -1.0, 1.0) + 0.1 * sin(time)

    fmu = export(Slides(), tmp_path / "slides.fmu")
    with fmu.new().begin() as run:
        assert run.instance.step(0.0, 1.0) != 0
        assert "no side of the condition on x agrees" in run.instance.message
        assert "tanh(x / small)" in run.instance.message
