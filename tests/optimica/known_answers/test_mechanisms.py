"""Mechanisms with closed loops against equations of one coordinate, computed apart."""

from itertools import pairwise

import numpy as np
import pytest

from gantrytau import Fixed, Start, between, simulate, translate
from gantrytau_models import DeltaRobot, FourBar
from gantrytau_optimica import Free, Optimization, final, initial, optimize


class TurnedCrank(Optimization):
    """A four-bar linkage from rest at 1 rad to rest at 2 rad, |torque| <= 20 N.m."""

    linkage: FourBar = FourBar()
    final_time = Free(0.5, unit="s", min=0.05, max=5.0)

    def objective(self):
        return self.final_time

    def constraints(self):
        yield between(-20.0, self.linkage.torque, 20.0)
        yield initial(self.linkage.crank.phi) == 1.0
        yield final(self.linkage.crank.phi) == 2.0
        yield initial(self.linkage.crank.w) == 0
        yield final(self.linkage.crank.w) == 0


def phase_plane(torque: float, begin: float, end: float, steps: int = 400) -> float:
    """Least time between rests: full torque, then full braking, in the plane of angle and squared speed.

    With one coordinate J(phi) w' + bias(phi) w^2 + weight(phi) = tau, and z = w^2 / 2 obeys the linear equation
    J dz/dphi + 2 bias z + weight = tau. J, bias and weight come from functions of the translated model.
    """
    dae = translate(FourBar())
    rate = dae.function(["crank.phi", "crank.w", "torque"], ["der(crank.w)"]).map(steps)
    angles = np.linspace(begin, end, steps)
    still = np.array(rate(angles[None, :], np.zeros((1, steps)), np.zeros((1, steps)))).ravel()
    pushed = np.array(rate(angles[None, :], np.zeros((1, steps)), np.ones((1, steps)))).ravel() - still
    moving = np.array(rate(angles[None, :], np.ones((1, steps)), np.zeros((1, steps)))).ravel() - still
    width = angles[1] - angles[0]

    def swept(sign, order):
        # midpoint rule of the linear equation, forwards from rest or backwards to rest
        z = np.zeros(steps)
        for here, there in pairwise(order):
            step = width * (there - here)
            a = moving[here] + moving[there]
            b = (still[here] + still[there]) / 2 + sign * torque * (pushed[here] + pushed[there]) / 2
            z[there] = (z[here] * (1 + step * a / 2) + step * b) / (1 - step * a / 2)
        return z

    z = np.minimum(swept(1.0, range(steps)), swept(-1.0, range(steps - 1, -1, -1)))
    w = np.sqrt(2 * z)
    # the time over an interval in which z is linear: 2 width / (w1 + w2)
    return float(np.sum(2 * width / (w[:-1] + w[1:])))


def test_a_four_bar_linkage_in_minimum_time_and_replayed():
    exact = phase_plane(20.0, 1.0, 2.0)
    assert exact == pytest.approx(phase_plane(20.0, 1.0, 2.0, 200), rel=1e-3)
    optimum = optimize(TurnedCrank)
    # one switch inside of an element
    assert optimum.final_time == pytest.approx(exact, rel=2e-3)
    t = np.linspace(0.0, optimum.final_time, 1001)
    found = simulate(
        FourBar(), stop=optimum.final_time, inputs={"torque": (t, optimum.signal("linkage.torque")(t))}
    )
    # the torque jumps once inside of an element, where its polynomial is sampled a few times
    assert found.final("crank.phi") == pytest.approx(2.0, abs=5e-4)


def test_a_start_of_the_crank_without_its_length():
    assert translate(FourBar(crank=dict(phi=Start(1.0)))).evaluate({})["crank.phi"] == pytest.approx(1.0)


def test_a_free_length_in_a_linkage():
    """The coupler for which the rocker stands at 1.5 rad when the crank is at 1 rad."""

    class Fitted(Optimization):
        linkage = FourBar(coupler=dict(length=Free(0.9, unit="m", min=0.7, max=1.2)), torque=0.0)
        final_time = 0.01

        def objective(self):
            return (initial(self.linkage.rocker.phi) - 1.5) ** 2

        def constraints(self):
            yield initial(self.linkage.crank.phi) == 1.0
            yield initial(self.linkage.crank.w) == 0

    crank = 0.3 * np.array([np.cos(1.0), np.sin(1.0)])
    rocker = np.array([1.0, 0.0]) + 0.6 * np.array([np.cos(1.5), np.sin(1.5)])
    optimum = optimize(Fitted, elements=2)
    assert optimum["linkage.coupler.length"] == pytest.approx(np.linalg.norm(rocker - crank), abs=1e-4)


class Pick(Optimization):
    """A delta robot 0.1 m across, |torque| <= 6 N.m."""

    robot: DeltaRobot = DeltaRobot()
    final_time = Free(0.4, unit="s", min=0.05, max=2.0)

    def objective(self):
        return self.final_time

    def constraints(self):
        for arm in self.robot.arms:
            yield between(-6.0, arm.tau, 6.0)
        yield initial(self.robot.tool.r) == [-0.05, 0.0, -0.75]
        yield final(self.robot.tool.r) == [0.05, 0.0, -0.75]
        for end in (initial, final):
            yield end(self.robot.tool.v) == 0


@pytest.fixture(scope="module")
def picked():
    return optimize(Pick, elements=12)


def test_a_delta_robot_replays(picked):
    optimum = picked
    assert 0.05 < optimum.final_time < 0.6
    t = np.linspace(0.0, optimum.final_time, 1001)
    inputs = {f"arms[{k}].tau": (t, optimum.signal(f"robot.arms[{k}].tau")(t)) for k in range(3)}
    robot = DeltaRobot(tool=dict(r=Fixed([-0.05, 0.0, -0.75])))
    found = simulate(robot, stop=optimum.final_time, inputs=inputs)
    # 12 elements with jumps of the torques in them
    np.testing.assert_allclose(found.final("tool.r"), [0.05, 0.0, -0.75], atol=5e-3)


def test_a_mirror_image_of_a_move_takes_as_long(picked):
    class Back(Pick):
        def constraints(self):
            for arm in self.robot.arms:
                yield between(-6.0, arm.tau, 6.0)
            yield initial(self.robot.tool.r) == [0.05, 0.0, -0.75]
            yield final(self.robot.tool.r) == [-0.05, 0.0, -0.75]
            for end in (initial, final):
                yield end(self.robot.tool.v) == 0

    # the limits are symmetric and there is no friction: time reversed, a motion is one as well; what is left is the
    # mesh, whose points are not symmetric
    assert optimize(Back, elements=12).final_time == pytest.approx(picked.final_time, rel=5e-3)
