"""Joints in open chains: dynamics against Newton-Euler by hand, pendulums, tops, and drives on their axes."""

import dataclasses

import numpy as np
import pytest

from gantrytau import Array, Fixed, Input, Model, Parameter, Start, connect, simulate, translate
from gantrytau.mechanics import rotational
from gantrytau.mechanics.multibody import (
    Body,
    FixedTranslation,
    PointMass,
    Revolute,
    Spherical,
    Universal,
    World,
)
from tests.mechanisms.rows import in_a_row, row
from tests.references import chain as serial
from tests.references.rotations import turn

ROUNDING = 1e-10  # of a serial chain in double precision, relative


class Driven(Model):
    """A bar, a revolute joint, a body and a motor."""

    offset = Parameter(shape=3, unit="m", description="from the body before to the joint")
    n = Parameter(shape=3, unit="1", description="axis")
    tau = Input(unit="N.m", description="torque of the motor")
    bar = FixedTranslation(r=offset)
    joint = Revolute(n=n)
    body = Body()
    motor = rotational.Torque()

    def equations(self):
        yield self.motor.tau == self.tau
        yield from row(self.bar, self.joint, self.body)
        yield connect(self.motor.flange, self.joint.axis)


class SerialChain(Model):
    """Driven links, one after another."""

    world = World()
    links = Array(Driven, 1)

    def equations(self):
        frames = [self.world.frame_b, *(link.body.frame_a for link in self.links)]
        for link, before in zip(self.links, frames, strict=False):
            yield connect(before, link.bar.frame_a)


def random_chain(count, seed):
    """A random chain of bodies that exist: inertias from second moments S of mass, J = tr(S) 1 - S."""
    chain = serial.random_chain(count, seed)
    spread = np.trace(chain.inertias, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    return dataclasses.replace(chain, inertias=spread - chain.inertias)


def chain_model(chain):
    """The model of a chain of tests.references."""
    parts = zip(chain.offsets, chain.axes, chain.masses, chain.centres, chain.inertias, strict=True)
    modifications = [
        dict(offset=offset, n=3.0 * axis, body=dict(m=m, r_cm=centre, J=J))
        for offset, axis, m, centre, J in parts
    ]

    class Chain(SerialChain):
        links = Array(Driven, modifications)

    return Chain()


def of(count, *names):
    """Names in all links."""
    return [name.format(k) for name in names for k in range(count)]


def numbers(function, *arguments):
    """Scalar results of a function, as one array."""
    return np.array([float(x) for x in function(*arguments)])


@pytest.mark.parametrize("count", [3, 6, 12])
def test_dynamics_of_serial_chains_both_ways(count):
    chain = random_chain(count, seed=count)
    dae = translate(chain_model(chain))
    assert dae.diagnosis.mobility == count
    forward = dae.function(
        of(count, "links[{}].joint.phi", "links[{}].joint.w", "links[{}].tau"),
        of(count, "der(links[{}].joint.w)"),
    )
    inverse = dae.function(
        of(count, "links[{}].joint.phi", "links[{}].joint.w", "der(links[{}].joint.w)"),
        of(count, "links[{}].tau"),
    )
    rng = np.random.default_rng(count)
    for _ in range(3):
        phi, w, tau = rng.uniform(-2.5, 2.5, count), rng.normal(size=count), rng.normal(size=count)
        expected = serial.forward_dynamics(chain, phi, w, tau)
        np.testing.assert_allclose(
            numbers(forward, *phi, *w, *tau), expected, rtol=ROUNDING, atol=ROUNDING * np.abs(expected).max()
        )
        back = serial.inverse_dynamics(chain, phi, w, expected)
        np.testing.assert_allclose(
            numbers(inverse, *phi, *w, *expected), back, rtol=ROUNDING, atol=ROUNDING * np.abs(back).max()
        )


def test_energy_of_a_falling_chain_stays():
    chain = random_chain(3, seed=1)
    model = chain_model(chain)
    fall = simulate(
        model, stop=3.0, tolerance=1e-10, points=61, inputs={f"links[{k}].tau": 0.0 for k in range(3)}
    )
    phi = np.column_stack([fall[f"links[{k}].joint.phi"] for k in range(3)])
    w = np.column_stack([fall[f"links[{k}].joint.w"] for k in range(3)])
    energy = [serial.energy(chain, a, b) for a, b in zip(phi, w, strict=True)]
    assert np.abs(w).max() > 1.0
    assert np.ptp(energy) < 1e-6  # ten thousand times the tolerance, of some joules


class DoublePendulum(Model):
    """Two point masses on massless bars in a vertical plane."""

    world = World()
    hinges = Array(Revolute, 2, n=[0.0, 1.0, 0.0])
    bars = Array(FixedTranslation, [dict(r=[0.0, 0.0, -0.8]), dict(r=[0.0, 0.0, -0.6])])
    balls = Array(PointMass, [dict(m=2.0), dict(m=1.5)])

    def equations(self):
        before = self.world.frame_b
        for hinge, bar, ball in zip(self.hinges, self.bars, self.balls, strict=True):
            yield from row(before, hinge, bar, ball)
            before = bar.frame_b


def test_double_pendulum_of_the_textbook():
    find = ["der(hinges[0].w)", "der(hinges[1].w)"]
    f = translate(DoublePendulum()).function(
        ["hinges[0].phi", "hinges[1].phi", "hinges[0].w", "hinges[1].w"], find
    )
    rng = np.random.default_rng(3)
    for a, b, da, db in rng.uniform(-2, 2, (5, 4)):
        m1, m2, l1, l2, g = 2.0, 1.5, 0.8, 0.6, 9.81
        first, second, d = a, a + b, -b  # absolute angles from the vertical
        d1, d2 = da, da + db
        mass = np.array([[(m1 + m2) * l1, m2 * l2 * np.cos(d)], [l1 * np.cos(d), l2]])
        force = [
            -m2 * l2 * d2**2 * np.sin(d) - (m1 + m2) * g * np.sin(first),
            l1 * d1**2 * np.sin(d) - g * np.sin(second),
        ]
        dd1, dd2 = np.linalg.solve(mass, force)
        np.testing.assert_allclose(numbers(f, a, b, da, db), [dd1, dd2 - dd1], rtol=1e-11, atol=1e-11)


class BallPendulum(Model):
    """A body hangs in a ball joint."""

    world = World()
    ball = Spherical()
    body = Body(m=2.0, r_cm=[0.0, 0.0, -0.7], J=np.diag([0.03, 0.03, 0.02]))

    def equations(self):
        yield from row(self.world, self.ball, self.body)


class ReversedBallPendulum(BallPendulum):
    """The same with frame_b of the joint on the world."""

    def equations(self):
        yield connect(self.world.frame_b, self.ball.frame_b)
        yield connect(self.ball.frame_a, self.body.frame_a)


@pytest.mark.parametrize("model", [BallPendulum, ReversedBallPendulum])
def test_body_in_a_ball_joint_obeys_euler(model):
    about = np.array([0.4, 0.9, 0.3])
    R, w = turn(about), np.array([0.5, -1.0, 2.0])
    half = np.linalg.norm(about) / 2
    q = np.array([np.cos(half), *(np.sin(half) * about / np.linalg.norm(about))])
    if model is ReversedBallPendulum:
        q[1:] *= -1
    at = translate(model(ball=dict(q=Start(q)), body=dict(w=Start(w)))).evaluate()
    arm = R @ [0.0, 0.0, -0.7]
    inertia = R @ np.diag([0.03, 0.03, 0.02]) @ R.T + 2.0 * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    torque = np.cross(arm, [0.0, 0.0, -2.0 * 9.81])
    expected = np.linalg.solve(inertia, torque - np.cross(w, inertia @ w))
    np.testing.assert_allclose(at["body.w"], w, atol=1e-13)
    np.testing.assert_allclose(at["der(body.w)"], expected, rtol=1e-11)


def test_gyroscope_precesses_at_the_rate_of_the_textbook():
    # regular precession of a top spinning with s about its figure: J3 s W - (J1 - J3) W^2 cos a = m g l
    m, arm, J_across, J_along, tilt, precession = 1.0, 0.2, 0.01 + 0.04, 0.008, 0.7, 1.3
    spin = (m * 9.81 * arm + (J_across - J_along) * precession**2 * np.cos(tilt)) / (J_along * precession)
    figure = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    w = spin * figure + precession * np.array([0.0, 0.0, 1.0])
    q = [np.cos(tilt / 2), 0.0, np.sin(tilt / 2), 0.0]
    top = BallPendulum(
        ball=dict(q=Fixed(q)),
        body=dict(m=m, r_cm=[0.0, 0.0, arm], J=np.diag([0.01, 0.01, J_along]), w=Fixed(w)),
    )
    spinning = simulate(top, stop=2.0, tolerance=1e-12, points=41)
    axis = spinning["body.frame_a.R"] @ [0.0, 0.0, 1.0]
    angle = precession * spinning.time
    expected = np.column_stack(
        [np.sin(tilt) * np.cos(angle), np.sin(tilt) * np.sin(angle), np.cos(tilt) + 0 * angle]
    )
    # sixty turns; measured 1e-6, falls with the tolerance
    np.testing.assert_allclose(axis, expected, atol=1e-5)


# A body on a universal joint.
OnUniversal = in_a_row(
    "OnUniversal",
    world=World(),
    joint=Universal(n_a=[1.0, 0.2, 0.0], n_b=[0.0, 1.0, 0.5]),
    body=Body(m=1.3, r_cm=[0.1, 0.2, -0.5], J=np.diag([0.1, 0.2, 0.15])),
)


def test_universal_joint_is_two_revolute_joints():
    one = translate(OnUniversal()).evaluate(
        {"joint.phi_a": 0.4, "joint.phi_b": -0.8, "der(joint.phi_a)": 1.1, "der(joint.phi_b)": 0.6}
    )
    chain = serial.Chain(
        axes=np.array([[1.0, 0.2, 0.0], [0.0, 1.0, 0.5]]) / np.sqrt([[1.04], [1.25]]),
        offsets=np.zeros((2, 3)),
        masses=np.array([0.0, 1.3]),
        centres=np.array([[0.0, 0.0, 0.0], [0.1, 0.2, -0.5]]),
        inertias=np.array([np.zeros((3, 3)), np.diag([0.1, 0.2, 0.15])]),
        gravity=np.array([0.0, 0.0, -9.81]),
    )
    expected = serial.forward_dynamics(chain, np.array([0.4, -0.8]), np.array([1.1, 0.6]), np.zeros(2))
    found = [one["der(der(joint.phi_a))"], one["der(der(joint.phi_b))"]]
    np.testing.assert_allclose(found, expected, rtol=1e-11)


def test_chain_of_reversed_joints_is_the_chain_of_negative_angles():
    chain = random_chain(3, seed=9)
    parts = list(zip(chain.offsets, chain.axes, chain.masses, chain.centres, chain.inertias, strict=True))

    class Reversed(Model):
        world = World()
        bars = Array(FixedTranslation, [dict(r=-p[0]) for p in parts])
        joints = Array(Revolute, [dict(n=p[1]) for p in parts])
        bodies = Array(Body, [dict(m=p[2], r_cm=p[3], J=p[4]) for p in parts])

        def equations(self):
            before = self.world.frame_b
            for bar, joint, body in zip(self.bars, self.joints, self.bodies, strict=True):
                yield connect(bar.frame_b, before)
                yield connect(joint.frame_b, bar.frame_a)
                yield connect(body.frame_a, joint.frame_a)
                before = body.frame_a

    f = translate(Reversed()).function(of(3, "joints[{}].phi", "joints[{}].w"), of(3, "der(joints[{}].w)"))
    phi, w = np.array([0.4, -1.2, 0.9]), np.array([1.0, 0.3, -2.0])
    expected = serial.forward_dynamics(chain, phi, w, np.zeros(3))
    np.testing.assert_allclose(numbers(f, *-phi, *-w), -expected, rtol=ROUNDING)
