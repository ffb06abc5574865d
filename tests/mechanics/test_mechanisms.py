"""Mechanisms with known answers: pendulums, chains, gears, linkages, in both causalities."""

import casadi as ca
import numpy as np
import pytest

from gantrytau import (
    Array,
    Connector,
    Flow,
    Model,
    Parameter,
    Real,
    StructureError,
    connect,
    der,
    sin,
    time,
    translate,
)
from gantrytau.mechanics import rotational, translational
from gantrytau.mechanics.multibody import PointMass, Prismatic, SphericalSpherical, World
from gantrytau_models.mechanisms.pendulum import Pendulum
from tests.mechanisms.rows import in_a_row, row


def test_pendulum_has_index_three_and_two_states():
    dae = translate(Pendulum())
    assert dae.indexed.structural_index == 3
    assert len(dae.states) == 2
    at = dae.evaluate({"x": 0.6, "v_x": 1.6})  # y < 0 as at the start
    assert at["y"] == pytest.approx(-0.8, abs=1e-15)
    assert at["v_y"] == pytest.approx(1.2, rel=1e-13)  # x v_x + y v_y = 0
    assert at["tension"] == pytest.approx(1.6**2 + 1.2**2 + 9.81 * 0.8, rel=1e-13)  # m v^2 / L^2 + weight
    # a force at right angles to the speed does no work: the energy stays
    power = at["der(kinetic_energy)"] + at["der(potential_energy)"] if "der(kinetic_energy)" in at else 0.0
    assert power == pytest.approx(0.0, abs=1e-12)


def test_pendulum_on_both_sides():
    dae = translate(Pendulum(), states=["x", "v_x"])
    assert float(dae.function(["x"], ["y"])(0.6)) == pytest.approx(-0.8, abs=1e-15)
    upside = translate(Pendulum(y=dict(start=0.6)), states=["x", "v_x"])
    assert float(upside.function(["x"], ["y"])(0.6)) == pytest.approx(0.8, abs=1e-15)


class Chain(Model):
    """Masses between walls, joined by springs."""

    count = 5
    left, right = translational.Fixed(), translational.Fixed()
    masses = Array(translational.Mass, 5, m=2.0)
    springs = Array(translational.Spring, 6, c=50.0)

    def equations(self):
        ends = [self.left, *self.masses, self.right]
        for spring, a, b in zip(self.springs, ends, ends[1:], strict=False):
            yield from row(a, spring, b)


def test_eigenfrequencies_of_a_chain_of_oscillators():
    dae = translate(Chain())
    assert len(dae.states) == 10
    s = [f"masses[{k}].s" for k in range(5)]
    function = dae.function(s, [f"der(masses[{k}].v)" for k in range(5)])
    x = ca.SX.sym("x", 5)
    matrix = np.array(ca.evalf(ca.jacobian(ca.vertcat(*function(*ca.vertsplit(x))), x)))
    expected = 2 * np.sqrt(50.0 / 2.0) * np.sin(np.arange(1, 6) * np.pi / 12)
    np.testing.assert_allclose(np.sort(np.sqrt(-np.linalg.eigvals(matrix).real)), expected, rtol=1e-12)


class TwoMasses(Model):
    """A motor moves a mass, and another one through a spring."""

    motor, spring = translational.Force(), translational.Spring(c=50.0)
    near, far = translational.Mass(m=2.0), translational.Mass(m=3.0)

    def equations(self):
        yield from row(self.motor, self.near, self.spring, self.far)


def test_inverse_dynamics_through_an_elastic_joint_need_the_fourth_derivative():
    dae = translate(TwoMasses())
    motion = ["far.s", "der(far.s)", "der(der(far.s))", "der(der(der(far.s)))", "der(der(der(der(far.s))))"]
    inverse = dae.function(motion, ["motor.f", "near.s"])
    force, near = (float(x) for x in inverse(0.1, 0.2, 0.3, 0.4, 0.5))
    assert near == pytest.approx(0.1 + 3.0 * 0.3 / 50.0, rel=1e-14)
    assert force == pytest.approx(2.0 * (0.3 + 3.0 * 0.5 / 50.0) + 3.0 * 0.3, rel=1e-13)
    with pytest.raises(StructureError, match=r"does not determine motor\.f\. Give also"):
        dae.function(motion[:4], ["motor.f"])


def test_gears_make_one_inertia_of_two():
    class Gear(Model):
        ratio = Parameter(5.0, unit="1")
        a, b = rotational.Flange(), rotational.Flange()

        def equations(self):
            yield self.a.phi == self.ratio * self.b.phi
            yield self.b.tau == -self.ratio * self.a.tau

    class Drive(Model):
        motor = rotational.Torque()
        rotor, load = rotational.Inertia(J=0.1), rotational.Inertia(J=2.0)
        gear = Gear()
        damper, wall = rotational.Damper(d=4.0), rotational.Fixed()

        def equations(self):
            yield from row(self.motor, self.rotor, self.gear.a)
            yield from row(self.gear.b, self.load, self.damper, self.wall)

    dae = translate(Drive())
    assert len(dae.states) == 2
    forward = dae.function(["load.w", "motor.tau"], ["der(load.w)", "rotor.w"])
    acceleration, speed = (float(x) for x in forward(0.5, 3.0))
    assert acceleration == pytest.approx((5 * 3.0 - 4.0 * 0.5) / (2.0 + 25 * 0.1), rel=1e-14)
    assert speed == 2.5
    parameters = dae.function(["load.w", "motor.tau", "gear.ratio"], ["der(load.w)"])
    assert float(parameters(0.5, 3.0, 2.0)) == pytest.approx((6.0 - 2.0) / 2.4, rel=1e-14)


def test_a_position_source_and_a_force_source_are_inverse_to_each_other():
    Moved = in_a_row(
        "Moved",
        source=translational.Position(),
        mass=translational.Mass(m=2.0),
        damper=translational.Damper(d=3.0),
        wall=translational.Fixed(),
    )

    dae = translate(Moved())
    assert dae.states == ()
    force = dae.function(["source.s", "der(source.s)", "der(der(source.s))"], ["source.flange.f"])
    assert float(force(1.0, 0.5, 0.2)) == pytest.approx(-(2.0 * 0.2 + 3.0 * 0.5), rel=1e-14)


def test_planar_four_bar_from_rods():
    class Joint(Connector):
        r = Real(2, unit="m")
        f = Flow(2, unit="N")

    class Rod(Model):
        L = Parameter(1.0, unit="m")
        tension = Real(unit="N/m")
        a, b = Joint(), Joint()

        def equations(self):
            way = self.b.r - self.a.r
            yield ca.dot(way, way) == self.L**2
            yield self.a.f == -self.tension * way
            yield self.b.f == self.tension * way

    class Knot(Model):
        m = Parameter(1.0, unit="kg")
        joint = Joint()

        def equations(self):
            yield self.m * (der(der(self.joint.r)) + ca.vertcat(0, 9.81)) == self.joint.f

    class Wall(Model):
        r = Parameter([0.0, 0.0], unit="m")
        joint = Joint()

        def equations(self):
            yield self.joint.r == self.r

    class FourBar(Model):
        left, right = Wall(), Wall(r=[2.0, 0.0])
        rods = Array(Rod, [dict(L=1.0), dict(L=2.0), dict(L=1.0)])
        p, q = Knot(joint=dict(r=dict(start=[0.1, -1.0]))), Knot(joint=dict(r=dict(start=[2.1, -1.0])))

        def equations(self):
            joints = [self.left.joint, self.p.joint, self.q.joint, self.right.joint]
            for rod, a, b in zip(self.rods, joints, joints[1:], strict=False):
                yield connect(a, rod.a)
                yield connect(rod.b, b)

    dae = translate(FourBar())
    assert len(dae.states) == 2
    assert dae.diagnosis.mobility == 1
    angle = 0.4  # a parallelogram: both knots swing as a pendulum does
    at = dae.evaluate({"p.joint.r[0]": np.sin(angle), "der(p.joint.r[0])": 0.0})
    assert at["q.joint.r"] == pytest.approx([2 + np.sin(angle), -np.cos(angle)], abs=1e-12)
    swing = -9.81 * np.sin(angle)
    assert at["der(der(p.joint.r))"] == pytest.approx(
        [swing * np.cos(angle), swing * np.sin(angle)], rel=1e-11
    )


def test_speeds_and_accelerations_of_a_given_motion():
    class Cam(Model):
        s, v, a = Real(unit="m"), Real(unit="m/s"), Real(unit="m/s2")
        push = Real(unit="N")

        def equations(self):
            yield self.s == sin(time)
            yield self.v == der(self.s)
            yield self.a == der(self.v)
            yield self.push == 2.0 * self.a

    dae = translate(Cam(), units=False)
    assert dae.states == ()
    at = dae.evaluate({"time": 0.3})
    assert at["v"] == pytest.approx(np.cos(0.3), rel=1e-14)
    assert at["push"] == pytest.approx(-2 * np.sin(0.3), rel=1e-14)
    assert float(dae.function(["time"], ["push"])(0.3)) == pytest.approx(-2 * np.sin(0.3), rel=1e-14)


def test_a_ball_on_a_rod_swings_in_space():
    Ball = in_a_row(
        "Ball",
        world=World(),
        rod=SphericalSpherical(L=2.0),
        body=PointMass(m=3.0, frame_a=dict(r=dict(start=[1.0, 1.0, -1.0]))),
    )

    dae = translate(Ball())
    assert len(dae.states) == 4
    # both the rod and the ball say that the ball joint carries no torque
    assert len(dae.diagnosis.redundant) == 3
    at = dae.evaluate(
        {"body.frame_a.r[1]": 0.2, "body.frame_a.r[0]": 0.5, "body.v[0]": 0.3, "body.v[1]": -0.2}
    )
    r, v, a = at["body.frame_a.r"], at["body.v"], at["der(body.v)"]
    pull = (9.81 * r[2] - v @ v) / 4.0  # from r . a = -v . v
    np.testing.assert_allclose(a, pull * r - [0, 0, 9.81], atol=1e-13)
    assert at["rod.tension"] == pytest.approx(-3.0 * pull, rel=1e-13)


def test_a_mass_on_an_inclined_rail():
    class Incline(Model):
        world, rail, body, motor = (
            World(),
            Prismatic(n=[1.0, 0.0, -1.0]),
            PointMass(m=2.0),
            translational.Force(),
        )

        def equations(self):
            yield from row(self.world, self.rail, self.body)
            yield connect(self.motor.flange, self.rail.axis)

    at = translate(Incline()).evaluate({"rail.s": 1.0, "motor.f": 4.0})
    assert at["der(rail.v)"] == pytest.approx(9.81 / np.sqrt(2) + 2.0, rel=1e-14)
    assert at["body.frame_a.r"] == pytest.approx(np.array([1.0, 0.0, -1.0]) / np.sqrt(2), rel=1e-14)


class TwiceHeld(Model):
    """A point mass on two rods of one length between the same two points: one of them repeats the other."""

    world = World()
    mass = PointMass()
    rods = Array(SphericalSpherical, 2)

    def equations(self):
        for rod in self.rods:
            yield from row(self.world, rod, self.mass)


def test_a_rod_that_repeats_another_is_left_out_and_named():
    dae = translate(TwiceHeld(mass=dict(frame_a=dict(r=dict(start=[0.6, 0.0, -0.8])))))
    (name,) = (n for n in dae.diagnosis.redundant if "rods" in n and "equation 1" in n and "row" not in n)
    assert name in ("rods[0] (SphericalSpherical), equation 1", "rods[1] (SphericalSpherical), equation 1")
    at = dae.evaluate()
    pulls = sorted(at[f"rods[{k}].tension"] for k in range(2))
    # one rod holds the ball on its circle as if it were alone: m g cos(phi) / L, the ball at rest
    np.testing.assert_allclose(pulls, [0.0, 9.81 * 0.8], atol=1e-12)
