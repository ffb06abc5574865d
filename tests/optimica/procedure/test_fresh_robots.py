"""The robot that stands there is none of those that were drawn: others within the tape error are safe and found, too."""

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau.kinematics import Box, Limits
from gantrytau_models import F1GantryTau, GantryTau, prototypes
from gantrytau_optimica import LaserTracker, plan_calibration
from gantrytau_optimica.procedure.motion_planning import clear_ways
from gantrytau_optimica.procedure.robot_samples import WIDER, build_fleet, check_home
from tests.families import NIGHTLY
from tests.optimica.procedure import cells

TAPE, RADIUS = 0.005, 0.03
FRESH = 40 if NIGHTLY else 10  # robots
STEP = 0.005  # m of a cart between samples, in which no point of a link moves by more than 20 mm


@pytest.fixture(scope="module")
def plan():
    # a post amidst the workspace, and no clearance at all that could hide what the tape measure does not know
    limits = Limits(strokes=(0.0, 2.0), obstacles=Box(cells.LOW, cells.HIGH), link_radius=RADIUS)
    tracker = LaserTracker((4.0, 3.0, 0.0))
    return plan_calibration(GantryTau(prototypes.L1), limits, tracker, poses=40, tape=TAPE, spacing=0.1)


def test_robots_that_were_not_drawn_pass_the_post(plan):
    parts = []
    for a, b in zip(plan.q, plan.q[1:], strict=False):
        s = np.linspace(0.0, 1.0, 2 + int(np.abs(b - a).max() / STEP))[:, None]
        parts.append((1 - s) * a + s * b)
    q, along = np.concatenate(parts), np.linspace(0.0, 1.0, 80)[:, None]
    for seed in range(FRESH):
        arms = cells.other_arms(GantryTau(prototypes.L1), TAPE, 1000 + seed)
        offsets, directions, lengths = (
            np.array([arm.values[f"{arm.name}.{name}"] for arm in arms])
            for name in ("offset", "direction", "length")
        )
        carts = offsets + q[:, :, None] * directions
        tool = cells.meeting_of_spheres(carts, lengths)
        for link in range(3):
            points = carts[:, link, None] + along * (tool - carts[:, link])[:, None]
            assert cells.box_distance(points).min() > RADIUS


def test_wider_robots_have_twice_the_errors(plan):
    fleet = plan.cell.fleet
    assert len(fleet.judges) == 1 + 2 * len(fleet.others)
    for one, wide in zip(fleet.others, fleet.wider, strict=True):
        for name in ("length", "offset", "direction"):
            nominal, near, far = (
                getattr(member.linked.geometry, name) for member in (fleet.nominal, one, wide)
            )
            np.testing.assert_allclose(far - nominal, WIDER * (near - nominal), atol=1e-12)


def test_home_must_be_safe_in_wider_robots():
    robot, limits, _ = cells.l1()
    fleet = build_fleet(robot, limits, tape=0.01, robots=10, seed=0)
    r = np.array([[x, 2.95, -0.42] for x in np.linspace(0.6, 0.8, 5)])
    r[:, 1] = np.linspace(2.535, 2.62, 5)  # from the post away
    q = fleet.nominal.joints(r, None)
    alone = [all(m.judged(each[None]).inside.all() for m in fleet.members) for each in q]
    both = [(fleet.reasons(each[None]) == 0).all() for each in q]
    assert sum(alone) >= sum(both)
    for each, good in zip(q, both, strict=True):
        if good:
            check_home(fleet, each)
        else:
            with pytest.raises(ModelError, match=r"at home = .*expected a place from which all robots"):
                check_home(fleet, each)


def test_ways_to_poses_of_another_branch_are_refused(monkeypatch):
    # some q of an F1 have a second pose near the first, which the iteration finds; motion from home does not lead there
    fleet = build_fleet(F1GantryTau(prototypes.F1), Limits(link_radius=0.01), tape=1e-6, robots=1, seed=0)
    kinematics, home = fleet.nominal.kinematics, fleet.nominal.linked.home
    q = home.q + np.random.default_rng(1).uniform(-0.6, 0.6, (500, 6))
    r, R = np.tile(home.r, (500, 1)), np.tile(home.R, (500, 1, 1))
    for share in np.linspace(0.0, 1.0, 201)[1:]:
        r, R = kinematics.fk(home.q + share * (q - home.q), near=(r, R))
    found = kinematics.fk(q)[0]
    with np.errstate(invalid="ignore"):
        reached = fleet.reasons(q) == 0
        other = reached & (np.linalg.norm(found - r, axis=1) > 1e-3)
    assert 0 < other.sum() < 0.05 * reached.sum()
    to = np.concatenate([q[other], q[reached & ~other][:20]])
    start = np.tile(home.q, (len(to), 1))
    clear = clear_ways.clear_ways(fleet, start, to)
    assert not clear[: other.sum()].any()
    assert clear[other.sum() :].sum() > 10
    monkeypatch.setattr(clear_ways, "_continuous", lambda *args: args[-1])
    assert clear_ways.clear_ways(fleet, start, to).sum() > clear.sum()  # clear all along, but for a jump
