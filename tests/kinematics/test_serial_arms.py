"""Arms of six joints in a row: their tool is given a pose where it has coordinates of its own."""

import itertools

import numpy as np
import pytest

from gantrytau import Model, ModelError, Start, connect
from gantrytau.kinematics import Kinematics
from gantrytau.mechanics.multibody import Body, FixedTranslation, Revolute, World

JOINTS = [f"{name}.phi" for name in ("base", "shoulder", "elbow", "roll", "pitch", "yaw")]


class SixJoints(Model):
    """Six joints in a row, the last three about crossing axes."""

    world = World()
    base = Revolute(n=[0, 0, 1], phi=Start(0.3))
    shoulder = Revolute(n=[0, 1, 0], phi=Start(0.5))
    elbow = Revolute(n=[0, 1, 0], phi=Start(0.8))
    roll = Revolute(n=[1, 0, 0], phi=Start(0.2))
    pitch = Revolute(n=[0, 1, 0], phi=Start(0.6))
    yaw = Revolute(n=[1, 0, 0], phi=Start(0.1))
    column = FixedTranslation(r=[0, 0, 0.4])
    upper, fore = FixedTranslation(r=[0.6, 0, 0]), FixedTranslation(r=[0.5, 0, 0])
    tool = Body(m=1.0)

    def equations(self):
        chain = [
            self.world,
            self.base,
            self.column,
            self.shoulder,
            self.upper,
            self.elbow,
            self.roll,
            self.fore,
        ]
        for one, other in itertools.pairwise([*chain, self.pitch, self.yaw]):
            yield connect(one.frame_b, other.frame_a)
        yield connect(self.yaw.frame_b, self.tool.frame_a)


def test_there_and_back_where_the_tool_has_coordinates_of_its_own():
    arm = Kinematics(SixJoints(tool=dict(free=True)), joints=JOINTS)
    start = np.array([0.3, 0.5, 0.8, 0.2, 0.6, 0.1])
    q = start + np.random.default_rng(1).uniform(-0.1, 0.1, (20, 6))
    r, R = arm.fk(q)
    assert np.abs(arm.ik(r, R) - q).max() < 1e-9
    # the wrist lies on a circle about the column, at the length of the two bars
    reach = np.array([np.hypot(*(each[:2])) for each in r])
    expected = 0.6 * np.cos(q[:, 1]) + 0.5 * np.cos(q[:, 1] + q[:, 2])
    assert np.abs(reach - expected).max() < 1e-12


def test_without_them_it_is_told_how_to_have_them():
    arm = Kinematics(SixJoints(), joints=JOINTS)
    r, R = arm.fk(np.array([[0.3, 0.5, 0.8, 0.2, 0.6, 0.1]]))
    assert np.isfinite(r).all()
    with pytest.raises(ModelError, match=r"no quaternion tool\.q.*tool = Body\(\.\.\., free=True\)"):
        arm.ik(r, R)
