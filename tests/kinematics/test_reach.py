"""Every place within reach is found on the branch of the start: closed forms of arms and loops whose workspace has holes."""

import itertools

import numpy as np
import pytest

from gantrytau import Model, ModelError, Start, connect
from gantrytau.kinematics import Kinematics
from gantrytau.kinematics.rotations import about, of_vectors
from gantrytau.mechanics.multibody import Body, FixedTranslation, Prismatic, Revolute, World
from gantrytau_models import DeltaRobot, FiveBar
from tests.families import NIGHTLY, first_of
from tests.kinematics.test_serial_arms import JOINTS, SixJoints
from tests.references.delta import ACROSS, OUT

PLACES = 10_000 if NIGHTLY else 400
UPPER, FORE = 0.4, 0.3
Y, Z = np.eye(3)[1:]
JOINTS_OF = {"two bars": ["shoulder.phi", "elbow.phi"], "SCARA": ["shoulder.phi", "elbow.phi", "spindle.s"]}
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


def delta_angles(r, side, base=0.2 - 0.06, arm=0.3, rod=0.8):
    """Angles of the arms of a delta robot below the level, elbows outside or inside, (N, 3); NaN up to its border."""
    x, y, z = r @ OUT.T - base, r @ ACROSS.T, r[:, 2:]
    cosine = (x**2 + z**2 + y**2 + arm**2 - rod**2) / (2 * arm * np.hypot(x, z))
    cosine[np.abs(cosine) > 1 - 1e-4] = np.nan
    return np.arctan2(-z, x) - side * np.arccos(cosine)


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


def half_turns(count):
    """Rotations by half a turn exactly and nearly, by none and 1e-13 rad, about axes of the world and others, (N, 3, 3)."""
    axes = np.vstack([np.eye(3), -np.eye(3), [[1, 1, 0], [0, 1, -1], [1, 1, 1], [0.3, -0.5, 0.8]]])
    axes = np.tile(axes / np.linalg.norm(axes, axis=1)[:, None], (count // 40, 1))
    exact = 2 * axes[:, :, None] * axes[:, None] - np.eye(3)
    return np.concatenate([exact, *(of_vectors(angle * axes) for angle in (np.radians(179.999), 0.0, 1e-13))])


@pytest.mark.nightly  # some seconds to grow its branch in six coordinates
def test_an_arm_of_six_joints_reaches_all_of_its_aspect():
    """Random joints that keep the signs of the three singular poses: over the column, elbow straight, wrist straight.

    Half of the tools are turned by half a turn, or hardly at all, from the axes of the world.
    """
    arm = Kinematics(SixJoints(), joints=JOINTS)
    q = np.random.default_rng(2).uniform(-np.pi, np.pi, (8 * PLACES, 6))
    q[:, [2, 4]] = np.abs(q[:, [2, 4]])
    q = q[0.6 * np.cos(q[:, 1]) + 0.5 * np.cos(q[:, 1] + q[:, 2]) > 0][:PLACES]
    R = half_turns(PLACES // 2)
    wrist = np.swapaxes(about(Z, q[:, 0]) @ about(Y, q[:, 1] + q[:, 2]), 1, 2)[: len(R)] @ R
    sine = np.hypot(wrist[:, 1, 0], wrist[:, 2, 0])
    q[: len(R), 3] = np.arctan2(wrist[:, 1, 0], -wrist[:, 2, 0])
    q[: len(R), 4] = np.arctan2(sine, wrist[:, 0, 0])
    q[: len(R), 5] = np.arctan2(wrist[:, 0, 1], wrist[:, 0, 2])
    r, there = arm.fk(q)
    assert np.abs(there[: len(R)] - R).max() < 1e-14
    assert np.abs(turned(arm.ik(r, np.concatenate([R, there[len(R) :]])) - q)).max() < 1e-7


def test_a_delta_robot_reaches_wherever_its_arms_do():
    """Each arm and its rods are two bars in a plane; above the base too, where the plate could begin to turn."""
    r = np.random.default_rng(4).uniform([-1.1, -1.1, -1.2], [1.1, 1.1, 1.2], (20 * PLACES, 3))
    phi = delta_angles(r, 1)
    r, phi = (a[np.isfinite(phi).all(axis=1)][:PLACES] for a in (r, phi))
    k = Kinematics(DeltaRobot())
    assert len(r) == PLACES
    assert np.abs(turned(k.ik(r) - phi)).max() < 1e-8


@pytest.mark.parametrize("robot", ["two bars", "SCARA", "five bars", "delta"])
def test_all_configurations_of_a_place(robot):
    r = np.array([0.1, 0.45, -0.6 if robot == "delta" else 0.0])
    sides = (1, -1)
    if robot == "delta":
        k = Kinematics(DeltaRobot())
        want = itertools.product(*np.array([delta_angles(r[None], side)[0] for side in sides]).T)
    elif robot == "five bars":
        k = Kinematics(FiveBar())
        arms = [[two_bars(r[None] - [x, 0, 0], s, 0.3, 0.4)[0, 0] for s in sides] for x in (-0.1, 0.1)]
        want = itertools.product(*arms)
    else:
        k = Kinematics(Scara() if robot == "SCARA" else TwoBars(), joints=JOINTS_OF[robot])
        want = [np.append(two_bars(r[None], side)[0], r[2:])[: len(k.joints)] for side in sides]
    found = k.configurations(r=r)
    want = np.array(list(want))
    gaps = np.abs(turned(np.array([c.q for c in found])[:, None] - want)).max(axis=2)
    assert np.sort(gaps.min(axis=0)) == pytest.approx(0, abs=1e-8)
    assert len(found) == len(want) == len({c.name for c in found})
    assert set(found[0].name) == {"+"}
    assert found[0].q == pytest.approx(k.ik(r), abs=1e-9)
    assert k.configurations(r=[9.0, 9.0, 0.0]) == k.configurations(r=[np.nan] * 3) == []
    assert robot != "five bars" or k.configurations(r=[*r[:2], 0.1]) == []  # beside their plane


def test_eight_configurations_of_an_arm_of_six_joints():
    """The first three joints from the place of the wrist, the others by a wrist that turns over."""
    limits = dict(phi=dict(min=0.0, max=np.pi))
    arm = Kinematics(SixJoints(elbow=limits | dict(phi=limits["phi"] | dict(start=0.8))), joints=JOINTS)
    q = np.array([0.9, -0.4, 1.1, 2.0, -0.7, -2.0])
    r, R = arm.fk(q)
    found = arm.configurations(r=r, R=R)
    assert len({c.name for c in found}) == len(found) == 8
    there, turns = arm.fk(np.array([c.q for c in found]))
    assert np.abs(there - r).max() < 1e-9
    assert np.abs(turns - R).max() < 1e-9
    size, height = np.hypot(*r[:2]), r[2] - 0.4
    elbow = np.arccos((size**2 + height**2 - 0.61) / 0.6)
    assert np.abs([c.q[2] for c in found]) == pytest.approx(np.full(8, elbow), abs=1e-9)
    assert all((c.q[2] > 0) == (c.name[0] == "+") == c.feasible for c in found)
    assert all((c.q[4] > 0) == (c.name[1] == "+") for c in found)
    assert arm.configurations(r=[9.0, 0.0, 0.0], R=R) == []
    with pytest.raises(ModelError, match="found 2 positions, expected one pose"):
        arm.configurations(r=[r, r], R=R)
