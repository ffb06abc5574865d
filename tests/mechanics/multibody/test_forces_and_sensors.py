"""Forces, torques and sensors in space: signs, axes in which they are resolved, and springs between points."""

import numpy as np
import pytest

from gantrytau import Fixed, Model, Start, connect, simulate, translate
from gantrytau.mechanics import translational
from gantrytau.mechanics.multibody import (
    Body,
    CutSensor,
    FixedRotation,
    FixedTranslation,
    FrameForce,
    FrameTorque,
    LineForce,
    PointMass,
    PoseSensor,
    RelativeSensor,
    Revolute,
    World,
    WorldForce,
    WorldTorque,
)
from tests.mechanisms.rows import row
from tests.references.rotations import skew, turn

TILT = np.array([0.3, -0.8, 0.5])
R = turn(TILT)
J = np.diag([0.2, 0.3, 0.4])
CENTRE = np.array([0.1, -0.2, 0.3])
POINT = np.array([0.5, 0.4, -0.2])
GRAVITY = np.array([0.0, 0.0, -9.81])


def quaternion(vector):
    half = np.linalg.norm(vector) / 2
    return np.array([np.cos(half), *(np.sin(half) * vector / np.linalg.norm(vector))])


class Pushed(Model):
    """A free body, pushed at a point by whatever is put in as `push`."""

    world = World()
    body = Body(m=2.0, r_cm=CENTRE, J=J, q=Fixed(quaternion(TILT)), w=Fixed([1.0, -0.5, 0.8]))
    bar = FixedTranslation(r=POINT)
    push = WorldForce()

    def equations(self):
        yield connect(self.body.frame_a, self.bar.frame_a)
        yield connect(self.push.frame_b, self.bar.frame_b)


def newton_euler(force, torque, w):
    """Acceleration of the frame and angular acceleration under a force at POINT and a torque, world axes."""
    inertia = R @ J @ R.T
    arm, centre = R @ (POINT - CENTRE), R @ CENTRE
    gain = np.linalg.solve(inertia, torque + np.cross(arm, force) - np.cross(w, inertia @ w))
    return force / 2.0 + GRAVITY - np.cross(gain, centre) - np.cross(w, np.cross(w, centre)), gain


@pytest.mark.parametrize(
    ("component", "force", "torque"),
    [
        (WorldForce(), np.eye(3), np.zeros((3, 3))),
        (WorldTorque(), np.zeros((3, 3)), np.eye(3)),
        (FrameForce(), R, np.zeros((3, 3))),
        (FrameTorque(), np.zeros((3, 3)), R),
    ],
)
def test_force_or_torque_on_a_body(component, force, torque):
    given = np.array([1.0, -2.0, 3.0])
    name = "push.t" if torque.any() else "push.f"
    at = translate(Pushed(push=component)).evaluate({name: given})
    a, gain = newton_euler(force @ given, torque @ given, np.array([1.0, -0.5, 0.8]))
    np.testing.assert_allclose(at["der(body.v)"], a, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(at["der(body.w)"], gain, rtol=1e-11, atol=1e-12)


def test_force_that_holds_a_body_still_in_the_world():
    # turned about: given the motion, what force and torque at the point does it take?
    class Held(Pushed):
        twist = WorldTorque()

        def equations(self):
            yield from super().equations()
            yield connect(self.twist.frame_b, self.bar.frame_b)

    dae = translate(Held(body=dict(w=Fixed([0.0, 0.0, 0.0]))))
    at = dae.evaluate(
        {"push.f": [0.0, 0.0, 2.0 * 9.81], "twist.t": np.cross(R @ (CENTRE - POINT), -2.0 * GRAVITY)}
    )
    np.testing.assert_allclose(at["der(body.v)"], 0.0, atol=1e-13)
    np.testing.assert_allclose(at["der(body.w)"], 0.0, atol=1e-12)


class Sprung(Model):
    """Two point masses in space, a line force with a spring between them."""

    world = World(g=0.0)
    line = LineForce()
    spring = translational.Spring(c=40.0, s_rel0=0.5)
    one, two = PointMass(m=2.0), PointMass(m=3.0)

    def equations(self):
        yield from row(self.one, self.line, self.two)
        yield connect(self.line.flange_a, self.spring.flange_a)
        yield connect(self.line.flange_b, self.spring.flange_b)


def placed(r, v):
    """Modification of a point mass that starts at r with v."""
    return dict(frame_a=dict(r=Fixed(r)), v=Fixed(v))


def test_spring_between_two_points_pulls_them_together():
    a, b = np.array([0.1, 0.2, 0.3]), np.array([0.9, -0.4, 0.5])
    at = translate(Sprung(one=placed(a, [0.0] * 3), two=placed(b, [0.0] * 3))).evaluate()
    length = np.linalg.norm(b - a)
    pull = 40.0 * (length - 0.5) * (b - a) / length
    assert at["line.s"] == pytest.approx(length, rel=1e-14)
    np.testing.assert_allclose(at["der(one.v)"], pull / 2.0, rtol=1e-12)
    np.testing.assert_allclose(at["der(two.v)"], -pull / 3.0, rtol=1e-12)


def test_two_sprung_masses_swing_at_the_reduced_mass():
    # on a line, from rest, stretched by 0.2 m: s = s0 + 0.2 cos(omega t), omega^2 = c / (m1 m2 / (m1 + m2))
    way = np.array([2.0, -1.0, 2.0]) / 3.0
    swing = simulate(
        Sprung(one=placed([0.0] * 3, [0.0] * 3), two=placed(0.7 * way, [0.0] * 3)),
        stop=2.0,
        tolerance=1e-10,
        points=41,
    )
    omega = np.sqrt(40.0 * 5.0 / 6.0)
    # ten thousand times the tolerance, over two swings
    np.testing.assert_allclose(swing["line.s"], 0.5 + 0.2 * np.cos(omega * swing.time), atol=1e-6)
    middle = 2.0 * swing["one.frame_a.r"] + 3.0 * swing["two.frame_a.r"]
    np.testing.assert_allclose(middle, np.tile(3.0 * 0.7 * way, (41, 1)), atol=1e-8)


class Measured(Model):
    """A pendulum in a tilted frame, with sensors everywhere."""

    world = World()
    tilt = FixedRotation(n=TILT, phi=float(np.linalg.norm(TILT)))
    hinge = Revolute(n=[0.0, 1.0, 0.0], phi=Start(0.7), w=Start(-1.2))
    cut = CutSensor()
    body = Body(m=2.0, r_cm=CENTRE, J=J)
    bar = FixedTranslation(r=POINT)
    pose = PoseSensor()
    relative, reverse = RelativeSensor(), RelativeSensor()

    def equations(self):
        yield from row(self.world, self.tilt, self.hinge, self.cut, self.body, self.bar, self.pose)
        yield connect(self.tilt.frame_b, self.relative.frame_a)
        yield connect(self.bar.frame_b, self.relative.frame_b)
        yield connect(self.bar.frame_b, self.reverse.frame_a)
        yield connect(self.tilt.frame_b, self.reverse.frame_b)


def matrix(at, name):
    """A matrix by its elements."""
    return np.array([[at[f"{name}[{i},{j}]"] for j in range(3)] for i in range(3)])


def test_sensors_of_a_pendulum():
    dae = translate(Measured())
    assert dae.diagnosis.mobility == 1
    at = dae.evaluate({"hinge.phi": 0.7, "hinge.w": -1.2})
    inner = turn(np.array([0.0, 0.7, 0.0]))
    whole, n = R @ inner, R @ [0.0, 1.0, 0.0]
    w, gain = -1.2 * n, at["der(hinge.w)"] * n
    np.testing.assert_allclose(at["pose.r"], whole @ POINT, atol=1e-14)
    np.testing.assert_allclose(at["pose.v"], np.cross(w, whole @ POINT), atol=1e-13)
    np.testing.assert_allclose(at["pose.w"], w, atol=1e-14)
    np.testing.assert_allclose(matrix(at, "pose.R"), whole, atol=1e-14)
    np.testing.assert_allclose(at["relative.r"], inner @ POINT, atol=1e-14)
    np.testing.assert_allclose(matrix(at, "relative.R"), inner, atol=1e-14)
    np.testing.assert_allclose(at["relative.w"], [0.0, -1.2, 0.0], atol=1e-14)
    np.testing.assert_allclose(at["reverse.r"], -POINT, atol=1e-14)
    np.testing.assert_allclose(matrix(at, "reverse.R"), inner.T, atol=1e-14)
    np.testing.assert_allclose(at["reverse.w"], [0.0, 1.2, 0.0], atol=1e-14)
    # Newton and Euler about the hinge, which stands still
    centre = whole @ CENTRE
    spread = skew(centre)
    inertia = whole @ J @ whole.T - 2.0 * spread @ spread
    force = 2.0 * (np.cross(gain, centre) + np.cross(w, np.cross(w, centre)) - GRAVITY)
    torque = inertia @ gain + np.cross(w, inertia @ w) - np.cross(centre, 2.0 * GRAVITY)
    np.testing.assert_allclose(at["cut.f"], whole.T @ force, rtol=1e-11)
    np.testing.assert_allclose(at["cut.t"], whole.T @ torque, rtol=1e-11, atol=1e-12)
    assert n @ torque == pytest.approx(0.0, abs=1e-11)  # nothing drives the hinge


def test_matrices_of_sensors_in_results():
    swing = simulate(Measured(), stop=0.3, points=4)
    shape = (4, 3, 3)
    assert swing["pose.R"].shape == shape
    np.testing.assert_allclose(swing["pose.R"], swing["bar.frame_b.R"], atol=1e-14)
    expected = [R @ turn(np.array([0.0, phi, 0.0])) for phi in swing["hinge.phi"]]
    np.testing.assert_allclose(swing["pose.R"], expected, atol=1e-14)
    # rates agree with differences of the orientation: R' = [w]x R
    fine = simulate(Measured(), stop=1e-4, points=3, tolerance=1e-10)
    rate = (fine["pose.R"][2] - fine["pose.R"][0]) / 1e-4
    np.testing.assert_allclose(rate, skew(fine["pose.w"][1]) @ fine["pose.R"][1], atol=1e-6)
