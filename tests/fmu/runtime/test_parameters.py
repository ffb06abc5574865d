"""What can be set in an exported FMU, when, and that it acts: against models made anew with the same values."""

from functools import cache
from typing import Any

import numpy as np
import pytest

from gantrytau import Dae, Input, Model, Output, Parameter, Real, der, sampled, translate
from gantrytau_models import FourBar, GantryTau, Pendulum, prototypes
from tests.fmu.exported import Numbers, Running, export
from tests.fmu.runtime.raw_calls import ERROR, OK

STEP = 0.004
L1 = prototypes.L1
TURNED = [0.99, -0.05, 0.01]  # one and a half degrees from where it was, and not of length one

# model -> parameters by name, and the same model with these values from the start
VALUES: dict[str, Any] = {
    "pendulum": ({"m": 1.7, "damping": 0.4, "g": 3.7}, lambda: Pendulum(m=1.7, damping=0.4, g=3.7)),
    "four-bar": (
        {"crank.m": 2.0, "coupler.length": 0.93, "ground": 1.02, "world.g": 5.0},
        lambda: FourBar(1.02, dict(length=0.3, m=2.0), dict(length=0.93), world=dict(g=5.0)),
    ),
    "three-link": (
        {"plate_mass": 9.0, "carts[1].m": 20.0, "arms[0].length": 2.09, "arms[2].offset[1]": 3.25},
        lambda: GantryTau(
            L1,
            plate_mass=9.0,
            carts=[{}, dict(m=20.0), {}],
            arms=[dict(length=2.09), {}, dict(offset=[-1.8086, 3.25, -1.4434])],
        ),
    ),
}


class Stretched(Model):
    """A mass that starts where its spring is stretched by half of its length; sampled besides."""

    length = Parameter(0.3, unit="m", description="of the spring")
    m = Parameter(2.0, unit="kg", description="mass")
    c = Parameter(40.0, unit="N/m", description="stiffness")
    period = Parameter(0.1, unit="s", description="of sampling")
    u = Input(unit="m", description="where the spring is held", start=0.0)
    s = Real(unit="m", start=lambda self: 1.5 * self.length, fixed=True, description="position")
    v = Real(unit="m/s", start=0.0, fixed=True, description="speed")
    seen = Real(unit="m", description="sampled position")
    pull = Output(unit="N", description="force of the spring")

    def equations(self):
        yield der(self.s) == self.v
        yield self.m * der(self.v) == -self.pull
        yield self.pull == self.c * (self.s - self.length - self.u)
        yield sampled(self.seen, self.s, period=self.period)


@pytest.fixture(params=[2, 3], ids=["fmi2", "fmi3"])
def version(request):
    return request.param


@cache
def made_with_values(name: str) -> Dae:
    """The model of VALUES."""
    return translate(VALUES[name][1](), events=True)


@cache
def turned() -> Numbers:
    """The robot with its first guideway turned."""
    return Numbers(translate(GantryTau(L1, arms=[dict(direction=TURNED), {}, {}])), ["carts[0].s"])


def refused(run: Running, name: str, value: float) -> str:
    """The message of a value that must be refused."""
    assert run.instance.set(run.fmu.references[name], value) == ERROR, name
    return run.instance.message


@pytest.mark.parametrize("name", ["four-bar", "pendulum", "filter", "sampled"])
def test_exactly_what_is_described_so_can_be_set(name, version, exported):
    """Everything is set to the value that it has, in all modes; FMI 3.0.2, sections 2.4.7.4 and 2.3."""
    fmu = exported(name, version)
    reals = [v for v in fmu.described.modelVariables if v.type in ("Real", "Float64")]
    states = {unknown.variable.derivative.name for unknown in fmu.described.derivatives}
    inputs = {v.name for v in reals if v.causality == "input"}
    tunable = {v.name for v in reals if (v.causality, v.variability) == ("parameter", "tunable")}
    fixed = {v.name for v in reals if (v.causality, v.variability) == ("parameter", "fixed")}
    exact = {v.name for v in reals if v.name in states and v.initial == "exact"}

    def settable(run: Running) -> set[str]:
        found = set()
        for v, value in zip(reals, run[[v.name for v in reals]], strict=True):
            if run.instance.set(v.valueReference, value) == OK:
                found.add(v.name)
            else:
                assert v.name in run.instance.message
        return found

    with fmu.new() as run, fmu.new("ModelExchange") as exchange:
        run.enter()
        assert settable(run) == inputs | tunable | fixed | exact
        run.exit()
        assert settable(run) == inputs | tunable
        exchange.begin()
        assert settable(exchange) == inputs | tunable | states
        exchange.settle()
        assert settable(exchange) == inputs | tunable | states


@pytest.mark.parametrize("name", VALUES)
@pytest.mark.parametrize("when", ["before", "event", "continuous"])
def test_parameters_act_as_in_a_model_made_with_them(name, when, exported):
    fmu = exported(name)
    values, _ = VALUES[name]
    fresh = made_with_values(name)
    outputs = [
        n
        for n in [
            v.name
            for v in fmu.described.modelVariables
            if v.variability == "continuous" and v.causality == "output"
        ]
        if n in fresh.variables
    ][::7]
    truth = Numbers(fresh, outputs)
    with fmu.new("ModelExchange") as run:
        run.enter()
        for place in ("before", "event", "continuous"):
            if place == when:
                for parameter, value in values.items():
                    run[parameter] = value
            if place == "before":
                run.exit()
            if place == "event":
                run.settle()
        x = run[list(fmu.dae.states)]
        rates = [u.variable.name for u in fmu.described.derivatives]
        wanted = truth(0.0, x)
        found = np.concatenate([run[rates], run[outputs]])
        assert found == pytest.approx(wanted, rel=1e-11, abs=1e-11 * np.abs(wanted).max())


def test_parameters_that_follow_from_others_are_renewed(exported):
    fmu = exported("four-bar")
    with fmu.new() as run:
        run.begin()
        assert run["crank.J[1,1]"] == pytest.approx(0.3**2 / 12, rel=1e-15)  # of a slender bar of 1 kg
        run["crank.m"], run["crank.length"] = 2.0, 0.5
        assert run["crank.J[1,1]"] == pytest.approx(2.0 * 0.5**2 / 12, rel=1e-15)
        assert run["crank.r_cm[0]"] == run["crank.body.r_cm[0]"] == 0.25
        assert "crank.J[1,1] cannot be set" in refused(run, "crank.J[1,1]", 1.0)


def test_a_parameter_that_changes_between_steps(exported, version):
    """Air drag comes up after 0.2 s: half of the motion is that of one model, half that of another."""
    fmu = exported("pendulum", version)
    states = list(fmu.dae.states)
    with fmu.new() as run:
        run.begin()
        for k in range(100):
            if k == 50:
                run["damping"] = 0.8
            run.time = k * STEP
            run.step(STEP)
        found = run[states]
    truth = Numbers(fmu.dae)
    middle = truth.integrate([0.0, 0.2])[-1]
    truth.p[fmu.dae.system().parameters.index("damping")] = 0.8
    wanted = truth.integrate([0.2, 0.4], middle)[-1]
    assert found == pytest.approx(wanted, abs=1e-8)  # a step keeps 1e-6 of its own change
    without = truth.integrate([0.0, 0.4])[-1]
    assert np.abs(found - without).max() > 1e-2


@pytest.fixture(scope="module")
def stretched(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stretched")
    return {v: export(Stretched(), folder / f"stretched{v}.fmu", v) for v in (2, 3)}


def test_fixed_parameters_act_on_starts_and_sampling(stretched, version):
    fmu = stretched[version]
    described = {v.name: v for v in fmu.described.modelVariables}
    assert [described[n].variability for n in ("length", "c", "period")] == ["fixed", "tunable", "fixed"]
    assert float(described["s"].start) == pytest.approx(0.45)
    with fmu.new() as run:
        run.enter()
        run["length"], run["period"] = 0.6, 0.25
        assert run["s"] == pytest.approx(0.9, rel=1e-15)
        assert run["pull"] == pytest.approx(12.0, rel=1e-14)
        run.exit()
        seen = []
        for k in range(100):
            run.time = k * 0.01
            run.step(0.01)
            seen.append(run["seen"])
        w = np.sqrt(40.0 / 2.0)  # of stiffness and mass
        instants = 0.25 * np.floor(0.01 * np.arange(100) / 0.25 + 1e-9)  # the last one before each step
        assert seen == pytest.approx(0.6 + 0.3 * np.cos(w * instants), abs=1e-6)


def test_fixed_parameters_are_refused_when_it_is_too_late(stretched, version):
    fmu = stretched[version]
    with fmu.new() as run:
        run.begin()
        for name, value in (("length", 0.5), ("period", 0.01)):
            before = run[name]
            message = refused(run, name, value)
            assert (
                f"{name} cannot be set: it is a fixed parameter; set it before initialisation ends" in message
            )
            assert run[name] == before
        run["c"] = 80.0
        assert run["pull"] == pytest.approx(80.0 * 0.15, rel=1e-14)


def test_a_start_that_was_set_holds_whatever_the_parameters(stretched, version):
    fmu = stretched[version]
    for first, second in (("s", "length"), ("length", "s")):
        with fmu.new() as run:
            run.enter()
            run[first], run[second] = 0.5, 0.5
            run.exit()
            assert run["s"] == 0.5
            assert run["pull"] == 0.0


def test_a_period_must_be_positive(stretched, version):
    with stretched[version].new() as run:
        run.enter()
        run["period"] = 0.0
        assert run.instance("ExitInitializationMode") == ERROR
        assert "the sampling period of seen is 0 s, expected one above zero" in run.instance.message


def test_constants_are_refused_unless_given_keeps_them(exported, version, tmp_path):
    shaping = [f"arms[0].direction[{k}]" for k in range(3)]
    with exported("three-link", version).new() as run:
        run.enter()
        for name in shaping:
            assert "shapes the equations and is constant" in refused(run, name, 0.5)
    fmu = export(GantryTau(L1), tmp_path / "kept.fmu", version, given=["arms[0].direction"])
    assert [v.name for v in fmu.described.modelVariables if v.causality == "input"] == [
        f"carts[{k}].f" for k in range(3)
    ]
    with fmu.new("ModelExchange") as run:
        run.begin(**dict(zip(shaping, TURNED, strict=True)))
        run.settle()
        states = run[[f"tool.{q}[{k}]" for q in "rv" for k in range(3)]]
        found = run[[f"der(tool.{q}[{k}])" for q in "rv" for k in range(3)] + ["carts[0].s"]]
        wanted = turned()(0.0, states)
        assert found == pytest.approx(wanted, rel=1e-11, abs=1e-11 * np.abs(wanted).max())


def test_a_filter_starts_at_rest_where_its_input_was_set(exported, version):
    fmu = exported("filter", version)
    rates = ["der(y,1)", "der(y,02)", "der(y,3)"]
    with fmu.new() as run:
        run.enter()
        assert run["y"] == pytest.approx(0.5, abs=1e-15)  # the start of the input
        run["bandwidth"], run["u"] = 3.0, -2.0
        assert run["y"] == pytest.approx(-2.0, rel=1e-14)
        assert "it follows from initial equations" in refused(run, "y", 1.0)
        run.exit()
        w = 3.0 * 2 * np.pi
        for k in range(100):
            run.time = k * STEP
            run.step(STEP)
        assert run["y"] == pytest.approx(-2.0, rel=1e-12)
        assert run[rates] == pytest.approx(np.zeros(3), abs=1e-12 * w**3)


def test_inverse_dynamics_takes_the_motion_of_the_tool_and_its_derivatives(version, tmp_path):
    """The forces that it tells are those under which the robot moves that way."""
    names = [f"carts[{k}].f" for k in range(3)]
    fmu = export(GantryTau(L1), tmp_path / "inverse.fmu", version, given=["tool.r"], find=names)
    inputs = [f.format(k) for f in ("tool.r[{}]", "der(tool.r[{}])", "der(tool.r[{}],2)") for k in range(3)]
    variables = fmu.described.modelVariables
    assert [v.name for v in variables if v.causality == "input"] == inputs
    assert [v.unit for v in variables if v.causality == "input"] == ["m"] * 3 + ["m/s"] * 3 + ["m/s2"] * 3
    assert [v.name for v in variables if v.causality == "output"] == names
    truth = Numbers(translate(GantryTau(L1)))
    random = np.random.default_rng(11)
    with fmu.new() as run:
        run.begin(**dict(zip(inputs, [*truth.x[:3], *np.zeros(6)], strict=True)))
        for k in range(10):
            r = truth.x[:3] + random.uniform(-0.1, 0.1, 3)
            v, a = random.uniform(-1, 1, 3), random.uniform(-10, 10, 3)
            for name, value in zip(inputs, [*r, *v, *a], strict=True):
                run[name] = value
            run.time = k * STEP
            run.step(STEP)
            # forces of some 500 N on 20 kg, so the accelerations are as exact as the forces
            assert truth(0.0, [*r, *v], run[names])[3:] == pytest.approx(a, abs=1e-11 * 500)
