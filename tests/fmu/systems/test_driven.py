"""FMUs driven by samples and signals: as `simulate` is, and no pulse is lost between two communication points."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from gantrytau import (
    Discrete,
    Input,
    Mode,
    Model,
    ModelError,
    Output,
    Parameter,
    Samples,
    chirp,
    der,
    prbs,
    pre,
    simulate,
    steps,
    transition,
    when,
    white_noise,
)
from gantrytau.commands.app import app
from gantrytau_fmu import Master, cosimulate, export_fmu
from gantrytau_fmu.systems.drives import Drive, between
from gantrytau_fmu.systems.run_fmu import run_fmu
from tests.fmu.systems.small_fmus import variable

PULSE = Samples([0.0, 0.3, 0.3 + 1e-6], [1.0, 1e6, 1.0], kind="constant")
TRIANGLE = Samples([0.0, 0.3, 0.3 + 1e-6, 0.3 + 2e-6, 1.0], [1.0, 1.0, 1e6 + 1.0, 1.0, 1.0])


class Lags(Model):
    """Two lags of first order, one driven by the other's input as well."""

    T = Parameter(0.2, unit="s", description="time constant")
    u = Input(2, unit="1", description="inputs")
    y = Output(2, unit="1", description="states", start=0.0, fixed=True)

    def equations(self):
        yield self.T * der(self.y[0]) == self.u[0] - self.y[0]
        yield self.T * der(self.y[1]) == self.u[1] + self.u[0] - self.y[1]


@pytest.fixture(scope="module")
def lags(tmp_path_factory):
    return export_fmu(Lags(), tmp_path_factory.mktemp("lags") / "lags.fmu", tolerance=1e-10)


def integrator(build, name, **more):
    """y' = u, exact for every step over which u is held."""
    lines = [variable("u", "input", 0.0), variable("y", "output", 0.0)]
    return build(name, lines, advance="v[1] = v[1] + v[0] * h;", **more)


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize("even", [False, True])  # equal steps only get the mean
@pytest.mark.parametrize("samples", [PULSE, TRIANGLE])
@pytest.mark.parametrize("order", ["gauss-seidel", "jacobi", "iterate"])
def test_a_pulse_between_two_points_is_not_lost(build, fmi, even, samples, order):
    name = f"integrator{fmi[0]}{'even' * even}"
    file = integrator(build, name, fmi=fmi, even=even)
    found = cosimulate({"a": file}, stop=1.0, step=0.25, inputs={"a.u": samples}, master=Master(order=order))
    jump = np.where(found.time > 0.3, 1.0, 0.0)
    np.testing.assert_allclose(
        found["a.y"], found.time + jump, atol=3e-6 + 1e-9
    )  # 1e-6 of rest belongs to the pulse


@pytest.mark.parametrize("step", [0.01, 0.1, 0.37])
@pytest.mark.parametrize(
    "signal",
    [white_noise([1.0, 3.0], 0.01, seed=1), steps([0.123, 0.5], [[1.0, 2.0], [-3.0, 0.5]])],
    ids=repr,
)
def test_an_fmu_is_driven_as_the_model(lags, signal, step):
    found = run_fmu(lags, stop=1.48, step=step, inputs={"u": signal})
    exact = simulate(Lags(), stop=1.48, inputs={"u": signal}, points=149, tolerance=1e-11)
    for name in ("y[0]", "y[1]"):
        at = np.interp(found.time, exact.time, exact[name])
        near = np.isclose(found.time[:, None], exact.time, atol=1e-9).any(
            axis=1
        )  # the last step may be shorter
        np.testing.assert_allclose(found[name][near], at[near], atol=1e-8)


def test_model_exchange_starts_anew_at_jumps_and_kinks(lags):
    for signal in (steps([0.123, 0.5, 0.500001], [1.0, 1e6, 0.0]), (TRIANGLE.times, TRIANGLE.values)):
        inputs = {"u[0]": signal, "u[1]": prbs(5, 0.1, seed=2)}
        found = run_fmu(lags, stop=1.0, step=0.1, inputs=inputs, tolerance=1e-9, model_exchange=True)
        exact = simulate(Lags(), stop=1.0, inputs=inputs, tolerance=1e-11)
        np.testing.assert_allclose(found.final("y"), exact.final("y"), rtol=1e-6)
    with pytest.raises(ModelError, match=r"samples at t = 0\.5 s and 1e-10 s later are one instant to FMPy"):
        run_fmu(
            lags,
            stop=1.0,
            step=0.1,
            inputs={"u[0]": steps([0.5, 0.5 + 1e-10], [1e10, 0.0])},
            model_exchange=True,
        )


def test_seeds_of_a_run_are_those_of_simulate(lags):
    inputs = {"u": white_noise(1.0, 0.05)}
    found = run_fmu(lags, stop=1.0, step=0.05, inputs=inputs, seed=7)
    exact = simulate(Lags(), stop=1.0, inputs=inputs, points=21, seed=7)
    behind = np.append(np.diff(exact.time) > 0, True)
    np.testing.assert_array_equal(found["u"], exact["u"][behind])
    with pytest.raises(ModelError, match=r"input u: white_noise has no seed"):
        run_fmu(lags, stop=1.0, step=0.05, inputs=inputs)


def test_smooth_signals_drive_an_fmu(lags):
    sweep = chirp(0.5, 3.0, 1.0, 2.0)
    found = run_fmu(lags, stop=1.0, step=1e-3, inputs={"u[0]": sweep, "u[1]": 0.0})
    exact = simulate(Lags(), stop=1.0, inputs={"u[0]": sweep, "u[1]": 0.0}, points=1001)
    # held at the middle of a step: of second order, (2 pi 3)^2 / 24 of the amplitude and a margin
    np.testing.assert_allclose(found["y[0]"], exact["y[0]"], atol=2 * 1e-6 * (2 * np.pi * 3) ** 2)


def test_parts_of_a_step():
    knots = np.array([0.1, 0.3, 0.30000000000000004, 0.7])
    assert between(knots, 0.1, 0.1) == [(0.1, 0.1)]
    assert [t for t, _ in between(knots, 0.0, 1.0)] == [0.0, 0.1, 0.3, 0.30000000000000004, 0.7]
    assert sum(h for _, h in between(knots, 0.0, 1.0)) == pytest.approx(1.0, abs=1e-15)
    assert between(knots, 0.2, 0.1) == [(0.2, 0.1)]  # 0.2 + 0.1 is the third of them
    drive = Drive(lambda t: 3.0 * t)
    assert drive.mean(1.0, 2.0) == 6.0
    assert Drive(lambda t: float(t >= 0.5), np.array([0.5]), held=True).mean(0.0, 2.0) == 0.75


def test_the_command_takes_signals_and_held_columns(lags, tmp_path):
    table = tmp_path / "u.csv"
    table.write_text("time,u[0],u:1\n0,2,1\n0.5,0,4\n")

    def final(*arguments):
        found = CliRunner().invoke(
            app, ["fmu", "run", str(lags), "--stop", "1", "--step", "0.1", "--json", *arguments]
        )
        assert found.exit_code == 0, found.output
        return json.loads(found.stdout)["final"]

    held = final("--input", f"u[0]={table}::constant", "--input", f"u[1]={table}:u:1:constant")
    exact = simulate(
        Lags(),
        stop=1.0,
        inputs={"u": Samples([0.0, 0.5], [[2.0, 1.0], [0.0, 4.0]], kind="constant")},
        tolerance=1e-10,
    )
    np.testing.assert_allclose([held["y[0]"], held["y[1]"]], exact.final("y"), atol=1e-8)
    drawn = final("--input", "u[0]=prbs(5, hold=0.1)", "--input", "u[1]=steps([0.2], [1.0])", "--seed", "4")
    inputs = {"u[0]": prbs(5, 0.1), "u[1]": steps([0.2], [1.0])}
    exact = simulate(Lags(), stop=1.0, inputs=inputs, seed=4, tolerance=1e-10)
    np.testing.assert_allclose([drawn["y[0]"], drawn["y[1]"]], exact.final("y"), atol=1e-8)


class Counter(Model):
    """Counts how often its input rises through a level, and how often it does so from far below."""

    u = Input(unit="1", description="input")
    rises = Discrete(0.0, description="rises through a half")
    swings = Discrete(0.0, description="rises from below minus a half")
    mode = Mode("low", "high")

    def equations(self):
        yield when(self.u > 0.5, self.rises == pre(self.rises) + 1)
        yield transition(self.mode, "low", "high", self.u > 0.5, self.swings == pre(self.swings) + 1)
        yield transition(self.mode, "high", "low", self.u < -0.5)


def test_what_happens_by_a_held_input_is_counted_right(tmp_path):
    noise = white_noise(1.0, 0.01, seed=2)
    values = noise.samples(0.0, 5.0).values[:, 0]
    rises = int(np.sum((values[1:] > 0.5) & (values[:-1] <= 0.5)))
    far = values[np.abs(values) > 0.5]
    swings = int(np.sum((far > 0) & (np.append(-1.0, far[:-1]) < 0)))
    file = export_fmu(Counter(), tmp_path / "counter.fmu")
    runs = [simulate(Counter(), stop=5.0, points=points, inputs={"u": noise}) for points in (2, 501)]
    runs += [run_fmu(file, stop=5.0, step=step, inputs={"u": noise}) for step in (0.01, 0.37)]
    runs.append(run_fmu(file, stop=5.0, step=0.1, inputs={"u": noise}, model_exchange=True))
    assert [(found.final("rises"), found.final("swings")) for found in runs] == [(rises, swings)] * 5
