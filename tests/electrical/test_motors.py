"""The DC motor: speeds and currents of its data sheet, its poles, its balance of energy, its work on a ball screw."""

import numpy as np
import pytest

from gantrytau import Fixed, Model, Real, connect, der, linearize, simulate, sin, translate
from gantrytau.electrical import DcMotor, Ground, VoltageSource
from gantrytau.mechanics import gears, rotational, translational
from tests.mechanisms.rows import row

TOLERANCE = 1e-10
NEAR = 1e3 * TOLERANCE  # the integrator holds its tolerance per step; over some time constants errors add up
R, L, K, J, D = 0.8, 2e-3, 0.06, 1.5e-4, 2e-5


class Drive(Model):
    """A motor on a source of voltage."""

    source, ground = VoltageSource(), Ground()
    motor = DcMotor(R=R, L=L, k=K, J=J, friction=dict(tau_v=D))

    def equations(self):
        yield connect(self.source.pin_a, self.motor.pin_a)
        yield connect(self.source.pin_b, self.motor.pin_b)
        yield connect(self.source.pin_b, self.ground.pin)


def poles(R=R, L=L, K=K, J=J, D=D):
    return np.sort_complex(np.roots([L * J, R * J + L * D, R * D + K**2]))


def test_a_motor_without_load_runs_up_to_its_speed():
    motor = dict(friction=dict(tau_v=0.0), i=Fixed(0.0), rotor=dict(w=Fixed(0.0)))
    found = simulate(Drive(motor=motor), stop=1.0, inputs={"source.v": 12.0}, tolerance=TOLERANCE)
    assert found.final("motor.rotor.w") == pytest.approx(12.0 / K, rel=1e-8)
    assert found.final("motor.i") == pytest.approx(0.0, abs=1e-6)
    # both poles are real: w = w0 (1 - (p2 e^(p1 t) - p1 e^(p2 t)) / (p2 - p1))
    first, second = np.real(poles(D=0.0))
    modes = (second * np.exp(first * found.time) - first * np.exp(second * found.time)) / (second - first)
    np.testing.assert_allclose(found["motor.rotor.w"], 12.0 / K * (1 - modes), atol=12.0 / K * NEAR)


def test_a_motor_that_is_held_draws_its_stall_current():
    class Held(Drive):
        wall = rotational.Fixed()

        def equations(self):
            yield from super().equations()
            yield connect(self.motor.flange, self.wall.flange)

    found = simulate(
        Held(motor=dict(i=Fixed(0.0))), stop=0.05, inputs={"source.v": 12.0}, tolerance=TOLERANCE
    )
    np.testing.assert_allclose(found["motor.i"], 12.0 / R * (1 - np.exp(-found.time * R / L)), atol=15 * NEAR)
    np.testing.assert_allclose(found["wall.flange.tau"], K * found["motor.i"], rtol=1e-12)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])  # of the inductance: apart, close, a pair
def test_the_poles_are_those_of_winding_and_rotor(scale):
    model = Drive(motor=dict(L=L * scale))
    found = linearize(model, inputs=["source.v"], outputs=["motor.rotor.w"])
    moving = found.poles[np.abs(found.poles) > 1e-9]  # the angle is an integral
    np.testing.assert_allclose(np.sort_complex(moving), poles(L=L * scale), rtol=1e-9)


def test_time_constants_far_apart_are_the_electrical_and_the_mechanical():
    found = linearize(Drive(motor=dict(L=1e-7)), inputs=["source.v"], outputs=["motor.rotor.w"])
    slow, fast = np.sort(np.abs(found.poles[np.abs(found.poles) > 1e-9]))
    assert fast == pytest.approx(R / 1e-7, rel=1e-4)  # L / R
    assert slow == pytest.approx((K**2 + R * D) / (R * J), rel=1e-4)  # R J / k^2, and a little friction


def test_electrical_work_becomes_heat_motion_and_field():
    class Balanced(Drive):
        delivered = Real(unit="J", description="from the source", start=0.0, fixed=True)
        lost = Real(unit="J", description="in winding and bearings", start=0.0, fixed=True)

        def equations(self):
            yield from super().equations()
            yield der(self.delivered) == self.source.v * self.source.i
            yield (
                der(self.lost)
                == self.motor.resistor.v * self.motor.i + self.motor.friction.tau * self.motor.friction.w
            )

    start = dict(i=Fixed(0.0), rotor=dict(w=Fixed(0.0)))
    wave = {"source.v": lambda t: 12 * sin(40 * t)}
    found = simulate(Balanced(motor=start), stop=1.0, inputs=wave, tolerance=TOLERANCE)
    stored = L * found["motor.i"] ** 2 / 2 + J * found["motor.rotor.w"] ** 2 / 2
    assert np.max(stored) > 1.0  # J
    np.testing.assert_allclose(
        found["delivered"], found["lost"] + stored, atol=NEAR * np.max(found["delivered"])
    )


class Axis(Model):
    """A motor moves a carriage through a ball screw."""

    source, ground = VoltageSource(), Ground()
    motor = DcMotor(R=R, L=L, k=K, J=J)
    screw = gears.BallScrew(lead=0.01)
    carriage = translational.Mass(m=20.0)

    def equations(self):
        yield connect(self.source.pin_a, self.motor.pin_a)
        yield connect(self.source.pin_b, self.motor.pin_b)
        yield connect(self.source.pin_b, self.ground.pin)
        yield from row(self.motor.flange, self.screw, self.carriage)


def test_a_carriage_on_a_ball_screw_is_an_inertia_on_the_shaft():
    dae = translate(Axis())
    assert len(dae.states) == 3
    reflected = J + 20.0 * (0.01 / (2 * np.pi)) ** 2
    found = linearize(dae, inputs=["source.v"], outputs=["carriage.v"])
    moving = found.poles[np.abs(found.poles) > 1e-9]
    np.testing.assert_allclose(np.sort_complex(moving), poles(J=reflected, D=0.0), rtol=1e-9)
    speed = simulate(dae, stop=2.0, inputs={"source.v": 24.0}).final("carriage.v")
    assert speed == pytest.approx(24.0 / K * 0.01 / (2 * np.pi), rel=1e-6)


def test_sticking_friction_takes_the_place_of_the_smooth_one():
    sticking = rotational.StickSlipFriction(tau_c=0.01)
    model = type("Sticking", (Drive,), {"motor": DcMotor(R=R, L=L, k=K, J=J, friction=sticking)})()
    assert any("friction" in name for name in translate(model, events=True).known)
