"""Ends at which loops do not close, or inputs are too weak: found again by geometry and by forward dynamics."""

import re
from typing import Any

import numpy as np
import pytest

from gantrytau import SolveError, between
from gantrytau_models import DeltaRobot, FourBar, StewartPlatform
from gantrytau_optimica import Free, Optimization, final, initial, optimize, prepare
from gantrytau_optimica.failures.end_equilibrium import held_ends

NUMBER = r"(-?[0-9.]+)"


class Turn(Optimization):
    """A four-bar linkage turned from rest to rest."""

    bar: Any = FourBar()
    final_time = Free(0.5, unit="s", min=0.02, max=5.0)
    begin, end, most, speed = 0.5, 1.2, 20.0, 0.0

    def objective(self):
        return self.final_time

    def constraints(self):
        yield between(-self.most, self.bar.torque, self.most)
        yield initial(self.bar.crank.phi) == self.begin
        yield initial(self.bar.crank.w) == self.speed
        yield final(self.bar.crank.phi) == self.end
        yield final(self.bar.crank.w) == self.speed


class Reach(Optimization):
    """A Delta robot from rest to rest."""

    robot: Any = DeltaRobot()
    final_time = Free(0.5, unit="s", min=0.02, max=5.0)
    begin, end, most = (0.0, 0.0, -0.7), (0.1, 0.0, -0.8), 12.0

    def objective(self):
        return self.final_time

    def constraints(self):
        for arm in self.robot.arms:
            yield between(-self.most, arm.tau, self.most)
        yield initial(self.robot.tool.r) == list(self.begin)
        yield initial(self.robot.tool.v) == 0
        yield final(self.robot.tool.r) == list(self.end)
        yield final(self.robot.tool.v) == 0


def said(problem, **changes) -> list[str]:
    """What is said of a problem with other numbers."""
    return held_ends(prepare(type("Changed", (problem,), changes), elements=2).built)


def test_nothing_is_said_of_ends_that_can_be_held():
    assert said(Turn) == []
    assert said(Reach) == []


def test_nothing_is_said_of_strength_where_it_does_not_rest():
    assert said(Turn, most=0.5, speed=1.0) == []


def test_a_crank_that_cannot_turn_fully():
    """Coupler and rocker in line, 1.1 m long: cos(phi) = (1 + 0.9^2 - 1.1^2) / (2 * 0.9) = 1 / 3."""
    (words,) = said(Turn, bar=FourBar(ground=1.0, crank=0.9, coupler=0.5, rocker=0.6), begin=0.4, end=2.5)
    assert words.startswith("The end is out of reach, or on another branch than the model's start: the loops")
    assert "cannot be closed at bar.crank.phi = 2.5, bar.crank.w = 0." in words
    found = re.search(f"open behind bar.crank.phi = {NUMBER}: a singular pose", words)
    assert found is not None
    # four digits are printed, 12 halvings
    assert float(found[1]) == pytest.approx(np.arccos(1 / 3), abs=1e-3)


def test_a_delta_robot_out_of_reach_at_the_start():
    (words,) = said(Reach, begin=(0.9, 0.0, -0.8))
    assert words.startswith("The start is out of reach")
    assert words.endswith("Take another pose, or start values on the branch that is meant.")


def test_what_holds_the_linkage_leaves_it_at_rest():
    """The torque that inverse dynamics ask for does not accelerate the crank by forward dynamics."""
    prepared = prepare(type("Weak", (Turn,), dict(most=0.5)), elements=2)
    start, end = held_ends(prepared.built)
    for words, when, phi in ((start, "start", 0.5), (end, "end", 1.2)):
        found = re.fullmatch(
            f"At the {when} the mechanism cannot be held at rest, which needs bar.torque = {NUMBER} N.m "
            r"\(limits -0.5 and 0.5\). Allow more, or make lighter what is carried.",
            words,
        )
        assert found is not None
        forward = prepared.built.read.dae.function(
            ["bar.crank.phi", "bar.crank.w", "bar.torque"], ["der(bar.crank.w)"]
        )
        moved, free = (abs(float(forward(phi, 0.0, torque))) for torque in (float(found[1]), 0.0))
        assert moved < 1e-3 * free  # four digits are printed


class Lift(Optimization):
    """A Stewart platform from rest to rest, whose rates of quaternions are states that no condition names."""

    robot: Any = StewartPlatform()
    final_time = Free(0.5, unit="s", min=0.02)
    most = 150.0

    def objective(self):
        return self.final_time

    def constraints(self):
        platform = self.robot.platform
        for leg in self.robot.legs:
            yield between(-self.most, leg.f, self.most)
        for point, z in ((initial, 0.8), (final, 0.85)):
            yield point(platform.r) == [0.0, 0.0, z]
            yield point(platform.q[1:4]) == [0.0, 0.0, 0.0]
            yield point(platform.v) == 0
            yield point(platform.w) == 0


def test_what_holds_a_platform_leaves_it_at_rest():
    assert said(Lift) == []
    prepared = prepare(type("Weak", (Lift,), dict(most=3.0)), elements=2)
    start, _ = held_ends(prepared.built)
    legs = [f"robot.legs[{k}].f" for k in range(6)]
    forces = [float(value) for value in re.findall(f"legs.. = {NUMBER} N".replace("..", r"\[\d\]\.f"), start)]
    dae = prepared.built.read.dae

    pose = [0.8 if name == "robot.platform.r[2]" else 0.0 for name in dae.states]
    function = dae.function([*dae.states, *legs], ["der(robot.platform.v[2])"])

    def falling(values) -> float:
        return abs(float(function(*pose, *values)))

    assert falling(forces) < 2e-3 * falling([0.0] * 6)  # four digits are printed


def test_the_error_of_a_solve_says_it():
    with pytest.raises(SolveError, match=r"At the end the mechanism cannot be held at rest, which needs"):
        optimize(type("Weak", (Turn,), dict(most=0.5)), elements=5, max_iterations=2)
