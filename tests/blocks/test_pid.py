"""The PID controller: its transfer function, its poles in a loop, its limits."""

from typing import Any

import numpy as np
import pytest

from gantrytau import Input, Model, ModelError, connect, linearize, simulate, translate
from gantrytau.blocks import FirstOrder, Integrator, Limiter, Pid, RateLimiter, Step
from tests.mechanisms.rows import row

TOLERANCE = 1e-10
NEAR = 1e3 * TOLERANCE  # the integrator holds its tolerance per step; over some seconds errors add up
W = np.array([0.01, 0.3, 2.0, 50.0, 1e4])  # rad/s


class Open(Model):
    """The controller alone."""

    wanted, measured = Input(start=0.0), Input(start=0.0)
    pid = Pid(k=3.0, T_i=0.5, T_d=0.2, N=8.0, b=0.7, c=0.3)

    def equations(self):
        yield connect(self.wanted, self.pid.u_s)
        yield connect(self.measured, self.pid.u_m)


class Loop(Model):
    """A lag in a loop with a controller."""

    step = Step(height=5.0, start_time=0.1)
    pid = Pid(kind="PI", k=3.0, T_i=0.5)
    plant = FirstOrder(k=2.0, T=0.7)

    def equations(self):
        yield connect(self.step.y, self.pid.u_s)
        yield from row(self.pid, self.plant, self.pid.u_m)


@pytest.mark.parametrize("kind", ["P", "PI", "PD", "PID"])
def test_both_transfer_functions_are_those_of_the_textbook(kind):
    system = linearize(Open(pid=dict(kind=kind)), inputs=["wanted", "measured"], outputs=["pid.y"])
    response = system.response(W / (2 * np.pi))
    s = 1j * W
    integral = 1 / (0.5 * s) if "I" in kind else 0 * s
    derivative = 0.2 * s / (1 + 0.2 * s / 8.0) if "D" in kind else 0 * s
    np.testing.assert_allclose(response[0, 0], 3 * (0.7 + integral + 0.3 * derivative), rtol=1e-12)
    np.testing.assert_allclose(response[0, 1], -3 * (1 + integral + derivative), rtol=1e-12)
    assert len(system.A) == ("I" in kind) + ("D" in kind)


def test_the_loop_has_the_poles_of_its_characteristic_polynomial():
    # 0.7 s^2 + (1 + 2 k) s + 2 k / T_i = 0
    poles = np.sort_complex(linearize(Loop(), inputs=[], outputs=["plant.y"]).poles)
    np.testing.assert_allclose(
        poles, np.sort_complex(np.roots([0.7, 1 + 2 * 3.0, 2 * 3.0 / 0.5])), rtol=1e-12
    )


def test_a_loop_with_an_integral_part_has_no_error_at_rest():
    found = simulate(Loop(), stop=12.0, tolerance=TOLERANCE)
    assert found.final("plant.y") == pytest.approx(5.0, abs=NEAR)  # e^-26 of the way remains


def test_a_controller_that_is_switched_on_gives_no_kick():
    found = simulate(Open(pid=dict(k=1.0, c=1.0)), stop=1.0, inputs={"wanted": 2.0, "measured": 2.0})
    np.testing.assert_allclose(found["pid.derivative"], 0.0, atol=1e-12)
    assert found.final("pid.y") == pytest.approx((0.7 - 1) * 2.0, abs=1e-12)


def test_at_a_limit_the_integral_settles_where_it_leaves_it_soon():
    """At rest at the limit: e / T_i = (v - y) / (k T_t), so v stands k e T_t / T_i above."""
    model = Open(pid=dict(kind="PI", b=1.0, T_t=0.1, actuator=Limiter(lower=-4.0, upper=4.0)))
    found = simulate(model, stop=3.0, inputs={"wanted": 2.0, "measured": 0.0}, tolerance=TOLERANCE)
    assert (found["pid.y"] == 4.0).all()
    excess = 3.0 * 2.0 * 0.1 / 0.5
    # v = k (b e + I), I' = e / T_i - (v - 4) / (k T_t): a lag with the time constant T_t
    expected = 4.0 + excess + (6.0 - 4.0 - excess) * np.exp(-found.time / 0.1)
    np.testing.assert_allclose(found["pid.v"], expected, atol=NEAR)


def test_limits_are_kept_and_the_overshoot_stays_small():
    # 4 is not much more than the 2.5 that the plant needs at 5; an integral that winds up overshoots far
    limited = dict(limits=(-3.0, 3.0))
    overshoot = {}
    for name, tracking in (("back", 0.1), ("wound up", 1e6)):
        model = type("Limited", (Loop,), {"pid": Pid(kind="PI", k=3.0, T_i=0.5, T_t=tracking, **limited)})()
        found = simulate(model, stop=12.0)
        assert np.max(found["pid.y"]) <= 3.0
        overshoot[name] = np.max(found["plant.y"]) - 5.0
    assert overshoot["back"] < 0.02 * 5.0
    assert overshoot["wound up"] > 3 * overshoot["back"]


def test_another_actuator_stands_in_the_place_of_the_limits():
    model = type("Slow", (Loop,), {"pid": Pid(kind="PI", k=3.0, T_i=0.5, actuator=RateLimiter(rising=2.0))})()
    found = simulate(model, stop=15.0, tolerance=TOLERANCE)
    assert np.max(np.diff(found["pid.y"]) / np.maximum(np.diff(found.time), 1e-12)) <= 2.0 + 1e-4
    assert found.final("plant.y") == pytest.approx(5.0, abs=1e-6)


def test_limits_are_parameters():
    model = type("Limited", (Open,), {"pid": Pid(kind="P", k=3.0, limits=(-4.0, 4.0))})()
    given = {"pid.actuator.upper": 1.0}
    found = simulate(model, stop=1.0, inputs={"wanted": 2.0, "measured": 0.0}, parameters=given)
    assert (found["pid.y"] == 1.0).all()


def test_a_controller_without_its_derivative_holds_an_integrator():
    class Position(Model):
        pid = Pid(kind="PD", k=4.0, T_d=0.1, N=1e3)
        plant = Integrator(y=dict(start=1.0))
        target = Step(height=0.0)

        def equations(self):
            yield connect(self.target.y, self.pid.u_s)
            yield from row(self.pid, self.plant, self.pid.u_m)

    poles = linearize(Position(), inputs=[], outputs=["plant.y"]).poles
    # slow pole of s (1 + k T_d) + k = 0, to first order in 1 / N
    assert np.min(np.abs(poles)) == pytest.approx(4.0 / 1.4, rel=1e-3)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (dict(kind="IP"), r"pid \(Pid\), equation 1: kind: found 'IP', expected one of P, PI, PD, PID"),
        (dict(T_i=0.0), "expected T_i above zero; kind='PD' has no integral"),
        (dict(T_t=0.0), "expected T_t above zero"),
        (dict(T_d=0.0), "expected T_d above zero; kind='PI' has no derivative"),
        (dict(N=0.0), "expected N above zero"),
        (dict(k=0.0), "expected a gain k that is not zero"),
        (dict(upper=3.0), r"pid \(Pid\) has no 'upper'"),
    ],
)
def test_wrong_controllers(settings, words):
    with pytest.raises(ModelError, match=words):
        translate(Open(pid=settings))


def test_wrong_limits():
    wrongs: list[Any] = [3.0, (1.0,), (1.0, 2.0, 3.0)]
    for wrong in wrongs:
        with pytest.raises(ModelError, match=r"Pid: limits: found .*, expected a pair, as \(-10.0, 10.0\)"):
            Pid(limits=wrong)
    with pytest.raises(ModelError, match="expected upper >= lower; exchange the two"):
        translate(Pid(limits=(1.0, -1.0)))
