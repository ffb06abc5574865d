"""Components along one axis against closed solutions; signs of sources, springs and sensors."""

import numpy as np
import pytest

from gantrytau import Fixed, Model, StructureError, connect, cos, simulate, sin, translate
from gantrytau.mechanics import translational
from tests.mechanisms.rows import in_a_row, row

TOLERANCE = 1e-10
NEAR = 1e3 * TOLERANCE  # the integrator holds its tolerance per step; over some seconds errors add up


class Swinging(Model):
    """A mass on a spring and damper at a wall."""

    wall, mass = translational.Fixed(s=0.3), translational.Mass(m=2.0, s=Fixed(1.0), v=Fixed(0.0))
    link = translational.SpringDamper(c=50.0, d=0.0, s_rel0=0.4)

    def equations(self):
        yield from row(self.wall, self.link, self.mass)


def test_a_mass_on_a_spring_swings_with_the_root_of_c_over_m():
    found = simulate(Swinging(), stop=3.0, tolerance=TOLERANCE)
    # at rest at the wall plus the length without force, 0.7 m
    np.testing.assert_allclose(found["mass.s"], 0.7 + 0.3 * np.cos(5.0 * found.time), atol=NEAR)
    np.testing.assert_allclose(found["link.f"], 50.0 * (found["mass.s"] - 0.7), atol=NEAR)  # pulled: positive


def test_a_damped_swing_decays_with_d_over_2m():
    found = simulate(Swinging(link=dict(d=4.0)), stop=3.0, tolerance=TOLERANCE)
    decay = 4.0 / (2 * 2.0)
    w = np.sqrt(25.0 - decay**2)
    t = found.time
    expected = 0.7 + 0.3 * np.exp(-decay * t) * (np.cos(w * t) + decay / w * np.sin(w * t))
    np.testing.assert_allclose(found["mass.s"], expected, atol=NEAR)


def test_a_spring_damper_is_a_spring_beside_a_damper():
    class Apart(Model):
        wall, mass = translational.Fixed(s=0.3), translational.Mass(m=2.0, s=Fixed(1.0), v=Fixed(0.0))
        spring, damper = translational.Spring(c=50.0, s_rel0=0.4), translational.Damper(d=4.0)

        def equations(self):
            for one in (self.spring, self.damper):
                yield from row(self.wall, one, self.mass)

    together = simulate(Swinging(link=dict(d=4.0)), stop=2.0, tolerance=TOLERANCE)
    apart = simulate(Apart(), stop=2.0, tolerance=TOLERANCE)
    np.testing.assert_allclose(together["mass.s"], apart["mass.s"], atol=NEAR)
    np.testing.assert_allclose(together["link.f"], apart["spring.f"] + apart["damper.f"], atol=50 * NEAR)


# A mass that slides against friction.
Slowed = in_a_row(
    "Slowed",
    mass=translational.Mass(m=2.0, s=Fixed(0.0), v=Fixed(3.0)),
    friction=translational.TanhFriction(f_c=4.0, f_v=0.0),
)


def test_coulomb_friction_slows_evenly_and_viscous_friction_in_proportion():
    found = simulate(Slowed(), stop=1.0, tolerance=TOLERANCE)
    # at 1 m/s and more, 20 smoothing speeds, tanh is one to 1e-17
    np.testing.assert_allclose(found["mass.v"], 3.0 - 2.0 * found.time, atol=NEAR)
    found = simulate(Slowed(friction=dict(f_c=0.0, f_v=5.0)), stop=1.0, tolerance=TOLERANCE)
    np.testing.assert_allclose(found["mass.v"], 3.0 * np.exp(-2.5 * found.time), atol=NEAR)
    np.testing.assert_allclose(found["friction.f"], 5.0 * found["mass.v"], atol=NEAR)


@pytest.mark.parametrize(
    ("law", "at_v_s"), [(translational.TanhFriction, np.tanh(1.0)), (translational.LinearFriction, 1.0)]
)
def test_friction_opposes_the_speed_on_both_sides(law, at_v_s):
    dae = translate(Slowed(friction=law(f_c=4.0, f_v=5.0, v_s=0.1)))
    force = dae.function(["mass.v"], ["friction.f"])
    for v, smoothed in ((0.0, 0.0), (0.05, None), (0.1, at_v_s), (10.0, 1.0)):
        if smoothed is not None:
            assert float(force(v)) == pytest.approx(4.0 * smoothed + 5.0 * v, rel=1e-14)
        assert float(force(-v)) == -float(force(v))


class Led(Model):
    """A source moves a mass against a damper."""

    source, mass = translational.Position(), translational.Mass(m=2.0)
    damper, wall = translational.Damper(d=3.0), translational.Fixed()

    def equations(self):
        yield from row(self.source, self.mass, self.damper, self.wall)


def test_a_position_source_tells_the_force_it_takes():
    found = simulate(Led(), stop=2.0, inputs={"source.s": lambda t: sin(4 * t)})
    t = found.time
    np.testing.assert_allclose(found["mass.v"], 4 * np.cos(4 * t), atol=1e-12)
    np.testing.assert_allclose(found["source.f"], -32 * np.sin(4 * t) + 12 * np.cos(4 * t), atol=1e-12)


class Driven(Led):
    """The same, moved by its speed."""

    source = translational.Speed()  # pyright: ignore[reportAssignmentType]


def test_the_position_under_a_speed_source_is_the_integral():
    inputs = {"source.v": lambda t: 4 * cos(4 * t)}
    found = simulate(Driven(source=dict(s=Fixed(0.5))), stop=2.0, inputs=inputs, tolerance=TOLERANCE)
    t = found.time
    np.testing.assert_allclose(found["mass.s"], 0.5 + np.sin(4 * t), atol=NEAR)
    np.testing.assert_allclose(found["source.f"], -32 * np.sin(4 * t) + 12 * np.cos(4 * t), atol=1e-12)
    # the start may stand at the mass as well, and is zero where nobody gives it
    assert simulate(Driven(mass=dict(s=Fixed(0.7))), stop=0.1, points=2)["source.s"][0] == 0.7
    assert simulate(Driven(), stop=0.1, points=2)["mass.s"][0] == 0.0


class Measured(Model):
    """A force pushes two masses, one after the other, past all sensors."""

    push, near, far = translational.Force(), translational.Mass(m=2.0), translational.Mass(m=3.0)
    spring = translational.Spring(c=40.0, s_rel0=0.5)
    force, position = translational.ForceSensor(), translational.PositionSensor()
    speed, relative = translational.SpeedSensor(), translational.RelativeSensor()

    def equations(self):
        yield from row(self.push, self.near, self.force, self.spring, self.far, self.position)
        yield connect(self.far.flange, self.speed.flange)
        yield connect(self.near.flange, self.relative.flange_a)
        yield connect(self.far.flange, self.relative.flange_b)


def test_sensors_measure_with_the_right_sign_and_disturb_nothing():
    found = simulate(
        Measured(), stop=1.0, inputs={"push.f": lambda t: 6 * sin(9 * t)}, tolerance=TOLERANCE, points=11
    )
    # what the sensor passes on from a to b moves the far mass
    np.testing.assert_allclose(found["force.f"], 3.0 * found["der(far.v)"], atol=1e-12)
    np.testing.assert_allclose(found["force.f"], -found["spring.f"], atol=1e-12)  # a push is no pull
    np.testing.assert_allclose(found["push.f"] - found["force.f"], 2.0 * found["der(near.v)"], atol=1e-12)
    np.testing.assert_array_equal(found["position.s"], found["far.s"])
    np.testing.assert_array_equal(found["speed.v"], found["far.v"])
    np.testing.assert_allclose(found["relative.s_rel"], found["far.s"] - found["near.s"], atol=1e-15)
    np.testing.assert_allclose(found["relative.v_rel"], found["far.v"] - found["near.v"], atol=1e-15)
    outputs = ("force.f", "position.s", "speed.v", "relative.s_rel", "relative.v_rel")
    assert translate(Measured()).outputs == outputs


# Two sources on one flange.
Twice = in_a_row("Twice", one=translational.Position(), other=translational.Fixed())


@pytest.mark.parametrize("source", [translational.Position, translational.Speed])
def test_a_flange_held_twice_is_explained(source):
    with pytest.raises(StructureError, match=r"Undetermined: one\.f \(something else holds this flange"):
        translate(Twice(one=source()))


def test_misused_sensors_are_explained():
    class Between(Model):
        push, sensor, wall = translational.Force(), translational.RelativeSensor(), translational.Fixed()

        def equations(self):
            yield from row(self.wall, self.sensor, self.push)

    Loose = in_a_row("Loose", push=translational.Force(), sensor=translational.PositionSensor())

    Bridged = in_a_row(
        "Bridged", left=translational.Fixed(), sensor=translational.ForceSensor(), right=translational.Fixed()
    )

    for model, words in (
        (Between(), r"sensor\.s_rel \(a relative sensor carries no force; connect it beside a component"),
        (Loose(), r"sensor\.s \(a sensor of position carries no force, so it holds nothing"),
        (Bridged(), r"sensor\.f \(both ends of the sensor are held, or it closes a rigid loop"),
    ):
        with pytest.raises(StructureError, match="Undetermined: " + words):
            translate(model)
