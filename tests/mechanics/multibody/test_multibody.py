"""Mechanisms of several joints driven through their axes, and models nested in models."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from gantrytau import Array, Model, Start, connect, simulate, sin, translate
from gantrytau.mechanics import gears, rotational, translational
from gantrytau.mechanics.multibody import (
    Body,
    FixedRotation,
    FixedTranslation,
    Frame,
    PointMass,
    Prismatic,
    Revolute,
    TwoFrames,
    World,
)
from tests.mechanisms.rows import row
from tests.references.rotations import turn


def numbers(function, *arguments):
    """Scalar results of a function, as one array."""
    return np.array([float(x) for x in function(*arguments)])


class Crane(Model):
    """A trolley on a rail, and a body that turns on it."""

    world = World()
    rail = Prismatic(n=[1.0, 0.0, 0.0])
    trolley = PointMass(m=3.0)
    hinge = Revolute(n=[0.0, 1.0, 0.0])
    load = Body(m=2.0, r_cm=[0.0, 0.0, -0.9], J=np.diag([0.1, 0.12, 0.05]))

    def equations(self):
        yield from row(self.world, self.rail, self.trolley)
        yield from row(self.rail, self.hinge, self.load)


class ReversedCrane(Crane):
    """The same with both joints the other way round: their coordinates change sign."""

    def equations(self):
        yield connect(self.world.frame_b, self.rail.frame_b)
        yield connect(self.rail.frame_a, self.trolley.frame_a)
        yield connect(self.rail.frame_a, self.hinge.frame_b)
        yield connect(self.hinge.frame_a, self.load.frame_a)


@pytest.mark.parametrize(("model", "sign"), [(Crane, 1), (ReversedCrane, -1)])
def test_crane_either_way_round(model, sign):
    f = translate(model()).function(
        ["rail.s", "rail.v", "hinge.phi", "hinge.w"], ["der(rail.v)", "der(hinge.w)"]
    )
    rng = np.random.default_rng(8)
    for s, v, phi, w in rng.uniform(-1.5, 1.5, (5, 4)):
        # x of the load is s - l sin(phi)
        couple = -2.0 * 0.9 * np.cos(phi)
        mass = np.array([[5.0, couple], [couple, 0.12 + 2.0 * 0.81]])
        force = [-2.0 * 0.9 * np.sin(phi) * w**2, -2.0 * 9.81 * 0.9 * np.sin(phi)]
        expected = np.linalg.solve(mass, force)
        found = sign * numbers(f, sign * s, sign * v, sign * phi, sign * w)
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


class Winch(Model):
    """A motor with rotor inertia turns an arm through a gear; a spring holds the arm to a shaft of its own."""

    world = World()
    motor = rotational.Torque()
    rotor = rotational.Inertia(J=0.01)
    gear = gears.IdealGear(ratio=5.0)
    spring = rotational.Spring(c=20.0, phi_rel0=0.1)
    hinge = Revolute(n=[0.0, 1.0, 0.0])
    arm = Body(m=2.0, r_cm=[0.5, 0.0, 0.0], J=np.diag([0.0, 0.04, 0.04]) + 0.01 * np.eye(3))

    def equations(self):
        yield from row(self.world, self.hinge, self.arm)
        yield from row(self.motor, self.rotor, self.gear, self.hinge.axis)
        yield connect(self.spring.flange_a, self.hinge.support)
        yield connect(self.spring.flange_b, self.hinge.axis)


def test_arm_driven_through_gear_and_spring():
    f = translate(Winch()).function(["hinge.phi", "hinge.w", "motor.tau"], ["der(hinge.w)"])
    for phi, w, tau in [(0.3, 1.0, 0.5), (-1.0, 0.2, -2.0)]:
        # positive about y lowers the arm, which points along x
        torque = 5.0 * tau - 20.0 * (phi - 0.1) + 2.0 * 9.81 * 0.5 * np.cos(phi)
        inertia = 0.05 + 2.0 * 0.25 + 25.0 * 0.01
        assert float(f(phi, w, tau)) == pytest.approx(torque / inertia, rel=1e-12)


class Led(Model):
    """A trolley led along its rail; the hinged load follows."""

    crane = Crane()
    source = translational.Position()

    def equations(self):
        yield connect(self.source.flange, self.crane.rail.axis)


def test_led_trolley_tells_the_force_it_takes():
    dae = translate(Led())
    assert dae.diagnosis.mobility == 1
    inverse = dae.function(
        ["source.s", "der(source.s)", "der(der(source.s))", "crane.hinge.phi", "crane.hinge.w"],
        ["source.f", "der(crane.hinge.w)"],
    )
    a, phi, w = 2.5, 0.6, -1.1
    inertia = 0.12 + 2.0 * 0.81
    gain = 2.0 * 0.9 * (a * np.cos(phi) - 9.81 * np.sin(phi)) / inertia
    push = 5.0 * a - 1.8 * np.cos(phi) * gain + 1.8 * np.sin(phi) * w**2
    np.testing.assert_allclose(numbers(inverse, 0.3, 0.7, a, phi, w), [push, gain], rtol=1e-12)


def test_a_trolley_led_by_a_function_of_time_swings_its_load():
    def way(t):
        return 0.1 * sin(3.0 * t)

    swing = simulate(Led(), stop=4.0, inputs={"source.s": way}, tolerance=1e-10, points=41)
    t = swing.time
    np.testing.assert_allclose(swing["crane.rail.s"], 0.1 * np.sin(3 * t), atol=1e-12)
    # what the source does is the energy of the trolley and its load
    phi, w, v = swing["crane.hinge.phi"], swing["crane.hinge.w"], swing["crane.rail.v"]
    energy = 2.5 * v**2 + (0.12 + 1.62) * w**2 / 2 - 1.8 * np.cos(phi) * v * w - 1.8 * 9.81 * np.cos(phi)
    fine = simulate(Led(), stop=4.0, inputs={"source.s": way}, tolerance=1e-10, points=801)
    work = CubicSpline(fine.time, fine["source.f"] * fine["crane.rail.v"]).integrate(0.0, 4.0)
    # splines on 5 ms: (5e-3)^4 times 1e3
    assert energy[-1] - energy[0] == pytest.approx(float(work), abs=1e-6)


class Screwed(Model):
    """A spindle turned by a motor moves a vertical slide against a spring."""

    world = World()
    motor = rotational.Torque()
    spindle = rotational.Inertia(J=1e-4)
    screw = gears.BallScrew(lead=0.02)
    rail = Prismatic(n=[0.0, 0.0, 2.0])
    slide = PointMass(m=4.0)
    spring = translational.Spring(c=300.0, s_rel0=0.1)

    def equations(self):
        yield from row(self.motor, self.spindle, self.screw, self.rail.axis)
        yield connect(self.rail.support, self.spring.flange_a)
        yield connect(self.rail.axis, self.spring.flange_b)
        yield from row(self.world, self.rail, self.slide)


def test_slide_on_a_ball_screw():
    f = translate(Screwed()).function(["rail.s", "rail.v", "motor.tau"], ["der(rail.v)", "rail.f"])
    per_metre = 2 * np.pi / 0.02
    mass = 4.0 + 1e-4 * per_metre**2
    push = 0.2 * per_metre - 300.0 * (0.25 - 0.1)
    a, force = numbers(f, 0.25, 0.1, 0.2)
    assert a == pytest.approx((push - 4.0 * 9.81) / mass, rel=1e-12)
    assert force == pytest.approx(4.0 * (a + 9.81), rel=1e-12)  # what the axis drives carries the slide


def test_a_fixed_rotation_from_either_side():
    about = 0.7 * np.array([0.6, 0.0, 0.8])

    class Turned(Model):
        world = World()
        ahead = FixedRotation(n=[3.0, 0.0, 4.0], phi=0.7)
        back = FixedRotation(n=[3.0, 0.0, 4.0], phi=0.7)
        one, other = FixedTranslation(r=[0.1, 0.2, 0.3]), FixedTranslation(r=[0.1, 0.2, 0.3])
        balls = Array(PointMass, 2, m=2.0)

        def equations(self):
            yield from row(self.world, self.ahead, self.one, self.balls[0])
            yield connect(self.world.frame_b, self.back.frame_b)
            yield from row(self.back.frame_a, self.other, self.balls[1])

    at = translate(Turned()).evaluate()
    for ball, R in ((0, turn(about)), (1, turn(-about))):
        place = R @ [0.1, 0.2, 0.3]
        np.testing.assert_allclose(at[f"balls[{ball}].frame_a.r"], place, atol=1e-15)
    weights = sum(np.cross(at[f"balls[{k}].frame_a.r"], [0.0, 0.0, -19.62]) for k in (0, 1))
    np.testing.assert_allclose(at["world.frame_b.t"], weights, rtol=1e-13)
    np.testing.assert_allclose(at["world.frame_b.f"], [0.0, 0.0, -2 * 19.62], rtol=1e-13)


class Arm(TwoFrames):
    """A hinged bar with a body."""

    hinge = Revolute(n=[0.0, -1.0, 0.0])
    body = Body(m=1.5, r_cm=[0.2, 0.0, 0.1], J=np.diag([0.02, 0.02, 0.02]))
    bar = FixedTranslation(r=[0.5, 0.0, 0.0])

    def equations(self):
        yield from row(self.frame_a, self.hinge, self.body)
        yield from row(self.hinge, self.bar, self.frame_b)


class Pair(TwoFrames):
    """Two arms in series, with two frames of their own at the tip."""

    one, two = Arm(), Arm()
    tip = Frame()

    def equations(self):
        yield from row(self.frame_a, self.one, self.two, self.frame_b)
        yield connect(self.frame_b, self.tip)


class Outside(Model):
    """A five-bar linkage whose loop goes through frames of its parts, with a load at the tip."""

    world = World()
    left, right = Pair(), Pair()
    join = Revolute(n=[0.0, -1.0, 0.0])
    ground = FixedTranslation(r=[0.6, 0.0, 0.0])
    load = PointMass(m=0.7)

    def equations(self):
        yield connect(self.world.frame_b, self.left.frame_a)
        yield from row(self.world, self.ground, self.right)
        yield from row(self.left.tip, self.join, self.right.frame_b)
        yield connect(self.right.tip, self.load.frame_a)


class FiveBar(TwoFrames):
    """The same as a part with two frames; connections in another order, and to its own frames from inside."""

    left, right = Pair(), Pair()
    join = Revolute(n=[0.0, -1.0, 0.0])
    ground = FixedTranslation(r=[0.6, 0.0, 0.0])

    def equations(self):
        yield connect(self.right.frame_b, self.frame_b)
        yield connect(self.join.frame_b, self.right.tip)
        yield connect(self.left.frame_b, self.join.frame_a)
        yield connect(self.ground.frame_b, self.right.frame_a)
        yield connect(self.left.frame_a, self.frame_a)
        yield connect(self.frame_a, self.ground.frame_a)


class Inside(Model):
    """The five-bar as a part."""

    world = World()
    part = FiveBar()
    load = PointMass(m=0.7)

    def equations(self):
        yield connect(self.part.frame_b, self.load.frame_a)
        yield connect(self.world.frame_b, self.part.frame_a)


def angles(one, two):
    """Starts of the hinges of a pair."""
    return dict(one=dict(hinge=dict(phi=Start(one))), two=dict(hinge=dict(phi=Start(two))))


def test_loops_through_the_frames_of_parts():
    parts = dict(left=angles(2.0, -1.0), right=angles(1.0, 1.0))
    found = []
    for model, before in ((Outside(**parts), ""), (Inside(part=parts), "part.")):
        dae = translate(model)
        assert dae.diagnosis.mobility == 2
        assert len(dae.diagnosis.redundant) == 3
        given = {"left.one.hinge.phi": 2.0, "right.one.hinge.phi": 1.2}
        given |= {"left.one.hinge.w": 0.5, "right.one.hinge.w": -0.8}
        at = dae.evaluate({before + name: value for name, value in given.items()})
        gains = [f"der({before}{side}.{arm}.hinge.w)" for side in ("left", "right") for arm in ("one", "two")]
        forces = [
            "load.frame_a.f",
            f"{before}left.frame_a.f",
            f"{before}right.frame_a.f",
            f"{before}join.frame_b.f",
        ]
        found.append((np.array([at[n] for n in gains]), np.array([at[n] for n in forces])))
        # Newton for the whole: what the world carries is weight and inertia of all parts
        total = at["load.frame_a.f"] + sum(
            at[f"{before}{side}.{arm}.body.frame_a.f"] for side in ("left", "right") for arm in ("one", "two")
        )
        np.testing.assert_allclose(at["world.frame_b.f"], -total, atol=1e-10)
        np.testing.assert_allclose(
            at[f"{before}left.frame_a.f"] + at[f"{before}right.frame_a.f"], total, atol=1e-10
        )
    np.testing.assert_allclose(found[0][0], found[1][0], rtol=1e-9)
    # across the plane only sums are determined
    np.testing.assert_allclose(found[0][1][:, [0, 2]], found[1][1][:, [0, 2]], rtol=1e-8, atol=1e-9)


def test_a_connection_stated_twice_says_nothing_new():
    class Twice(Model):
        world = World()
        hinge = Revolute(n=[0.0, 1.0, 0.0])
        body = Body(r_cm=[0.3, 0.0, 0.0])

        def equations(self):
            yield connect(self.world.frame_b, self.hinge.frame_a)
            yield connect(self.hinge.frame_a, self.world.frame_b)
            yield connect(self.hinge.frame_b, self.body.frame_a)
            yield connect(self.hinge.frame_b, self.body.frame_a)

    dae = translate(Twice())
    assert dae.diagnosis.redundant == ()
    assert dae.evaluate()["der(hinge.w)"] == pytest.approx(9.81 * 0.3 / (0.1 + 0.09), rel=1e-13)
