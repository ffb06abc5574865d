"""The delta robot with all six rods, against spheres that meet and Lagrange's equations with multipliers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gantrytau import Fixed, InitializationError, Start, simulate, translate
from gantrytau_models.mechanisms.delta import DeltaRobot
from tests.references import delta

ANGLES = [f"arms[{i}].phi" for i in range(3)]
SPEEDS = [f"arms[{i}].w" for i in range(3)]
TORQUES = [f"arms[{i}].tau" for i in range(3)]
INERTIA = np.diag([1e-3, 1e-3, 2e-3])
PEER = delta.Delta(
    0.2, 0.3, 0.06, 0.12, np.full(6, 0.8), 0.6, 0.02 + 0.6 * 0.09 / 12, 0.1, 0.5, INERTIA
)  # fmt: skip


@pytest.fixture(scope="module")
def robot():
    return translate(DeltaRobot())


def places(count, seed=0):
    """Places of the plate in a cylinder below the base, velocities, torques."""
    random = np.random.default_rng(seed)
    while count:
        x, y, z = random.uniform([-0.3, -0.3, -0.9], [0.3, 0.3, -0.6])
        T = np.array([x, y, z])
        if np.hypot(x, y) < 0.3 and np.all(np.isfinite(delta.angles(PEER, T))):
            count -= 1
            yield T, random.normal(size=3), random.normal(size=3) * 5


def test_three_degrees_of_freedom(robot):
    assert robot.diagnosis.mobility == 3
    assert robot.diagnosis.redundant == ()  # rods turn about themselves, and hold nothing twice
    assert set(robot.inputs) == set(TORQUES)


def test_plate_stays_level_where_three_spheres_meet(robot):
    for T, *_ in places(6):
        phi = delta.angles(PEER, T)
        at = robot.evaluate(dict(zip(ANGLES, phi, strict=True)))
        np.testing.assert_allclose(at["tool.R"], np.eye(3), rtol=0, atol=1e-12)
        np.testing.assert_allclose(at["tool.r"], delta.position(PEER, phi), rtol=0, atol=1e-12)
        np.testing.assert_allclose(at["tool.r"], T, rtol=0, atol=1e-12)


def test_forward_and_inverse_dynamics(robot):
    for T, T_dot, tau in places(4, seed=1):
        state = delta.level_state(PEER, T, T_dot)
        expected = delta.accelerations(PEER, state, tau)
        driven = robot.evaluate({"tool.r": T, "tool.v": T_dot} | dict(zip(TORQUES, tau, strict=True)))
        found = np.concatenate([driven["der(tool.v)"], driven["tool.w"], [driven[n] for n in SPEEDS]])
        exact = np.concatenate([expected[:3], state.w, state.phi_dot])
        assert np.abs(found - exact).max() < 1e-10 * np.abs(exact).max()


def test_forward_and_inverse_dynamics_as_functions(robot):
    forward = robot.function(["tool.r", "tool.v", *TORQUES], ["der(tool.v)"])
    inverse = robot.function(["tool.r", "tool.v", "der(tool.v)"], TORQUES)
    for T, T_dot, tau in places(20, seed=2):
        expected = delta.accelerations(PEER, delta.level_state(PEER, T, T_dot), tau)[:3]
        found = np.array(forward(T, T_dot, *tau)).ravel()
        assert np.abs(found - expected).max() < 1e-10 * np.abs(expected).max()
        needed = np.array([float(x) for x in inverse(T, T_dot, expected)])
        assert np.abs(needed - tau).max() < 1e-10 * np.abs(tau).max()


def test_a_rod_of_another_length_turns_the_plate():
    lengths = PEER.lengths + np.array([0.0, 2e-3, 0.0, 0.0, -1e-3, 0.0])
    rods = [[dict(length=one), dict(length=two)] for one, two in lengths.reshape(3, 2)]
    dae = translate(
        DeltaRobot(arms=[dict(rods=pair) for pair in rods]),
        find=["der(tool.w)", *(f"der({n})" for n in SPEEDS)],
    )
    uneven = replace(PEER, lengths=lengths)
    for T, T_dot, tau in places(3, seed=3):
        at = dae.evaluate({"tool.r": T, "tool.v": T_dot} | dict(zip(TORQUES, tau, strict=True)))
        phi, phi_dot = (np.array([at[name] for name in names]) for names in (ANGLES, SPEEDS))
        state = delta.State(T, at["tool.R"], phi, T_dot, at["tool.w"], phi_dot)
        rods = T + delta.plate_joints(uneven, state.R) - delta.arm_joints(uneven, phi)
        np.testing.assert_allclose(np.linalg.norm(rods, axis=1), lengths, rtol=1e-13)
        assert np.linalg.norm(state.R - np.eye(3)) > 1e-3  # 2 mm on 120 mm
        rates = delta.constraint_jacobian(uneven, state) @ np.concatenate([T_dot, state.w, phi_dot])
        np.testing.assert_allclose(rates, 0.0, atol=1e-12)
        expected = delta.accelerations(uneven, state, tau)
        found = np.concatenate([at["der(tool.v)"], at["der(tool.w)"], [at[f"der({n})"] for n in SPEEDS]])
        assert np.abs(found - expected).max() < 1e-10 * np.abs(expected).max()


def test_energy_is_kept():
    model = DeltaRobot(tool=dict(r=Start([0.1, -0.05, -0.7]), v=Start([1.0, 0.5, 0.8])))
    fall = simulate(model, stop=0.2, tolerance=1e-9, points=41)
    energy = []
    for k in range(41):
        phi, phi_dot = (np.array([fall[name][k] for name in names]) for names in (ANGLES, SPEEDS))
        pose = fall["tool.r"][k], fall["tool.R"][k], phi, fall["tool.v"][k], fall["tool.w"][k], phi_dot
        energy.append(delta.energy(PEER, delta.State(*pose)))
    assert np.ptp(fall["tool.r"], axis=0).max() > 0.1  # m
    assert np.ptp(energy) < 1e-6  # J; a thousand times the integrator's tolerance
    np.testing.assert_allclose(fall["tool.R"], np.tile(np.eye(3), (41, 1, 1)), atol=1e-7)


def test_a_place_out_of_reach_is_refused(robot):
    inverse, lowest = robot.function(["tool.r"], ANGLES), delta.position(PEER, np.full(3, np.pi / 2))
    assert np.all(np.isfinite([float(x) for x in inverse([0.0, 0.0, -1.0])]))
    assert np.all(np.isnan([float(x) for x in inverse(lowest - [0.0, 0.0, 0.1])]))
    with pytest.raises(InitializationError, match=r"DeltaRobot: no consistent start found.*rod"):
        translate(DeltaRobot(tool=dict(r=Fixed([0.0, 0.0, -1.2]))))
