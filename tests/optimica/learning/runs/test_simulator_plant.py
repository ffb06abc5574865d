"""Learning on an FMU is learning on the model that it was made of."""

from typing import Any

import numpy as np
import pytest

from gantrytau import ModelError, Result
from gantrytau_fmu import cosimulate, export_fmu
from gantrytau_models import FlexibleGantryTau, GantryTau, PreslidingFriction, cart_servos, prototypes
from gantrytau_optimica import Learning, Measured, Rig, Tukey, learn, square_reference
from gantrytau_optimica.learning import (
    LearningError,
    Scatter,
    SimulatorPlant,
    StraightAxes,
    estimated_response,
)
from tests.optimica.learning.runs.linear_plant import KINEMATICS, PERIOD, RESPONSE, line

RECORD = prototypes.L1_flexible
SQUARE = square_reference(rounds=1, begin=0.4, duration=2.2)
LEARNING = Learning(window=Tukey(0.3, 2.2, lead=0.2))


@pytest.fixture(scope="module")
def rig() -> Rig:
    robot = FlexibleGantryTau(RECORD, friction=PreslidingFriction)
    return Rig(robot, cart_servos(RECORD), period=PERIOD, stiff=GantryTau(RECORD))


@pytest.fixture(scope="module")
def plant(rig, tmp_path_factory) -> SimulatorPlant:
    """The same rig as an FMU."""
    file = tmp_path_factory.mktemp("fmu") / "rig.fmu"
    loop, still = rig.at_rest(rig.kinematics.ik(SQUARE.r[0]))
    positions = [f"robot.{joint}" for joint in rig.joints]
    export_fmu(loop, file, find=[*positions, "robot.gauge.r"])
    held = {f"rig.{name}": value for name, value in still.items()}
    return SimulatorPlant(
        lambda inputs, stop: cosimulate({"rig": file}, stop=stop, step=PERIOD, inputs={**inputs, **held}),
        rig.kinematics,
        period=PERIOD,
        position="rig.q_ref",
        velocity="rig.v_ref",
        q=[f"rig.{name}" for name in positions],
        r="rig.robot.gauge.r",
    )


def test_runs_of_an_fmu_are_those_of_its_model(rig, plant):
    """To 20 nm, as the model is simulated to 40 nm and the FMU more closely."""
    model, fmu = (learn(each, SQUARE, LEARNING, iterations=3, response=RESPONSE) for each in (rig, plant))
    assert np.abs(model.q - fmu.q).max() < 2e-8
    assert np.abs(model.tool - fmu.tool).max() < 4e-8
    assert model.relative == pytest.approx(fmu.relative, abs=0.01)
    assert np.all(fmu.relative[3] < 4)


def test_responses_are_measured_on_an_fmu_and_gauges_are_refused_as_on_the_model(rig, plant):
    ours, theirs = (estimated_response(each, SQUARE, Measured()) for each in (rig, plant))
    hz = np.array([1.0, 5.0, 9.0])
    assert theirs.response(hz) == pytest.approx(ours.response(hz), abs=0.02)
    with pytest.raises(LearningError, match="diverges"):
        learn(plant, SQUARE, LEARNING, Measured(), response=theirs)


class Recorded:
    """A simulator that answers with its references."""

    def __init__(self, step=PERIOD, names=("q", "r"), fails=99):
        self.step, self.names, self.fails, self.calls = step, names, fails, 0

    def __call__(self, inputs, stop):
        self.calls += 1
        if self.calls > self.fails:
            raise ModelError("the FMU stopped at 0.1 s")
        t = np.arange(0, stop + 1e-9, self.step)
        q = np.column_stack(
            [
                np.interp(t, np.ravel(inputs[f"q_ref[{k}]"].times), np.ravel(inputs[f"q_ref[{k}]"].values))
                for k in range(3)
            ]
        )
        values = {
            f"{name}[{k}]": (q if name == "q" else KINEMATICS.fk(q)[0])[:, k]
            for name in self.names
            for k in range(3)
        }
        return Result(t, values)


def recorded(simulator, **words) -> SimulatorPlant:
    asked: dict[str, Any] = dict(period=PERIOD, position="q_ref", q="q", r="r") | words
    return SimulatorPlant(simulator, KINEMATICS, **asked)


def test_a_single_joint_may_be_a_scalar():
    """An FMU of one axis has x.s and no x.s[0], and q_ref[0], as its references are a vector."""
    t = PERIOD * np.arange(5)
    plant = SimulatorPlant(
        lambda inputs, stop: Result(t, {"x.s": 2 * np.ravel(inputs["q_ref[0]"].values)}, units={"x.s": "m"}),
        StraightAxes(["x.s"]),
        period=PERIOD,
        position="q_ref",
        q="x.s",
    )
    run = plant.run(t[:, None], 0 * t[:, None])
    assert run["measured.q"][:, 0] == pytest.approx(2 * t)
    assert run.unit("measured.q") == "m"


def test_noise_is_that_of_its_seed():
    plant = recorded(Recorded(), noise=Scatter(encoder=1e-5, gauge=1e-4))
    q = KINEMATICS.ik(line().r)
    first, again, other = (plant.run(q, 0 * q, seed=seed) for seed in (1, 1, 2))
    assert np.array_equal(first["measured.q"], again["measured.q"])
    assert not np.array_equal(first["measured.q"], other["measured.q"])
    assert np.std(first["measured.q"] - q) == pytest.approx(1e-5, rel=0.1)
    assert np.std(first["measured.r"] - line().r) == pytest.approx(1e-4, rel=0.1)


@pytest.mark.parametrize(
    ("plant", "words"),
    [
        (lambda: recorded(Recorded(step=0.006)), r"a result without 0.\d+ s, expected one at all multiples"),
        (lambda: recorded(Recorded(names=("q",))), r"a result without r\[0\], expected it"),
        (lambda: recorded(Recorded(), q=["q[0]", "q[1]"]), "found 2 names in q=.*, expected 3"),
    ],
)
def test_what_does_not_fit_is_told(plant, words):
    q = KINEMATICS.ik(line().r)
    with pytest.raises(ModelError, match=words):
        plant().run(q, 0 * q)


def test_a_simulator_that_stops_loses_no_finished_run():
    learning = Learning(window=Tukey(0.2, lead=0.2))
    with pytest.raises(LearningError, match=r"run 2 failed, the 2 before it stand in .history: the") as told:
        learn(recorded(Recorded(fails=2)), line(), learning, response=RESPONSE)
    assert told.value.history is not None
    assert len(told.value.history) == 2
