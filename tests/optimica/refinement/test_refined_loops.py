"""`refine=` for robots whose loops have no closed form: from the answer without ramps straight to its arcs."""

import pytest

from gantrytau_optimica import optimize
from tests.optimica.known_answers.closed_loops import TIMES, carried, turned

ACCURACY = 1e-6


def test_a_crank_is_turned_with_one_switch_wherever_the_elements_stand():
    times = []
    for elements in (20, 27):
        optimum = optimize(turned(0), elements=elements, refine=ACCURACY)
        assert optimum.refinement.reached
        assert optimum.playback.violation <= ACCURACY
        assert max(d.relative for d in optimum.playback.defects) <= ACCURACY
        assert len({arc.side for arc in optimum.arcs} & {"min", "max"}) == 2
        times.append(optimum.final_time)
    assert times[0] == pytest.approx(times[1], rel=2 * ACCURACY)  # each to its accuracy
    assert times[0] == pytest.approx(TIMES["fourbar"][0], rel=1e-3)  # 20 elements, by hand


def test_six_links_are_carried_with_all_drives_at_their_limits():
    optimum = optimize(carried("six_D1", 0), elements=20, refine=1e-4)
    assert optimum.refinement.reached
    assert optimum.final_time == pytest.approx(TIMES["six_D1"][0], rel=3e-3)  # 20 elements, by hand
    played = optimum.playback
    assert played.violation <= 1e-4
    end = {d.name: abs(d.amount) for d in played.defects if "final" in d.name}
    assert max(amount for name, amount in end.items() if "tool.r" in name) < 1e-4  # m
    assert max(amount for name, amount in end.items() if "tool.v" in name) < 1e-3  # m/s
    assert {arc.side for arc in optimum.arcs} == {"min", "max"}
    assert len(optimum.refinement.switches) == 5
