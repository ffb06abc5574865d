"""Arms of six joints in a row, with tools of their own coordinates and without."""

import itertools

import numpy as np
import pytest

from gantrytau import Array, Model, ModelError, Real, Start, connect
from gantrytau.kinematics import Kinematics
from gantrytau.mechanics.multibody import Body, FixedTranslation, Revolute, World
from tests.families import NIGHTLY

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


@pytest.mark.parametrize("tool", [dict(), dict(free=True)])
def test_there_and_back(tool):
    arm = Kinematics(SixJoints(tool=tool), joints=JOINTS)
    start = np.array([0.3, 0.5, 0.8, 0.2, 0.6, 0.1])
    q = start + np.random.default_rng(1).uniform(-0.1, 0.1, (20, 6))
    r, R = arm.fk(q)
    assert np.abs(arm.ik(r, R) - q).max() < 1e-9
    # the wrist lies on a circle about the column, at the length of the two bars
    reach = np.array([np.hypot(*(each[:2])) for each in r])
    expected = 0.6 * np.cos(q[:, 1]) + 0.5 * np.cos(q[:, 1] + q[:, 2])
    assert np.abs(reach - expected).max() < 1e-12


def test_tools_that_point_down_are_half_a_turn_from_the_world():
    arm = Kinematics(SixJoints(), joints=JOINTS)
    base, shoulder, elbow = np.random.default_rng(3).uniform([-1, 0, 0.5], [1, 1, 1.5], (20, 3)).T
    q = np.column_stack([base, shoulder, elbow, 0 * base, np.pi - shoulder - elbow, 0 * base])
    r, R = arm.fk(q)
    assert R[:, :, 0] == pytest.approx(np.column_stack([-np.cos(base), -np.sin(base), 0 * base]), abs=1e-12)
    assert np.abs(arm.ik(r, R) - q).max() < 1e-9
    both = arm.jacobian(r, R) @ arm.rates(r, R)
    assert np.abs(both - np.eye(6)).max() < 1e-9
    (place,) = arm.variables("fore.frame_b.r", r, R)
    assert place == pytest.approx(r, abs=1e-12)  # the wrist


class Heavy(SixJoints):
    links = Array(Body, 6, m=1.0, J=np.eye(3))

    def equations(self):
        yield from super().equations()
        for link, name in zip(self.links, JOINTS, strict=True):
            yield connect(getattr(self, name[:-4]).frame_b, link.frame_a)


class Mark(Model):
    r = Real(3, unit="m")


class Marked(SixJoints):
    mark = Mark()

    def equations(self):
        yield from super().equations()
        yield self.mark.r == self.fore.frame_b.r


def test_poses_that_joints_cannot_have_are_told():
    arm = Kinematics(Marked(), joints=JOINTS, tool="mark")
    with pytest.raises(ModelError, match=r"no quaternion mark\.q.*mark = Body\(\.\.\., free=True\)"):
        arm.ik([0.5, 0.0, 0.5], np.eye(3))
    straight = Kinematics(Heavy(pitch=dict(phi=Start(0.0))), joints=JOINTS)
    with pytest.raises(ModelError, match=r"move tool in 5 ways.*singular one"):
        straight.ik(*straight.fk(straight.home.q))


class FiveJoints(SixJoints):
    yaw = FixedTranslation(r=[0.1, 0.0, 0.0])


def test_five_joints_have_poses_beside_which_none_is():
    five = Kinematics(FiveJoints(), joints=JOINTS[:5])
    r, R = five.fk(five.home.q[None] + 0.1)
    assert np.abs(five.ik(r, R) - five.home.q - 0.1).max() < 1e-9
    if NIGHTLY:  # as the whole branch is grown before a pose is given up
        assert np.isnan(five.ik(r, R @ R[0])).all()  # beside the poses that five joints have
