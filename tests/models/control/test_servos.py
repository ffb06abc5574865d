"""Servos of carts, the mass they move, and friction that gives before it slides."""

import re

import numpy as np
import pytest

from gantrytau import Model, ModelError, Parameter, Real, Samples, der, linearize, simulate, translate
from gantrytau.mechanics.translational import Position
from gantrytau_models import CartServo, GantryTau, PreslidingFriction, cart_servos, prototypes
from gantrytau_models.control.servos import moved_masses
from gantrytau_models.mechanisms.flexible import unstretched
from tests.mechanisms.rows import in_a_row

RECORD = prototypes.L1_flexible
PLACE = np.array([0.9, 2.7, -0.7])


def test_moved_masses_are_those_of_the_rigid_robot():
    names = [f"carts[{k}].s" for k in range(3)]
    dae = translate(GantryTau(RECORD, friction=None, tool=dict(r=dict(start=PLACE.tolist()))))
    motion = [*names, *(f"der({n})" for n in names), *(f"der(der({n}))" for n in names)]
    forces = dae.function(motion, [f"carts[{k}].f" for k in range(3)])
    still = [*unstretched(RECORD, PLACE), 0, 0, 0]
    at_rest = np.array(forces(*still, 0, 0, 0)).ravel()
    pushed = np.array([np.array(forces(*still, *a)).ravel() - at_rest for a in np.eye(3)])
    assert moved_masses(RECORD, PLACE) == pytest.approx(np.diag(pushed), rel=1e-9)  # of one cart, others held
    gains = [servo.modifications["k_v"] for servo in cart_servos(RECORD, bandwidth=300.0)]
    assert gains == pytest.approx(300 * moved_masses(RECORD, PLACE), rel=1e-12)


class Served(Model):
    """A cart without friction under its servo."""

    m = Parameter(80.0, unit="kg", description="mass")
    s = Real(unit="m", description="position")
    v = Real(unit="m/s", description="speed")
    servo = CartServo(k_v=300 * 80.0)

    def equations(self):
        yield self.v == der(self.s)
        yield self.m * der(self.v) == self.servo.f
        yield self.servo.q == self.s
        yield self.servo.v == self.v


def test_the_slow_pole_of_a_servo_is_that_of_its_position():
    linear = linearize(Served())
    slow = max(np.abs(linear.poles))
    # exactly, the loop of the speed moves it: (s^2 + w s + w / T_i) s + w k_p (s + 1 / T_i) = 0
    exact = np.roots([1, 300, 300 / 0.012 + 300 * 9.0, 300 * 9.0 / 0.012])
    assert slow == pytest.approx(np.exp(exact.real.max() * 0.004), rel=1e-9)
    assert slow == pytest.approx(np.exp(-9.0 * 0.004), abs=3e-4)


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_references_act_a_whole_number_of_samples_later(delay):
    t = 0.004 * np.arange(40)
    step = Samples(t, np.where(t >= 0.04, 1e-3, 0.0), kind="constant")
    served = simulate(
        Served(servo=dict(delay=delay)), stop=t[-1], inputs={"servo.q_ref": step}, points=40 * 8 - 7
    )
    begins = served.time[np.argmax(np.abs(served["s"]) > 0) - 1]
    assert begins == pytest.approx(0.04 + delay * 0.004, abs=1e-12)


def test_a_speed_fed_forward_and_a_force_act_as_they_say():
    t = 0.004 * np.arange(250)
    ramp = Samples(t, 0.1 * t, kind="constant")
    speed = Samples(t, np.full(250, 0.1), kind="constant")
    lags = []
    for share in (0.0, 0.95, 1.0):
        served = simulate(
            Served(servo=dict(k_ff=share)), stop=t[-1], inputs={"servo.q_ref": ramp, "servo.v_ref": speed}
        )
        lags.append(served["servo.q_seen[3]"][-1] - served["s"][-1])
    # the integral leaves (1 - k_ff) v / k_p; the reference is held, half a period on average
    assert np.array(lags) - lags[2] == pytest.approx(np.array([1.0, 0.05, 0.0]) * 0.1 / 9.0, abs=2e-6)
    pushed = simulate(Served(), stop=0.001, inputs={"servo.q_ref": 0.0, "servo.f_ff": 40.0}, points=11)
    assert pushed["der(v)"][0] == pytest.approx(40.0 / 80.0, rel=1e-12)


# Friction that is moved.
Rubbed = in_a_row("Rubbed", moved=Position(), law=PreslidingFriction(f_c=100.0, f_v=20.0, x=30e-6))


@pytest.mark.parametrize(("level", "z_0"), [(1.0, 0.0), (0.9, 18e-6), (1.1, -29e-6)])
def test_friction_gives_from_where_it_was_left_and_then_slides(level, z_0):
    inputs = {"law.level": level, "law.z_0": z_0, "moved.s": lambda t: 1e-3 * t}
    run = simulate(Rubbed(), stop=0.3, inputs=inputs, tolerance=1e-9)
    z = 30e-6 + (z_0 - 30e-6) * np.exp(-1e-3 * run.time / 30e-6)  # Dahl's law along one way
    assert run["law.f"] == pytest.approx(level * 100.0 * z / 30e-6 + 20.0 * 1e-3, abs=1e-4)
    assert run.final("law.f") == pytest.approx(level * 100.0 + 0.02, abs=0.01)  # e^-10 of it is left


def wrong(words: str):
    return pytest.raises(ModelError, match=re.escape(words))


def test_wrong_servos_are_told():
    with wrong("CartServo: found delay=1.5, expected a whole number"):
        translate(CartServo(delay=1.5), events=True)
    for poles in ((0.9, 0.9), (0.9, 0.9, 1.0)):
        with wrong(f"cart_servos: found poles={list(poles)}, expected 3 numbers between 0 and 1"):
            cart_servos(RECORD, poles=poles)
    with wrong(
        "law (PreslidingFriction): found law.x = 0; expected a way x above zero; take TanhFriction for none"
    ):
        translate(Rubbed(law=dict(x=0.0)))
    with wrong("does not reach"):
        cart_servos(RECORD, r=(0.9, 9.0, -0.7))
