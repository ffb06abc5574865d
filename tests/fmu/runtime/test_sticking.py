"""Exact stick-slip in exported FMUs, against motion pieced together from solutions of the linear equations."""

import math

import numpy as np
import pytest

from gantrytau import Fixed, Model, Parameter, Real, der, simulate, stick_slip
from gantrytau_fmu import cosimulate, export_fmu
from tests.fmu.exported import Exported, export
from tests.references.sticking import C, Chain, M, OnSpring, Plank, Shaken, on_spring, shaken

STEP = 0.004


@pytest.fixture(scope="module")
def fmus(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sticking")
    return {
        (model.__name__, solver): export(model(), folder / f"{model.__name__}_{solver}.fmu", solver=solver)
        for model, solver in (
            (OnSpring, "dopri5"),
            (Shaken, "dopri5"),
            (OnSpring, "rodas4"),
            (Shaken, "rodas4"),
        )
    }


def stepped(fmu: Exported, names: list[str], stop: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    times, found = STEP * np.arange(1, round(stop / STEP) + 1), []
    with fmu.new() as run:
        run.begin()
        for k in range(len(times)):
            run.time = k * STEP
            run.step(STEP)
            found.append(run[names])
    return times, np.array(found)


@pytest.mark.parametrize("solver", ["dopri5", "rodas4"])
@pytest.mark.parametrize(("model", "truth"), [("OnSpring", on_spring), ("Shaken", shaken)])
def test_co_simulation_finds_the_instants(fmus, model, truth, solver):
    times, found = stepped(fmus[model, solver], ["mass.s"])
    # a speed of 1e-8 m/s counts as rest, which the mass leaves within hundredths of a second
    assert found[:, 0] == pytest.approx(truth(times), abs=2e-8 if model == "Shaken" else 5e-9)


@pytest.mark.parametrize("solver", ["dopri5", "rodas4"])
def test_what_sticks_stays_in_its_place(fmus, solver):
    _, found = stepped(fmus["OnSpring", solver], ["mass.s", "mass.v", "floor.f"], 4.0)
    resting = found[round(3.2 * np.pi / np.sqrt(C / M) / STEP) :]
    assert np.ptp(resting[:, 0]) < 1e-9
    assert resting[-1] == pytest.approx([-0.005, 0.0, 4.0], abs=1e-6)  # the force is that of the spring
    assert abs(resting[-1, 1]) < 1e-15


@pytest.mark.parametrize(("model", "truth"), [(OnSpring, on_spring), (Shaken, shaken)])
@pytest.mark.parametrize("version", [2, 3])
def test_model_exchange_with_the_events_of_fmpy(tmp_path, model, truth, version):
    from fmpy import simulate_fmu

    fmu = export(model(), tmp_path / "model.fmu", version)
    result = simulate_fmu(
        str(fmu.path),
        fmi_type="ModelExchange",
        solver="CVode",
        stop_time=1.0,
        relative_tolerance=1e-9,
        output_interval=STEP,
        output=["mass.s"],
    )
    # a hundred times the tolerance, and what CVode leaves between an event and its end of search
    assert result["mass.s"] == pytest.approx(truth(np.asarray(result["time"])), abs=1e-6)


def test_carts_of_a_robot_that_nothing_pushes_enough_stay_where_they_are(exported):
    fmu = exported("stick-slip")
    tool, forces = [f"tool.r[{k}]" for k in range(3)], [f"carts[{k}].law.f" for k in range(3)]
    with fmu.new() as run:
        # the weight of the tool pulls at the carts with some 60 N
        run.begin(**{f"carts[{k}].law.f_c": 200.0 for k in range(3)})
        start, places = run[tool], []
        assert np.abs(run[forces]).max() > 1.0
        for k in range(500):
            run.time = k * STEP
            run.step(STEP)
            places.append(run[tool])
    assert np.abs(np.array(places) - start).max() < 1e-9


class OnBelt(Model):
    """A mass on a spring and on a belt at 0.06 m/s, which it sticks to up to 2 N, and slips on with 1 N."""

    sign = 1.0
    m = Parameter(1.0, unit="kg", description="mass")
    c = Parameter(100.0, unit="N/m", description="stiffness")
    belt = Parameter(0.06, unit="m/s", description="speed of the belt")
    s = Real(start=0.0, fixed=True, unit="m", description="position")
    w = Real(start=0.06, fixed=True, unit="m/s", description="speed")
    slip = Real(unit="m/s", description="speed against the belt")
    f = Real(unit="N", description="friction")

    def equations(self):
        yield der(self.s) == self.w
        yield self.slip == self.sign * (self.w - 0.06)
        yield self.m * der(self.w) == -self.c * self.s - self.sign * self.f
        yield stick_slip(self.f, self.slip, coulomb=1.0, smooth=0.0, breakaway=2.0)


class OnTunableBelt(OnBelt):
    """The same, the speed of the belt as a parameter, and slip counted the other way."""

    sign = -1.0

    def equations(self):
        first, _, *rest = super().equations()
        yield first
        yield self.slip == self.sign * (self.w - self.belt)
        yield from rest


def carried(t: float) -> float:
    """Position: with the belt up to 0.02 m, then an arc about 0.01 m until the speed is that of the belt again."""
    phase = math.atan2(0.1, 0.06)  # of 0.01 cos(10 t) + 0.006 sin(10 t)
    arc = (2 * math.pi - 2 * phase) / 10
    now, s = 0.0, 0.0
    while True:
        if t < (stuck := now + (0.02 - s) / 0.06):
            return s + 0.06 * (t - now)
        if t < stuck + arc:
            return 0.01 + 0.01 * math.cos(10 * (t - stuck)) + 0.006 * math.sin(10 * (t - stuck))
        now, s = stuck + arc, 0.01 + 0.01 * math.cos(10 * arc) + 0.006 * math.sin(10 * arc)


@pytest.mark.parametrize("model", [OnBelt, OnTunableBelt])
def test_a_speed_against_a_belt_sticks_to_the_speed_of_the_belt(tmp_path, model):
    """The speed of slip is that of the mass but for an offset and a sign."""
    path = export_fmu(model(), tmp_path / "belt.fmu", tolerance=1e-10)
    found = cosimulate({"m": path}, stop=2.0, step=0.01)
    exact = [carried(t) for t in found.time]
    assert found["m.s"] == pytest.approx(np.array(exact), abs=1e-9)


@pytest.mark.parametrize(
    ("model", "names"),
    [
        (Chain(masses=[dict(s=Fixed(0.0), v=Fixed(0.0))] * 3), [f"masses[{k}].s" for k in range(3)]),
        (OnBelt(), ["s"]),
        (Plank(), ["x", "y"]),
    ],
    ids=["chain", "belt", "plank"],
)
def test_it_is_the_motion_of_simulate(tmp_path, model, names):
    path = export_fmu(model, tmp_path / "model.fmu", tolerance=1e-11)
    found = cosimulate({"m": path}, stop=2.0, step=0.01)
    expected = simulate(model, stop=2.0, tolerance=1e-11, points=201)
    times, places = np.unique(expected.time, return_index=True)
    for name in names:
        shown = np.interp(found.time, times, expected[name][places])
        # an FMU locks where the speed has come 1e-8 m/s beyond zero
        assert found[f"m.{name}"] == pytest.approx(shown, abs=5e-9)
        assert np.ptp(shown) > 0.01
