"""What never changes is no unknown of the program: the orientation of a plate that parallel rods keep level."""

import numpy as np
import pytest

from gantrytau_models import DeltaRobot
from gantrytau_optimica import optimize, prepare, sensitivities
from tests.benchmarks.peers.delta import DeltaMotion

ROD = "robot.arms[0].rods[0].length"


def motion(length: float) -> type[DeltaMotion]:
    """The motion of a delta robot one of whose rods has a length (m) of its own, that of the others is 0.8."""

    class Motion(DeltaMotion):
        robot = DeltaRobot(arms=[dict(rods=[dict(length=length), dict()]), dict(), dict()])

    return Motion


def orientations(problem) -> list[str]:
    """Unknowns of the program that turn the plate."""
    (phase,) = prepare(problem, elements=4).program.problem.phases
    assert phase.residuals.numel() == len(phase.algebraics) == len(phase.residual_names)
    return [a.name for a in phase.algebraics if "tool.q" in a.name]


def test_the_orientation_of_a_level_plate_is_no_unknown():
    assert not orientations(motion(0.8))
    assert len(orientations(motion(0.8 + 1e-6))) == 3 * 4  # with their rates and accelerations


def test_answers_without_an_orientation_tell_it_and_what_would_tilt_the_plate():
    found = optimize(motion(0.8), elements=6)
    assert np.all(found["robot.tool.R"] == np.eye(3))
    step = 1e-5  # m
    tilted = optimize(motion(0.8 + step), elements=6).final_time
    slope = float(sensitivities(found, [ROD]).slopes.objective[0])
    assert slope == pytest.approx((tilted - found.final_time) / step, rel=1e-3)  # of first order in the step
