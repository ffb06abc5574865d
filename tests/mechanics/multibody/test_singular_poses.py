"""Singular poses are met at the same time however few points are asked for, and wherever the motion starts."""

import pytest

from gantrytau import SolveError, Start, simulate
from gantrytau_models import FourBar


def parallelogram(phi: float, w: float) -> FourBar:
    """Singular where all four bars lie in one line."""
    return FourBar(1.0, dict(length=0.3, phi=Start(phi), w=Start(w)), 1.0, 0.3)


@pytest.mark.parametrize("points", [3, 11, 501])
def test_the_time_does_not_depend_on_the_points(points):
    with pytest.raises(SolveError, match="singular pose") as caught:
        simulate(parallelogram(1.0, 20.0), stop=1.0, points=points)
    assert caught.value.time == pytest.approx(0.10594, abs=1e-4)


@pytest.mark.parametrize("phi", [0.1, 0.001])
def test_a_start_near_a_singular_pose_hides_none(phi):
    with pytest.raises(SolveError, match="singular pose") as caught:
        simulate(parallelogram(phi, 0.0), stop=0.3)
    motion = caught.value.result
    assert abs(motion.final("crank.phi")) < 0.01  # flat
    assert abs(motion.final("rocker.phi") - motion.final("crank.phi")) < 1e-3  # still a parallelogram
