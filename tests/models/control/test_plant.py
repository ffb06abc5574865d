"""The robot driven by motors against the robot driven by forces."""

import numpy as np
import pytest

from gantrytau import simulate, translate
from gantrytau_models import GantryTau, MeasuredGantryTau, MotorDrivenGantryTau, SixLinkGantryTau, prototypes
from gantrytau_models.control.plant import MotorDriven
from tests.models.mechanisms.test_gantry_tau import FORCES, RATES, mapped, random_motions, relative

TORQUES = [f"motors[{i}].tau" for i in range(3)]
RATIO = 190.5  # N per N.m


def test_torques_act_as_forces_by_the_gear():
    robot = translate(GantryTau(prototypes.GT_A)).function(["tool.r", "tool.v", *FORCES], ["der(tool.v)"])
    driven = translate(MotorDrivenGantryTau(prototypes.GT_A))
    assert set(driven.inputs) == set(TORQUES)
    driven = driven.function(["tool.r", "tool.v", *TORQUES], ["der(tool.v)"])
    positions, velocities, torques = random_motions(prototypes.GT_A)
    found = mapped(driven, positions, velocities, *torques.T)
    expected = mapped(robot, positions, velocities, *(RATIO * torques).T)
    assert relative(found, expected).max() < 1e-12  # roundings of the same formulas


def test_inertia_of_the_rotors_is_mass_of_the_carts():
    rotor = 5e-4  # kg.m2
    heavier = [dict(m=mass + RATIO**2 * rotor) for mass in prototypes.GT_A.cart_masses]
    cart = translate(GantryTau(prototypes.GT_A, carts=heavier)).function(
        ["tool.r", "tool.v", *FORCES], ["der(tool.v)"]
    )
    driven = translate(MotorDrivenGantryTau(prototypes.GT_A, motors=dict(J=rotor)))
    driven = driven.function(["tool.r", "tool.v", *TORQUES], ["der(tool.v)"])
    positions, velocities, torques = random_motions(prototypes.GT_A, seed=1)
    found = mapped(driven, positions, velocities, *torques.T)
    expected = mapped(cart, positions, velocities, *(RATIO * torques).T)
    # guideways of GT_A are level, weight of carts does not count
    assert relative(found, expected).max() < 1e-10


def test_measured_are_positions_and_speeds_of_the_carts():
    motion = simulate(
        MeasuredGantryTau(prototypes.L1), stop=0.2, inputs={"carts[0].f": 150.0, "carts[2].f": -80.0}
    )
    for i in range(3):
        np.testing.assert_array_equal(motion["q"][:, i], motion[f"carts[{i}].s"])
        np.testing.assert_array_equal(motion["v"][:, i], motion[f"carts[{i}].v"])
    assert np.ptp(motion["q"], axis=0).min() > 1e-3  # m, they did move


def test_power_of_motors_is_power_of_forces():
    robot = translate(MotorDrivenGantryTau(prototypes.L1))
    at = robot.evaluate({"tool.v": [0.3, -0.1, 0.2], **dict(zip(TORQUES, (2.0, -1.0, 0.5), strict=True))})
    turning = sum(at[f"motors[{i}].tau"] * at[f"motors[{i}].w"] for i in range(3))
    sliding = sum(at[f"carts[{i}].f"] * at[RATES[i]] for i in range(3))
    assert turning == pytest.approx(sliding, rel=1e-12)


def test_other_robots_take_motors_too():
    class Driven(MotorDriven, SixLinkGantryTau):
        """The six-link robot driven by motors."""

    robot = translate(Driven(prototypes.L1))
    assert set(robot.inputs) == set(TORQUES)
    at = robot.evaluate(dict.fromkeys(TORQUES, 1.0))
    np.testing.assert_allclose([at[name] for name in FORCES], RATIO)
