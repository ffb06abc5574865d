"""Every place within reach is found on the branch of the start: closed forms of arms and loops whose workspace has holes."""

import itertools

import numpy as np
import pytest

from gantrytau import Model, Start, connect
from gantrytau.kinematics import Kinematics
from gantrytau.kinematics.rotations import quaternions
from gantrytau.mechanics.multibody import Body, FixedTranslation, Prismatic, Revolute, World
from gantrytau_models import FiveBar
from tests.families import NIGHTLY, first_of
from tests.kinematics.test_serial_arms import JOINTS, SixJoints

PLACES = 10_000 if NIGHTLY else 400
UPPER, FORE = 0.4, 0.3
NEAR = 1e-3  # m beside the border of the workspace, where the branch turns back


class TwoBars(Model):
    """Two bars in a plane; a third joint lowers the tool where it slides (SCARA)."""

    world = World()
    shoulder, elbow = Revolute(phi=Start(0.9)), Revolute(phi=Start(1.0))
    upper, fore = FixedTranslation(r=[UPPER, 0.0, 0.0]), FixedTranslation(r=[FORE, 0.0, 0.0])
    tool = Body(m=1.0)

    def equations(self):
        chain = [self.world, self.shoulder, self.upper, self.elbow, self.fore]
        for one, other in itertools.pairwise(chain):
            yield connect(one.frame_b, other.frame_a)
        yield from self.hand()

    def hand(self):
        yield connect(self.fore.frame_b, self.tool.frame_a)


class Scara(TwoBars):
    spindle = Prismatic(n=[0, 0, 1])

    def hand(self):
        yield connect(self.fore.frame_b, self.spindle.frame_a)
        yield connect(self.spindle.frame_b, self.tool.frame_a)


def turned(angle):
    """An angle within half a turn of zero."""
    return np.angle(np.exp(1j * np.asarray(angle)))


def two_bars(r, side, a=UPPER, b=FORE):
    """Angles of two bars by the law of cosines, elbow on one side, (N, 2)."""
    cosine = (np.sum(r[:, :2] ** 2, axis=1) - a**2 - b**2) / (2 * a * b)
    elbow = side * np.arccos(cosine)
    shoulder = np.arctan2(r[:, 1], r[:, 0]) - np.arctan2(b * np.sin(elbow), a + b * np.cos(elbow))
    return np.column_stack([shoulder, elbow])


def ring(inner, outer, seed=0):
    """Places in a ring about the z axis, (N, 3), as many in equal areas."""
    random = np.random.default_rng(seed)
    size, angle = (
        np.sqrt(random.uniform((inner + NEAR) ** 2, (outer - NEAR) ** 2, PLACES)),
        random.uniform(-np.pi, np.pi, PLACES),
    )
    return np.column_stack([size * np.cos(angle), size * np.sin(angle), 0 * angle])


@pytest.mark.parametrize("side", [1, -1])
def test_two_bars_reach_all_around_their_first_axis(side):
    k = Kinematics(TwoBars(elbow=dict(phi=Start(side * 1.0))), joints=["shoulder.phi", "elbow.phi"])
    r = ring(UPPER - FORE, UPPER + FORE)
    q = k.ik(r)
    assert np.abs(turned(q - two_bars(r, side))).max() < 1e-9
    assert np.abs(q[:, 0] - k.home.q[0]).max() <= np.pi + 1e-12
    one = k.ik(r[0])
    assert np.abs(one - q[0]).max() < 1e-12
    assert np.isnan(k.ik([[0.0, UPPER + FORE + NEAR, 0.0], [0.0, UPPER - FORE - NEAR, 0.0]])).all()
    assert k.jacobian(r[:9])[:, :, :2] @ k.rates(r[:9])[:, :2] == pytest.approx(
        np.tile(np.eye(2), (9, 1, 1)), abs=1e-9
    )


@pytest.mark.parametrize("side", first_of([1, -1]))
def test_a_scara_reaches_its_whole_ring(side):
    k = Kinematics(
        Scara(elbow=dict(phi=Start(side * 1.0))), joints=["shoulder.phi", "elbow.phi", "spindle.s"]
    )
    r = ring(UPPER - FORE, UPPER + FORE)
    r[:, 2] = np.random.default_rng(1).uniform(-0.5, 0.5, PLACES)
    q = k.ik(r)
    assert np.abs(turned(q[:, :2] - two_bars(r, side))).max() < 1e-9
    assert np.abs(q[:, 2] - r[:, 2]).max() < 1e-12


@pytest.mark.parametrize(("left", "right"), first_of([(1, -1), (1, 1), (-1, 1), (-1, -1)]))
def test_five_bars_reach_wherever_both_cranks_do(left, right):
    """Each crank with its coupler is an arm of two bars about its pivot."""
    sides, pivots, a, b = (left, right), (-0.1, 0.1), 0.3, 0.4
    angles = [
        float(two_bars(np.array([[0.0 - x, 0.5, 0.0]]), side, a, b)[0, 0])
        for x, side in zip(pivots, sides, strict=True)
    ]
    starts = [dict(phi=dict(start=angle)) for angle in angles]
    k = Kinematics(FiveBar(cranks=starts, tool=dict(r=dict(start=[0.0, 0.5, 0.0]))))
    assert k.home.q == pytest.approx(angles, abs=1e-9)
    r = np.column_stack([np.random.default_rng(0).uniform(-0.8, 0.8, (4 * PLACES, 2)), np.zeros(4 * PLACES)])
    from_pivots = [r - [x, 0, 0] for x in pivots]
    sizes = np.array([np.linalg.norm(d, axis=1) for d in from_pivots])
    inside = ((sizes > b - a + NEAR) & (sizes < a + b - NEAR)).all(axis=0)
    r, from_pivots = r[inside], [d[inside] for d in from_pivots]
    want = np.column_stack(
        [two_bars(d, side, a, b)[:, 0] for d, side in zip(from_pivots, sides, strict=True)]
    )
    assert np.abs(turned(k.ik(r) - want)).max() < 1e-8
    assert np.isnan(k.ik(np.array([[0.5, 0.5, 0.0], [-0.1, 0.05, 0.0]]))).all()


@pytest.mark.nightly  # ten seconds to grow its branch in six coordinates
def test_an_arm_of_six_joints_reaches_all_of_its_aspect():
    """Places of joints that keep the signs of the three singular poses: over the column, elbow straight, wrist straight."""
    arm = Kinematics(SixJoints(tool=dict(free=True)), joints=JOINTS)
    random = np.random.default_rng(2)
    q = np.column_stack([
        random.uniform(-np.pi, np.pi, 8 * PLACES),
        random.uniform(-np.pi, np.pi, 8 * PLACES),
        random.uniform(0.05, np.pi - 0.05, 8 * PLACES),
        random.uniform(-np.pi, np.pi, 8 * PLACES),
        random.uniform(0.05, np.pi - 0.05, 8 * PLACES),
        random.uniform(-np.pi, np.pi, 8 * PLACES),
    ])  # fmt: skip
    ahead = 0.6 * np.cos(q[:, 1]) + 0.5 * np.cos(q[:, 1] + q[:, 2])
    q = q[ahead > 0.05][:PLACES]
    r, R = arm.fk(q)
    found = arm.ik(r, R)
    half = quaternions(R)[:, 0] < 1e-2  # nearly half a turn from the axes of the world
    assert not np.isnan(found[~half]).any()
    assert np.abs(turned(found - q)[~half]).max() < 1e-7
