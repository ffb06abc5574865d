"""Components along and about one axis against closed solutions; signs of sources, springs, friction and sensors."""

from typing import Any

import numpy as np
import pytest

from gantrytau import Fixed, Model, StructureError, connect, cos, simulate, sin, translate
from tests.mechanisms.axes import ABOUT, ALONG
from tests.mechanisms.rows import in_a_row, row

TOLERANCE = 1e-10
NEAR = 1e3 * TOLERANCE  # the integrator holds its tolerance per step; over some seconds errors add up

pytestmark = pytest.mark.parametrize("a", [ALONG, ABOUT], ids=["along", "about"])


def swinging(a, **parameters):
    """A mass on a spring and damper at a wall."""
    link = a.part("SpringDamper", **dict(c=50.0, d=0.0, s_rel0=0.4) | parameters)
    return in_a_row("Swinging", wall=a.part("Fixed", s=0.3), link=link, mass=a.mass(2.0, 1.0, 0.0))()


def slowed(a, friction):
    """A mass that slides against friction."""
    return in_a_row("Slowed", mass=a.mass(2.0, 0.0, 3.0), friction=friction)()


def led(a, source):
    """A source moves a mass against a damper."""
    parts = dict(mass=a.mass(2.0), damper=a.part("Damper", d=3.0), wall=a.part("Fixed"))
    return in_a_row("Led", source=source, **parts)


def test_a_mass_on_a_spring_swings_with_the_root_of_c_over_m(a):
    found = simulate(swinging(a), stop=3.0, tolerance=TOLERANCE)
    # at rest at the wall plus the length without force, 0.7
    np.testing.assert_allclose(found[f"mass.{a.s}"], 0.7 + 0.3 * np.cos(5.0 * found.time), atol=NEAR)
    pulled = 50.0 * (found[f"mass.{a.s}"] - 0.7)
    np.testing.assert_allclose(found[f"link.{a.f}"], pulled, atol=10 * NEAR)


def test_a_damped_swing_decays_with_d_over_2m(a):
    found = simulate(swinging(a, d=4.0), stop=3.0, tolerance=TOLERANCE)
    decay, t = 4.0 / (2 * 2.0), found.time
    w = np.sqrt(25.0 - decay**2)
    expected = 0.7 + 0.3 * np.exp(-decay * t) * (np.cos(w * t) + decay / w * np.sin(w * t))
    np.testing.assert_allclose(found[f"mass.{a.s}"], expected, atol=NEAR)


def test_a_spring_damper_is_a_spring_beside_a_damper(a):
    class Apart(Model):
        wall, mass = a.part("Fixed", s=0.3), a.mass(2.0, 1.0, 0.0)
        spring, damper = a.part("Spring", c=50.0, s_rel0=0.4), a.part("Damper", d=4.0)

        def equations(self):
            for one in (self.spring, self.damper):
                yield from row(self.wall, one, self.mass)

    together = simulate(swinging(a, d=4.0), stop=2.0, tolerance=TOLERANCE)
    apart = simulate(Apart(), stop=2.0, tolerance=TOLERANCE)
    np.testing.assert_allclose(together[f"mass.{a.s}"], apart[f"mass.{a.s}"], atol=NEAR)
    both = apart[f"spring.{a.f}"] + apart[f"damper.{a.f}"]
    np.testing.assert_allclose(together[f"link.{a.f}"], both, atol=50 * NEAR)


def test_coulomb_friction_slows_evenly_and_viscous_friction_in_proportion(a):
    v = f"mass.{a.v}"
    found = simulate(slowed(a, a.part("TanhFriction", f_c=4.0, f_v=0.0)), stop=1.0, tolerance=TOLERANCE)
    # at 1 and more, 20 smoothing speeds, tanh is one to 1e-17
    np.testing.assert_allclose(found[v], 3.0 - 2.0 * found.time, atol=NEAR)
    found = simulate(slowed(a, a.part("TanhFriction", f_c=0.0, f_v=5.0)), stop=1.0, tolerance=TOLERANCE)
    np.testing.assert_allclose(found[v], 3.0 * np.exp(-2.5 * found.time), atol=NEAR)
    np.testing.assert_allclose(found[f"friction.{a.f}"], 5.0 * found[v], atol=NEAR)
    found = simulate(slowed(a, a.part("Frictionless")), stop=1.0, tolerance=TOLERANCE)
    np.testing.assert_allclose(found[v], 3.0, rtol=1e-14)


@pytest.mark.parametrize(("law", "at_v_s"), [("TanhFriction", np.tanh(1.0)), ("LinearFriction", 1.0)])
def test_friction_opposes_the_speed_on_both_sides(a, law, at_v_s):
    dae = translate(slowed(a, a.part(law, f_c=4.0, f_v=5.0, v_s=0.1)))
    force = dae.function([f"mass.{a.v}"], [f"friction.{a.f}"])
    for v, smoothed in ((0.0, 0.0), (0.05, None), (0.1, at_v_s), (10.0, 1.0)):
        if smoothed is not None:
            assert float(force(v)) == pytest.approx(4.0 * smoothed + 5.0 * v, rel=1e-14)
        assert float(force(-v)) == -float(force(v))


def test_a_position_source_tells_the_force_it_takes(a):
    found = simulate(led(a, a.part("Position"))(), stop=2.0, inputs={f"source.{a.s}": lambda t: sin(4 * t)})
    t = found.time
    np.testing.assert_allclose(found[f"mass.{a.v}"], 4 * np.cos(4 * t), atol=1e-12)
    expected = -32 * np.sin(4 * t) + 12 * np.cos(4 * t)
    np.testing.assert_allclose(found[f"source.{a.f}"], expected, atol=1e-12)


def test_the_position_under_a_speed_source_is_the_integral(a):
    inputs, driven = {f"source.{a.v}": lambda t: 4 * cos(4 * t)}, led(a, a.part("Speed"))
    begun = driven(source={a.s: Fixed(0.5)})
    found = simulate(begun, stop=2.0, inputs=inputs, tolerance=TOLERANCE)
    t = found.time
    np.testing.assert_allclose(found[f"mass.{a.s}"], 0.5 + np.sin(4 * t), atol=NEAR)
    expected = -32 * np.sin(4 * t) + 12 * np.cos(4 * t)
    np.testing.assert_allclose(found[f"source.{a.f}"], expected, atol=1e-12)
    # the start may stand at the mass as well, and is zero where nobody gives it
    assert simulate(driven(mass={a.s: Fixed(0.7)}), stop=0.1, points=2)[f"source.{a.s}"][0] == 0.7
    assert simulate(driven(), stop=0.1, points=2)[f"mass.{a.s}"][0] == 0.0


def test_sensors_measure_with_the_right_sign_and_disturb_nothing(a):
    class Measured(Model):
        """A force pushes two masses, one after the other, past all sensors."""

        push, near, far = a.part("{force}"), a.mass(2.0), a.mass(3.0)
        spring = a.part("Spring", c=40.0, s_rel0=0.5)
        force, position = a.part("{force}Sensor"), a.part("{position}Sensor")
        speed, relative = a.part("SpeedSensor"), a.part("RelativeSensor")

        def equations(self):
            yield from row(self.push, self.near, self.force, self.spring, self.far, self.position)
            yield from row(self.far, self.speed)
            yield connect(self.position.flange, self.relative.flange_b)
            yield connect(self.push.flange, self.relative.flange_a)

    s, v, f = a.s, a.v, a.f
    inputs: Any = {f"push.{f}": lambda t: 6 * sin(9 * t)}
    found = simulate(Measured(), stop=1.0, inputs=inputs, tolerance=TOLERANCE, points=11)
    # what the sensor passes on from a to b moves the far mass
    force = found[f"force.{f}"]
    np.testing.assert_allclose(force, 3.0 * found[f"der(far.{v})"], atol=1e-12)
    np.testing.assert_allclose(force, -found[f"spring.{f}"], atol=1e-12)  # a push is no pull
    np.testing.assert_allclose(found[f"push.{f}"] - force, 2.0 * found[f"der(near.{v})"], atol=1e-12)
    np.testing.assert_array_equal(found[f"position.{s}"], found[f"far.{s}"])
    np.testing.assert_array_equal(found[f"speed.{v}"], found[f"far.{v}"])
    for one in (s, v):
        apart = found[f"far.{one}"] - found[f"near.{one}"]
        np.testing.assert_allclose(found[f"relative.{one}_rel"], apart, atol=1e-15)
    outputs = (f"force.{f}", f"position.{s}", f"speed.{v}", f"relative.{s}_rel", f"relative.{v}_rel")
    assert translate(Measured()).outputs == outputs


@pytest.mark.parametrize("source", ["Position", "Speed"])
def test_a_flange_held_twice_is_explained(a, source):
    twice = in_a_row("Twice", one=a.part(source), other=a.part("Fixed"))
    with pytest.raises(StructureError, match=rf"Undetermined: one\.{a.f} \(something else holds this flange"):
        translate(twice())


def test_misused_sensors_are_explained(a):
    push, wall = a.part("{force}"), a.part("Fixed")
    between = in_a_row("Between", wall=wall, sensor=a.part("RelativeSensor"), push=push)
    loose = in_a_row("Loose", push=push, sensor=a.part("{position}Sensor"))
    bridged = in_a_row("Bridged", left=wall, sensor=a.part("{force}Sensor"), right=a.part("Fixed"))
    force, position = a.force.lower(), a.position.lower()
    for model, words in (
        (
            between,
            rf"sensor\.{a.s}_rel \(a relative sensor carries no {force}; connect it beside a component",
        ),
        (loose, rf"sensor\.{a.s} \(a sensor of {position} carries no {force}, so it holds nothing"),
        (bridged, rf"sensor\.{a.f} \(both ends of the sensor are held, or it closes a rigid loop"),
    ):
        with pytest.raises(StructureError, match="Undetermined: " + words):
            translate(model())
