"""`Mpc.run` with plants that run by themselves: an FMU is the model that it was made of, a robot's controller, refusals."""

from typing import Any, cast

import numpy as np
import pytest
from scipy.linalg import expm

from gantrytau import Input, Model, ModelError, Parameter, Real, der
from gantrytau_fmu import Channel, PythonComponent, export_fmu
from gantrytau_fmu.controller import AxisLimits, Controller
from gantrytau_models import CartServo
from gantrytau_optimica import ExtendedKalman, Mpc, Optimization, Rig
from tests.optimica.predictive.test_mpc import Pole, Rest, Upright

SAME = 1e-3  # N: an FMU integrates with a relative tolerance of 1e-6, the model has steps of third order


@pytest.fixture(scope="module")
def pole(tmp_path_factory):
    """Three seconds: it is compiled."""
    return export_fmu(
        Pole(length=0.6), tmp_path_factory.mktemp("pole") / "pole.fmu", interfaces="co-simulation"
    )


def exact_cart(period: float, unit: str = "1", given: str = "u") -> PythonComponent:
    """The cart of `Rest` in its exact steps."""
    system = np.zeros((3, 3))
    system[0, 1], system[1, 1], system[1, 2] = 1.0, -0.5, 1.0
    step, x = expm(period * system), np.array([1.0, 0.3])

    def go_on(t: float, values: Any) -> dict[str, float]:
        x[:] = (step @ [*x, values[given]])[:2]
        return {"x": x[0], "v": x[1]}

    ends = [Channel("x", unit), Channel("v", "1")]
    kind: Any = dict(starts={"x": 1.0, "v": 0.3}, sampled=False)
    return PythonComponent(go_on, inputs=[Channel(given, "1")], outputs=ends, **kind)


def test_an_fmu_is_the_model_that_it_was_made_of(pole):
    mpc, plant = Mpc(Upright, period=0.05, elements=20), Upright(pole=dict(length=0.6))
    given: Any = dict(stop=1.0, noise={"pole.th": 0.002}, seed=2)
    model, fmu = mpc.run(plant, **given), mpc.run(Controller(pole, period=0.05), **given)
    np.testing.assert_allclose(fmu["pole.f"], model["pole.f"], rtol=0, atol=SAME)
    np.testing.assert_allclose(fmu["pole.th"], model["pole.th"], rtol=0, atol=1e-5)
    np.testing.assert_allclose(fmu.plans["pole.p"], model.plans["pole.p"], rtol=0, atol=1e-4)
    assert fmu.statuses == model.statuses


def test_the_cost_along_a_plant_that_is_the_model_is_the_same():
    mpc = Mpc(Rest, period=0.05, elements=20, terminal="lqr")
    model, exact = mpc.run(stop=2.0), mpc.run(Controller(exact_cart(0.05), period=0.05), stop=2.0)
    assert exact.cost == pytest.approx(model.cost, rel=1e-6)
    np.testing.assert_allclose(exact["cart.x"], model["cart.x"], rtol=0, atol=1e-6)


def test_a_robots_controller_takes_answers_a_period_later(pole):
    mpc, plant = Mpc(Upright, period=0.04, elements=20, delay=1), Upright(pole=dict(length=0.6))
    robot = Controller(pole, lambda t, values: {"f": values["mpc.pole.f"]}, period=0.004)
    model, found = mpc.run(plant, stop=0.6), mpc.run(robot, stop=0.6)
    np.testing.assert_allclose(found["pole.f"], model["pole.f"], rtol=0, atol=SAME)
    assert len(found.record.time) == 151
    assert found.record.timing.clients["mpc"].dropped == 0


def test_on_the_wall_samples_go_on_while_a_plan_is_made():
    """Half a second: it is on the wall."""
    mpc = Mpc(Rest, period=0.04, elements=10, delay=1)
    robot = Controller(exact_cart(0.004), lambda t, values: {"u": values["mpc.cart.u"]}, clock="wall")
    found = mpc.run(robot, stop=0.4)
    assert len(found.time) == 11
    assert len(found.statuses) == 10
    assert found.record.timing.clock == "wall"
    assert found["cart.u"][2:].any()


def test_limits_of_the_plant_are_in_the_record():
    mpc = Mpc(Rest, period=0.05, elements=20)
    slow = Controller(exact_cart(0.05), period=0.05, limits={"u": AxisLimits(minimum=-0.5)})
    found = mpc.run(slow, stop=0.5)
    assert found["cart.u"].min() == -0.5
    assert found.plans["cart.u"].min() < -0.6


def test_an_estimator_sees_what_the_plant_gives():
    mpc = Mpc(Rest, period=0.05, elements=20, terminal="lqr")
    seen: Any = dict(estimator=ExtendedKalman(Rest, period=0.05, measured={"cart.x": 1e-3}))
    plant: Any = Controller(exact_cart(0.05), period=0.05)
    found, model = mpc.run(plant, stop=3.0, **seen), mpc.run(stop=3.0, **seen)
    np.testing.assert_allclose(found["cart.x"], model["cart.x"], rtol=0, atol=1e-6)


class Sledge(Model):
    """A mass on a guideway."""

    m = Parameter(80.0, unit="kg")
    s, v = Real(unit="m"), Real(unit="m/s")
    f = Input(unit="N", start=0.0)

    def equations(self):
        yield self.v == der(self.s)
        yield self.m * der(self.v) == self.f


class Axis(Model):
    """It alone."""

    x = Sledge()


class Servo(Model):
    """An axis under its servo, seen from its reference."""

    k_p = Parameter(9.0, unit="1/s")
    q = Real(unit="m", start=0.0)
    q_ref = Input(unit="m", start=0.0, min=-0.02, max=0.02)

    def equations(self):
        yield der(self.q) == self.k_p * (self.q_ref - self.q)


class There(Optimization):
    """The axis shall be at 10 mm."""

    servo = Servo()

    def integrand(self):
        return (self.servo.q - 0.01) ** 2 + 0.1 * (self.servo.q_ref - 0.01) ** 2


def test_a_rig_in_the_loop_moves_as_by_the_same_references():
    """Four seconds: it is compiled."""
    rig = Rig(Axis(), [CartServo()], period=0.004)
    loop, starts = rig.at_rest([0.0], seed=1)
    mpc = Mpc(There, period=0.04, elements=20, terminal="lqr")
    with pytest.raises(
        ModelError, match=r"loop, starts = rig.at_rest\(q\); Controller\(loop, period=rig.period"
    ):
        mpc.run(cast(Any, rig), stop=0.4)
    wires = {"servo.q": "robot.x.s", "servo.q_ref": "q_ref"}
    found = mpc.run(Controller(loop, period=rig.period, starts=starts), stop=0.4, wires=wires)
    assert found["servo.q"][-1] == pytest.approx(0.01, abs=5e-5)
    references = np.append(np.zeros(5), found.record["applied.q_ref"])
    run = rig.run(references[:, None], seed=1)
    np.testing.assert_allclose(run["x.s"][5:], found.record["robot.x.s"], rtol=0, atol=1e-6)


CART = dict(cart=exact_cart(0.05), metres=exact_cart(0.05, "m"), other=exact_cart(0.05, given="push"))


@pytest.mark.parametrize(
    ("plant", "period", "run", "told"),
    [
        ("other", 0.05, {}, "found no input 'cart.u' of the plant, which the controller gives; wires={'cart.u': name"),
        ("other", 0.05, dict(wires={"cart.u": "force"}), "found no input 'force' of the plant"),
        ("cart", 0.05, dict(wires={"cart.v": "speed"}), "found no output 'speed' of the plant, which the controller"),
        ("cart", 0.05, dict(wires={"cart.w": "v"}), "found 'cart.w', expected some of cart.u, cart.x, cart.v"),
        ("metres", 0.05, {}, "cart.x is in 1 and x of the plant in m, expected one unit"),
        ("cart", 0.03, {}, "samples every 0.03 s, expected a multiple of these; Mpc(..., period=0.06)"),
        ("cart", 0.1, {}, "samples every 0.1 s, expected a multiple of these; Mpc(..., period=0.1)"),
        ("cart", 0.05, dict(start={"cart.x": 0.0}), "found start= or after=, expected none"),
        ("cart", 0.05, dict(noise={"x": 0.1}), "found noise='x', expected states of cart.x, cart.v"),
    ],
)  # fmt: skip
def test_a_plant_that_does_not_fit_is_told(plant, period, run, told):
    mpc = Mpc(Rest, period=0.05, elements=5)
    with pytest.raises(ModelError) as raised:
        mpc.run(Controller(CART[plant], period=period), stop=0.5, **run)
    assert told in str(raised.value)


def test_names_are_joined_by_wires():
    mpc = Mpc(Rest, period=0.05, elements=5)
    found = mpc.run(Controller(CART["other"], period=0.05), stop=0.1, wires={"cart.u": "push"})
    assert len(found.time) == 3


@pytest.mark.parametrize(
    ("plant", "told"),
    [
        ("pole.fmu", "or a plant that runs by itself: Controller('pole.fmu', period=...)"),
        (Pole(), "expected the same problem with other parameters, or a plant that runs by itself"),
    ],
)
def test_what_is_no_plant_is_told(plant, told):
    with pytest.raises(ModelError) as raised:
        Mpc(Rest, period=0.05, elements=5).run(plant, stop=0.5)
    assert told in str(raised.value)


def test_a_controller_of_its_own_wants_a_delay():
    robot = Controller(exact_cart(0.05), lambda t, values: {}, period=0.05)
    with pytest.raises(ModelError, match=r"expected delay=1; Mpc\(..., delay=1\)"):
        Mpc(Rest, period=0.05, elements=5).run(robot, stop=0.5)
