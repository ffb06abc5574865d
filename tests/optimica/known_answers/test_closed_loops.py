"""Robots whose loops have no closed form, from cold, against times of programs written by hand."""

import os
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from gantrytau import Fixed, simulate
from gantrytau_models import SixLinkGantryTau, prototypes
from gantrytau_optimica import Optimum, optimize
from gantrytau_optimica.solving.assembly import jumps
from tests.optimica.known_answers.closed_loops import PAIRS, TIMES, carried, turned

MORE = int(os.environ.get("GANTRYTAU_ROUTES", "0"))  # pairs of each robot, where all are wanted
FIRST = {"six_D1": (0,), "six_L1": (0,), "f1": (0,), "stewart": (0,), "delta": (0,)}
CASES = [(kind, k) for kind, first in FIRST.items() for k in (range(min(MORE, 20)) if MORE else first)]


@cache
def solved(kind: str, number: int) -> Optimum:
    return optimize(carried(kind, number), elements=20)


@pytest.mark.parametrize(("kind", "number"), CASES)
def test_pairs_of_poses(kind, number):
    optimum = solved(kind, number)
    assert optimum.iterations <= 200
    if number < len(TIMES[kind]):
        assert optimum.final_time == pytest.approx(TIMES[kind][number], rel=3e-3)
    limits = PAIRS[kind]["limits"]
    for name, limit in limits.items():
        assert np.max(np.abs(optimum[f"robot.{name}"][1:])) <= limit * (1 + 1e-6)


def test_six_links_take_no_more_iterations_than_by_hand():
    # a program by hand takes 33
    assert optimize(carried("six_D1", 0), elements=16).iterations <= 40


@pytest.mark.parametrize("number", range(max(MORE, 3)))
def test_full_turns_of_a_crank(number):
    optimum = optimize(turned(number), elements=20)
    assert optimum.iterations <= 60
    if number < len(TIMES["fourbar"]):
        assert optimum.final_time == pytest.approx(TIMES["fourbar"][number], rel=1e-3)


def test_loops_stay_assembled():
    # the equations at a point hold for other assemblies as well, in which turntables are turned by 2 rad
    optimum = solved("f1", 0)
    for k in range(3):
        assert np.max(np.abs(optimum[f"robot.turntables[{k}].phi"])) < 1.0
    assert np.all(np.abs(np.diff(optimum["robot.tool.q"], axis=0)) < 0.1)


def test_what_rests_on_its_assembly_goes_on():
    # the first answer, 0.278 s, rests where turntables are kept within 1 rad of the guess
    optimum = optimize(carried("f1", 3), elements=20)
    assert not optimum.solution.held
    assert optimum.final_time < 0.2
    # 20 elements pass a place at which loops are singular, where the integrator stops
    assert optimum.status.startswith(
        "solved on this mesh only: played back, it cannot be integrated beyond t = "
    )


def test_a_jump_to_another_assembly_is_no_motion():
    optimum = optimize(turned(0), elements=20)
    (trajectory,) = optimum.phases.values()
    assert jumps(optimum.built, trajectory) == ""
    signals = [s.name for s in trajectory.phase.signals]
    w = trajectory.w.copy()
    w[trajectory.layout.of(signals.index("robot.rocker.phi"))[30:]] *= -1.0  # the other way to close the loop
    said = jumps(optimum.built, replace(trajectory, w=w))
    assert "no motion: robot.rocker.phi jumps from" in said
    assert "where loops close in another way" in said


def test_both_causalities_find_the_same():
    inverse, forward = (
        optimize(carried("six_D1", 2), elements=20, causality=way) for way in ("inverse", "forward")
    )
    assert inverse.final_time == pytest.approx(forward.final_time, rel=1e-6)
    assert "Inverse causality, as asked for: accelerations are found" in inverse.report()
    assert "Forward causality: as asked for." in forward.report()


def test_played_through_the_model_the_tool_arrives():
    optimum = optimize(
        carried("six_D1", 2), elements=40, controls={f"robot.carts[{k}].f": "ramps" for k in range(3)}
    )
    times = np.unique(np.concatenate([np.linspace(0, optimum.final_time, 4001), optimum.breaks]))
    forces = {f"carts[{k}].f": (times, optimum.signal(f"robot.carts[{k}].f")(times)) for k in range(3)}
    begin, end = PAIRS["six_D1"]["pairs"][2]
    robot = SixLinkGantryTau(prototypes.D1, tool=dict(r=Fixed(begin["tool_r"]), v=Fixed([0.0, 0.0, 0.0])))
    played = simulate(robot, stop=optimum.final_time, inputs=forces)
    np.testing.assert_allclose(played.final("tool.r"), end["tool_r"], atol=2e-3)  # 40 elements


def test_forces_in_costs_and_in_blocks():
    problem: Any = carried("six_D1", 2)

    class Gentle(problem):
        def integrand(self):
            return 1e-8 * sum(cart.f**2 for cart in self.robot.carts)

    fast, gentle = solved("six_D1", 2), optimize(Gentle, elements=20)
    assert gentle.final_time > fast.final_time
    spent = [
        np.trapezoid(sum(o[f"robot.carts[{k}].f"] ** 2 for k in range(3)), o.time) for o in (fast, gentle)
    ]
    assert spent[1] < spent[0]
    blocks = optimize(problem, elements=20, controls={"robot.carts[1].f": "constant"})
    assert fast.final_time <= blocks.final_time < 1.05 * fast.final_time
