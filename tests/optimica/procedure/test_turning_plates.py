"""The procedure for plates that turn: six links, and the F1 with turntables."""

import numpy as np
import pytest

from gantrytau.kinematics import Limits
from gantrytau.kinematics.rotations import angle_between
from gantrytau_models import F1GantryTau, prototypes
from gantrytau_optimica import plan_calibration
from gantrytau_optimica.calibration import TMac
from gantrytau_optimica.procedure.documents.plan_page import html_page
from tests.optimica.procedure import cells

SAMPLES = 150


def checked(plan, strokes):
    """All along the program, for each robot: links as long as they are, none too near to another, carts in their strokes."""
    s = np.linspace(0, 1, SAMPLES)[:, None]
    q = np.concatenate([(1 - s) * a + s * b for a, b in zip(plan.q, plan.q[1:], strict=False)])
    assert (q[:, :3] >= strokes[0]).all()
    assert (q[:, :3] <= strokes[1]).all()
    along = np.linspace(0, 1, 25)[:, None]
    for member in plan.cell.fleet.members:
        geometry, limits = member.linked.geometry, member.limits
        r, R = member.pose(q)
        a, b = geometry.cart_joints(q), geometry.plate_joints(r, R)
        np.testing.assert_allclose(
            np.linalg.norm(b - a, axis=2), np.tile(geometry.length, (len(q), 1)), atol=1e-9
        )
        points = a[:, :, None] + along * (b - a)[:, :, None]  # (N, 6, 25, 3)
        for i in range(6):
            for j in range(i):
                if geometry.arm[i] == geometry.arm[j]:
                    continue
                apart = np.linalg.norm(points[::7, i, :, None] - points[::7, j, None], axis=-1).min()
                assert apart > 2 * limits.link_radius + limits.clearance
        steps = np.linalg.norm(np.diff(r, axis=0), axis=1)
        assert steps.max() < 0.1  # no jump to another branch: moves of up to 3 m in 150 steps


def test_six_links():
    plan = plan_calibration(*cells.six_links(), poses=14, robots=2, tape=0.001, spacing=0.25)
    checked(plan, (0.0, 2.0))
    assert plan.verdict.good
    assert plan.trials.before.min() > 5e-4
    assert plan.settings["prior"] == {"plate_offset": 0.001}  # one orientation does not tell where joints are
    assert "calibrate measurements.csv --prior plate_offset=0.001" in html_page(plan, None, "Calibration.mod")
    # few poses and nearly one orientation: the prediction is a size, not a number
    assert 0.3 < plan.trials.in_frame.mean() / plan.prediction.error < 2.0


def test_turntables():
    limits = Limits(strokes=(-0.6, 0.9), ball_joint=np.radians(45), link_radius=0.01, clearance=0.01)
    f1 = F1GantryTau(prototypes.F1)
    tmac = TMac((-0.2, -2.0, -0.2))
    plan = plan_calibration(f1, limits, tmac, poses=16, robots=2, tape=0.001, spacing=0.3, wanted=1e-3)
    checked(plan, (-0.6, 0.9))
    assert plan.verdict.good
    assert plan.trials.after.max() < 0.3 * plan.trials.before.min()
    turned = angle_between(plan.R[plan.measured] @ [0.0, 0.0, 1.0], plan.R[0] @ [0.0, 0.0, 1.0])
    assert turned.max() > np.radians(10)  # poses turn the plate, else its turntables stay unknown
    text = plan.program(carts="robax")
    assert f"{np.degrees(plan.q[1, 5]):.5f}".rstrip("0") in text


@pytest.mark.parametrize("poses", [8, 10])
def test_six_links_take_more_poses(poses):
    from gantrytau import ModelError

    with pytest.raises(ModelError, match=rf"poses={poses}, expected a whole number of at least 11"):
        plan_calibration(*cells.six_links(), poses=poses, tape=0.001, robots=1)
