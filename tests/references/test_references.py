"""The hand-written references against conservation laws, analytic cases and finite differences."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.references import chain, four_bar, free_body
from tests.references.rotations import random_rotation, skew, turn

ANGLES = np.linspace(0.1, 6.2, 13)  # rad, all round


def test_rotation_is_the_exponential():
    rng = np.random.default_rng(0)
    for size in (0.0, 1e-9, 1e-3, 1.0, 3.0):
        a = size * rng.normal(size=3)
        series = sum(np.linalg.matrix_power(skew(a), k) / np.prod(np.arange(1.0, k + 1)) for k in range(60))
        assert np.allclose(turn(a), series, atol=1e-11)  # rounding of the series at 6 rad


# four-bar loop


@pytest.mark.parametrize("branch", [1, -1])
def test_loop_and_its_derivatives(branch):
    bars, h = four_bar.example(), 1e-5
    a, b, c = bars.lengths
    for theta in ANGLES:
        below, now, above = (four_bar.loop(bars, theta + step, branch) for step in (-h, 0.0, h))
        e = [four_bar.along(angle) for angle in now.angles]
        assert np.allclose(a * e[0] + b * e[1], [bars.ground + c * e[2][0], c * e[2][1]], atol=1e-14)
        change = (above.angles - below.angles + np.pi) % (2 * np.pi) - np.pi
        assert np.allclose(change / (2 * h), now.slopes, atol=1e-8)  # h^2 times third derivatives
        assert np.allclose((above.slopes - below.slopes) / (2 * h), now.curvatures, atol=1e-7)


@pytest.mark.parametrize("branch", [1, -1])
@pytest.mark.parametrize("gravity", [(0.0, -9.81), (9.81, 0.0), (3.0, 4.0), (0.0, 0.0)])
def test_one_coordinate_and_pin_forces_agree(branch, gravity):
    bars = four_bar.example(gravity)
    for theta in ANGLES:
        lagrange = four_bar.accelerations(bars, theta, w=2.5, torque=1.5, branch=branch)
        newton, pins = four_bar.accelerations_with_reactions(bars, theta, 2.5, 1.5, branch)
        assert np.allclose(lagrange, newton, atol=1e-11)  # rounding
        _, r1, r2 = four_bar.centre_motion(bars, four_bar.loop(bars, theta, branch))
        centres = r1 * newton[0] + r2 * 2.5**2
        momentum = bars.masses @ (centres - bars.gravity)
        assert np.allclose(pins[0] + pins[3], momentum, atol=1e-10)  # what the ground carries


def test_four_bar_keeps_its_energy_and_gains_the_work_of_a_torque():
    bars, torque = four_bar.example(), 2.0

    def rates(t, y):
        return [y[1], four_bar.accelerations(bars, y[0], y[1], torque)[0]]

    motion = solve_ivp(rates, (0, 3), [0.3, 8.0], method="DOP853", rtol=1e-11, atol=1e-12)
    theta = motion.y[0]
    balance = [four_bar.energy(bars, *y) - torque * y[0] for y in motion.y.T]
    assert np.ptp(balance) < 1e-7  # J, of hundreds: ten times the integrator's tolerance
    assert np.ptp(theta) > 2 * np.pi  # the crank went all round


def test_parallelogram_is_a_pendulum():
    """Equal cranks that stay parallel: the coupler is a point mass at their tips."""
    a, m, J = 0.5, 2.0, 0.03
    bars = four_bar.FourBar(
        ground=0.8,
        lengths=np.array([a, 0.8, a]),
        masses=np.array([m, 3.0, m]),
        centres=np.array([[a / 2, 0], [0.4, 0], [a / 2, 0]]),
        inertias=np.array([J, 0.2, J]),
        gravity=np.array([0.0, -9.81]),
    )
    inertia = 2 * (J + m * a**2 / 4) + 3.0 * a**2
    for theta in (0.7, 1.4, 2.2):
        expected = -9.81 * (2 * m * a / 2 + 3.0 * a) * np.cos(theta) / inertia
        found = four_bar.accelerations(bars, theta, w=1.7, branch=1)
        assert np.allclose(found, [expected, 0, expected], atol=1e-12)


def test_gravity_in_a_tilted_plane():
    rng = np.random.default_rng(1)
    rotation = random_rotation(rng)
    g = four_bar.gravity_in_plane(rotation)
    r = rng.normal(size=2)
    assert g @ r == pytest.approx(np.array([0, 0, -9.81]) @ rotation @ [*r, 0], abs=1e-13)
    assert np.allclose(four_bar.gravity_in_plane(np.eye(3)), 0)  # a horizontal plane carries all


def test_open_loop_is_refused():
    short = replace(four_bar.example(), lengths=np.array([0.3, 0.3, 0.3]))
    with pytest.raises(ValueError, match="cannot be joined there, choose another theta"):
        four_bar.loop(short, 3.0)


# body without torque

BODIES = {
    "asymmetric": np.diag([1.0, 2.0, 3.5]),
    "flat": np.diag([1.0, 1.0, 1.9]),
    "long": np.diag([0.3, 2.0, 2.0]),
    "reordered": np.diag([2.0, 3.5, 1.0]),
}
SPINS = [
    (2.0, 0.4, 0.3),
    (0.2, 0.5, -2.0),
    (0.01, 2.0, 0.02),
    (-1.0, -1.0, 1.0),
    (0.0, 0.0, 1.5),
    (-0.1, 0.0, -2.0),
]


def tumbled(J, R, w, t):
    """(w, R) by integration of Euler's equations."""

    def rates(_, y):
        return np.concatenate(
            [np.linalg.solve(J, np.cross(J @ y[:3], y[:3])), (y[3:].reshape(3, 3) @ skew(y[:3])).ravel()]
        )

    y = solve_ivp(rates, (0, t), np.concatenate([w, R.ravel()]), method="DOP853", rtol=1e-12, atol=1e-13).y[
        :, -1
    ]
    return y[:3], y[3:].reshape(3, 3)


@pytest.mark.parametrize("general", [False, True])
@pytest.mark.parametrize("spin", SPINS)
@pytest.mark.parametrize("name", BODIES)
def test_free_body_is_that_of_euler(name, spin, general):
    J, w = BODIES[name], np.array(spin)
    rng = np.random.default_rng(2)
    R = random_rotation(rng)
    if general:
        turned = random_rotation(rng)
        J, w = turned @ J @ turned.T, turned @ w
    for t in (0.7, 8.0):
        expected_w, expected_R = tumbled(J, R, w, t)
        found_w, found_R = free_body.angular_velocity(J, w, t), free_body.orientation(J, R, w, t)
        assert np.allclose(found_w, expected_w, atol=1e-8)  # errors of 1e-12 grow by 1e3 near the middle axis
        assert np.allclose(found_R, expected_R, atol=1e-8)
        assert free_body.energy(J, found_w) == pytest.approx(free_body.energy(J, w), rel=1e-12)
        before, after = free_body.angular_momentum(J, R, w), free_body.angular_momentum(J, found_R, found_w)
        assert np.allclose(before, after, atol=1e-10)


def test_symmetric_top_is_two_rotations():
    R, w = random_rotation(np.random.default_rng(3)), np.array([0.4, -0.3, 2.0])
    general = free_body.orientation(np.diag([1.0, 1.0, 1.9]), R, w, 5.0)
    assert np.allclose(general, free_body.symmetric_orientation(1.0, 1.9, R, w, 5.0), atol=1e-9)


def test_sphere_keeps_its_angular_velocity():
    w = np.array([1.0, 2.0, 3.0])
    assert np.array_equal(free_body.angular_velocity(0.7 * np.eye(3), w, 4.0), w)
    assert np.allclose(free_body.orientation(0.7 * np.eye(3), np.eye(3), w, 4.0), turn(4.0 * w), atol=1e-10)


# serial chain


def random_motion(count, seed):
    rng = np.random.default_rng(seed)
    return rng.uniform(-3, 3, count), rng.uniform(-2, 2, count), rng.uniform(-5, 5, count)


@pytest.mark.parametrize("count", [1, 2, 6, 12])
def test_composite_bodies_and_newton_euler_agree(count):
    arm = chain.random_chain(count)
    phi, w, tau = random_motion(count, seed=count)
    w_dot = chain.forward_dynamics(arm, phi, w, tau)
    assert np.allclose(chain.inverse_dynamics(arm, phi, w, w_dot), tau, atol=1e-9)  # rounding
    still = chain.inverse_dynamics(arm, phi, w, np.zeros(count))
    columns = [chain.inverse_dynamics(arm, phi, w, unit) - still for unit in np.eye(count)]
    assert np.allclose(np.array(columns).T, chain.mass_matrix(arm, phi), atol=1e-10)


@pytest.mark.parametrize("count", [1, 3, 5])
def test_chain_is_that_of_lagrange(count):
    """d/dt dE/dw - dE/dphi of energies written with the derivative of every place, by CasADi."""
    arm = chain.random_chain(count, seed=7)
    phi, w, tau = random_motion(count, seed=8)
    x, v = ca.SX.sym("x", count), ca.SX.sym("v", count)
    R, p, kinetic, potential = ca.SX.eye(3), ca.SX.zeros(3), ca.SX(0), ca.SX(0)
    for i in range(count):
        p = p + R @ arm.offsets[i]
        K = ca.skew(arm.axes[i])
        R = R @ (ca.SX.eye(3) + ca.sin(x[i]) * K + (1 - ca.cos(x[i])) * K @ K)
        centre = p + R @ arm.centres[i]
        spin = ca.inv_skew(R.T @ ca.reshape(ca.jtimes(ca.vec(R), x, v), 3, 3))
        kinetic += arm.masses[i] * ca.sumsqr(ca.jtimes(centre, x, v)) / 2
        kinetic += spin.T @ arm.inertias[i] @ spin / 2
        potential -= arm.masses[i] * ca.dot(ca.DM(arm.gravity), centre)
    momentum = ca.gradient(kinetic, v)
    bias = ca.jtimes(momentum, x, v) - ca.gradient(kinetic - potential, x)
    system = ca.Function("system", [x, v], [ca.jacobian(momentum, v), bias, kinetic + potential])
    M, b, E = (np.asarray(part) for part in system(phi, w))
    assert np.allclose(
        chain.forward_dynamics(arm, phi, w, tau), np.linalg.solve(M, tau - b.ravel()), rtol=1e-9, atol=1e-9
    )
    assert chain.energy(arm, phi, w) == pytest.approx(float(E[0, 0]), rel=1e-12)


def test_chain_keeps_its_energy():
    arm = chain.random_chain(4, seed=1)
    phi, w, _ = random_motion(4, seed=2)

    def rates(_, y):
        return np.concatenate([y[4:], chain.forward_dynamics(arm, y[:4], y[4:], np.zeros(4))])

    motion = solve_ivp(rates, (0, 0.5), np.concatenate([phi, w]), method="DOP853", rtol=1e-10, atol=1e-11)
    energies = [chain.energy(arm, y[:4], y[4:]) for y in motion.y.T]
    assert np.ptp(energies) < 1e-7 * abs(energies[0])  # a thousand times the integrator's tolerance
