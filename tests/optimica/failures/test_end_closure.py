"""Ends at which loops of iterated positions cannot be closed: refused before solving, the gap known by geometry."""

import re
from typing import Any

import numpy as np
import pytest

from gantrytau import SolveError, between
from gantrytau_models import FourBar, SixLinkGantryTau, prototypes
from gantrytau_optimica import Free, Optimization, final, initial, optimize, prepare
from gantrytau_optimica.failures.end_closure import open_ends
from tests.optimica.known_answers.closed_loops import PAIRS, turned


class Bar(Optimization):
    """A linkage whose coupler and rocker, 0.5 m and 0.6 m, reach the crank of 0.9 m up to cos(phi) = 1 / 3."""

    bar: Any = FourBar(ground=1.0, crank=0.9, coupler=0.5, rocker=0.6)
    final_time = Free(0.5, unit="s", min=0.02, max=5.0)
    end = 2.0

    def objective(self):
        return self.final_time

    def constraints(self):
        yield between(-20, self.bar.torque, 20)
        for point, phi in ((initial, 0.5), (final, self.end)):
            yield point(self.bar.crank.phi) == phi
            yield point(self.bar.crank.w) == 0


class Six(Optimization):
    """The six-link robot from rest to rest."""

    robot: Any = SixLinkGantryTau(prototypes.D1)
    final_time = Free(0.5, unit="s", min=0.02)
    begin, end = (pose["tool_r"] for pose in PAIRS["six_D1"]["pairs"][2])
    turned = False

    def objective(self):
        return self.final_time

    def constraints(self):
        tool = self.robot.tool
        for cart in self.robot.carts:
            yield between(-1200, cart.f, 1200)
        for point, r in ((initial, self.begin), (final, self.end)):
            yield point(tool.r) == list(r)
            yield point(tool.v) == 0
        if self.turned:
            yield final(tool.q[3]) == 0.3


def said(problem, **changes) -> str:
    return open_ends(prepare(type("Changed", (problem,), changes), elements=2).built)


def test_nothing_is_said_of_ends_at_which_loops_close():
    assert said(Six) == ""
    assert said(Bar, end=1.2) == ""
    assert open_ends(prepare(turned(0), elements=2).built) == ""


def test_the_nearest_angle_of_a_crank():
    words = said(Bar)
    assert words.startswith(
        "the end is out of reach: no pose was found in which the loops of the mechanism are closed"
    )
    found = re.search(r"the nearest with closed loops: final\(bar.crank.phi\) = ([0-9.]+)$", words)
    assert found is not None
    assert float(found[1]) == pytest.approx(np.arccos(1 / 3), abs=1e-4)  # four digits


def test_a_place_out_of_reach_says_how_far():
    far = np.array(PAIRS["six_D1"]["pairs"][2][1]["tool_r"]) - [0.0, 5.0, 0.0]
    words = said(Six, end=far)
    found = re.search(r"closed loops, ([0-9.]+) m away: (.*)$", words)
    assert found is not None
    near = far.copy()
    for k, value in re.findall(r"final\(robot\.tool\.r\[(\d)\]\) = (-?[0-9.]+)", found[2]):
        near[int(k)] = float(value)
    assert float(found[1]) == pytest.approx(np.linalg.norm(near - far), abs=1e-3)  # four digits
    assert said(Six, end=near + 1e-3 * (near - far) / np.linalg.norm(near - far)) == ""


def test_an_orientation_that_the_links_decide_is_refused_before_solving():
    with pytest.raises(SolveError, match=r"`final\(robot\.tool\.q\[3\]\) == 0\.3` hold; the") as error:
        optimize(type("Turned", (Six,), dict(turned=True)), elements=5)
    assert error.value.optimum is not None
    assert error.value.optimum.iterations == 0
    assert str(error.value).endswith("Correct these conditions, or the parameters of the model.")
