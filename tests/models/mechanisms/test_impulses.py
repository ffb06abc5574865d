"""The flexible robot under its servos, hit at the plate: resonances beside Dressler (2012), Table 6.4.

Printed are the lowest resonances, in Hz, for forces along x and y: x -> x 7.4; x -> y 11.4 to 11.9, then 7.3 to 7.5;
y -> x 10.4 to 10.7; y -> y 11.4 to 11.5. The record has 10.3 and 12.2 Hz with carts and frame locked, as its path errors
say (Table 7.2): a pair that is wider than the printed one, about the same middle. Servos soften the lower one by 0.3 Hz.
"""

from functools import cache

import numpy as np
import pytest
from scipy.signal import find_peaks

from gantrytau import (
    Array,
    Input,
    Model,
    Output,
    Parameter,
    Real,
    connect,
    der,
    linearize,
    simulate,
    translate,
)
from gantrytau.mechanics.multibody import WorldForce
from gantrytau.mechanics.translational import DahlFriction
from gantrytau_models import FlexibleGantryTau, prototypes
from gantrytau_models.mechanisms.flexible import unstretched

RECORD = prototypes.L1_flexible
PLACE = (0.9, 2.7, -0.7)
POLES = (0.9647, 0.9656, 0.9728)  # (6.11), every 4 ms
MASSES = (88.0, 63.0, 79.0)  # kg, moved by each actuator
PRESLIDING = 30e-6  # m, way before a cart slides
PERIOD, LENGTH = 0.004, 2.4  # s
RINGING = 150  # samples after which only what is hardly damped is left, 0.6 s
LOW, HIGH = 4.0, 20.0  # Hz


class HoldingServo(Model):
    """Position P around speed PI, as (6.11) demands of a servo, at a reference that rests."""

    k_p = Parameter(unit="1/s", description="gain of the position")
    k_v = Parameter(unit="kg/s", description="gain of the speed")
    T_i = Parameter(0.012, unit="s", description="integral time of the speed")
    q_ref = Parameter(unit="m", description="reference")
    q = Input(unit="m", description="measured position")
    v = Input(unit="m/s", start=0.0, description="measured speed")
    f = Output(unit="N", description="force of the actuator")
    integral = Real(unit="m", start=0.0, fixed=True, description="integral of the error of the speed")

    def equations(self):
        e = self.k_p * (self.q_ref - self.q) - self.v
        yield der(self.integral) == e
        yield self.f == self.k_v * (e + self.integral / self.T_i)


class Struck(Model):
    """The robot, its servos, and a force at the plate."""

    f = Input(3, unit="N", start=0.0, description="force at the plate")
    robot = FlexibleGantryTau(
        RECORD,
        r=PLACE,
        friction=DahlFriction,
        carts=[dict(law=dict(sigma_0=f_c / PRESLIDING)) for f_c in np.array(RECORD.coulomb)],
    )
    force = WorldForce()
    servos = Array(
        HoldingServo,
        [
            HoldingServo(k_p=-np.log(a) / PERIOD, k_v=300.0 * mass, q_ref=s)
            for a, mass, s in zip(POLES, MASSES, unstretched(RECORD, np.array(PLACE)), strict=True)
        ],
    )

    def equations(self):
        yield connect(self.force.frame_b, self.robot.tool.frame)
        yield self.force.f == self.f
        for cart, servo in zip(self.robot.carts, self.servos, strict=True):
            yield servo.q == cart.s
            yield servo.v == cart.v
            yield cart.f == servo.f


@cache
def at_rest():
    """The model, and values of its states when the weight hangs on the servos."""
    model = translate(Struck())
    states = linearize(model).states
    settled = simulate(model, stop=5.0, points=2)
    return model, {name: settled.final(name) for name in states}


@cache
def hit(axis, newtons):
    """Motion of the wrist (N, 3) after a hit of 12 ms along an axis, every 4 ms, and the largest way of a cart, in m."""
    model, starts = at_rest()
    edges = np.array([0.0, 1e-4, 0.012, 0.0121, LENGTH])
    force = np.zeros((5, 3))
    force[1:3, axis] = newtons
    names = ["robot.gauge.r", *(f"robot.carts[{k}].s" for k in range(3))]
    points = round(LENGTH / PERIOD) + 1
    run = simulate(
        model,
        stop=LENGTH,
        inputs={"f": (edges, force)},
        starts=starts,
        outputs=names,
        points=points,
        tolerance=1e-6,
    )
    t = np.arange(0.016, LENGTH, PERIOD)
    way = max(float(np.ptp(run[name])) for name in names[1:])
    return run.at(t, "robot.gauge.r") - run.at(0.0, "robot.gauge.r"), way


def peaks(y):
    """Resonances in Hz that a motion shows, the strongest first, and their gains beside it."""
    hertz = np.fft.rfftfreq(2**15, PERIOD)
    gain = np.abs(np.fft.rfft(y - y.mean(), 2**15))
    found, _ = find_peaks(np.where((hertz > LOW) & (hertz < HIGH), gain, 0.0), prominence=0.01 * gain.max())
    found = found[np.argsort(-gain[found])]
    return hertz[found], gain[found] / gain[found[0]]


def test_a_light_hit_rings_at_the_poles_of_the_linear_model():
    """Two routes: carts stick, so that friction is a spring of f_c / 30 um."""
    model, starts = at_rest()
    linear = linearize(model, at=starts)
    near = (linear.eigenfrequencies > LOW) & (linear.eigenfrequencies < HIGH)
    frame, lower, upper = linear.eigenfrequencies[near][::2]
    along_x, along_y = (hit(axis, 200.0)[0][:, axis] for axis in (0, 1))
    # peaks of motions that decay and overlap lie beside the poles: damping of 5 % and a neighbour of a quarter to a half
    assert peaks(along_x)[0][:2] == pytest.approx([lower, frame], rel=0.02)
    assert peaks(along_y)[0][:2] == pytest.approx([lower, upper], rel=0.02)


@pytest.mark.parametrize("newtons", [200.0, 2000.0])
def test_forces_along_x_sway_the_frame(newtons):
    """Table 6.4: 7.4 Hz in x -> x, 7.3 to 7.5 Hz at last in x -> y."""
    motion, _ = hit(0, newtons)
    for measured, printed in ((0, (7.4, 7.4)), (1, (7.3, 7.5))):
        found, gains = peaks(motion[RINGING:, measured])
        lowest = np.argmin(found)
        assert printed[0] - 0.1 < found[lowest] < printed[1] + 0.1
        assert gains[lowest] > 0.3
    assert peaks(motion[:, 1])[0][0] > 9.5  # x -> y begins with the arms, printed 11.4 to 11.9


def test_a_hard_hit_along_x_ends_in_the_sway_alone():
    assert peaks(hit(0, 2000.0)[0][RINGING:, 0])[0][0] == pytest.approx(7.4, abs=0.1)


@pytest.mark.parametrize("newtons", [200.0, 2000.0])
def test_forces_along_y_ring_the_arms(newtons):
    """Table 6.4 has 10.4 to 10.7 Hz in y -> x and 11.4 to 11.5 Hz in y -> y.

    The record gives 10.0 Hz in both, and 12.0 Hz beside it in y -> y: too low by 0.4 and 1.4 Hz. The printed values lie
    between its pair, about 11 Hz as they do.
    """
    motion, _ = hit(1, newtons)
    assert peaks(motion[:, 0])[0][0] == pytest.approx(10.0, abs=0.2)
    lower, upper = peaks(motion[:, 1])[0][:2]
    assert lower == pytest.approx(10.0, abs=0.2)
    assert upper == pytest.approx(12.1, abs=0.2)
    assert lower < 10.4 < 11.5 < upper
    assert (lower + upper) / 2 == pytest.approx((10.55 + 11.45) / 2, abs=0.15)


def test_hard_hits_break_carts_loose_and_soften_what_rings():
    (light, small), (hard, large) = hit(1, 200.0), hit(1, 2000.0)
    assert small < 3 * PRESLIDING
    assert large > 20 * small  # not in proportion
    first = slice(0, 75)  # 0.3 s, while carts slide
    assert peaks(hard[first, 1])[0][0] < peaks(light[first, 1])[0][0] - 0.3
