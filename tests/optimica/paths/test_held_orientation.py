"""A plate that is to keep its orientation along a line, where the links decide it."""

from typing import Any

import numpy as np
import pytest

from gantrytau import StructureError, between
from gantrytau_models import F1GantryTau, SixLinkGantryTau, prototypes
from gantrytau_optimica import Free, Optimization, final, initial, optimize
from gantrytau_optimica.paths.path import Path
from gantrytau_optimica.paths.way import Way
from tests.optimica.known_answers.closed_loops import PAIRS, quaternion

BEGIN, END = PAIRS["f1"]["pairs"][0]
HELD = quaternion(BEGIN["tool_R"])


class Held(Optimization):
    """The six-link robot on a line, without turning."""

    robot: Any = SixLinkGantryTau(prototypes.D1)
    way: Any = Way(Path.polyline([pose["tool_r"] for pose in PAIRS["six_D1"]["pairs"][0]]))
    final_time = Free(1.0, unit="s", min=0.02)
    given = ("way.a",)

    def equations(self):
        yield self.robot.tool.r == self.way.r
        yield self.robot.tool.w == [0.0, 0.0, 0.0]

    def objective(self):
        return self.final_time


def test_three_drives_cannot_hold_the_orientation_as_well():
    """Links decide the orientation: three conditions more than there are motions, refused when the problem is read."""
    with pytest.raises(StructureError, match=r"and 2 of the equations named below.*Overdetermined") as error:
        optimize(Held, elements=5)
    assert "leave out way.a" in str(error.value)


class HeldBySixDrives(Optimization):
    """The F1 with its three turntables on a line, without turning."""

    robot: Any = F1GantryTau(
        prototypes.F1, tool=dict(r=dict(start=BEGIN["tool_r"]), q=dict(start=HELD.tolist()))
    )
    way: Any = Way(Path.polyline([BEGIN["tool_r"], END["tool_r"]]))
    final_time = Free(1.0, unit="s", min=0.02)
    given = ("way.a",)

    def equations(self):
        yield self.robot.tool.r == self.way.r
        yield self.robot.tool.q[1:4] == HELD[1:].tolist()

    def objective(self):
        return self.final_time

    def constraints(self):
        for at, s in ((initial, 0.0), (final, self.way.path.length)):
            yield at(self.way.s) == s
            yield at(self.way.v) == 0.0
        for cart in self.robot.carts:
            yield between(-1000.0, cart.f, 1000.0)
        for turntable in self.robot.turntables:
            yield between(-60.0, turntable.tau, 60.0)


def test_six_drives_hold_it_along_the_fastest_line():
    optimum = optimize(HeldBySixDrives, elements=20)
    np.testing.assert_allclose(optimum["robot.tool.q"], np.tile(HELD, (optimum.time.size, 1)), atol=1e-9)
    assert np.max(np.abs(optimum["robot.tool.w"])) < 1e-9
    # one motion is left along the line: at each instant one drive is at its limit but for the switches of 20 elements
    shares = [np.abs(optimum[f"robot.carts[{k}].f"]) / 1000 for k in range(3)]
    shares += [np.abs(optimum[f"robot.turntables[{k}].tau"]) / 60 for k in range(3)]
    assert np.mean(np.max(shares, axis=0) > 0.999) > 0.85
    assert np.max(shares) < 1 + 1e-6
