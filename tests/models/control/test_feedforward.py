"""Feedforward against the inverse dynamics of the robot, and the robot driven by it."""

import dataclasses

import casadi as ca
import numpy as np
import pytest

from gantrytau import Fixed, ModelError, simulate, translate
from gantrytau.mechanics.filters import coefficients
from gantrytau_models import Feedforward, GantryTau, InverseDynamics, prototypes
from tests.families import first_of
from tests.models.mechanisms.test_gantry_tau import (
    CARTS,
    FORCES,
    HEAVY_LINKS,
    RATES,
    mapped,
    random_motions,
    relative,
    symmetric,
)

ROBOTS = {
    "L1": prototypes.L1,
    "D1": dataclasses.replace(prototypes.D1, link_masses=(0.9, 1.7, 2.4)),
    "GT_A": prototypes.GT_A,
    "heavy links": HEAVY_LINKS,
    "symmetric": symmetric(),
}
START = [0.5, 2.8, -0.8]


@pytest.mark.parametrize("name", first_of(ROBOTS, 2))
def test_forces_are_the_inverse_dynamics_of_the_robot(name):
    prototype = ROBOTS[name]
    dae = translate(Feedforward(prototype))
    assert len(dae.states) == 9  # three filters of order three; the robot inside adds none
    assert not dae.algebraics
    ways = ["robot.tool.r", "robot.tool.v", "der(robot.tool.v)"]
    motions = random_motions(prototype)
    found = mapped(dae.function(ways, ["f", "q", "v", "a", "r"]), *motions)
    accelerations = [f"der({rate})" for rate in RATES]
    robot = translate(GantryTau(prototype)).function(
        ["tool.r", "tool.v", "der(tool.v)"], [*FORCES, *CARTS, *RATES, *accelerations, "tool.r"]
    )
    assert relative(found, mapped(robot, *motions)).max() < 1e-9


@pytest.mark.parametrize("name", first_of(ROBOTS, 2))
def test_forces_for_measured_speeds_are_those_of_the_robot(name):
    prototype = ROBOTS[name]
    dae = translate(InverseDynamics(prototype))
    assert not dae.states
    assert not dae.algebraics
    positions, velocities, accelerations = random_motions(prototype, seed=1)
    rates = [f"der({rate})" for rate in RATES]
    robot = translate(GantryTau(prototype)).function(
        ["tool.r", "tool.v", "der(tool.v)"], [*CARTS, *RATES, *rates, *FORCES]
    )
    q, v, a, forces = np.split(mapped(robot, positions, velocities, accelerations), 4, axis=1)
    found = mapped(dae.function(["q", "v", "a"], ["f", "tool_v", "r"]), q, v, a)
    assert relative(found[:, :3], forces).max() < 1e-9
    np.testing.assert_allclose(found[:, 3:6], velocities, atol=1e-9)
    np.testing.assert_allclose(found[:, 6:], positions, atol=1e-12)


def test_the_reference_passes_through_filters_of_order_three():
    bandwidth, step = 50.0, 1e-3
    moved = simulate(
        Feedforward(prototypes.GT_A, start=START, bandwidth=bandwidth),
        stop=0.2,
        inputs={
            "r_ref[0]": ([0.0, 1e-9, 1.0], [0.5, 0.5 + step, 0.5 + step]),
            "r_ref[1]": 2.8,
            "r_ref[2]": -0.8,
        },
        tolerance=1e-10,
    )
    # three equal poles: 1 - (1 + x + x^2/2) exp(-x) with x = t / time constant
    x = moved.time * bandwidth / coefficients(3, "critical")[3] ** (1 / 3)
    expected = 0.5 + step * (1 - (1 + x + x**2 / 2) * np.exp(-x))
    np.testing.assert_allclose(moved["r"][:, 0], expected, atol=1e-9)  # m; ten times tolerance, and the ramp
    np.testing.assert_allclose(moved["r"][:, 1:], [START[1:]] * len(x), atol=1e-12)


def test_robot_driven_by_the_forces_follows_the_reference():
    def reference(k):
        return lambda t: START[k] + [0.1, 0.05, 0.08][k] * ca.sin(3 * t) ** 2

    inputs = {f"r_ref[{k}]": reference(k) for k in range(3)}
    planned = simulate(
        Feedforward(prototypes.L1, start=START), stop=0.5, inputs=inputs, tolerance=1e-10, points=2001
    )
    forces = {f"carts[{i}].f": (planned.time, planned["f"][:, i]) for i in range(3)}
    motion = simulate(
        GantryTau(prototypes.L1, tool=dict(r=Fixed(START))),
        stop=0.5,
        inputs=forces,
        tolerance=1e-10,
        points=2001,
    )
    assert np.ptp(planned["r"], axis=0).min() > 0.02  # m
    # straight lines between samples of the forces: 1/8 of f'' h^2, about 1e-4 N, for half a second
    np.testing.assert_allclose(motion["tool.r"], planned["r"], atol=1e-6)


def test_the_robot_inside_can_be_modified():
    # guideways of GT_A are level: only the plate weighs on the carts
    still = translate(Feedforward(prototypes.GT_A, start=START)).evaluate({})
    heavier = Feedforward(prototypes.GT_A, start=START, robot=dict(plate_mass=2 * prototypes.GT_A.plate_mass))
    np.testing.assert_allclose(translate(heavier).evaluate({})["f"], 2 * still["f"], rtol=1e-9)
    gone = translate(Feedforward(prototypes.L1, friction=None)).function(
        ["robot.tool.r", "robot.tool.v", "der(robot.tool.v)"], ["f"]
    )
    with_friction = translate(Feedforward(prototypes.L1)).function(
        ["robot.tool.r", "robot.tool.v", "der(robot.tool.v)"], ["f", "v"]
    )
    f, v = with_friction(START, [0.3, 0.2, -0.1], [0.0] * 3)
    friction = np.array(prototypes.L1.coulomb) * np.tanh(np.ravel(v) / 0.05) + np.array(
        prototypes.L1.viscous
    ) * np.ravel(v)
    rest = np.ravel(f - gone(START, [0.3, 0.2, -0.1], [0.0] * 3))
    np.testing.assert_allclose(rest, friction, rtol=1e-10)


def test_an_order_too_low_is_refused():
    with pytest.raises(ModelError, match=r"r_ref"):
        simulate(
            Feedforward(prototypes.L1, start=START, filters=dict(order=1)),
            stop=0.1,
            inputs={f"r_ref[{k}]": ([0.0, 1.0], [START[k]] * 2) for k in range(3)},
        )
