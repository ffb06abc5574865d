"""Chapter 7 of Dressler (2012) on the flexible robot, beside Table 7.2: its speed, and learning without it.

Table 7.2 itself, what diverges and the values of sigma are held by the notebook a_robot_that_learns.
"""

import numpy as np
import pytest

from gantrytau import Result
from gantrytau_models import FlexibleGantryTau, GantryTau, PreslidingFriction, cart_servos, prototypes
from gantrytau_optimica import Learning, Rig, Tukey, learn, square_reference
from gantrytau_optimica.learning import Scatter
from gantrytau_optimica.learning.runs.robot_runs import forward_speed
from tests.optimica.learning.runs.linear_plant import RESPONSE

RECORD = prototypes.L1_flexible
SQUARE = square_reference()
WINDOW = Tukey(1.2, 4.5)
PLAIN = Learning(window=WINDOW)


def rig_of(**servo) -> Rig:
    servos = [each.modified(servo) for each in cart_servos(RECORD)]
    robot = FlexibleGantryTau(RECORD, friction=PreslidingFriction)
    return Rig(robot, servos, period=0.004, noise=Scatter(), stiff=GantryTau(RECORD))


@pytest.fixture(scope="module")
def rig() -> Rig:
    return rig_of()


def test_the_tool_is_a_little_slower_than_100_mm_per_second():
    peak = np.linalg.norm(np.diff(SQUARE.r, axis=0), axis=1).max() / SQUARE.period
    assert 0.085 < peak < 0.1


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
