"""A plate that is to keep its orientation along a line, where the links decide it."""

from typing import Any

import pytest

from gantrytau import StructureError
from gantrytau_models import SixLinkGantryTau, prototypes
from gantrytau_optimica import Free, Optimization, optimize
from gantrytau_optimica.paths.path import Path, Way
from tests.optimica.known_answers.closed_loops import PAIRS


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
    with pytest.raises(
        StructureError, match=r"and 2 of the equations named below.*Overdetermined by 3"
    ) as error:
        optimize(Held, elements=5)
    assert "leave out way.a" in str(error.value)
