"""Ways between poses: dense samples with other robots, distances by hand, and the bounds against what really moves."""

from typing import Any

import numpy as np
import pytest

from gantrytau.kinematics import Limits
from gantrytau_models import F1GantryTau, GantryTau, prototypes
from gantrytau_optimica import plan_calibration
from gantrytau_optimica.procedure.motion_planning import clear_ways as ways
from gantrytau_optimica.procedure.motion_planning.tours import Roadmap, find_tour
from gantrytau_optimica.procedure.robot_samples import build_fleet
from tests.optimica.procedure import cells

SAMPLES = 400  # of a way of up to 3 m: 8 mm apart, of which a link with 20 mm radius and clearance misses nothing much
FEW: dict[str, Any] = dict(poses=12, robots=4, tape=0.003, spacing=0.15)


@pytest.fixture(scope="module")
def plan():
    return plan_calibration(*cells.l1(), **FEW)


@pytest.fixture(scope="module")
def symmetric():
    return plan_calibration(*cells.symmetric(), **FEW)


def links_along(arms, q):
    """Ends of the three links of a robot with its plate held, by spheres meeting: (N, 3, 3) on carts, (N, 3)."""
    offsets, directions, lengths = (
        np.array([arm.values[f"{arm.name}.{name}"] for arm in arms])
        for name in ("offset", "direction", "length")
    )
    carts = offsets + q[:, :, None] * directions
    return carts, cells.meeting_of_spheres(carts, lengths)


def dense(plan):
    """Coordinates along the whole program, (n, 3)."""
    s = np.linspace(0, 1, SAMPLES)[:, None]
    return np.concatenate([(1 - s) * a + s * b for a, b in zip(plan.q, plan.q[1:], strict=False)])


@pytest.mark.parametrize("which", ["plan", "symmetric"])
def test_no_link_comes_near_the_box_in_robots_within_the_tape_error(which, request):
    plan = request.getfixturevalue(which)
    robot, limits, _ = cells.l1() if which == "plan" else cells.symmetric()
    box, q = limits.obstacles[0], dense(plan)
    along = np.linspace(0, 1, 60)[:, None]  # 35 mm of a link, which miss a corner by less than a millimetre
    nominal = [arm.moved(np.zeros(arm.count)) for arm in cells.read_arms(robot)]
    fleet = [m.kinematics for m in plan.cell.fleet.others]
    for arms in [nominal, *(of_member(m, nominal) for m in fleet)]:
        carts, tool = links_along(arms, q)
        assert np.isfinite(tool).all()
        for link in range(3):
            points = carts[:, link, None] + along * (tool - carts[:, link])[:, None]
            assert cells.box_distance(points, box.low, box.high).min() > cells.RADIUS + cells.CLEARANCE - 1e-3
    assert q.min() >= 0.0
    assert q.max() <= 2.0


def of_member(kinematics, arms):
    """Arms with the numbers of another robot of the fleet, read from its geometry."""
    geometry = kinematics.linked().geometry
    steps = [
        np.concatenate([[geometry.length[k]], geometry.offset[k], geometry.direction[k]]) for k in range(3)
    ]
    return [arm.moved(step - arm.vector) for arm, step in zip(arms, steps, strict=True)]


def test_robots_of_the_fleet_differ_by_the_tape_error():
    robot, limits, _ = cells.l1()
    fleet = build_fleet(robot, limits, tape=0.005, robots=30, seed=3)
    nominal = fleet.nominal.linked.geometry
    for name in ("length", "offset", "direction"):
        errors = [getattr(m.linked.geometry, name) - getattr(nominal, name) for m in fleet.others]
        assert np.std(errors) == pytest.approx(0.005, rel=0.2)  # 90 lengths give it to 8 per cent


def test_the_direct_way_through_the_post_is_refused_and_a_detour_found():
    robot, limits, _ = cells.l1()
    fleet = build_fleet(robot, limits, tape=0.002, robots=2, seed=0)
    post = (cells.LOW + cells.HIGH)[:2] / 2
    left, right = (np.array([post[0], post[1] + side, -0.9]) for side in (0.35, -0.35))
    ends = fleet.nominal.joints(np.array([left, right]), None)
    assert (fleet.reasons(ends) == 0).all()
    assert not ways.clear_ways(fleet, ends[:1], ends[1:])[0]
    over = fleet.nominal.joints(np.array([[*left[:2], 0.2], [*right[:2], 0.2]]), None)
    roadmap = Roadmap(fleet, np.concatenate([ends, over]))
    detour = roadmap.way(0, 1)
    assert detour is not None
    assert len(detour) > 2
    assert (detour[0], detour[-1]) == (0, 1)
    tour = find_tour(roadmap, np.array([1]))
    assert tour.nodes.tolist() == [*detour, *detour[-2::-1]]
    assert np.flatnonzero(~tour.via).tolist() == [len(detour) - 1]


def test_a_way_of_no_length_is_clear_where_its_place_is_safe():
    robot, limits, _ = cells.l1()
    fleet = build_fleet(robot, limits, tape=1e-3, robots=1, seed=0)
    home, inside = fleet.nominal.joints(np.array([[0.92, 2.93, -0.42], [0.7, 2.45, -0.9]]), None)
    q = np.array([home, inside])
    assert ways.clear_ways(fleet, q, q).tolist() == [True, False]


def test_unreachable_stops_are_named():
    robot, limits, _ = cells.l1()
    fleet = build_fleet(robot, limits, tape=1e-4, robots=1, seed=0)
    q = np.random.default_rng(0).uniform(0.5, 1.0, (6, 3))

    def check(_, a, b):  # nothing leads to the last place
        return ~(np.isin(a[:, 0], q[-1]) | np.isin(b[:, 0], q[-1]))

    tour = find_tour(Roadmap(fleet, q, check), np.arange(1, 6))
    assert tour.lost.tolist() == [5]
    assert sorted(tour.nodes[~tour.via]) == [1, 2, 3, 4]


def test_tours_are_short():
    # thirty places on a ring: the shortest round trip is the ring itself
    angle = np.random.default_rng(1).permutation(30) * 2 * np.pi / 30
    q = 1 + 0.5 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    nobody: Any = None  # no robot, as all ways are clear
    tour = find_tour(Roadmap(nobody, q, lambda _, a, b: np.ones(len(a), dtype=bool)), np.arange(1, 30))
    length = np.linalg.norm(np.diff(q[tour.nodes], axis=0), axis=1).sum()
    assert length == pytest.approx(30 * np.sin(np.pi / 30), rel=1e-9)


@pytest.mark.parametrize(
    ("robot", "limits"),
    [
        (GantryTau(prototypes.L1), Limits(link_radius=0.02)),
        (cells.symmetric()[0], Limits(link_radius=0.02)),
        (cells.six_links()[0], Limits(link_radius=0.01)),
        (F1GantryTau(prototypes.F1), Limits(link_radius=0.01, ball_joint=np.radians(60))),
    ],
    ids=["three", "symmetric", "six", "turntables"],
)
def test_nothing_moves_more_than_the_bound_says(robot, limits):
    member = build_fleet(robot, limits, tape=1e-3, robots=1, seed=0).members[1]
    random, home = np.random.default_rng(4), member.linked.home.q
    n = len(home)
    q = home + np.where(np.arange(n) < 3, 0.1, 0.1) * random.uniform(-1, 1, (40, n))
    rate = random.uniform(-1, 1, (40, n))
    r, R = member.pose(q)
    good = np.isfinite(r).all(axis=1)
    q, rate, r, R = q[good], rate[good], r[good], R[good]
    bounds = ways._bounds(member, q, r, R, rate)
    assert (bounds.reach > 1e-4).all()
    geometry = member.linked.geometry
    for share in (-1.0, -0.5, 0.3, 1.0):
        h = share * bounds.reach
        there = q + h[:, None] * rate
        moved_r, moved_R = member.pose(there)
        assert np.isfinite(moved_r).all()
        ends = geometry.plate_joints(moved_r, moved_R) - geometry.plate_joints(r, R)
        carts = geometry.cart_joints(there) - geometry.cart_joints(q)
        moved = np.linalg.norm(np.concatenate([ends, carts], axis=1), axis=2).max(axis=1)
        assert (moved <= bounds.moved(np.abs(h)) * (1 + 1e-9)).all()
        angles = member.kinematics.ball_joint_angles(
            moved_r, moved_R, there
        ) - member.kinematics.ball_joint_angles(r, R, q)
        assert (np.abs(angles).max(axis=(1, 2)) <= bounds.angles * np.abs(h) + 1e-9).all()
