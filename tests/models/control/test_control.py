"""Controllers against their difference equations written out, at their limits, and against the robot."""

import casadi as ca
import numpy as np
import pytest

from gantrytau import ModelError, simulate, translate
from gantrytau_models import (
    CascadedController,
    ComputedTorqueController,
    GantryTau,
    PidController,
    TrackingController,
    prototypes,
)
from gantrytau_models.control.controllers import IntegralController
from tests.models.mechanisms.test_gantry_tau import CARTS, FORCES, RATES, mapped, random_motions, relative

PERIOD = 0.004  # s
MASS = np.array(prototypes.GT_A.cart_masses) + prototypes.GT_A.plate_mass
SIGNALS = {
    "q": lambda t: 0.5 + 0.01 * ca.sin(9 * t),
    "v": lambda t: 0.1 * ca.cos(11 * t),
    "q_ref": lambda t: 0.51 + 0.02 * ca.cos(8 * t),
    "v_ref": lambda t: -0.2 * ca.sin(7 * t),
    "f_ff": lambda t: 100 * ca.sin(5 * t),
}


def driven(controller, **others):
    """A controller by itself, all axes with the same signals; twelve points to a period."""
    signals = {**SIGNALS, **others}
    inputs = {f"{name}[{k}]": signal for name, signal in signals.items() for k in range(3)}
    return simulate(controller, stop=50 * PERIOD, inputs=inputs, points=601)


def signals_at(t):
    return {name: float(ca.DM(signal(t))) for name, signal in SIGNALS.items()}


def cascade(s, integral):
    """The cascade as difference equations: wanted force, what is integrated."""
    proportional = MASS * 80.0 * (s["v_ref"] + 20.0 * (s["q_ref"] - s["q"]) - s["v"])
    return s["f_ff"] + proportional + integral, proportional


def pid(s, integral):
    """The PID controller as difference equations."""
    proportional = MASS * 35.0**2 * (s["q_ref"] - s["q"])
    return s["f_ff"] + proportional + 70.0 * MASS * (s["v_ref"] - s["v"]) + integral, proportional


LAWS = {CascadedController: cascade, PidController: pid}


@pytest.mark.parametrize("controller", LAWS)
@pytest.mark.parametrize("limit", [1e5, 60.0], ids=["wide", "narrow"])
def test_forces_follow_the_difference_equations(controller, limit):
    found = driven(controller(prototypes.GT_A, limit=[limit] * 3))
    integral = np.zeros(3)
    reached = False
    for k in range(50):
        wanted, proportional = LAWS[controller](signals_at(k * PERIOD), integral)
        force = np.clip(wanted, -limit, limit)
        held = found["f"][12 * k : 12 * (k + 1)]
        np.testing.assert_allclose(held, [force] * 12, rtol=1e-9, atol=1e-9)  # held until the next instant
        integral = integral + PERIOD / 0.1 * (proportional - (wanted - force))
        reached |= bool(np.any(force != wanted))
    assert reached == (limit == 60.0)
    np.testing.assert_allclose(found["tau"], found["f"] / 190.5, rtol=1e-12)


@pytest.mark.parametrize("controller", LAWS)
def test_the_integral_does_not_wind_up(controller: type[IntegralController]):
    # an error of 5 cm that stays for two seconds: without a limit the integral would grow without end
    stay = {"q": 0.5, "v": 0.0, "q_ref": 0.55, "v_ref": 0.0, "f_ff": 0.0}
    inputs = {f"{name}[{k}]": value for name, value in stay.items() for k in range(3)}
    found = simulate(controller(prototypes.GT_A, limit=[300.0] * 3), stop=2.0, inputs=inputs)
    np.testing.assert_allclose(found.final("f"), 300.0)
    assert np.abs(found["integral"]).max() <= 300.0 + 1e-9
    free = simulate(controller(prototypes.GT_A, limit=[1e9] * 3), stop=2.0, inputs=inputs)
    assert free.final("integral").min() > 10 * 300.0


def test_computed_torque_is_the_inverse_dynamics_of_the_robot():
    dae = translate(ComputedTorqueController(prototypes.L1), events=True)
    positions, velocities, accelerations = random_motions(prototypes.L1, count=50)
    rates = [f"der({rate})" for rate in RATES]
    robot = translate(GantryTau(prototypes.L1)).function(
        ["tool.r", "tool.v", "der(tool.v)"], [*CARTS, *RATES, *rates, *FORCES]
    )
    q, v, a, forces = np.split(mapped(robot, positions, velocities, accelerations), 4, axis=1)
    find = dae.function(
        [f"seen.{name}" for name in ("q", "v", "q_ref", "v_ref", "a_ref", "f_ff")], ["wanted", "f"]
    )
    # speeds without error, so that friction is that of the motion; an error of position asks for more acceleration
    error = np.random.default_rng(5).normal(size=q.shape) * 1e-3
    found = mapped(find, q, v, q + error, v, a - 35.0**2 * error, np.zeros_like(q))
    assert relative(found[:, :3], forces).max() < 1e-9
    np.testing.assert_array_equal(found[:, 3:], np.clip(found[:, :3], -1207.0, 1207.0))


def test_computed_torque_gives_no_force_out_of_reach():
    dae = translate(ComputedTorqueController(prototypes.L1), events=True)
    seen = [f"seen.{name}" for name in ("q", "v", "q_ref", "v_ref", "a_ref", "f_ff")]
    f, status = dae.function(seen, ["f", "dynamics.status"])([9.0, 0.0, 0.0], *[[0.1] * 3] * 5)
    assert float(status) == 1
    np.testing.assert_array_equal(np.array(f), 0.0)


def test_mistakes_are_told():
    with pytest.raises(ModelError, match="PidController: found 5, expected a Prototype"):
        PidController(5)  # pyright: ignore[reportArgumentType]
    with pytest.raises(ModelError, match=r"TrackingController: found control=.*GantryTau"):
        TrackingController(prototypes.L1, control=GantryTau)  # pyright: ignore[reportArgumentType]
    with pytest.raises(ModelError, match=r"expected a sampling period above zero"):
        translate(CascadedController(prototypes.L1, period=0.0), events=True)
