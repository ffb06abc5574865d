"""When things happen: samples of masters that add up their steps, late starts, short steps, slips between points."""

import numpy as np
import pytest

from gantrytau import (
    Discrete,
    Fixed,
    Input,
    Model,
    Parameter,
    Real,
    Samples,
    connect,
    der,
    fmin,
    if_else,
    pre,
    sampled,
    simulate,
    sin,
    time,
    when,
)
from gantrytau.mechanics import translational
from gantrytau_fmu import cosimulate
from gantrytau_fmu.systems.run_fmu import run_fmu
from tests.fmu.exported import export
from tests.fmu.runtime.raw_calls import ERROR, OK

VERSIONS = pytest.mark.parametrize("version", [2, 3])


class Sampler(Model):
    """y holds u."""

    period = Parameter(0.004, unit="s", description="of the samples")
    u = Input(start=0.0, description="input")
    y = Real(description="sample")

    def equations(self):
        yield sampled(self.y, self.u, period=self.period)


class Count(Model):
    """Counts its samples; x is how long it has run, with the first-order lag z."""

    n = Real(start=0.0, description="samples so far")
    x = Real(start=1.0, fixed=True, description="decays")

    def equations(self):
        yield sampled(self.n, self.n + 1, period=0.1)
        yield der(self.x) == -self.x


@pytest.fixture(scope="module")
def fmus(tmp_path_factory):
    folder = tmp_path_factory.mktemp("instants")
    return {
        (model, version): export(model(), folder / f"{model.__name__}{version}.fmu", version)
        for model in (Sampler, Count)
        for version in (2, 3)
    }


@VERSIONS
@pytest.mark.parametrize("step", [0.0005, 0.001, 0.004])
def test_a_step_that_begins_at_an_instant_samples_what_it_begins_with_also_where_time_is_summed(
    fmus, version, step
):
    each = round(0.004 / step)
    with fmus[Sampler, version].new() as run:
        run.begin()
        now = 0.0
        for k in range(round(45 / step)):
            run["u"] = float(k)
            assert run.instance.step(now, step) == OK
            now += step
            if k > 40 / step:  # by then the sum is off by 1e-11 s
                assert run["y"] == k - k % each


@VERSIONS
@pytest.mark.parametrize("start", [0.0, 86400.0, 1e6, -3.0])
def test_samples_are_counted_from_any_start(fmus, version, start):
    with fmus[Count, version].new() as run:
        run.enter(start=start)
        run.exit()
        seen = []
        for k in range(20):
            assert run.instance.step(start + k * 0.05, 0.05) == OK, run.instance.message
            seen.append(run["n"])
    assert seen == [1 + k // 2 for k in range(20)]


@VERSIONS
@pytest.mark.parametrize("start", [0.0, 86400.0, 1e6])
def test_event_iterations_end_at_any_start(fmus, version, start):
    with fmus[Count, version].new("ModelExchange") as run:
        run.enter(start=start)
        run.exit()
        run.settle()
        assert run["n"] == 1.0


@VERSIONS
def test_the_first_sample_takes_the_inputs_of_the_first_step(fmus, version):
    with fmus[Sampler, version].new() as run:
        run.begin()
        run["u"] = 5.0
        run.step(0.002)
        assert run["y"] == 5.0


@VERSIONS
def test_the_first_sample_is_taken_once(fmus, version):
    with fmus[Count, version].new() as run:
        run.begin()
        assert run["n"] == 1.0
        run.step(0.05)
        assert run["n"] == 1.0


@VERSIONS
@pytest.mark.parametrize(("start", "step"), [(1e5, 1e-9), (1.7e9, 1e-4), (1e3, 1e-7)])
def test_short_steps_at_late_times_move_the_states(fmus, version, start, step):
    with fmus[Count, version].new() as run:
        run.enter(start=start)
        run.exit()
        now = start
        for _ in range(1000):
            assert run.instance.step(now, step) == OK, run.instance.message
            now += step
        # time itself has the resolution of its numbers
        assert run["x"] == pytest.approx(np.exp(-(now - start)), rel=1e-6)


@VERSIONS
def test_a_step_that_time_cannot_tell_is_refused(fmus, version):
    with fmus[Count, version].new() as run:
        run.enter(start=1e9)
        run.exit()
        assert run.instance.step(1e9, 1e-8) == ERROR
        assert "found a step of 1e-08 s" in run.instance.message or "step" in run.instance.message


class Shaken(Model):
    """A mass on a floor, pushed to and fro; it breaks loose for some 15 ms in each half period of 52 ms."""

    amplitude = Parameter(10.0, unit="N", description="of the push")
    w = Parameter(60.0, unit="rad/s", description="of the push")
    mass = translational.Mass(m=2.0, s=Fixed(0.0), v=Fixed(0.0))
    push = translational.Force()
    floor = translational.StickSlipFriction(f_c=6.0, f_s=9.0)

    def equations(self):
        yield connect(self.mass.flange, self.push.flange)
        yield connect(self.mass.flange, self.floor.flange)
        yield self.push.f == self.amplitude * sin(self.w * time)


@pytest.mark.parametrize("solver", ["dopri5", "rodas4"])
def test_slips_that_begin_and_end_within_a_step_are_found(tmp_path, solver):
    fmu, ends = export(Shaken(), tmp_path / "shaken.fmu", solver=solver), []
    for step in (0.001, 0.01, 0.02, 0.03, 0.05, 0.06, 0.1, 0.2, 0.6, 1.2):
        with fmu.new() as run:
            run.begin()
            for k in range(round(1.2 / step)):
                run.time = k * step
                run.step(step)
            ends.append(run["mass.s"])
    # as long as a tenth of a slip, which steps of 1 ms resolve; a slip that is missed moves it by 8e-4 m
    assert ends == pytest.approx([6.6783e-4] * len(ends), abs=5e-9)


@pytest.mark.parametrize("step", [0.002, 0.004, 0.001])
def test_a_sampled_component_gets_functions_of_time_at_the_beginning_of_its_step(fmus, step):
    found = cosimulate({"a": fmus[Sampler, 3].path}, stop=0.1, step=step, inputs={"a.u": lambda t: 5 + t})
    # at an instant the result has what was held until then
    latest = np.maximum(np.ceil(found.time / 0.004 - 1e-9) - 1, 0) * 0.004
    assert found["a.y"] == pytest.approx(5 + latest, abs=1e-12)


class Instants(Model):
    """Switches 8 times a second, acts at 1 s by x and at 2 s by time, and samples what acts, behind a limit of r."""

    r = Input(start=0.0, description="input")
    x = Real(start=0.0, fixed=True, description="time that has passed")
    y = Real(start=0.0, fixed=True, description="time with the sine above a half")
    n = Discrete(0.0, description="rises")
    m = Discrete(0.0, description="1 behind 1 s, 11 behind 2 s")
    seen = Real(start=0.0, description="m before an instant, and r up to 1")

    def equations(self):
        fast = sin(50 * self.x) > 0.5
        yield der(self.x) == 1
        yield der(self.y) == if_else(fast, 1.0, 0.0)
        yield when(fast, self.n == pre(self.n) + 1)
        yield when(self.x >= 1.0, self.m == pre(self.m) + 1).elsewhen(time >= 2.0, self.m == pre(self.m) + 10)
        yield sampled(self.seen, 10 * self.m + fmin(self.r, 1.0), period=0.5)


@pytest.mark.parametrize(("version", "solver"), [(2, "dopri5"), (3, "rodas4")])
def test_steps_of_a_second_lose_nothing_and_act_at_their_ends(tmp_path, version, solver):
    r = Samples([0.0, 2.0], [0.2, 5.0], kind="constant")
    export(Instants(), tmp_path / "instants.fmu", version, solver=solver)
    found = run_fmu(tmp_path / "instants.fmu", stop=3.0, step=1.0, inputs={"r": r})
    rises = np.floor((50 * found.time - np.arcsin(0.5)) / (2 * np.pi)) + 1
    assert found["n"].tolist() == rises.tolist()
    assert found.final("y") == pytest.approx(24 * (2 * np.pi / 3) / 50, abs=1e-9)  # a third of each period
    assert found["m"].tolist() == [0.0, 1.0, 11.0, 11.0]  # once, where samples are due as well
    # m before an instant; r, as soon as it jumps, up to 1
    assert found["seen"].tolist() == [0.2, 0.2, 10.2, 111.0]
    same = simulate(Instants(), stop=3.0, points=7, inputs={"r": r})
    assert [same.at(t, "seen") for t in (0.75, 1.25, 2.25)] == [0.2, 0.2, 11.0]
