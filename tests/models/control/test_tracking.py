"""The controlled robot on a circle: what feedforward and control are worth."""

from functools import cache

import casadi as ca
import numpy as np
import pytest

from gantrytau import Real, simulate, translate
from gantrytau_models import (
    CascadedController,
    CircularReference,
    ComputedTorqueController,
    ControlledRobot,
    Feedforward,
    PidController,
    prototypes,
)
from tests.families import first_of

CENTRE, RADIUS, ROUND = (0.5, 2.8, -0.8), 0.1, 1.0  # m, m, s
HEAVIER = 12.0  # kg, of the plate; the controller knows of 9.13 kg


def circle(t):
    """The angle grows smoothly from rest to one round per second."""
    angle = 2 * np.pi / ROUND * (t - 0.3 * (1 - ca.exp(-t / 0.3)))
    return CENTRE[0] + RADIUS * ca.sin(angle), CENTRE[1] + RADIUS * (1 - ca.cos(angle)), CENTRE[2] + 0 * t


REFERENCE = {f"r_ref[{k}]": (lambda t, k=k: circle(t)[k]) for k in range(3)}


@cache
def controlled(control):
    return translate(ControlledRobot(prototypes.GT_A, start=CENTRE, control=control), events=True)


def largest_error(control, parameters):
    """Largest distance of the tool from its filtered reference, m."""
    motion = simulate(controlled(control), stop=2.0, inputs=REFERENCE, parameters=parameters)
    return np.linalg.norm(motion["error"], axis=1).max()


@pytest.mark.parametrize("control", first_of([CascadedController, PidController]))
@pytest.mark.parametrize(("mass", "ratio", "bound"), [(9.13, 30.0, 0.4e-3), (HEAVIER, 8.0, 2.5e-3)])
def test_feedforward_makes_tracking_several_times_better(control, mass, ratio, bound):
    fed = largest_error(control, {"robot.plate_mass": mass})
    alone = largest_error(control, {"robot.plate_mass": mass, "controller.feedforward_share": 0.0})
    # the exact model leaves what a force that is held for 4 ms cannot follow, a plate that is
    # a third too heavy what its weight and inertia ask for in excess: some 30 N and 10 N beside 200 N of friction
    assert fed < bound
    assert alone > ratio * fed


def test_what_is_left_with_the_exact_model_shrinks_with_the_period():
    periods = [{"controller.control.period": period} for period in (0.004, 0.001)]
    errors = [largest_error(CascadedController, period) for period in periods]
    # a held force lags by half a period: first order, less where friction turns sharply
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.3)


def test_computed_torque_makes_all_axes_forget_alike():
    # the robot begins 2 mm off; with damping 1 each coordinate of the carts decays as (1 + w t) exp(-w t)
    bandwidth, off = 20.0, np.array([2e-3, -1e-3, 1e-3])
    control = ComputedTorqueController(
        prototypes.GT_A,
        start=CENTRE,
        bandwidth=bandwidth,
        period=0.001,
        dynamics=dict(loads=dict(f_c=0.0, f_v=0.0)),
    )
    begin = dict(tool=dict(r=dict(start=list(CENTRE + off))))
    model = ControlledRobot(prototypes.GT_A, start=CENTRE, control=control, friction=None, robot=begin)
    still = {f"r_ref[{k}]": CENTRE[k] for k in range(3)}
    motion = simulate(model, stop=0.5, inputs=still, tolerance=1e-10)
    error = motion["controller.feedforward.q"] - motion["robot.q"]
    decay = (1 + bandwidth * motion.time) * np.exp(-bandwidth * motion.time)
    expected = decay[:, None] * error[0]
    assert np.abs(error[0]).min() > 1e-4
    # half a period of delay turns the decay by its share of the time constant, 1 %
    np.testing.assert_allclose(error, expected, atol=0.02 * np.abs(error[0]).max())


def test_tracking_survives_a_force_at_its_limit():
    # a jump of the reference by 20 cm asks for more than the motors have; the tool still gets there
    model = ControlledRobot(
        prototypes.GT_A,
        start=CENTRE,
        control=CascadedController(prototypes.GT_A, start=CENTRE, limit=[400.0] * 3),
        controller=dict(feedforward=dict(bandwidth=25.0)),
    )
    jump = {
        f"r_ref[{k}]": ([0, 0.1, 0.1001, 9], [CENTRE[k], CENTRE[k], *[CENTRE[k] + 0.2 * (k == 1)] * 2])
        for k in range(3)
    }
    motion = simulate(model, stop=2.5, inputs=jump)
    forces = motion["controller.f"]
    assert np.abs(forces).max() == 400.0
    assert np.linalg.norm(motion.final("error")) < 2e-3
    overshoot = (motion["r"][:, 1] - CENTRE[1] - 0.2).max()
    assert overshoot < 0.02  # m, a tenth of the jump: the integral has not wound up


def test_the_same_robot_inside_and_outside():
    # feedforward in the loop is feedforward by itself
    model = ControlledRobot(prototypes.GT_A, start=CENTRE)
    loop = simulate(model, stop=0.5, inputs=REFERENCE)
    alone = simulate(Feedforward(prototypes.GT_A, start=CENTRE), stop=0.5, inputs=REFERENCE)
    np.testing.assert_allclose(loop["controller.feedforward.f"], alone["f"], rtol=1e-5, atol=1e-3)


class Circling(ControlledRobot):
    """The controlled robot with the circle as its own reference."""

    r_ref = Real(3, unit="m", description="reference of the tool position")
    circle = CircularReference(start=CENTRE, radius=RADIUS, period=ROUND)

    def equations(self):
        yield from super().equations()
        yield self.r_ref == self.circle.r


def test_a_reference_inside_is_the_reference_from_outside():
    inside = simulate(Circling(prototypes.GT_A, start=CENTRE), stop=0.5)
    outside = simulate(ControlledRobot(prototypes.GT_A, start=CENTRE), stop=0.5, inputs=REFERENCE)
    np.testing.assert_allclose(inside["r_ref"], outside["r_ref"], rtol=1e-13)
    np.testing.assert_allclose(inside["r"], outside["r"], atol=1e-8)  # m; tolerances of two runs


def test_the_circular_reference_is_a_circle_in_its_plane():
    ahead, aside, start = np.array([0.6, 0.0, 0.8]), np.array([0.0, 1.0, 0.0]), np.array([1.0, 2.0, 3.0])
    circle = CircularReference(start=start, ahead=ahead, aside=aside, radius=0.25, period=0.5, rise=0.1)
    r = simulate(circle, stop=2.0)["r"]
    from_centre = r - (start + 0.25 * aside)
    np.testing.assert_allclose(np.linalg.norm(from_centre, axis=1), 0.25, rtol=1e-12)
    np.testing.assert_allclose(from_centre @ np.cross(ahead, aside), 0.0, atol=1e-13)
    np.testing.assert_allclose(r[0], start, atol=1e-15)
    speed = np.linalg.norm(np.diff(r, axis=0), axis=1) / (2.0 / 500)
    assert speed[0] < 0.05 * speed[-1]
    assert speed[-1] == pytest.approx(2 * np.pi * 0.25 / 0.5, rel=1e-3)  # chords, 1/24 of the angle squared
