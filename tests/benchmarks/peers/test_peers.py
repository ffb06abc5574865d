"""Programs by hand, with Opti and from components are routes of their own to the same motions."""

import pytest

from gantrytau_optimica import optimize
from tests.benchmarks.peers import by_hand, crane, delta, six_link, with_opti

SAME = 1e-7  # relative: ten times Ipopt's tolerance, on the same mesh


@pytest.mark.parametrize(
    ("problem", "motion"), [(crane.CraneMotion, crane.motion), (delta.DeltaMotion, delta.motion)]
)
def test_components_and_closed_forms_by_hand_take_the_same_time(problem, motion):
    ours, hand = optimize(problem, elements=10), by_hand.solve(motion, 10)
    assert hand.success
    assert ours.final_time == pytest.approx(hand.time, rel=SAME)


@pytest.mark.parametrize("motion", [crane.motion, delta.motion])
def test_both_programs_of_casadi_take_the_same_time(motion):
    assert with_opti.solve(motion, 6).time == pytest.approx(by_hand.solve(motion, 6).time, rel=SAME)


def test_the_six_links_by_hand_take_the_time_that_is_known():
    found = by_hand.solve(six_link.motion, 20)
    assert found.success
    assert found.time == pytest.approx(0.41601, abs=5e-6)  # s, measured with other programs, to five digits
