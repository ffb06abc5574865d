"""What FMUs do when conditions become true, in both versions and both interfaces: exact solutions, and how runs end."""

import math
from ctypes import byref, c_double, c_int

import pytest

from gantrytau import (
    Discrete,
    Input,
    Model,
    Real,
    SolveError,
    der,
    logic_and,
    pre,
    reinit,
    sampled,
    sin,
    terminate,
    time,
    when,
)
from gantrytau_fmu import check_fmu, export_fmu, run_fmu
from tests.families import first_of
from tests.fmu.exported import export
from tests.fmu.jumping_models import Ball, Balls, G, Tank, Thermostat
from tests.fmu.runtime.raw_calls import DISCARD, ERROR, OK

VERSIONS = pytest.mark.parametrize("version", [2, 3])
TOLERANCE = 1e-11


def bounced(t: float) -> tuple[float, float, float]:
    """Height, speed and bounces of the ball."""
    at, v, count = math.sqrt(2 / G), 0.8 * math.sqrt(2 * G), 1
    while at + 2 * v / G < t:
        at, v, count = at + 2 * v / G, 0.8 * v, count + 1
    s = t - at
    return v * s - G * s**2 / 2, v - G * s, float(count)


def heated(t: float) -> tuple[float, float]:
    """Temperature, and whether it is heated."""
    now, T, on = 0.0, 18.0, 1.0
    while True:
        rest, limit = 40 * on, 21.0 if on else 19.0
        length = 4 * math.log((T - rest) / (limit - rest))
        if now + length > t:
            return rest + (T - rest) * math.exp(-(t - now) / 4), on
        now, T, on = now + length, limit, 1 - on


def balls(t: float) -> tuple[float, float, float]:
    """Positions, and how often they hit each other."""
    now, x, v, hits = 0.0, [0.2, 0.7], [1.0, -0.3], 0.0
    while True:
        waits = [
            (x[1] - x[0]) / (v[0] - v[1]) if v[0] > v[1] else math.inf,
            x[0] / -v[0] if v[0] < 0 else math.inf,
            (1 - x[1]) / v[1] if v[1] > 0 else math.inf,
        ]
        wait = min(waits)
        step = min(wait, t - now)
        x = [a + b * step for a, b in zip(x, v, strict=True)]
        now += step
        if step < wait:
            return x[0], x[1], hits
        if wait == waits[0]:
            v, hits = [(-v[0] + 4 * v[1]) / 3, (2 * v[0] + v[1]) / 3], hits + 1
        elif wait == waits[1]:
            v[0] = -v[0]
        else:
            v[1] = -v[1]


EXACT = {
    Ball: (("h", "v", "n"), bounced),
    Thermostat: (("T", "on"), heated),
    Balls: (("x[0]", "x[1]", "hits"), balls),
}


@pytest.fixture(scope="module")
def fmus(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whens")
    return {
        (model, version): export(
            model(), folder / f"{model.__name__}{version}.fmu", version, tolerance=TOLERANCE
        )
        for model in (Ball, Tank, Thermostat, Balls)
        for version in (2, 3)
    }


@pytest.mark.parametrize("model", EXACT, ids=lambda model: model.__name__)
@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
@VERSIONS
def test_motions_are_exact_over_their_events(fmus, model, kind, version):
    import fmpy

    names, exact = EXACT[model]
    found = fmpy.simulate_fmu(
        str(fmus[model, version].path),
        stop_time=3.0,
        output_interval=0.05,
        relative_tolerance=1e-13 if kind == "ModelExchange" else TOLERANCE,
        fmi_type=kind,
        output=list(names),
    )
    # CVode's errors grow by each event
    assert [found[n][-1] for n in names] == pytest.approx(exact(3.0), abs=1e-9)


@VERSIONS
def test_a_tank_that_is_empty_ends_the_steps(fmus, version):
    with fmus[Tank, version].new().begin() as run:
        made = run.instance
        assert made.step(0.0, 0.75) == OK
        status = made.step(0.75, 0.75)
        words = "ended at time = 1 s: the tank is empty: 100 % of what may flow"
        if version == 3:
            assert status == OK
            assert [flag.value for flag in made.flags] == [False, True, False]
            reached = made.reached.value
        else:
            assert status == DISCARD
            ended, at = c_int(), c_double()
            assert made("GetBooleanStatus", 3, byref(ended)) == OK  # fmi2Terminated
            assert made("GetRealStatus", 2, byref(at)) == OK  # fmi2LastSuccessfulTime
            assert ended.value == 1
            reached = at.value
        assert made.message.replace("%%", "%").endswith(words)
        assert reached == pytest.approx(1.0, abs=1e-10)  # (1 - t / 2)^2 = 1/4
        assert run["h"] == pytest.approx(0.25, abs=1e-10)
        assert made.step(reached, 0.1) == ERROR
        assert "the run has ended at" in made.message
        assert made("Terminate") == OK


@VERSIONS
def test_a_tank_that_is_empty_ends_model_exchange(fmus, version):
    import fmpy

    found = fmpy.simulate_fmu(
        str(fmus[Tank, version].path),
        stop_time=3.0,
        fmi_type="ModelExchange",
        relative_tolerance=1e-9,
        output=["h"],
    )
    assert found["time"][-1] == pytest.approx(1.0, abs=1e-7)
    assert found["h"][-1] == pytest.approx(0.25, abs=1e-7)


@pytest.mark.parametrize(
    ("version", "model"),
    first_of(
        [
            (2, Ball),
            (3, Tank),
            (2, Thermostat),
            (3, Balls),
            (3, Ball),
            (2, Tank),
            (3, Thermostat),
            (2, Balls),
        ],
        4,
    ),
    ids=lambda one: getattr(one, "__name__", one),
)
def test_they_pass_the_checks(fmus, model, version):
    assert not check_fmu(fmus[model, version].path, run=True)


@VERSIONS
def test_a_run_that_ends_early_passes_the_checks(tmp_path, version):
    class Early(Model):
        x = Real(start=0.0, fixed=True, description="time")

        def equations(self):
            yield der(self.x) == 1
            yield when(self.x > 1e-4, terminate("enough"))

    assert not check_fmu(export(Early(), tmp_path / "early.fmu", version).path, run=True)


@VERSIONS
def test_discretes_are_discrete_variables(fmus, version):
    variables = {v.name: v for v in fmus[Ball, version].described.modelVariables}
    assert (variables["n"].variability, variables["n"].description) == ("discrete", "bounces")


@VERSIONS
def test_saved_states_remember_which_conditions_hold(fmus, version):
    """Before, at and behind a bounce, bit by bit."""
    with fmus[Ball, version].new().begin() as run:
        for _ in range(8):
            saved, now = run.instance.save(), run.time
            run.step(0.13)
            first = run["h", "v", "n"]
            text = run.instance.serialize(saved)
            status, again = run.instance.deserialize(text)
            assert status == OK
            assert run.instance.restore(again) == OK
            run.time = now
            run.step(0.13)
            assert (run["h", "v", "n"] == first).all()


@VERSIONS
def test_derivatives_are_those_of_the_piece(fmus, version):
    with fmus[Thermostat, version].new().begin() as run:
        run.step(3.0)  # the heater is off
        T, on = run["T", "on"]
        assert (T, on) == pytest.approx(heated(3.0), abs=1e-9)
        assert run["der(T)"] == pytest.approx(10 * on - 0.25 * T, abs=1e-12)


class Counts(Model):
    """What happens at one instant, in rounds: a sample makes a condition true, and that the next one."""

    u = Input(start=0.0, description="input")
    y = Real(description="sample of u", start=0.0)
    a = Discrete(0.0, description="times that y went above 1")
    b = Discrete(0.0, description="times that a was even")
    late = Discrete(0.0, description="a before")
    x = Real(start=0.0, fixed=True, description="integral")

    def equations(self):
        yield sampled(self.y, self.u, period=0.1)
        yield when(self.y > 1, self.a == pre(self.a) + 1, self.late == pre(self.a))
        yield when(
            logic_and(self.a >= 2, self.a < 3), self.b == pre(self.b) + 1, reinit(self.x, pre(self.x) + 10)
        )
        yield der(self.x) == self.a


@VERSIONS
def test_what_is_sampled_makes_conditions_true_at_the_same_instant(tmp_path, version):
    fmu = export(Counts(), tmp_path / "counts.fmu", version)
    with fmu.new().begin() as run:
        x = 0.0
        for k, (u, a, b) in enumerate([(0, 0, 0), (2, 1, 0), (0, 1, 0), (3, 2, 1), (0, 2, 1), (9, 3, 1)]):
            run["u"] = u
            run.instance.step(0.1 * k, 0.1)
            x += 0.1 * a + (10 if k == 3 else 0)
            assert list(run["a", "b", "late", "x"]) == pytest.approx([a, b, max(a - 1, 0), x], abs=1e-9)


class Restarted(Model):
    """A condition that its own action makes true again."""

    x = Real(start=0.0, fixed=True, description="time")
    a = Discrete(0.0, description="flips")

    def equations(self):
        yield der(self.x) == 1
        yield (
            when(self.x > 0.5, self.a == 1)
            .elsewhen(self.a < 0.5, self.a == 1)
            .elsewhen(self.a > 0.5, self.a == 0)
        )


@VERSIONS
def test_rounds_without_end_are_named(tmp_path, version):
    fmu = export(Restarted(), tmp_path / "restarted.fmu", version)
    with fmu.new().begin() as run:
        assert run.instance.step(0.0, 1.0) == ERROR
        assert "after 50 rounds at time = 0.5 s" in run.instance.message
        assert "when((a<0.5))" in run.instance.message or "when((0.5<a))" in run.instance.message


@VERSIONS
@pytest.mark.parametrize("e", [0.1, 0.5, 0.9])
def test_bounces_that_come_ever_faster_end_with_the_name_of_their_condition(fmus, version, e):
    """All bounces are over at sqrt(2 h / g) (1 + e) / (1 - e)."""
    over = math.sqrt(2 / G) * (1 + e) / (1 - e)
    with fmus[Ball, version].new().begin(e=e) as run:
        size = over / 7
        while run.instance.step(run.time, size) == OK:
            run.time += size
            assert run.time < 1.2 * over
        assert "when((h<=0))" in run.instance.message
        assert "more than 1000 events" in run.instance.message
        assert run["time"] == pytest.approx(over, abs=1e-3)


def test_switches_that_are_dense_all_along_a_step_are_none_too_many(tmp_path):
    class Carrier(Model):
        n = Discrete(0)

        def equations(self):
            yield when(sin(2 * math.pi * 1e7 * time) > 0.5, self.n == pre(self.n) + 1)

    export_fmu(Carrier(), tmp_path / "carrier.fmu")
    assert run_fmu(tmp_path / "carrier.fmu", stop=2e-4, step=1e-4).final("n") == 2000


@VERSIONS
@pytest.mark.parametrize("tolerance", [1e-6, 1e-10])
def test_they_do_so_in_model_exchange_where_an_importer_would_let_the_ball_fall_through(
    fmus, version, tolerance
):
    with pytest.raises(SolveError, match=r"more than 1000 events.*when\(\(h<=0\)\)") as caught:
        run_fmu(
            fmus[Ball, version].path,
            stop=3.0,
            step=0.01,
            start={"e": 0.5},
            tolerance=tolerance,
            model_exchange=True,
        )
    assert caught.value.result.final("h") > -1e-11  # a thousand times rounding


@VERSIONS
def test_a_value_that_is_not_finite_is_named(tmp_path, version):
    class Divides(Model):
        n = Discrete(1.0, description="quotient")

        def equations(self):
            yield when(time > 0.5, self.n == 1 / (pre(self.n) - 1))

    fmu = export(Divides(), tmp_path / "divides.fmu", version)
    with fmu.new().begin() as run:
        assert run.instance.step(0.0, 1.0) == ERROR
        assert "the new value of n is not a finite number" in run.instance.message


def test_what_is_true_at_the_start_does_not_act(tmp_path):
    class True_(Model):
        n = Discrete(0.0, description="acts")
        x = Real(start=1.0, fixed=True, description="falls")

        def equations(self):
            yield der(self.x) == -1
            yield when(self.x > 0, self.n == pre(self.n) + 1)
            yield when(self.x < 0.5, terminate("half"))

    path = export_fmu(True_(), tmp_path / "true.fmu")
    fmu = export(True_(), path)
    with fmu.new().begin() as run:
        run.instance.step(0.0, 1.0)
        assert run.instance.reached.value == pytest.approx(0.5, abs=1e-12)
        assert run["n"] == 0
