"""What the robot makes of start poses, masses and friction that are given to it."""

import pytest

from gantrytau import ModelError, Start, translate
from gantrytau.mechanics.translational import LinearFriction
from gantrytau_models import GantryTau, InverseDynamics, prototypes


def test_a_start_pose_is_held_and_the_carts_are_behind_the_tool():
    pose = [0.5, 3.0, -0.6]
    start = translate(GantryTau(prototypes.L1, tool=dict(r=Start(pose)))).start
    assert [start[f"tool.r[{k}]"] for k in range(3)] == pose
    assert start["carts[0].s"] < 0.5 - prototypes.L1.arms[0].offset[0]


def test_a_negative_mass_is_refused():
    with pytest.raises(ModelError, match=r"plate_mass: value is -1"):
        translate(GantryTau(prototypes.L1, plate_mass=-1.0))


def test_friction_by_direction_is_that_of_table_6_1():
    robot = translate(GantryTau(prototypes.L1_asymmetric))
    forth, back = (robot.evaluate({"tool.v": [speed, 0.0, 0.0]}) for speed in (1.0, -1.0))
    v = forth["carts[0].law.v"]
    assert forth["carts[0].law.f"] == pytest.approx(189.12 + 205.03 * v, rel=1e-12)  # tanh(20) is 1
    assert back["carts[0].law.f"] == pytest.approx(-145.69 - 158.01 * v, rel=1e-12)


def test_friction_by_direction_takes_a_law_that_knows_it():
    with pytest.raises(ModelError, match=r"L1_asymmetric, whose .* expected AsymmetricFriction"):
        GantryTau(prototypes.L1_asymmetric, friction=LinearFriction)
    with pytest.raises(ModelError, match=r"InverseDynamics: found L1_asymmetric, .* replace its coulomb"):
        InverseDynamics(prototypes.L1_asymmetric)


def test_what_is_no_friction_is_refused():
    with pytest.raises(TypeError, match=r"found friction='linear', expected a class such as LinearFriction"):
        GantryTau(prototypes.L1, friction="linear")  # pyright: ignore[reportArgumentType]
