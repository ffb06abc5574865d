"""Kinematics of models that are no Gantry-Tau, through their own equations."""

import itertools
import signal
import threading

import numpy as np
import pytest

from gantrytau import GantryTauError, Model, Real, Start, connect
from gantrytau.border.refusal import ModelError
from gantrytau.kinematics import Kinematics, assembly_modes
from gantrytau.kinematics.rotations import turned
from gantrytau.mechanics.multibody import Body, FixedTranslation, PointMass, Prismatic, Revolute, World
from gantrytau_models import DeltaRobot, GantryTau, Pendulum, StewartPlatform, prototypes
from tests.mechanisms.rows import row

ALONG_X = np.array([1.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def delta():
    return Kinematics(DeltaRobot())


def test_a_delta_robot_there_and_back(delta):
    assert delta.joints == ("arms[0].phi", "arms[1].phi", "arms[2].phi")
    random = np.random.default_rng(0)
    q = delta.home.q + random.uniform(-0.2, 0.2, (300, 3))
    r, R = delta.fk(q)
    np.testing.assert_allclose(delta.ik(r), q, atol=1e-9)  # of the iteration in the model
    np.testing.assert_allclose(R, np.broadcast_to(np.eye(3), R.shape), atol=1e-9)  # a delta robot stays level
    step = 1e-5
    slope = (delta.ik(r + step * ALONG_X) - delta.ik(r - step * ALONG_X)) / (2 * step)
    np.testing.assert_allclose(delta.jacobian(r)[:, :, 0], slope, atol=1e-6)


def test_a_delta_robot_out_of_reach(delta):
    assert np.isnan(delta.ik([[0.0, 0.0, -9.0]])).all()


def test_poses_that_are_no_numbers_are_nan_without_a_word(delta, capfd):
    r = np.array([delta.home.r, [np.nan, 0.0, 0.0], [0.0, np.inf, 0.0], delta.home.r])
    lost = [False, True, True, False]
    q = delta.ik(r)
    assert np.isnan(q).all(axis=1).tolist() == lost
    assert np.isnan(delta.jacobian(r)).all(axis=(1, 2)).tolist() == lost
    for near in (None, r):
        found, turns = delta.fk(q, near=near)
        assert np.isnan(found).all(axis=1).tolist() == lost
        assert np.isnan(turns).all(axis=(1, 2)).tolist() == lost
    assert capfd.readouterr() == ("", "")


def test_an_interrupt_ends_the_call_between_two_blocks(delta):
    """Poses out of reach take longest; Ctrl-C while CasADi iterates is no failure of the iteration, and ends arrays too."""
    # its functions are made; while CasADi makes some, it may drop a Ctrl-C: heeding_interrupts
    delta.ik(delta.home.r)
    main = threading.main_thread().ident
    assert main is not None
    timer = threading.Timer(0.3, signal.pthread_kill, (main, signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        delta.ik(np.tile([0.0, 0.0, -9.0], (200_000, 1)))
    timer.join()
    assert np.isfinite(delta.ik(delta.home.r)).all()


def test_near_chooses_among_the_assembly_modes_of_a_stewart_platform():
    kinematics = Kinematics(StewartPlatform(), tool="platform")
    values = kinematics.dae.table.values
    base, plate = (
        np.array([[values[f"legs[{k}].{end}_offset[{i}]"] for i in range(3)] for k in range(6)])
        for end in ("base", "platform")
    )
    q = kinematics.home.q + np.random.default_rng(0).uniform(-0.03, 0.03, 6)
    r, R = assembly_modes(base, plate, q).poses
    assert len(r) == 16
    found, turns = kinematics.fk(np.tile(q, (16, 1)), near=(r + 0.01, R))
    np.testing.assert_allclose(found, r, atol=1e-9)
    np.testing.assert_allclose(turns, R, atol=1e-9)
    assert 0 < kinematics.iterations < 8
    assert np.isnan(kinematics.fk(50.0 * q, near=(r[0], R[0]))[0]).all()


def test_near_of_a_delta_robot_is_where_newton_starts(delta):
    q = delta.home.q + np.random.default_rng(4).uniform(-0.2, 0.2, (5, 3))
    r, R = delta.fk(q)
    found, turns = delta.fk(q, near=r + 0.02)
    np.testing.assert_allclose(found, r, atol=1e-9)
    np.testing.assert_allclose(turns, R, atol=1e-9)


@pytest.mark.parametrize("start", [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0], [-0.6, 0.0, 0.0, -0.8]])
def test_the_legs_of_a_stewart_platform(start):
    """Level, half a turn about the vertical, and a quaternion of the other sign."""
    kinematics = Kinematics(StewartPlatform(platform=dict(q=dict(start=start))), tool="platform")
    assert kinematics.joints == tuple(f"legs[{k}].s" for k in range(6))
    random = np.random.default_rng(1)
    r = kinematics.home.r + random.uniform(-0.05, 0.05, (20, 3))
    R = turned(np.broadcast_to(kinematics.home.R, (20, 3, 3)), random.uniform(-0.1, 0.1, (20, 3)))
    q = kinematics.ik(r, R)
    values = kinematics.dae.table.values
    base, plate = (
        np.array([[values[f"legs[{k}].{end}_offset[{i}]"] for i in range(3)] for k in range(6)])
        for end in ("base", "platform")
    )
    expected = np.linalg.norm(r[:, None] + plate @ np.swapaxes(R, 1, 2) - base, axis=2)
    np.testing.assert_allclose(q, expected, atol=1e-9)
    step = 1e-5
    for k in range(3):
        turn = np.broadcast_to(step * np.eye(3)[k], (20, 3))
        slope = (kinematics.ik(r, turned(R, turn)) - kinematics.ik(r, turned(R, -turn))) / (2 * step)
        np.testing.assert_allclose(kinematics.jacobian(r, R)[:, :, 3 + k], slope, atol=1e-8)
    found, turns = kinematics.fk(q[:3])
    np.testing.assert_allclose(found, r[:3], atol=1e-9)
    np.testing.assert_allclose(turns, R[:3], atol=1e-9)


def test_the_equations_of_a_gantry_tau_answer_as_its_closed_form():
    """Joints named in another order are no longer recognised."""
    known = Kinematics(GantryTau(prototypes.L1))
    order = [2, 0, 1]
    through = Kinematics(known.dae, joints=[known.joints[k] for k in order])
    q = known.home.q + np.random.default_rng(2).uniform(-0.2, 0.2, (50, 3))
    r, _ = known.fk(q)
    np.testing.assert_allclose(through.fk(q[:, order])[0], r, atol=1e-9)
    np.testing.assert_allclose(through.ik(r), q[:, order], atol=1e-9)
    np.testing.assert_allclose(through.jacobian(r), known.jacobian(r)[:, order], atol=1e-9)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Kinematics(StewartPlatform()), "has no 'tool.r', expected the position of a tool"),
        (lambda: Kinematics(Pendulum(), tool="body"), "has no 'body.r'"),
        (lambda: Kinematics(DeltaRobot(), joints=["arms[0].psi"]), r"no variable or parameter"),
    ],
)
def test_models_without_what_is_needed(make, words):
    with pytest.raises(GantryTauError, match=words):
        make()


def test_what_only_links_answer_is_told(delta):
    with pytest.raises(ModelError, match="expected a Gantry-Tau robot"):
        delta.state(delta.home.r)
    with pytest.raises(ModelError, match="found 3 joints and an orientation R"):
        delta.ik(delta.home.r, np.eye(3))


class PlanarArm(Model):
    """Two bars that turn about z."""

    world = World()
    shoulder, elbow = Revolute(phi=Start(0.5)), Revolute(phi=Start(1.0))
    upper, fore = FixedTranslation(r=[0.4, 0.0, 0.0]), FixedTranslation(r=[0.3, 0.0, 0.0])
    tool = Body(m=1.0, J=np.eye(3))

    def equations(self):
        chain = [self.world, self.shoulder, self.upper, self.elbow, self.fore]
        for one, other in itertools.pairwise(chain):
            yield connect(one.frame_b, other.frame_a)
        yield connect(self.fore.frame_b, self.tool.frame_a)


def test_an_arm_of_two_joints_of_ones_own():
    """Its tool is in a plane and turns as it goes; the elbow by the law of cosines."""
    arm = Kinematics(PlanarArm(), joints=["shoulder.phi", "elbow.phi"])
    r = np.random.default_rng(5).uniform([0.2, 0.2, 0.0], [0.45, 0.45, 0.0], (400, 3))
    q = arm.ik(r)
    elbow = np.arccos((np.sum(r**2, axis=1) - 0.4**2 - 0.3**2) / (2 * 0.4 * 0.3))
    np.testing.assert_allclose(q[:, 1], elbow, atol=1e-12)
    there, R = arm.fk(q)
    np.testing.assert_allclose(there, r, atol=1e-12)
    np.testing.assert_allclose(np.arctan2(R[:, 1, 0], R[:, 0, 0]), q.sum(axis=1), atol=1e-12)
    assert np.isnan(arm.ik([0.3, 0.3, 0.1])).all()
    assert np.isnan(arm.ik(np.tile([0.6, 0.6, 0.0], (300, 1)))).all()
    with pytest.raises(GantryTauError, match="is given twice"):
        Kinematics(PlanarArm(), joints=["shoulder.phi", "shoulder.phi"]).ik(r[0])


def test_as_many_ways_to_move_as_joints():
    with pytest.raises(ModelError, match="found 2 joints and an orientation R for PlanarArm, expected none"):
        Kinematics(PlanarArm(), joints=["shoulder.phi", "elbow.phi"]).ik([0.3, 0.3, 0.0], np.eye(3))
    stretched = PlanarArm(elbow=dict(phi=Start(0.0)))
    with pytest.raises(ModelError, match="found 2 joints of PlanarArm, which move tool in 1 ways"):
        Kinematics(stretched, joints=["shoulder.phi", "elbow.phi"]).ik([0.3, 0.3, 0.0])


def test_a_model_that_nothing_drives():
    class Thing(Model):
        r = Real(3, unit="m")
        body = PointMass(m=1.0)

        def equations(self):
            yield self.r == self.body.frame_a.r

    class Loose(Model):
        world = World()
        tool = Thing()
        x = Prismatic(n=[1.0, 0.0, 0.0])

        def equations(self):
            yield from row(self.world, self.x, self.tool.body)

    with pytest.raises(ModelError, match="has the inputs none, expected forces"):
        Kinematics(Loose())
