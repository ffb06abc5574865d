"""Chapter 7 of Dressler (2012) on the flexible robot: what is learnt of a square, and what is not.

The thesis prints no servo gain, no model and no filter: magnitudes, order and sigma are held, not curves.
"""

from dataclasses import replace

import numpy as np
import pytest

from gantrytau import Result
from gantrytau_models import FlexibleGantryTau, GantryTau, PreslidingFriction, cart_servos, prototypes
from gantrytau_optimica import (
    Complementary,
    History,
    Kalman,
    Learning,
    Measured,
    Rig,
    Tukey,
    design_q,
    learn,
    square_reference,
)
from gantrytau_optimica.learning import Actuators, LearningError, Scatter, arm_model, estimated_response
from gantrytau_optimica.learning.runs.robot_runs import forward_speed
from tests.optimica.learning.runs.linear_plant import RESPONSE

RECORD = prototypes.L1_flexible
STIFFER = replace(
    RECORD,
    arm_stiffness=tuple(1.1 * c for c in RECORD.arm_stiffness),
    frame_stiffness=1.1 * RECORD.frame_stiffness,
)  # another robot, 5 % off in frequency
SQUARE = square_reference()
WINDOW = Tukey(1.2, 4.5)
PLAIN = Learning(window=WINDOW)


def rig_of(record=RECORD, **servo) -> Rig:
    servos = [each.modified(servo) for each in cart_servos(RECORD)]
    robot = FlexibleGantryTau(record, friction=PreslidingFriction)
    return Rig(robot, servos, period=0.004, noise=Scatter(), stiff=GantryTau(RECORD))


@pytest.fixture(scope="module")
def rig() -> Rig:
    return rig_of()


@pytest.fixture(scope="module")
def actuators(rig) -> History:
    """Case 1."""
    return learn(rig, SQUARE, PLAIN, Actuators(), iterations=8, seed=1, response=RESPONSE)


def test_actuators_learn_to_a_fortieth_and_the_tool_keeps_what_arms_give_way(actuators):
    assert np.all(actuators.relative[5] < 4)
    assert 1.8 < actuators.relative[5].mean() < 3.2
    tool = actuators.tool_relative[5:].mean(axis=0)
    assert abs(tool[0] - 13) < 3
    assert abs(tool[1] - 36) < 4
    peak = np.linalg.norm(np.diff(SQUARE.r, axis=0), axis=1).max() / SQUARE.period
    assert 0.085 < peak < 0.1  # m/s, "slightly below 100 mm/s"


def test_without_the_speed_in_the_reference_learning_is_slow(rig):
    """Servos that are fed no speed, and corrections of the position alone."""
    slow = learn(rig_of(k_ff=0.0), SQUARE, PLAIN, iterations=5, seed=1, response=RESPONSE)
    assert np.all((slow.relative[5] > 20) & (slow.relative[5] < 32))

    class PositionAlone:
        period, kinematics = rig.period, rig.kinematics

        def run(self, position: np.ndarray, velocity: np.ndarray, seed: int = 0) -> Result:
            return rig.run(position, forward_speed(rig.kinematics.ik(SQUARE.r), rig.period), seed=seed)

    half = learn(PositionAlone(), SQUARE, PLAIN, iterations=5, seed=1, response=RESPONSE)
    assert np.all(half.relative[5] > 30)
    assert half.relative[5].mean() > 35


def test_a_plain_filter_diverges_from_gauges_as_foretold(rig):
    response = estimated_response(rig, SQUARE, Measured())
    assert PLAIN.stability(response, len(SQUARE)).sigma > 2
    with pytest.raises(LearningError, match="diverges"):
        learn(rig, SQUARE, PLAIN, Measured(), response=response)
    forced = learn(rig, SQUARE, PLAIN, Measured(), iterations=7, seed=1, response=response, force=True)
    assert forced.relative[7].min() > 1000


def estimators() -> dict:
    return {
        "2A": Complementary,
        "2B": lambda: Kalman(arm_model(rig_of(STIFFER), SQUARE)),
        "3": Measured,
    }


@pytest.mark.parametrize("case", ["2A", "2B", "3"])
def test_what_is_learnt_of_the_tool_is_less_wrong_across(rig, actuators, case):
    """At least 8 points in y below case 1, with filters that converge in each run, all axes coupled."""
    estimator = estimators()[case]()
    response = estimated_response(rig, SQUARE, estimator)
    learning = Learning(q=design_q(response), window=WINDOW)
    found = learn(rig, SQUARE, learning, estimator, iterations=8, seed=1, response=response)
    assert found.stability is not None
    assert 0.84 < found.stability.sigma < 0.96
    assert np.all(learning.q.magnitude(np.array([1.0, 4.0]), 0.004) > 0.8)
    tool, before = (each.tool_relative[5:].mean(axis=0) for each in (found, actuators))
    assert tool[1] < before[1] - 8
    assert tool[0] < before[0] + 2
    assert np.all(np.diff(found.relative[:3], axis=0) < 0)
