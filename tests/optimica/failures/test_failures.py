"""What is said of a problem without solution: what would have to give, against sizes that are known."""

import re
from typing import Any

import numpy as np
import pytest

from gantrytau import SolveError, between
from gantrytau.commands.demo.motion_problems import FreePath, OnLine
from gantrytau_optimica import Free, final, initial, optimize
from tests.optimica.known_answers.test_gantry import START
from tests.optimica.problems import FastestMass

CLOSE = 1e-4  # of the size of what gives way: the mesh resolves a switch of the force to its elements


def failure(problem: Any, **policy: Any) -> SolveError:
    """What optimize raises."""
    with pytest.raises(SolveError) as caught:
        optimize(problem, **policy)
    return caught.value


def single(error: SolveError) -> dict[str, float]:
    """The conditions that suffice alone, and by how much they would have to give way."""
    return {way[0].name: way[0].amount for way in error.optimum.relaxed.ways if len(way) == 1}


class Hasty(FastestMass):
    """From rest to rest over 1 m in 1.9 s with 1 N for 1 kg, which takes 2 s."""

    final_time: Any = 1.9

    def objective(self):
        return 0.0


def test_too_little_time_says_what_would_have_to_give():
    error = failure(Hasty)
    ways = single(error)
    way = 1.9**2 / 4  # half the time forwards, half back, with unit force
    assert ways["final(mass.x) == 1"] == pytest.approx(1 - way, rel=CLOSE)
    # an even number of elements has a border in the middle, where the force switches
    assert ways["limits of mass.u"] == pytest.approx(1 / way - 1, rel=CLOSE)
    assert ways["final_time = 1.9"] == pytest.approx(0.1, rel=CLOSE)
    text = str(error)
    assert "It could be solved if `final(mass.x) == 1` gave way by 0.0975 m" in text
    assert "or if `limits of mass.u` gave way by 0.108 m/s2 from t = " in text
    assert "or if `final_time = 1.9` gave way by 0.1 s to 2 s" in text
    assert text.index("final(mass.x) == 1` gave") < text.index("initial(mass.x) == 0` gave")


def test_a_longest_duration_that_is_too_short():
    class Late(FastestMass):
        final_time = Free(1.0, unit="s", min=0.1, max=1.9, description="duration")

    ways = single(failure(Late))
    assert ways["max of final_time"] == pytest.approx(0.1, rel=CLOSE)
    assert ways["final(mass.x) == 1"] == pytest.approx(1 - 1.9**2 / 4, rel=CLOSE)


def test_a_speed_limit_that_is_too_low():
    class Slow(Hasty):
        final_time = 2.0  # enough only without a limit of the speed, which reaches 1 m/s

        def constraints(self):
            yield from super().constraints()
            yield self.mass.v <= 0.6

    error = failure(Slow)
    ways = single(error)
    assert ways["mass.v <= 0.6"] == pytest.approx(0.4, rel=CLOSE)
    assert ways["final(mass.x) == 1"] == pytest.approx(1 - 0.6 * (2.0 - 0.6), rel=CLOSE)
    assert "`mass.v <= 0.6` gave way by 0.4 m/s at t = 1 s" in str(error)


def test_an_expression_on_the_path_gives_way():
    class Strict(Hasty):
        final_time = 2.0

        def constraints(self):
            yield from super().constraints()
            yield between(-0.5, self.mass.u + 0 * self.mass.v * self.mass.u, 0.5)
            yield self.mass.u**2 <= 0.64

    error = failure(Strict)
    # both limits of the force are in the way: neither is enough alone
    together = [way for way in error.optimum.relaxed.ways if len(way) > 1]
    names = {name for way in together for name in (one.name for one in way)} | set(single(error))
    assert "final(mass.x) == 1" in names
    assert single(error)["final(mass.x) == 1"] == pytest.approx(0.5, rel=CLOSE)


def test_ends_that_contradict_each_other():
    class Torn(FastestMass):
        def constraints(self):
            yield from super().constraints()
            yield final(self.mass.x) >= 5

    error = failure(Torn)
    ways = single(error)
    assert ways["final(mass.x) >= 5"] == pytest.approx(4, rel=CLOSE)
    assert ways["final(mass.x) == 1"] == pytest.approx(4, rel=CLOSE)
    assert "`final(mass.x) >= 5` gave way by 4 m" in str(error)


def test_several_conditions_that_must_give_way_together():
    class Twice(Hasty):
        final_time = 3.0

        def constraints(self):
            yield from super().constraints()
            yield final(self.mass.x) >= 2
            yield final(self.mass.v) >= 3

    error = failure(Twice)
    (way,) = error.optimum.relaxed.ways
    amounts = sorted(one.amount for one in way)
    assert amounts == pytest.approx([1, 3], rel=CLOSE)  # one of either pair
    assert {one.name[:13] for one in way} == {"final(mass.x)", "final(mass.v)"}
    assert "` gave way by 3 m/s and `" in str(error)


def test_the_nearest_motion_keeps_to_the_model():
    optimum = failure(Hasty).optimum.nearest
    assert optimum.final("mass.x") == pytest.approx(1.9**2 / 4, rel=CLOSE)
    assert optimum.final("mass.v") == pytest.approx(0, abs=1e-6)  # Ipopt's tolerance
    assert np.max(np.abs(optimum["mass.u"])) <= 1 + 1e-6
    assert optimum.integral("mass.u") == pytest.approx(0, abs=1e-6)


def test_what_is_worse_stands_first():
    class Torn(Hasty):
        def constraints(self):
            yield from super().constraints()
            yield final(self.mass.x) >= 50

    text = str(failure(Torn))
    found = re.findall(r"`([^`]*)` is off by ([0-9.e+-]+) m", text)
    assert found
    assert [float(size) for _, size in found] == sorted((float(size) for _, size in found), reverse=True)


def test_interruption_and_limits_of_effort_do_not_look_for_more():
    error = failure(Hasty, max_iterations=2)
    assert "It could be solved" not in str(error)
    assert "relaxed" not in vars(error.optimum)
    assert single(error)["final(mass.x) == 1"] == pytest.approx(1 - 1.9**2 / 4, rel=CLOSE)  # when asked


def test_all_conditions_can_be_met_together():
    error = failure(FastestMass, max_iterations=2)
    relaxed = error.optimum.relaxed
    assert relaxed.found
    assert not relaxed.ways
    assert "can be met together" in str(relaxed)
    assert optimize(FastestMass, guess=error.optimum.nearest).final_time == pytest.approx(2.0, abs=1e-6)


def test_a_robot_that_is_hurried_names_end_torque_and_time():
    class Hurried(OnLine):
        final_time = 0.9  # the motion takes 0.974 s

        def objective(self):
            return 0.0

    ways = single(failure(Hurried, max_iterations=200))
    assert 0.9 + ways["final_time = 0.9"] == pytest.approx(0.97406, abs=2e-4)  # on 50 elements 0.97406
    assert {"final(robot.tool.r[0]) == 1.711", "limits of torque[2]"} <= set(ways)


def test_a_pose_out_of_reach_says_what_is_in_reach():
    class Far(FreePath):
        def constraints(self):
            yield initial(self.robot.tool.r) == START
            yield final(self.robot.tool.r) == (1.711, 4.9, -0.24)

    text = str(failure(Far))
    y, z = (float(re.findall(rf"final\(robot\.tool\.r\[{k}\]\) = ([-0-9.]+\d)", text)[0]) for k in (1, 2))

    class Beyond(FreePath):
        def constraints(self):
            yield final(self.robot.tool.r) == (1.711, y + 0.01, z)

    assert "out of reach" in str(failure(Beyond))

    class Near(FreePath):
        def constraints(self):
            yield final(self.robot.tool.r) == (1.711, y - 0.01, z)

    assert "out of reach" not in str(failure(Near, elements=5, max_iterations=1))


@pytest.mark.parametrize("scheme", ["radau", "gauss"])
def test_both_schemes_agree_on_what_would_have_to_give(scheme: str):
    ways = single(failure(Hasty, scheme=scheme, elements=20))
    assert ways["final(mass.x) == 1"] == pytest.approx(1 - 1.9**2 / 4, rel=CLOSE)
