"""Components of shafts against closed solutions; signs of sources, friction and sensors."""

import numpy as np
import pytest

from gantrytau import Fixed, Model, StructureError, connect, cos, simulate, sin, translate
from gantrytau.mechanics import rotational
from tests.mechanisms.rows import in_a_row, row

TOLERANCE = 1e-10
NEAR = 1e3 * TOLERANCE  # the integrator holds its tolerance per step; over some seconds errors add up


class Twisted(Model):
    """An inertia on a torsion spring and damper at a wall."""

    wall, load = rotational.Fixed(phi=0.2), rotational.Inertia(J=0.5, phi=Fixed(1.0), w=Fixed(0.0))
    shaft = rotational.SpringDamper(c=8.0, d=0.0, phi_rel0=0.3)

    def equations(self):
        yield from row(self.wall, self.shaft, self.load)


def test_an_inertia_on_a_torsion_spring_swings_with_the_root_of_c_over_J():
    found = simulate(Twisted(), stop=3.0, tolerance=TOLERANCE)
    np.testing.assert_allclose(found["load.phi"], 0.5 + 0.5 * np.cos(4.0 * found.time), atol=NEAR)
    np.testing.assert_allclose(found["shaft.tau"], 8.0 * (found["load.phi"] - 0.5), atol=10 * NEAR)


def test_a_damped_swing_decays_with_d_over_2J():
    found = simulate(Twisted(shaft=dict(d=1.0)), stop=3.0, tolerance=TOLERANCE)
    decay, t = 1.0 / (2 * 0.5), found.time
    w = np.sqrt(16.0 - decay**2)
    expected = 0.5 + 0.5 * np.exp(-decay * t) * (np.cos(w * t) + decay / w * np.sin(w * t))
    np.testing.assert_allclose(found["load.phi"], expected, atol=NEAR)


class Slowed(Model):
    """A wheel that runs out."""

    wheel = rotational.Inertia(J=0.5, phi=Fixed(0.0), w=Fixed(8.0))
    friction = rotational.TanhFriction(tau_c=1.0, tau_v=0.0)

    def equations(self):
        yield connect(self.wheel.flange_a, self.friction.flange)


def test_coulomb_friction_slows_evenly_and_viscous_friction_in_proportion():
    found = simulate(Slowed(), stop=3.0, tolerance=TOLERANCE)
    # at 2 rad/s and more, 40 smoothing speeds, tanh is one to rounding
    np.testing.assert_allclose(found["wheel.w"], 8.0 - 2.0 * found.time, atol=NEAR)
    found = simulate(Slowed(friction=dict(tau_c=0.0, tau_v=0.6)), stop=3.0, tolerance=TOLERANCE)
    np.testing.assert_allclose(found["wheel.w"], 8.0 * np.exp(-1.2 * found.time), atol=NEAR)
    found = simulate(Slowed(friction=rotational.Frictionless()), stop=3.0, tolerance=TOLERANCE)
    np.testing.assert_allclose(found["wheel.w"], 8.0, rtol=1e-14)


@pytest.mark.parametrize(
    ("law", "at_w_s"), [(rotational.TanhFriction, np.tanh(1.0)), (rotational.LinearFriction, 1.0)]
)
def test_friction_opposes_the_speed_on_both_sides(law, at_w_s):
    dae = translate(Slowed(friction=law(tau_c=4.0, tau_v=5.0, w_s=0.1)))
    torque = dae.function(["wheel.w"], ["friction.tau"])
    for w, smoothed in ((0.1, at_w_s), (10.0, 1.0)):
        assert float(torque(w)) == pytest.approx(4.0 * smoothed + 5.0 * w, rel=1e-14)
        assert float(torque(-w)) == -float(torque(w))
    assert float(torque(0.0)) == 0.0


class Brake(Model):
    """Two wheels of which one brakes the other through their common bearing."""

    one, other = (
        rotational.Inertia(J=0.5, phi=Fixed(0.0), w=Fixed(8.0)),
        rotational.Inertia(J=1.5, phi=Fixed(0.0), w=Fixed(0.0)),
    )
    bearing = rotational.BearingFriction(tau_c=0.0, tau_v=0.6)

    def equations(self):
        yield from row(self.one, self.bearing, self.other)


def test_friction_between_two_wheels_keeps_their_angular_momentum():
    found = simulate(Brake(), stop=3.0, tolerance=TOLERANCE)
    np.testing.assert_allclose(0.5 * found["one.w"] + 1.5 * found["other.w"], 4.0, atol=NEAR)
    decay = 0.6 * (1 / 0.5 + 1 / 1.5)
    np.testing.assert_allclose(
        found["one.w"] - found["other.w"], 8.0 * np.exp(-decay * found.time), atol=NEAR
    )
    # Coulomb friction drags with the same torque until they turn together, after 8 / (1 / 0.5 + 1 / 1.5) s
    found = simulate(Brake(bearing=dict(tau_c=1.0, tau_v=0.0)), stop=5.0, tolerance=TOLERANCE)
    sliding = found.time < 2.5
    np.testing.assert_allclose(found["one.w"][sliding], 8.0 - 2.0 * found.time[sliding], atol=NEAR)
    assert found.final("one.w") == pytest.approx(
        2.0, abs=1e-6
    )  # 2 s are a hundred time constants w_s J / tau_c


class Led(Model):
    """A source turns an inertia against a damper."""

    source, load = rotational.Position(), rotational.Inertia(J=2.0)
    damper, wall = rotational.Damper(d=3.0), rotational.Fixed()

    def equations(self):
        yield from row(self.source, self.load, self.damper, self.wall)


class Driven(Led):
    """The same, turned by its speed."""

    source = rotational.Speed()  # pyright: ignore[reportAssignmentType]


def test_sources_of_angle_and_speed_tell_the_torque_they_take():
    def expected(t):
        return -32 * np.sin(4 * t) + 12 * np.cos(4 * t)

    found = simulate(Led(), stop=2.0, inputs={"source.phi": lambda t: sin(4 * t)})
    np.testing.assert_allclose(found["load.w"], 4 * np.cos(4 * found.time), atol=1e-12)
    np.testing.assert_allclose(found["source.tau"], expected(found.time), atol=1e-12)
    found = simulate(
        Driven(source=dict(phi=Fixed(0.5))),
        stop=2.0,
        inputs={"source.w": lambda t: 4 * cos(4 * t)},
        tolerance=TOLERANCE,
    )
    np.testing.assert_allclose(found["load.phi"], 0.5 + np.sin(4 * found.time), atol=NEAR)
    np.testing.assert_allclose(found["source.tau"], expected(found.time), atol=1e-12)


class Measured(Model):
    """A torque turns two inertias, one after the other, past all sensors."""

    motor, near, far = rotational.Torque(), rotational.Inertia(J=2.0), rotational.Inertia(J=3.0)
    spring = rotational.Spring(c=40.0, phi_rel0=0.5)
    torque, angle = rotational.TorqueSensor(), rotational.AngleSensor()
    speed, relative = rotational.SpeedSensor(), rotational.RelativeSensor()

    def equations(self):
        yield from row(self.motor, self.near, self.torque, self.spring, self.far, self.angle)
        yield connect(self.far.flange_b, self.speed.flange)
        yield connect(self.near.flange_a, self.relative.flange_a)
        yield connect(self.far.flange_a, self.relative.flange_b)


def test_sensors_measure_with_the_right_sign_and_disturb_nothing():
    found = simulate(
        Measured(), stop=1.0, inputs={"motor.tau": lambda t: 6 * sin(9 * t)}, tolerance=TOLERANCE, points=11
    )
    # what the sensor passes on from a to b turns the far inertia
    np.testing.assert_allclose(found["torque.tau"], 3.0 * found["der(far.w)"], atol=1e-12)
    np.testing.assert_allclose(found["torque.tau"], -found["spring.tau"], atol=1e-12)
    np.testing.assert_allclose(
        found["motor.tau"] - found["torque.tau"], 2.0 * found["der(near.w)"], atol=1e-12
    )
    np.testing.assert_array_equal(found["angle.phi"], found["far.phi"])
    np.testing.assert_array_equal(found["speed.w"], found["far.w"])
    np.testing.assert_allclose(found["relative.phi_rel"], found["far.phi"] - found["near.phi"], atol=1e-15)
    np.testing.assert_allclose(found["relative.w_rel"], found["far.w"] - found["near.w"], atol=1e-15)


@pytest.mark.parametrize("source", [rotational.Position, rotational.Speed])
def test_a_shaft_held_twice_is_explained(source):
    Twice = in_a_row("Twice", one=source(), other=rotational.Fixed())

    with pytest.raises(StructureError, match=r"Undetermined: one\.tau \(something else holds this flange"):
        translate(Twice())


def test_misused_sensors_are_explained():
    class Between(Model):
        motor, sensor, wall = rotational.Torque(), rotational.RelativeSensor(), rotational.Fixed()

        def equations(self):
            yield from row(self.wall, self.sensor, self.motor)

    Loose = in_a_row("Loose", motor=rotational.Torque(), sensor=rotational.AngleSensor())

    Bridged = in_a_row(
        "Bridged", left=rotational.Fixed(), sensor=rotational.TorqueSensor(), right=rotational.Fixed()
    )

    for model, words in (
        (Between(), r"sensor\.phi_rel \(a relative sensor carries no torque; connect it beside a component"),
        (Loose(), r"sensor\.phi \(a sensor of angle carries no torque, so it holds nothing"),
        (Bridged(), r"sensor\.tau \(both ends of the sensor are held, or it closes a rigid loop"),
    ):
        with pytest.raises(StructureError, match="Undetermined: " + words):
            translate(model)
