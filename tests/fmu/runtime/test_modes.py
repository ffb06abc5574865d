"""Modes in FMUs of both versions and interfaces, as in `simulate`: on events, at instants, at the start, and refused."""

from typing import Any

import pytest

from gantrytau import Fixed, SolveError, simulate
from gantrytau_fmu import export_fmu, read_fmu
from gantrytau_fmu.systems.run_fmu import run_fmu
from tests.simulation.test_modes import Clocked, Fork, Thermostat, Wall

MODELS = {
    "events": Thermostat(),
    "at the start": Thermostat(T=Fixed(290.0)),
    "instants": Clocked(),
    "wall": Wall(d=10.0),
}


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize("which", MODELS)
def test_an_fmu_changes_its_modes_as_simulate_does(which, fmi, tmp_path):
    model = MODELS[which]
    state, stop = ("s", 1.0) if which == "wall" else ("T", 150.0)
    file = export_fmu(model, tmp_path / "model.fmu", fmi=fmi, tolerance=1e-10)
    exact = simulate(model, stop=stop, points=11, tolerance=1e-10)
    for model_exchange in (False, True):
        policy: Any = dict(tolerance=1e-9) if model_exchange else {}
        found = run_fmu(file, stop=stop, step=stop / 10, model_exchange=model_exchange, **policy)
        assert found.final("mode") == exact.final("mode")
        # errors of the runs at their tolerances, which the growth of a motion through its events multiplies
        assert found.final(state) == pytest.approx(exact.final(state), abs=2e-5 if model_exchange else 1e-6)
        assert set(found["mode"]) <= set(exact["mode"])
    described = {v.name: v for v in read_fmu(file).variables}["mode"]
    assert described.description == exact.description("mode")


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_two_guards_at_once_are_an_error_of_the_fmu(fmi, tmp_path):
    file = export_fmu(Fork(), tmp_path / "fork.fmu", fmi=fmi)
    with pytest.raises(SolveError, match=r"at time = 0\.5 s two transitions of mode out of way may act at"):
        run_fmu(file, stop=1.0, step=0.1)
