"""Workspaces: against volumes in closed form, against other ways to compute a limit, and against finer grids."""

import math
from typing import Any

import matplotlib
import numpy as np
import pytest

from gantrytau import Bounds, ModelError, Start
from gantrytau.kinematics.kinematics import Kinematics
from gantrytau.kinematics.workspace.examine import examine
from gantrytau.kinematics.workspace.obstacles import Box, Capsule, Cylinder
from gantrytau.kinematics.workspace.pose_limits import REASONS, Limits
from gantrytau.kinematics.workspace.workspace import workspace
from gantrytau_models import F1GantryTau, GantryTau, SixLinkGantryTau, prototypes

matplotlib.use("Agg")

L1 = Kinematics(GantryTau(prototypes.L1))
SIX = Kinematics(SixLinkGantryTau(prototypes.L1))
F1 = Kinematics(F1GantryTau(prototypes.F1))
STROKE, LENGTH = 0.8, 1.0
FREE = [-np.inf, np.inf]
# what is of another type than asked for
NO_LIMITS: Any = dict(strokes=(0, 1))
SHARE: Any = 1.5


def one_link() -> Kinematics:
    """A robot of which only arm 1 limits the tool: the others are links of 200 m from far away."""
    arms = [dict(length=LENGTH, offset=[0.0, 0.0, 0.0], direction=[1.0, 0.0, 0.0])]
    for away in ([0.0, 200.0, 0.0], [0.0, 0.0, -200.0]):
        arms.append(dict(length=200.0, offset=away, direction=[-1.0, *(-0.5 * np.sign(away))[1:]]))
    robot = GantryTau(prototypes.L1).modified(dict(arms=arms, tool=dict(r=Start([0.9, 0.05, 0.05]))))
    return Kinematics(robot)


ONE = one_link()
BOX = np.array([[-0.1, STROKE + LENGTH + 0.1], [-1.1, 1.1], [-1.1, 1.1]])


def along_arm_1(**limits) -> Limits:
    """Limits of the first cart and of joints whose axes are along its guideway."""
    axes = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]]
    return Limits(strokes=[[0.0, STROKE], FREE, FREE], cart_axes=axes, plate_axes=axes, **limits)


def test_one_link_reaches_a_cylinder_with_round_ends():
    # the half sphere ahead of the cart, moved along: any line along the guideway has the length of the stroke inside
    found = workspace(ONE, along_arm_1(), box=BOX, spacing=0.05)
    exact = math.pi * LENGTH**2 * STROKE
    assert found.volume == pytest.approx(exact, abs=3 * found.uncertainty)
    assert found.uncertainty < 0.01 * exact


@pytest.mark.parametrize("angle", [25.0, 60.0])
def test_a_ball_joint_narrows_the_cylinder(angle):
    angle = math.radians(angle)
    found = workspace(ONE, along_arm_1(ball_joint=angle), box=BOX, spacing=0.05, refine=2)
    exact = math.pi * (LENGTH * math.sin(angle)) ** 2 * STROKE
    assert found.volume == pytest.approx(exact, abs=3 * found.uncertainty)
    part = math.radians(5.0)
    same = workspace(
        ONE, along_arm_1(ball_joint=angle + part, angle_margin=part), box=BOX, spacing=0.05, refine=2
    )
    assert same.volume == pytest.approx(found.volume, rel=1e-12)  # a margin is a smaller limit


def test_margins_of_strokes_shorten_the_cylinder():
    found = workspace(ONE, along_arm_1(stroke_margin=0.15), box=BOX, spacing=0.05)
    assert found.volume == pytest.approx(math.pi * LENGTH**2 * (STROKE - 0.3), abs=3 * found.uncertainty)


def test_an_obstacle_cuts_off_a_segment_of_the_cylinder():
    wall = Box([-2.0, -2.0, 0.35], [3.0, 2.0, 2.0])  # the far links come from the side and from below
    hand = Capsule([0.0, 0.0, 0.0], [0.0, 0.0, 0.0], 0.1)
    limits = along_arm_1(obstacles=wall, plate=hand, clearance=0.05)
    found = workspace(ONE, limits, box=BOX, spacing=0.05, refine=2)
    height = 0.2  # of the wall over the guideway, less hand and clearance
    segment = LENGTH**2 * math.acos(height / LENGTH) - height * math.sqrt(LENGTH**2 - height**2)
    exact = (math.pi * LENGTH**2 - segment) * STROKE
    assert found.volume == pytest.approx(exact, abs=3 * found.uncertainty)


def test_finer_grids_converge():
    exact = math.pi * LENGTH**2 * STROKE
    # the grid meets the border differently at each spacing: means over some boxes fall, as the spacing does at least
    errors = [
        np.mean(
            [
                abs(workspace(ONE, along_arm_1(), box=BOX + shift, spacing=spacing).volume - exact)
                for shift in shifts
            ]
        )
        for spacing, shifts in ((0.2, (0.0, 0.03, 0.07)), (0.05, (0.0, 0.01, 0.02)))
    ]
    assert errors[1] < errors[0] / 4


def test_refining_the_border_is_a_finer_grid():
    coarse = workspace(L1, Limits(strokes=(0.0, 1.5), ball_joint=0.7), spacing=0.16, refine=4)
    fine = workspace(L1, Limits(strokes=(0.0, 1.5), ball_joint=0.7), spacing=0.04, box=coarse.box)
    assert coarse.volume == pytest.approx(fine.volume, abs=4 * (coarse.uncertainty + fine.uncertainty))
    assert 0.5 < coarse.uncertainty / fine.uncertainty < 2.0


def test_a_slice_has_the_area_of_the_cross_section():
    box = [[1.0, 1.0], BOX[1], BOX[2]]
    found = workspace(ONE, along_arm_1(), box=box, spacing=0.02, refine=2)
    # the tool at x = 1 m: carts from 0.8 m to 0 m are within 1 m of it in the ring from 0 to sqrt(1 - 0.2^2)
    inner = LENGTH**2 - 0.2**2  # nearer to the guideway than that the cart is at 0 to 0.8 m
    exact = math.pi * inner
    assert found.volume == 0.0
    assert found.area == pytest.approx(exact, abs=3 * found.uncertainty)
    assert found.cross_section("x") == found.area
    whole = workspace(ONE, along_arm_1(), box=BOX, spacing=0.05)
    assert whole.cross_section("x", 1.0) == pytest.approx(exact, rel=0.1)  # a layer of 0.05 m, not a plane
    assert whole.cross_section("x") == pytest.approx(math.pi * LENGTH**2, rel=0.06)


def test_the_default_box_holds_the_whole_workspace():
    for robot, limits in (
        (L1, Limits(strokes=(0.0, 1.0))),
        (SIX, Limits(strokes=(0.0, 1.0))),
        (F1, Limits(strokes=(-0.5, 0.5))),
    ):
        found = workspace(robot, limits, spacing=0.2)
        grown = workspace(robot, limits, spacing=0.2, box=found.box + 0.4 * np.array([-1.0, 1.0]))
        assert grown.inside.any()
        outside = (grown.places < found.box[:, 0]) | (grown.places > found.box[:, 1])
        assert not outside.any()


def test_the_cross_section_of_l1_is_as_wide_as_the_thesis_says():
    # Dressler (2012), Figure 2.4: about 1 m by 1 m at 40 deg, links of 1.8 to 2.0 m. The figure keeps what is below the
    # guideways; where the axes of joints are along the links at home, the section is wider, as none is printed
    found = workspace(
        L1, Limits(strokes=(0.0, 2.5), ball_joint=math.radians(40.0)), spacing=0.05, box=_slice(1.2)
    )
    assert 1.0 < found.area < 4.0
    assert np.ptp(found.places, axis=0)[1:].min() > 1.0


def _slice(x: float) -> list:
    return [[x, x], [1.0, 4.5], [-2.2, 1.0]]


@pytest.mark.parametrize(("robot", "links"), [(L1, 3), (SIX, 6), (F1, 6)])
def test_limits_of_joints_are_those_of_the_kinematics(robot, links):
    rng = np.random.default_rng(5)
    r = robot.home.r + rng.uniform(-0.5, 0.5, (200, 3))
    R = robot.home.R if links == 6 and len(robot.joints) == 6 else None
    angles = robot.ball_joint_angles(r, R)
    assert angles.shape == (200, links, 2)
    found = examine(robot, r, R, Limits(ball_joint=0.6))
    assert found.angle == pytest.approx(0.6 - angles.max(axis=(1, 2)), abs=1e-9, nan_ok=True)
    reached = np.isfinite(found.q).all(axis=1)
    assert 0 < reached.sum()
    assert found.q[reached] == pytest.approx(robot.ik(r, R)[reached], abs=1e-9)
    assert (found.reason[~reached] == REASONS.index("out of reach")).all()


def test_reasons_are_the_first_limit_that_is_broken():
    limits = Limits(
        strokes=[[0.2, 0.9], [0.2, 1.4], [0.2, 1.4]], ball_joint=0.5, obstacles=[_block()], link_radius=0.03
    )
    found = workspace(L1, limits, spacing=0.1)
    kept = found.examined
    assert set(np.unique(kept.reason)) == {0, 1, 2, 3, 4}
    q_kept = ((kept.q >= [0.2] * 3) & (kept.q <= [0.9, 1.4, 1.4])).all(axis=1)
    assert (q_kept == np.isin(kept.reason, [0, 3, 4])).all()
    assert (kept.angle[np.isin(kept.reason, [0, 4])] >= 0).all()
    assert (kept.angle[kept.reason == 3] < 0).all()
    assert (kept.clearance[kept.reason == 4] < 0).all()
    assert (kept.clearance[kept.reason == 0] >= 0).all()
    assert np.isnan(kept.clearance[kept.reason == 3]).all()


def _block() -> Box:
    return Box([0.6, 2.6, -0.9], [0.8, 2.9, -0.6])


def test_links_hit_what_the_tool_does_not():
    # an obstacle between a cart and the tool: points of the links, sampled, are inside of it
    post = Cylinder([0.9, 3.1, -1.5], [0.9, 3.1, 0.5], 0.05)
    limits = Limits(obstacles=(post,), link_radius=0.02)
    r = np.stack(np.meshgrid(np.linspace(1.2, 1.9, 12), np.linspace(2.4, 3.4, 12), [-0.6]), axis=-1).reshape(
        -1, 3
    )
    found = examine(L1, r, None, limits)
    carts = L1.linked().geometry.cart_joints(found.q)
    way = np.linspace(0.0, 1.0, 2001)[:, None]
    sampled = np.array([
        min(post.distance(cart + way * (tool - cart)).min() for cart in row) for row, tool in zip(carts, r, strict=True)
    ])  # fmt: skip
    assert found.clearance == pytest.approx(sampled - 0.02, abs=0.6e-3)  # half a step between the samples
    assert (found.clearance[post.distance(r) > 0.1] < 0).any()
    assert (found.clearance > 0).any()


def test_links_of_different_arms_may_not_touch_each_other():
    home = SIX.home.r + np.zeros((1, 3))
    apart = examine(SIX, home, None, Limits(link_radius=0.001)).clearance[0] + 0.002
    assert 0 < apart < 0.5
    assert examine(SIX, home, None, Limits(link_radius=apart / 2 - 1e-6)).inside[0]
    assert not examine(SIX, home, None, Limits(link_radius=apart / 2 + 1e-6)).inside[0]
    # three links end in one point, where they always meet
    assert examine(L1, L1.home.r, None, Limits(link_radius=0.3)).clearance[0] == np.inf


def test_the_plate_turns_with_its_orientation():
    tip = [0.0, 0.0, 0.0]
    R = F1.home.R
    reach = R.T @ np.array([0.0, 0.3, 0.0])  # in the world along y at home
    wall = Box(F1.home.r + np.array([-0.05, 0.25, -0.05]), F1.home.r + np.array([0.05, 0.4, 0.05]))
    limits = Limits(obstacles=(wall,), plate=(Capsule(tip, reach, 0.01),))
    assert examine(F1, F1.home.r, R, limits).clearance[0] < 0
    half = math.radians(15.0)
    turn = np.array([[math.cos(half), -math.sin(half), 0], [math.sin(half), math.cos(half), 0], [0, 0, 1]])
    found = examine(F1, F1.home.r, turn @ R, limits)
    tip_turned = F1.home.r + turn @ [0.0, 0.3, 0.0]
    assert found.inside[0]
    assert found.clearance[0] < wall.distance(tip_turned)  # the nearest point is not the tip


def test_strokes_of_the_model_are_the_default():
    model = GantryTau(prototypes.L1, carts=[dict(s=Bounds(0.0, 1.2))] * 3)
    assert (
        workspace(model, spacing=0.2).volume == workspace(L1, Limits(strokes=(0.0, 1.2)), spacing=0.2).volume
    )


def test_turntables_have_limits_of_their_own():
    tight = Limits(strokes=[[-1, 1]] * 3 + [[-0.2, 0.2]] * 3, turn_margin=0.05)
    found = examine(F1, F1.home.r + np.zeros((1, 3)), F1.home.R, tight)
    turned = np.abs(F1.ik(F1.home.r, F1.home.R)[3:]).max()
    assert found.turn[0] == pytest.approx(0.15 - turned, abs=1e-12)


def test_parts_behind_an_obstacle_are_told():
    wall = Box([0.9, -9.0, -9.0], [0.95, 9.0, 9.0])

    class Thin:
        """For the tool alone: its links pass."""

        def distance(self, points):
            return wall.distance(points) if points.ndim == 2 else np.full(points.shape[:-1], 9.0)

    limits = along_arm_1(obstacles=(Thin(),), plate=(Capsule([0, 0, 0], [0, 0, 0], 0.03),))
    found = workspace(ONE, limits, box=BOX, spacing=0.1)
    assert found.parts.max() == 2
    assert (found.parts == 1).sum() > (found.parts == 2).sum() > 0
    assert ((found.parts > 0) == found.inside).all()
    assert "in 2 separate parts" in str(found)


def test_a_line_of_places_prints_itself():
    line = workspace(L1, Limits(strokes=(0.0, 2.5)), box=[[1.2, 1.2], [3.0, 3.0], [-2.0, 1.0]])
    assert "no area; of 60 places" in str(line)


def test_figures(tmp_path):
    limits = Limits(strokes=(0.0, 1.2), ball_joint=0.6, obstacles=[_block()], link_radius=0.02)
    found = workspace(L1, limits, spacing=0.15)
    layers: list[Any] = [("x", "limits"), ("y", "stroke"), ("z", "angle"), ("x", "clearance")]
    for k, (axis, quantity) in enumerate(layers):
        found.plot(axis, quantity=quantity, file=tmp_path / f"{k}.png")
        assert (tmp_path / f"{k}.png").stat().st_size > 1000
    assert "m³" in found.plot_solid(file=tmp_path / "solid.png").axes[0].get_title()
    figure = workspace(L1, limits, spacing=0.1, box=_slice(1.0)).plot(file=tmp_path / "slice.png")
    assert figure.axes[0].get_xlabel() == "y [m]"
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert {"inside", "guideway", "collision"} <= set(words)
    hides = figure.legends[0].get_window_extent()
    drawn = figure.axes[0].get_tightbbox()
    assert drawn is not None
    assert not hides.overlaps(drawn)  # data and labels stay in sight
    assert figure.bbox.x0 <= hides.x0 < hides.x1 <= figure.bbox.x1
    with pytest.raises(ModelError, match="found no place of the layer where turn is limited"):
        found.plot(quantity="turn")
    with pytest.raises(ModelError, match=r"plot_solid: found \(1, "):
        workspace(L1, limits, spacing=0.3, box=_slice(1.0)).plot_solid()
    with pytest.raises(ModelError, match="found at="):
        found.cross_section("x", 9.0)
    with pytest.raises(ModelError, match="expected a slice for its area"):
        _ = found.area


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: workspace(L1), "strokes: found .* expected finite ones"),
        (lambda: workspace(L1, box=[[0, 1], [0, 1]]), "found box of 2 x 2"),
        (lambda: workspace(L1, box=[[0, 1], [0, 1], [1, 0]]), "found box=.* expected pairs"),
        (lambda: workspace(L1, box=BOX, spacing=1e-5), "expected 2e.07 at most"),
        (lambda: workspace(L1, Limits(strokes=[[0, 1]] * 2), box=BOX), "found strokes of 2 x 2"),
        (lambda: Limits(clearance=np.inf), "found clearance=inf, expected a finite number"),
        (lambda: workspace(L1, Limits(strokes=(1, 0)), box=BOX), "found strokes=.* expected .least, largest"),
        (lambda: workspace(L1, Limits(ball_joint=0.5, cart_axes=[0, 0, 0]), box=BOX), "found cart_axes"),
        (lambda: workspace(L1, Limits(ball_joint=0.5, home=[9, 9, 9]), box=BOX), "found cart_axes .*in"),
        (lambda: workspace(L1, Limits(strokes=[[0, 0.1], [50, 51], [0, 0.1]])), "cannot meet in any place"),
        (lambda: examine(L1, [[0, 0]]), "found r of 1 x 2"),
        (lambda: workspace(L1, NO_LIMITS, box=BOX), "found limits={.*expected Limits"),
        (lambda: workspace(L1, Limits(ball_joint=0.5, home="here"), box=BOX), "home: found r='here'"),
        (lambda: workspace(L1, box=[[1, 1], [3, 3], [-2, 1]]).plot(), "expected a slice or a solid to draw"),
        (lambda: Limits(obstacles=[Box]), "Limits.obstacles: found <class"),
        (lambda: Limits(ball_joint=40), "Limits: found ball_joint=40.* in rad"),
        (lambda: Limits(clearance=-1), "Limits: found clearance=-1"),
        (lambda: Limits(plate=(_block(),)), "Limits: found plate=.*Capsule"),
    ],
)
def test_what_cannot_be_answered_is_refused(call, message):
    with pytest.raises(ModelError, match=message):
        call()
