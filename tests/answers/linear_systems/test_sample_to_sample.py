"""Models that sample, linear from sample to sample, against their simulation and the textbook."""

import numpy as np
import pytest
from scipy.linalg import expm

from gantrytau import (
    Input,
    Model,
    ModelError,
    Parameter,
    Real,
    StateSpace,
    connect,
    der,
    linearize,
    sampled,
    simulate,
    sin,
)


class Servo(Model):
    """A mass whose speed a sampled PI controller holds; the speed is measured at a rate of its own."""

    m = Parameter(2.0, unit="kg", description="mass")
    period = Parameter(0.02, unit="s", description="sampling period of the controller")
    measured_every = Parameter(0.01, unit="s", description="sampling period of the measurement")
    v = Real(unit="m/s", description="speed", start=0.0, fixed=True)
    measured = Real(unit="m/s", description="measured speed", start=0.0)
    integral = Real(unit="N", description="integral part", start=0.0)
    f = Real(unit="N", description="force", start=0.0)
    wanted = Input(unit="m/s", description="wanted speed", start=0.0)
    k = Parameter(30.0, unit="kg/s", description="gain")
    k_i = Parameter(90.0, unit="N/m", description="gain of the integral part")

    def equations(self):
        yield self.m * der(self.v) == self.f
        error = self.wanted - self.measured
        yield sampled(self.measured, self.v, period=self.measured_every)
        yield sampled(self.integral, self.integral + self.period * self.k_i * error, period=self.period)
        yield sampled(self.f, self.k * error + self.integral, period=self.period)


def followed(model, linear, stop, wanted=1.0):
    """The outputs of a simulation at the instants of a linear system, and those of that system, for a constant input."""
    points = round(stop / linear.period) + 1
    motion = simulate(model, stop=stop, inputs={"wanted": wanted}, points=points, tolerance=1e-10)
    found = linear.simulate(np.full((points, 1), wanted))
    return np.stack([motion[n] for n in linear.outputs], axis=1), found


def test_one_rate_is_what_the_simulation_does():
    model = Servo(measured_every=0.02)
    linear = linearize(model, outputs=["v", "f", "measured"])
    assert linear.period == 0.02
    assert linear.states == ("v", "measured", "integral")  # the force is not asked for at the next instant
    expected, found = followed(model, linear, 1.0)
    assert found == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize("measured_every", [0.01, 0.005, 0.03, 0.02 / 3])
def test_several_rates_come_together_in_one_period(measured_every):
    model = Servo(measured_every=measured_every)
    linear = linearize(model, outputs=["v", "f"])
    assert linear.period == pytest.approx(0.06 if measured_every == 0.03 else 0.02, rel=1e-12)
    expected, found = followed(model, linear, 0.6)
    assert found == pytest.approx(expected, abs=1e-8)


def test_poles_of_a_sampled_integrator_with_gain_are_those_of_the_textbook():
    class Loop(Model):
        y = Real(start=0.0, fixed=True)
        u = Real(start=0.0)
        w = Input(start=0.0)

        def equations(self):
            yield der(self.y) == self.u
            yield sampled(self.u, 3.0 * (self.w - self.y), period=0.1)

    linear = linearize(Loop(), outputs=["y"])
    assert linear.poles == pytest.approx([1 - 3.0 * 0.1], rel=1e-14)
    assert linear.response([0.0])[0, 0] == pytest.approx([1.0], rel=1e-14)


def test_period_of_a_continuous_model_is_that_of_a_zero_order_hold():
    A, B, C = [[0, 1], [-25, -1.5]], [0, 0.5], [50, 0]

    class Plant(Model):
        system = StateSpace(A, B, C)
        u = Input(start=0.0)

        def equations(self):
            yield connect(self.u, self.system.u)

    linear = linearize(Plant(), outputs=["system.y"], period=0.02)
    assert linear.A == pytest.approx(expm(0.02 * np.array(A)), rel=1e-13)
    assert linear.period == 0.02
    assert linearize(Plant(), outputs=["system.y"]).discrete(0.02).B == pytest.approx(linear.B, rel=1e-14)


def test_longer_period_takes_the_same_steps_with_the_input_held():
    one, three = linearize(Servo(), outputs=["v"]), linearize(Servo(), outputs=["v"], period=0.06)
    assert three.A == pytest.approx(np.linalg.matrix_power(one.A, 3), rel=1e-10, abs=1e-12)
    u = np.ones((30, 1))
    assert one.simulate(u)[::3] == pytest.approx(three.simulate(u[:10]), rel=1e-10)


def test_discrete_component_samples_as_its_matrices_say():
    class Filtered(Model):
        filter = StateSpace([[0.5, 0.1], [-0.2, 0.7]], [[1.0, 0.0], [0.5, 2.0]], np.eye(2), 0, period=0.1)
        w = Input(2, start=0.0)

        def equations(self):
            yield self.filter.u == self.w

    found = simulate(Filtered(), stop=2.0, inputs={"w": [1.0, -2.0]}, points=21)["filter.y"]
    system = StateSpace([[0.5, 0.1], [-0.2, 0.7]], [[1.0, 0.0], [0.5, 2.0]], np.eye(2), 0, period=0.1)
    assert found == pytest.approx(system.simulate(np.tile([1.0, -2.0], (21, 1))), rel=1e-12, abs=1e-14)
    assert linearize(Filtered(), outputs=["filter.y"]).A == pytest.approx(system.A)


def test_point_at_rest_of_a_sampled_loop_keeps_what_is_held():
    rest = linearize(Servo(), at={"wanted": 0.7}, steady=True)
    assert rest.point["v"] == pytest.approx(0.7, rel=1e-12)
    assert rest.point["measured"] == pytest.approx(0.7, rel=1e-12)
    assert rest.point["f"] == pytest.approx(0.0, abs=1e-12)


def test_linearization_about_a_point_differs_by_second_order():
    class Pendulum(Model):
        phi = Real(unit="rad", start=0.4, fixed=True)
        w = Real(unit="rad/s", start=0.0, fixed=True)
        tau = Real(unit="rad/s2", start=0.0)
        wanted = Input(unit="rad", start=0.0)
        c, k = Parameter(9.81, unit="rad/s2"), Parameter(20.0, unit="rad/s2")
        d = Parameter(4.0, unit="1/s")

        def equations(self):
            yield der(self.phi) == self.w
            yield der(self.w) == -self.c * sin(self.phi) + self.tau
            yield sampled(self.tau, self.k * (self.wanted - self.phi) - self.d * self.w, period=0.02)

    errors = []
    linear = linearize(Pendulum(), at={"wanted": 0.4}, steady=True, outputs=["phi"])
    for size in (1e-2, 1e-3):
        start = {"phi": linear.point["phi"] + size, "w": 0.0, "tau": linear.point["tau"]}
        moved = simulate(
            Pendulum(), stop=1.0, inputs={"wanted": 0.4}, starts=start, points=51, tolerance=1e-11
        )["phi"]
        x = [{"phi": size}.get(name, 0.0) for name in linear.states]
        found = linear.simulate(np.zeros((51, 1)), x=x)[:, 0]
        errors.append(np.abs(moved - linear.point["phi"] - found).max())
    assert np.log10(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.2)


@pytest.mark.parametrize(
    ("model", "period", "words"),
    [
        (Servo(), 0.03, "expected a multiple of 0.02 s"),
        (Servo(measured_every=0.02 / np.pi), None, "never come together again"),
    ],
)
def test_periods_that_do_not_fit_are_refused(model, period, words):
    with pytest.raises(ModelError, match=words):
        linearize(model, period=period)
