"""Margins of square roots: where equations divide by them, as near to zero as the first guess, and told of."""

from typing import Any

import numpy as np
import pytest

from gantrytau import Input, Model, Real, der
from gantrytau.commands.demo.motion_problems import FreePath
from gantrytau_optimica import Free, Optimization, final, initial, optimize
from gantrytau_optimica.control.build import build
from gantrytau_optimica.problem.read_problem import read_problem

LONGEST = 2.06  # m, what the tool may be ahead of a cart


def margins(problem: Any) -> list[float]:
    built = build(read_problem(problem), {})
    return [a.min for phase in built.problem.phases for a in phase.algebraics if a.is_root]


class ToPose(FreePath):
    def constraints(self):
        yield initial(self.robot.tool.r) == (0.0, 2.51, -1.03)
        yield final(self.robot.tool.r) == self.pose()
        yield initial(self.robot.tool.v) == 0
        yield final(self.robot.tool.v) == 0

    def pose(self):
        return 1.711, 3.46, -0.24


def test_roots_that_forces_are_divided_by_keep_a_tenth_of_their_size():
    found = margins(ToPose)
    assert len(found) == 3
    assert all(0.05 * LONGEST < x < 0.1 * LONGEST for x in found)


class NearPole(ToPose):
    """The third link of 2.0611 m ends across its guideway but for 0.05 m."""

    def pose(self):
        return 1.0, 2.51, -1.4434 + np.sqrt(2.0611**2 - 0.05**2 - (2.51 - 3.2774) ** 2)


def test_ends_nearer_to_zero_are_within_the_margin():
    first, _, third = margins(NearPole)
    assert first > 0.05 * LONGEST
    # the guess ends at 0.05 m, or beside by what rounding leaves of a square
    assert third == pytest.approx(0.025, rel=1e-6)


def test_a_motion_that_ends_nearer_to_zero_is_found():
    optimum = optimize(NearPole, elements=15)
    # s = x - offset - reach, offset -1.8086 m
    assert optimum["robot.carts[2].s"][-1] == pytest.approx(1.0 + 1.8086 - 0.05, abs=1e-7)


class Tank(Model):
    """A tank that runs empty through a hole, whose speed of flow is the root of its level."""

    h = Real(start=1.0, fixed=True, min=0.0)
    w = Real(start=1.0)
    u = Input(min=0.0, max=1.0)

    def equations(self):
        yield self.w**2 == self.h
        yield der(self.h) == -self.u * self.w


class Emptied(Optimization):
    tank = Tank()
    final_time = Free(3.0, min=0.5, max=20.0)

    def objective(self):
        return self.final_time

    def constraints(self):
        yield final(self.tank.h) == 1e-4


def test_roots_that_nothing_is_divided_by_have_no_margin():
    assert all(x == 0.0 for x in margins(Emptied))
    # sqrt(h) falls by half of u: 2 (1 - 0.01) s
    assert optimize(Emptied, elements=20).final_time == pytest.approx(1.98, abs=1e-6)


def test_what_rests_on_a_margin_says_so():
    class Drawn(ToPose):
        def constraints(self):
            yield initial(self.robot.tool.r) == (0.0, 3.92673079, -0.47723183)
            yield final(self.robot.tool.r) == (1.46483081, 3.25779682, 0.53639168)
            yield initial(self.robot.tool.v) == 0
            yield final(self.robot.tool.v) == 0

    text = optimize(Drawn, elements=20).report()
    assert "from which robot.carts[2].s follows, at its turning point (singular) but for a margin of" in text
