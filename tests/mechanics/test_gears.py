"""Gears: kinematics, reflected inertia, and the power that enters and leaves."""

import numpy as np
import pytest

from gantrytau import Fixed, Model, StructureError, simulate, sin, translate
from gantrytau.mechanics import gears, rotational, translational
from tests.mechanisms.rows import in_a_row, row

TOLERANCE = 1e-10
NEAR = 1e3 * TOLERANCE  # the integrator holds its tolerance per step; over some seconds errors add up


class Turning(Model):
    """A motor turns a rotor, and through a gear a load that a damper holds back."""

    motor = rotational.Torque()
    rotor, load = rotational.Inertia(J=0.1), rotational.Inertia(J=2.0)
    gear = gears.IdealGear(ratio=-5.0)
    damper, wall = rotational.Damper(d=4.0), rotational.Fixed()

    def equations(self):
        yield from row(self.motor, self.rotor, self.gear, self.load, self.damper, self.wall)


# A motor turns a rotor, which moves a mass through a gear against a spring.
Sliding = in_a_row(
    "Sliding",
    motor=rotational.Torque(),
    rotor=rotational.Inertia(J=0.02),
    gear=gears.RackAndPinion(radius=0.05),
    mass=translational.Mass(m=8.0),
    spring=translational.Spring(c=500.0),
    wall=translational.Fixed(),
)


SLIDING = {
    "rack": (gears.RackAndPinion(radius=0.05), 0.05),
    "reversed rack": (gears.RackAndPinion(radius=-0.05), -0.05),
    "ball screw": (gears.BallScrew(lead=0.02), 0.02 / (2 * np.pi)),
}


def test_a_gear_adds_the_inertia_of_the_rotor_times_its_ratio_squared():
    dae = translate(Turning())
    assert len(dae.states) == 2
    forward = dae.function(["load.w", "motor.tau"], ["der(load.w)", "rotor.w"])
    acceleration, speed = (float(x) for x in forward(0.5, 3.0))
    assert acceleration == pytest.approx((-5 * 3.0 - 4.0 * 0.5) / (2.0 + 25 * 0.1), rel=1e-14)
    assert speed == -2.5


def test_power_that_enters_a_gear_leaves_it():
    found = simulate(Turning(), stop=2.0, inputs={"motor.tau": lambda t: 3 * sin(5 * t)}, tolerance=TOLERANCE)
    enters = found["gear.flange_a.tau"] * found["rotor.w"]
    leaves = found["gear.flange_b.tau"] * found["load.w"]
    assert np.ptp(enters) > 0.1  # W
    np.testing.assert_allclose(leaves, -enters, atol=1e-13 * np.ptp(enters))  # some hundred roundings


@pytest.mark.parametrize("kind", SLIDING)
def test_power_that_enters_as_rotation_leaves_as_translation(kind):
    gear, travel = SLIDING[kind]
    found = simulate(
        Sliding(gear=gear), stop=2.0, inputs={"motor.tau": lambda t: 3 * sin(5 * t)}, tolerance=TOLERANCE
    )
    np.testing.assert_allclose(found["mass.s"], travel * found["rotor.phi"], atol=1e-14)
    np.testing.assert_allclose(found["mass.v"], travel * found["rotor.w"], atol=1e-14)
    enters = found["gear.flange_a.tau"] * found["rotor.w"]
    leaves = found["gear.flange_b.f"] * found["mass.v"]
    assert np.ptp(enters) > 0.1  # W
    np.testing.assert_allclose(leaves, -enters, atol=1e-13 * np.ptp(enters))  # some hundred roundings


@pytest.mark.parametrize("kind", SLIDING)
def test_rotor_and_mass_swing_as_one_on_the_spring(kind):
    gear, travel = SLIDING[kind]
    found = simulate(Sliding(gear=gear, mass=dict(s=Fixed(0.1), v=Fixed(0.0))), stop=2.0, tolerance=TOLERANCE)
    w = np.sqrt(500.0 / (8.0 + 0.02 / travel**2))
    np.testing.assert_allclose(found["mass.s"], 0.1 * np.cos(w * found.time), atol=NEAR)


def test_a_cyclic_rack_loses_no_power_and_repeats_with_its_pitch():
    rack = gears.CyclicRack(pitch=0.02, cosine=3e-4, sine=-5e-4)  # slope from 0.82 to 1.18
    Slide = in_a_row("Slide", motor=translational.Position(), rack=rack, load=translational.Force())
    dae = translate(Slide())
    s, step = np.linspace(-0.02, 0.02, 9), 1e-6
    told = [dae.evaluate({"motor.s": x, "load.f": -100.0}) for x in s]
    cart = np.array([at["load.flange.s"] for at in told])
    np.testing.assert_allclose(cart[4:] - cart[:5], 0.02, atol=1e-15)
    assert cart[4] == pytest.approx(3e-4)  # the cosine, at 0
    ahead = np.array([dae.evaluate({"motor.s": x + step})["load.flange.s"] for x in s])
    # virtual work: the motor holds what the load pulls times ds_b/ds_a; differences to step * 2nd derivative, 0.05
    np.testing.assert_allclose([at["motor.f"] for at in told], 100.0 * (ahead - cart) / step, rtol=1e-4)


def test_one_turn_of_a_ball_screw_is_its_lead():
    at = translate(Sliding(gear=gears.BallScrew(lead=0.02))).evaluate({"rotor.phi": 2 * np.pi})
    assert at["mass.s"] == pytest.approx(0.02, rel=1e-15)


def test_a_ball_screw_holds_a_load_with_little_torque():
    Press = in_a_row(
        "Press", motor=rotational.Position(), screw=gears.BallScrew(lead=0.01), load=translational.Force()
    )

    at = translate(Press()).evaluate({"load.f": -2000.0, "motor.phi": 0.3})
    assert at["motor.tau"] == pytest.approx(2000.0 * 0.01 / (2 * np.pi), rel=1e-14)


def test_an_axis_with_a_ball_screw_speeds_up_evenly():
    class Axis(Model):  # as in the README of the folder
        motor, rotor = rotational.Torque(), rotational.Inertia(J=2e-4)
        screw, slide = gears.BallScrew(lead=0.01), translational.Mass(m=12.0)

        def equations(self):
            yield from row(self.motor, self.rotor, self.screw, self.slide)

    found = simulate(Axis(), stop=1.0, inputs={"motor.tau": 0.1}, tolerance=TOLERANCE)
    turn = 2 * np.pi / 0.01
    np.testing.assert_allclose(found["slide.v"], 0.1 * turn / (12.0 + 2e-4 * turn**2) * found.time, atol=NEAR)


# A motor led along a motion, an elastic gear, a load.
Elastic = in_a_row(
    "Elastic",
    motor=rotational.Position(),
    gear=gears.ElasticGear(ratio=10.0, c=50.0, d=0.0),
    load=rotational.Inertia(J=2.0),
)


def test_a_load_swings_behind_an_elastic_gear():
    start = dict(phi=Fixed(0.2), w=Fixed(0.0))
    found = simulate(Elastic(load=start), stop=2.0, tolerance=TOLERANCE)
    np.testing.assert_allclose(found["load.phi"], 0.2 * np.cos(5.0 * found.time), atol=NEAR)
    # the motor holds a tenth of the torque of the spring
    np.testing.assert_allclose(found["motor.tau"], -50.0 * found["load.phi"] / 10.0, atol=NEAR)


def test_an_elastic_gear_loses_only_what_its_damper_takes():
    start = dict(phi=Fixed(0.2), w=Fixed(0.0))
    found = simulate(
        Elastic(load=start, gear=dict(d=3.0)),
        stop=2.0,
        inputs={"motor.phi": lambda t: sin(8 * t)},
        tolerance=TOLERANCE,
        points=2001,
    )
    energy = found["load.w"] ** 2 + 25.0 * found["gear.shaft.phi_rel"] ** 2
    power = found["motor.tau"] * 8 * np.cos(8 * found.time) - 3.0 * found["gear.shaft.w_rel"] ** 2
    h = found.time[1]
    work = h / 3 * (power[0] + 4 * power[1:-1:2].sum() + 2 * power[2:-1:2].sum() + power[-1])  # Simpson
    assert energy[-1] - energy[0] == pytest.approx(work, abs=1e-7)


def test_a_gear_held_at_both_ends_is_refused():
    class Held(Model):
        gear, left, right = gears.IdealGear(ratio=3.0), rotational.Fixed(), rotational.Fixed()

        def equations(self):
            yield from row(self.left, self.gear, self.right)

    with pytest.raises(StructureError, match=r"Undetermined: gear\.flange_a\.tau"):
        translate(Held())
