"""FMUs move as `simulate` does, over their events, to 1e-9: both versions, both interfaces, in our runs and in FMPy's."""

from typing import Any

import numpy as np
import pytest

from gantrytau import simulate
from gantrytau_fmu import export_fmu, run_fmu
from tests.fmu.jumping_models import Ball, Balls, PulsedDrive, RelayLoop, Tank, Thermostat

MODELS: dict[type, tuple[str, ...]] = {
    Ball: ("h", "v", "n"),
    Tank: ("h",),
    Thermostat: ("T", "on"),
    Balls: ("x[0]", "x[1]", "hits"),
    PulsedDrive: ("i", "w"),
    RelayLoop: ("x", "v", "side"),
}
STOP = 2.45  # s
CLOSE = 1e-9
TOLERANCE = 1e-12
EXCHANGED = 1e-13  # of CVode, whose errors grow by each event


@pytest.fixture(scope="module")
def simulated() -> dict[type, Any]:
    return {model: simulate(model(), stop=STOP, points=50, tolerance=TOLERANCE) for model in MODELS}


@pytest.fixture(scope="module")
def fmus(tmp_path_factory) -> dict[tuple[type, str], Any]:
    folder = tmp_path_factory.mktemp("like")
    return {
        (model, fmi): export_fmu(
            model(), folder / f"{model.__name__}{fmi}.fmu", fmi=fmi, tolerance=TOLERANCE, find=names
        )
        for model, names in MODELS.items()
        for fmi in ("2.0", "3.0")
    }


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.__name__)
@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize("exchange", [False, True], ids=["co-simulation", "model-exchange"])
def test_our_runs(fmus, simulated, model, fmi, exchange):
    tolerance = EXCHANGED if exchange else None
    found = run_fmu(fmus[model, fmi], stop=STOP, step=0.05, model_exchange=exchange, tolerance=tolerance)
    expected = simulated[model]
    assert found.ended == expected.ended
    assert found.time[-1] == pytest.approx(expected.time[-1], abs=CLOSE)
    for name in MODELS[model]:
        assert found.final(name) == pytest.approx(expected.final(name), abs=CLOSE), name


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.__name__)
@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_runs_of_fmpy(fmus, simulated, model, fmi, kind):
    import fmpy

    found = fmpy.simulate_fmu(
        str(fmus[model, fmi]),
        stop_time=STOP,
        output_interval=0.05,
        relative_tolerance=EXCHANGED if kind == "ModelExchange" else TOLERANCE,
        fmi_type=kind,
    )
    expected = simulated[model]
    for name in MODELS[model]:
        assert found[name][-1] == pytest.approx(expected.final(name), abs=CLOSE), name


def test_between_events_as_well(fmus, simulated):
    """At all points where neither has both sides of a jump."""
    for model in (Ball, PulsedDrive, RelayLoop):
        found, expected = run_fmu(fmus[model, "3.0"], stop=STOP, step=0.05), simulated[model]
        name = MODELS[model][0]  # continuous
        at = np.array([expected.at(t, name) for t in found.time])
        assert found[name] == pytest.approx(at.ravel(), abs=CLOSE), model.__name__


def test_a_system_that_one_component_ends(fmus):
    from gantrytau_fmu import Master, cosimulate

    found = cosimulate(
        {"tank": fmus[Tank, "3.0"], "ball": fmus[Ball, "2.0"]},
        stop=STOP,
        step=0.15,
        master=Master(isolate=["tank"]),
    )
    assert found.ended == "the tank is empty: 100 % of what may flow"
    assert found.time[-1] == pytest.approx(0.9)  # the last point before 1 s
