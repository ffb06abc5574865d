"""Rigid bodies that move freely: against Euler's equations in closed form and the conservation laws."""

import numpy as np
import pytest

from gantrytau import Array, Fixed, Model, Start, check, connect, linearize, simulate, translate
from gantrytau.mechanics.multibody import (
    Body,
    FixedRotation,
    FixedTranslation,
    PointMass,
    Revolute,
    Spherical,
    World,
)
from tests.mechanisms.rows import in_a_row, row
from tests.references import free_body
from tests.references.rotations import turn

TOLERANCE = 1e-9
GRAVITY = np.array([0.0, 0.0, -9.81])
GENERAL = np.array([[0.4, 0.05, -0.03], [0.05, 0.7, 0.02], [-0.03, 0.02, 0.9]])  # kg.m2
OFFSET = np.array([0.2, -0.1, 0.3])  # m


class Thrown(Model):
    """One body, held by nothing."""

    world = World()
    body = Body()


def quaternion(vector):
    """Unit quaternion of the rotation by |vector| about vector, (4,)."""
    half = np.linalg.norm(vector) / 2
    return np.array([np.cos(half), *(np.sinc(half / np.pi) / 2 * np.asarray(vector))])


def thrown(w, turned=(0.0, 0.0, 0.0), v=(0.0, 0.0, 0.0), g=0.0, **body):
    """A body of 2 kg at the origin with angular velocity w, turned by a rotation vector; world axes."""
    start = dict(r=Fixed([0.0, 0.0, 0.0]), v=Fixed(v), w=Fixed(w), q=Fixed(quaternion(turned)))
    return Thrown(world=dict(g=g), body=start | dict(m=2.0) | body)


def centre_of_mass(result, name, m, r_cm, J):
    """Position, velocity, angular momentum about it and kinetic energy of a body over time."""
    R, w = result[f"{name}.frame_a.R"], result[f"{name}.frame_a.w"]
    arm = R @ r_cm
    r, v = result[f"{name}.r"] + arm, result[f"{name}.v"] + np.cross(w, arm)
    spin = np.einsum("tij,jk,tlk,tl->ti", R, J, R, w)
    energy = m * (v**2).sum(axis=1) / 2 + (spin * w).sum(axis=1) / 2
    return r, v, spin, energy


@pytest.mark.parametrize(
    ("J", "w"),
    [
        (np.diag([0.3, 0.5, 0.8]), [2.0, 0.2, 0.4]),
        (np.diag([0.3, 0.5, 0.8]), [0.2, 0.1, 1.8]),
        (np.diag([0.3, 0.5, 0.8]), [0.01, 1.5, 0.01]),  # tumbles about the middle axis
        (GENERAL, [0.5, 1.5, -0.7]),
    ],
)
def test_torque_free_body_follows_jacobis_functions(J, w):
    R = turn(np.array([0.3, -0.8, 0.5]))
    fall = simulate(thrown(R @ w, (0.3, -0.8, 0.5), J=J), stop=5.0, tolerance=1e-10, points=51)
    for k in (17, 50):
        t = fall.time[k]
        expected = free_body.orientation(J, R, np.array(w), t)
        # ten thousand times the integrator's tolerance: tumbling multiplies errors by e^(rate t)
        np.testing.assert_allclose(fall["body.frame_a.R"][k], expected, atol=1e-6)
        spin = expected @ free_body.angular_velocity(J, np.array(w), t)
        np.testing.assert_allclose(fall["body.w"][k], spin, atol=1e-6)


def test_symmetric_top_precesses_steadily():
    J, w = np.diag([0.5, 0.5, 0.8]), np.array([0.6, 0.0, 3.0])
    fall = simulate(thrown(w, J=J), stop=5.0, tolerance=1e-10, points=51)
    expected = free_body.symmetric_orientation(0.5, 0.8, np.eye(3), w, 5.0)
    # a thousand times the tolerance
    np.testing.assert_allclose(fall["body.frame_a.R"][-1], expected, atol=1e-7)


def test_energy_and_angular_momentum_stay_for_a_hundred_seconds():
    fall = simulate(thrown([0.5, 1.2, -0.4], J=GENERAL), stop=100.0, tolerance=TOLERANCE, points=101)
    _, _, spin, energy = centre_of_mass(fall, "body", 2.0, np.zeros(3), GENERAL)
    # relative to their size, a hundred times the tolerance over 140 radians (measured: 7e-9 and 3.4e-8)
    assert np.abs(energy - energy[0]).max() < 1e-7 * energy[0]
    assert np.linalg.norm(spin - spin[0], axis=1).max() < 1e-7 * np.linalg.norm(spin[0])
    R = fall["body.frame_a.R"]
    # the projection keeps the quaternion of length one
    np.testing.assert_allclose(R @ R.transpose(0, 2, 1), np.tile(np.eye(3), (101, 1, 1)), atol=1e-13)


def test_thrown_body_with_an_offset_centre_turns_about_that_centre():
    v, w = np.array([0.3, -0.2, 4.0]), np.array([1.0, -2.0, 0.7])
    fall = simulate(thrown(w, v=v, g=9.81, r_cm=OFFSET, J=GENERAL), stop=3.0, tolerance=1e-10, points=31)
    r, _, spin, _ = centre_of_mass(fall, "body", 2.0, OFFSET, GENERAL)
    t = fall.time[:, None]
    ballistic = OFFSET + (v + np.cross(w, OFFSET)) * t + GRAVITY * t**2 / 2
    np.testing.assert_allclose(r, ballistic, atol=1e-7)  # a thousand times the tolerance, 40 m of fall
    np.testing.assert_allclose(spin, np.tile(spin[0], (31, 1)), atol=1e-7)
    R = free_body.orientation(GENERAL, np.eye(3), w, 3.0)
    np.testing.assert_allclose(fall["body.frame_a.R"][-1], R, atol=1e-7)


def test_a_free_body_has_six_degrees_of_freedom():
    dae = translate(thrown([0.0, 0.0, 1.0]))
    assert len(dae.states) == 12
    assert dae.diagnosis.redundant == ()


def test_mobility_of_a_free_body_is_six():
    assert translate(thrown([0.0, 0.0, 1.0])).diagnosis.mobility == 6


def test_upside_down_is_a_start_like_any_other():
    # half a turn: the scalar of the quaternion is zero, and w must not depend on the choice of states
    w = np.array([0.3, 0.5, -0.2])
    at = translate(thrown(w, (np.pi, 0.0, 0.0), J=GENERAL)).evaluate()
    R = np.diag([1.0, -1.0, -1.0])
    found = [[at[f"body.frame_a.R[{i},{j}]"] for j in range(3)] for i in range(3)]
    np.testing.assert_allclose(found, R, atol=1e-14)
    inertia = R @ GENERAL @ R.T
    expected = np.linalg.solve(inertia, -np.cross(w, inertia @ w))
    np.testing.assert_allclose(at["der(body.w)"], expected, rtol=1e-12, atol=1e-13)


def test_evaluate_returns_orientations_as_matrices():
    at = translate(thrown([0.0, 0.0, 1.0], (0.0, 0.0, 0.5))).evaluate()
    np.testing.assert_allclose(at["body.frame_a.R"], turn(np.array([0.0, 0.0, 0.5])), atol=1e-14)
    np.testing.assert_allclose(at["body.frame_a.w"], [0.0, 0.0, 1.0], atol=1e-14)


class Assembled(Model):
    """A body, a point mass and a second body rigidly joined to one frame."""

    world = World()
    body = Body(m=2.0, r_cm=OFFSET, J=GENERAL)
    bar = FixedTranslation(r=[0.5, 0.1, -0.2])
    ball = PointMass(m=0.7)
    turned = FixedRotation(n=[1.0, 1.0, 0.0], phi=0.6)
    other = Body(m=1.1, r_cm=[0.1, 0.0, 0.3], J=np.diag([0.05, 0.07, 0.09]))

    def equations(self):
        yield from row(self.body, self.bar, self.ball)
        yield connect(self.body.frame_a, self.turned.frame_b)
        yield connect(self.turned.frame_a, self.other.frame_a)


def lumped():
    """Mass, centre and inertia about it of what Assembled joins, in the axes of its first body."""
    R = turn(0.6 * np.array([1.0, 1.0, 0.0]) / np.sqrt(2)).T  # axes of `other` in those of `body`
    parts = [
        (2.0, OFFSET, GENERAL),
        (0.7, np.array([0.5, 0.1, -0.2]), np.zeros((3, 3))),
        (1.1, R @ [0.1, 0.0, 0.3], R @ np.diag([0.05, 0.07, 0.09]) @ R.T),
    ]
    m = sum(p[0] for p in parts)
    centre = sum(p[0] * p[1] for p in parts) / m
    inertia = sum(J + k * ((d := c - centre) @ d * np.eye(3) - np.outer(d, d)) for k, c, J in parts)
    return m, centre, inertia


def test_bodies_on_one_frame_move_as_one():
    m, centre, inertia = lumped()
    w = np.array([0.4, -0.9, 1.3])
    start = dict(q=Start(quaternion([0.4, 0.2, -0.3])), w=Start(w), v=Start([1.0, 2.0, 3.0]))
    parts = translate(Assembled(body=start)).evaluate()
    one = translate(
        thrown(w, (0.4, 0.2, -0.3), (1.0, 2.0, 3.0), 9.81, m=m, r_cm=centre, J=inertia)
    ).evaluate()
    for name in ("der(body.w)", "der(body.v)"):
        np.testing.assert_allclose(parts[name], one[name], rtol=1e-11, atol=1e-12)


class Linked(Model):
    """Three bodies that float in space, joined by a hinge and a ball joint; no joint leads to the world."""

    world = World(g=0.0)
    bodies = Array(
        Body,
        [
            dict(m=2.0, r_cm=[0.1, 0.0, 0.2], J=GENERAL),
            dict(m=1.0, r_cm=[0.0, 0.3, 0.0], J=np.diag([0.1, 0.2, 0.15])),
            dict(m=1.5, r_cm=[0.2, 0.1, 0.0], J=np.diag([0.2, 0.1, 0.25])),
        ],
    )
    bar = FixedTranslation(r=[0.5, 0.0, 0.0])
    hinge = Revolute(n=[0.3, 0.2, 1.0], w=Fixed(1.5), phi=Fixed(0.4))
    far = FixedTranslation(r=[0.0, 0.4, 0.1])
    ball = Spherical()

    def equations(self):
        yield from row(
            self.bodies[0], self.bar, self.hinge, self.bodies[1], self.far, self.ball, self.bodies[2]
        )


def test_linked_bodies_without_a_ground_keep_momentum_and_energy():
    start = [dict(w=Start([0.3, 0.8, -0.5]), v=Start([0.1, 0.0, 0.0])), {}, dict(w=Start([1.0, 0.2, 0.5]))]
    tumble = simulate(Linked(bodies=start), stop=10.0, tolerance=TOLERANCE, points=51)
    momentum, spin, energy = np.zeros((51, 3)), np.zeros((51, 3)), np.zeros(51)
    masses = [2.0, 1.0, 1.5]
    centres = [[0.1, 0.0, 0.2], [0.0, 0.3, 0.0], [0.2, 0.1, 0.0]]
    inertias = [GENERAL, np.diag([0.1, 0.2, 0.15]), np.diag([0.2, 0.1, 0.25])]
    for k, (m, c, J) in enumerate(zip(masses, centres, inertias, strict=True)):
        r, v, own, kinetic = centre_of_mass(tumble, f"bodies[{k}]", m, np.array(c), J)
        momentum += m * v
        spin += own + np.cross(r, m * v)
        energy += kinetic
    assert np.abs(tumble["bodies[0].w"][0]).max() > 0.1
    # a thousand times the integrator's tolerance, relative to sizes of about one
    for conserved in (momentum, spin, energy):
        assert np.ptp(conserved, axis=0).max() < 1e-6


def test_an_inertia_that_nobody_gave_is_told():
    """A pendulum of 1 kg at 0.3 m swings at sqrt(g / l) as a point mass; the inertia that is assumed doubles its square."""

    Swinging = in_a_row(
        "Swinging", world=World(), hinge=Revolute(n=[0.0, 1.0, 0.0]), body=Body(m=1.0, r_cm=[0.0, 0.0, -0.3])
    )

    (line,) = check(Swinging()).assumed
    assert line.startswith("body.J: nobody gave the inertia, 0.1 kg.m2 about each axis is taken; give J")
    assert line in str(check(Swinging()))
    point = Swinging(body=dict(J=np.zeros((3, 3))))
    assert check(point).assumed == ()
    slope = linearize(translate(point), at={"hinge.phi": 0.0, "hinge.w": 0.0}).poles
    assert np.abs(slope) == pytest.approx(np.sqrt(9.81 / 0.3), rel=1e-9)
    slope = linearize(translate(Swinging()), at={"hinge.phi": 0.0, "hinge.w": 0.0}).poles
    assert np.abs(slope) == pytest.approx(np.sqrt(9.81 * 0.3 / (0.1 + 0.09)), rel=1e-9)
