"""What the robot makes of start poses, masses and friction that are given to it."""

import pytest

from gantrytau import ModelError, Start, translate
from gantrytau_models import GantryTau, prototypes


def test_a_start_pose_is_held_and_the_carts_are_behind_the_tool():
    pose = [0.5, 3.0, -0.6]
    start = translate(GantryTau(prototypes.L1, tool=dict(r=Start(pose)))).start
    assert [start[f"tool.r[{k}]"] for k in range(3)] == pose
    assert start["carts[0].s"] < 0.5 - prototypes.L1.arms[0].offset[0]


def test_a_negative_mass_is_refused():
    with pytest.raises(ModelError, match=r"plate_mass: value is -1"):
        translate(GantryTau(prototypes.L1, plate_mass=-1.0))


def test_what_is_no_friction_is_refused():
    with pytest.raises(TypeError, match=r"found friction='linear', expected a class such as LinearFriction"):
        GantryTau(prototypes.L1, friction="linear")  # pyright: ignore[reportArgumentType]
