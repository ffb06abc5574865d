"""The way through the poses of a plan, as it is shown."""

from typing import Any

import numpy as np
import pytest

from gantrytau import ModelError, animate
from gantrytau.viewing import Cloud, Cuboid, ForceArrow
from gantrytau_optimica import load_plan, plan_calibration
from tests.optimica.procedure import cells
from tests.optimica.refusals import refused

FEW: dict[str, Any] = dict(poses=12, robots=3, tape=0.003, spacing=0.25)


@pytest.fixture(scope="module")
def plan():
    return plan_calibration(*cells.l1(), **FEW)


def test_it_passes_all_poses_and_rests_where_it_is_measured(plan):
    motion = plan.motion(speed=0.2, rest=2.0)
    q = np.stack([motion[name] for name in plan.joints], axis=1)
    gaps = np.linalg.norm(q[:, None] - plan.q, axis=2).min(axis=0)
    assert gaps.max() == 0
    assert np.isclose(np.diff(motion.time), 2.0).sum() == plan.measured.sum() == 12
    # where the nominal robot is, by the plan's own way to say so
    at = [int(np.argmin(np.linalg.norm(q - one, axis=1))) for one in plan.q]
    np.testing.assert_allclose(motion["tool.r"][at], plan.r, atol=1e-9)


def test_the_tool_moves_at_the_speed_that_is_asked_for(plan):
    motion = plan.motion(speed=0.2, rest=0.0)
    way = np.linalg.norm(np.diff(motion["tool.r"], axis=0), axis=1).sum()
    # but for ways that are shorter than the shortest
    assert motion.time[-1] == pytest.approx(way / 0.2, rel=0.01)


def test_rods_obstacles_and_places_are_seen_and_forces_are_not(plan, tmp_path):
    shapes = plan.motion().shapes
    kinds = [type(shape) for shape in shapes]
    assert ForceArrow not in kinds
    (cloud,) = [shape for shape in shapes if isinstance(shape, Cloud)]
    np.testing.assert_allclose(cloud.places, plan.r[plan.measured], atol=1e-12)
    assert kinds.count(Cuboid) >= len(plan.cell.limits.obstacles)
    page = animate(plan, speed=20.0, file=tmp_path / "plan.html")
    assert (tmp_path / "plan.html").stat().st_size < 3_000_000
    assert "GantryTau" in page.title


@pytest.mark.parametrize("wrong", [dict(speed=0.0), dict(rest=-1.0), dict(speed="fast")])
def test_what_no_drive_can_have_is_refused(plan, wrong):
    with refused(*wrong):
        plan.motion(**wrong)


def test_a_plan_without_its_robot_says_what_it_needs(plan, tmp_path):
    plan.write(tmp_path / "cell")
    with pytest.raises(ModelError, match=r"expected its robot; load_plan\(folder, robot, limits\)"):
        animate(load_plan(tmp_path / "cell"))
    robot, limits, _ = cells.l1()
    assert load_plan(tmp_path / "cell", robot, limits).motion().time[-1] > 0


def test_the_plate_of_six_links_turns_on_the_way():
    robot, limits, tracker = cells.six_links()
    plan = plan_calibration(robot, limits, tracker, **FEW)
    motion = plan.motion(rest=0.0)
    q = np.stack([motion[name] for name in plan.joints], axis=1)
    at = [int(np.argmin(np.linalg.norm(q - one, axis=1))) for one in plan.q]
    np.testing.assert_allclose(motion["tool.R"][at], plan.R, atol=1e-9)
