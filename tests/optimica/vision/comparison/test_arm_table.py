"""Numbers of arms by cameras beside those by a laser: Tables 5.6 and 5.7."""

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau_models import SixLinkGantryTau, prototypes
from gantrytau_optimica import Measurements, calibrate
from gantrytau_optimica.vision import ArmTable, arm_table, compare, reconstruct
from tests.optimica.vision.camera_rig import LENS, lines, pair, seen

ROBOT = SixLinkGantryTau(prototypes.GT_A)


def test_the_printed_tables_say_what_the_text_says():
    table = ArmTable.printed("5.6")
    assert np.abs(table.difference("cameras", "laser")[:, :4]).max() == pytest.approx(0.009)  # "up to 9 mm"
    lengths = ArmTable.printed("5.7").arms["one camera"][:, 0] - table.arms["laser"][:, 0]
    assert np.round(1e3 * lengths).tolist() == [-4, -55, -37]  # where the text says 5 mm of the last two
    assert np.linalg.norm(ArmTable.printed("5.7").arms["one camera"][:, 4:], axis=1) == pytest.approx(
        [0.96437, 0.97760, 1.0], abs=1e-5
    )


def test_cameras_and_laser_find_the_same_arms_in_the_frame_of_the_laser():
    r, q = lines(1)
    poses = reconstruct(seen(r, pair()), [LENS, LENS], spacing=q)
    laser = r + 1e-5 * np.random.default_rng(1).standard_normal(r.shape)
    found = {
        "cameras": calibrate(ROBOT, poses.measurements(q), model=1),
        "laser": calibrate(ROBOT, Measurements(q, laser), model=1),
    }
    table = arm_table(found, {"cameras": compare(poses.r, laser)})
    apart = table.difference("cameras", "laser")
    assert np.abs(apart[:, :4]).max() < 2e-3
    assert np.abs(apart[:, 4:]).max() < 1e-3
    assert np.abs(arm_table(found).difference("cameras", "laser")).max() > 1
    text = str(table)
    assert len(text.splitlines()) == 7
    assert "arm 3, laser" in text


def test_what_does_not_fit_is_refused_by_name():
    for wrong, argument in (
        (lambda: ArmTable.printed("6.1"), "table"),
        (lambda: ArmTable.printed("5.6").difference("tape", "laser"), "one"),
    ):
        with pytest.raises(ModelError) as refusal:
            wrong()
        assert refusal.value.argument == argument
    r, q = lines(1, count=6)
    found = {"laser": calibrate(ROBOT, Measurements(q, r), model=1)}
    with pytest.raises(ModelError, match="found frames of cameras, expected those of laser"):
        arm_table(found, {"cameras": compare(r, r)})
    turned = np.repeat(np.eye(3)[None], len(r), axis=0)
    six = calibrate(ROBOT, Measurements(q, r, turned))
    with pytest.raises(ModelError, match=r"without arms\[0\].length, expected arms of one length each"):
        arm_table({"six": six})
