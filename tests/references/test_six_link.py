"""The six-link reference against itself: energies, balances of forces, finite differences, Lagrange by CasADi."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from tests.references import six_link, six_link_motion
from tests.references.rotations import turn
from tests.references.six_link import ARMS, SixLink, State

ROBOTS = {
    "nominal": six_link.parameters_L1(),
    "symmetric": six_link.parameters_symmetric(),
    "longer": six_link.parameters_longer(),
    "disturbed": six_link.parameters_disturbed(),
}
START = np.array([0.9, 2.75, -0.55])  # m
FORCE = np.array([10.0, -5.0, 5.0])  # N


@pytest.fixture(params=ROBOTS, name="robot")
def robot_of_each_geometry(request: pytest.FixtureRequest) -> SixLink:
    return ROBOTS[request.param]


def speeds(state: State) -> np.ndarray:
    return np.concatenate([state.T_dot, state.w, state.q_dot])


def moved(
    state: State, u: np.ndarray, u_dot: np.ndarray, t: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pose after t along a motion with these speeds and accelerations now; wrong by t^3."""
    x = t * u + t**2 / 2 * u_dot
    return state.T + x[:3], turn(x[3:6]) @ state.R, state.q + x[6:]


def test_states_are_consistent(robot):
    for state in six_link.consistent_states(robot, 50, seed=0):
        assert np.abs(six_link.constraints(robot, *state[:3])).max() < 1e-13  # rounding of lengths of 2 m
        A = six_link.constraint_jacobian(robot, *state[:3])
        assert np.abs(A @ speeds(state)).max() < 1e-12  # rounding times the condition of the pose, below 1e3


@pytest.mark.parametrize("name", ["nominal", "symmetric"])
def test_parallel_links_keep_the_plate_level(name):
    for state in six_link.consistent_states(ROBOTS[name], 50, seed=1):
        found = six_link.accelerations(ROBOTS[name], *state, FORCE)
        assert np.abs(state.R - np.eye(3)).max() < 1e-12
        assert np.abs(found.w_dot).max() < 1e-10  # rounding times a condition of up to 1e5


def test_jacobian_and_its_rate_are_derivatives_of_the_constraints(robot):
    h = 1e-4
    for state in six_link.consistent_states(robot, 20, seed=2):
        u, u_dot = speeds(state), np.concatenate(six_link.accelerations(robot, *state, FORCE)[:3])
        A, c = six_link.constraint_jacobian(robot, *state[:3]), six_link.constraint_bias(robot, state)
        any_u = np.arange(9) - 4.0  # the first rate holds for inconsistent speeds too
        ahead, behind = (
            six_link.constraints(robot, *moved(state, any_u, 0 * u, side * h)) for side in (1.0, -1.0)
        )
        assert np.allclose((ahead - behind) / (2 * h), A @ any_u, atol=1e-5)  # h^2 times third derivatives
        assert np.abs(A @ u_dot + c).max() < 1e-9 * (1 + np.abs(c).max())  # rounding times the condition
        later = [six_link.constraints(robot, *moved(state, u, u_dot, side * h)) for side in (1.0, -1.0)]
        assert np.abs(sum(later)).max() < 1e-13 + 1e3 * h**4  # the third derivatives cancel


def test_bodies_obey_newton_and_euler(robot):
    """Forces at the ends of each link from its tension and the motion of its middle."""
    up = np.array([0, 0, robot.g])
    for state in six_link.consistent_states(robot, 20, seed=3):
        T, R, q, _, w, _ = state
        T_ddot, w_dot, q_ddot, tension = six_link.accelerations(robot, *state, FORCE)
        arms = robot.plate_joints @ R.T
        d = six_link.link_vectors(robot, T, R, q)
        pull = tension[:, None] * d / robot.lengths[:, None]
        ends = T_ddot + np.cross(w_dot, arms) + np.cross(w, np.cross(w, arms))
        middles = (ends + (q_ddot[:, None] * robot.directions)[ARMS]) / 2
        carried = robot.link_masses[:, None] / 2 * (middles + up)
        on_plate, on_carts = -pull - carried, pull - carried
        J = R @ robot.plate_inertia @ R.T
        size = 1e-10 * (1 + np.abs(tension).max())
        assert np.allclose(robot.plate_mass * (T_ddot + up), on_plate.sum(axis=0), atol=size)
        assert np.allclose(J @ w_dot + np.cross(w, J @ w), np.cross(arms, on_plate).sum(axis=0), atol=size)
        for i, v in enumerate(robot.directions):
            force = FORCE[i] + v @ on_carts[ARMS == i].sum(axis=0)
            assert robot.cart_masses[i] * v @ (q_ddot[i] * v + up) == pytest.approx(force, abs=size)


def lagrange(robot: SixLink, state: State) -> ca.Function:
    """Lagrange's equations by automatic differentiation, in T, the rotation vector from R, and q."""
    x, v = ca.SX.sym("x", 9), ca.SX.sym("v", 9)
    K = ca.skew(x[3:6])
    turned = (ca.SX.eye(3) + K + K @ K / 2 + K @ K @ K / 6) @ ca.DM(state.R)  # exact to order 3 at x = 0
    carts = [ca.DM(robot.cart_joints[k]) + x[6 + i] * ca.DM(robot.directions[i]) for k, i in enumerate(ARMS)]
    plate = [x[:3] + turned @ ca.DM(b) for b in robot.plate_joints]
    points = [(robot.plate_mass, x[:3])]
    points += [(robot.cart_masses[i], x[6 + i] * ca.DM(robot.directions[i])) for i in range(3)]
    points += [(m, (a + b) / 2) for m, a, b in zip(robot.link_masses, carts, plate, strict=True)]
    # a plate is its tetrad of points on the body axes: sum of m r r' = trace(J) / 2 - J
    spread = np.trace(robot.plate_inertia) / 2 * np.eye(3) - robot.plate_inertia
    rate = ca.reshape(ca.jtimes(ca.vec(turned), x, v), 3, 3)
    kinetic = sum(m * ca.sumsqr(ca.jtimes(r, x, v)) / 2 for m, r in points)
    kinetic += ca.trace(rate @ ca.DM(spread) @ rate.T) / 2
    potential = sum(robot.g * m * r[2] for m, r in points)
    lengths = ca.vertcat(*(ca.norm_2(b - a) for a, b in zip(carts, plate, strict=True)))
    momentum = ca.gradient(kinetic, v)
    bias = ca.jtimes(momentum, x, v) - ca.gradient(kinetic - potential, x)
    rates = ca.jtimes(lengths, x, v)
    outputs = [ca.jacobian(momentum, v), bias, ca.jacobian(lengths, x), ca.jtimes(rates, x, v)]
    return ca.Function("lagrange", [x, v], outputs)


def test_accelerations_are_those_of_lagrange(robot):
    for state in six_link.consistent_states(robot, 3, seed=4):
        at = ca.vertcat(state.T, np.zeros(3), state.q)
        M, b, A, c = (np.asarray(part) for part in lagrange(robot, state)(at, speeds(state)))
        force = np.concatenate([np.zeros(6), FORCE]) - b.ravel()
        matrix = np.block([[M, A.T], [A, np.zeros((6, 6))]])
        expected = np.linalg.solve(matrix, np.concatenate([force, -c.ravel()]))
        found = np.concatenate(six_link.accelerations(robot, *state, FORCE))
        assert np.allclose(found, expected, rtol=1e-9, atol=1e-9)  # rounding times a condition of up to 1e5


def test_energy_grows_by_the_work_of_the_carts(robot):
    motion = six_link_motion.simulate(robot, START, FORCE, stop=0.4)
    states = [six_link_motion.state(y) for y in motion.y.T]
    balance = [six_link.energy(robot, state) - FORCE @ state.q for state in states]
    assert np.ptp(balance) < 1e-7  # J, of tens of J in motion: ten times the tolerance of the integrator
    still = states[-1]._replace(T_dot=np.zeros(3), w=np.zeros(3), q_dot=np.zeros(3))
    assert six_link.energy(robot, states[-1]) - six_link.energy(robot, still) > 10  # J, not a robot at rest


@pytest.mark.parametrize(("name", "time"), [("nominal", 0.6670810), ("symmetric", 0.6756171)])
def test_singular_pose_is_met(name, time):
    """From rest at START under FORCE; measured with two integrators and tolerances."""
    robot = ROBOTS[name]
    motion = six_link_motion.level_motion(robot, START, FORCE, stop=0.7)
    found = six_link_motion.singular_time(robot, motion)
    assert found == pytest.approx(time, abs=2e-7)  # the last digit written here
    now = six_link_motion.level_state(motion.sol(found))
    normal = np.cross(*np.diff(robot.plate_joints[3:], axis=0))
    e = six_link.link_vectors(robot, *now[:3])[3] / robot.lengths[3]
    assert abs(e @ normal) < 1e-12 * np.linalg.norm(normal)  # links 3a, 3b and 3c in one plane
    left, values, _ = np.linalg.svd(six_link.constraint_jacobian(robot, *now[:3]))
    assert values[-1] < 1e-9  # A has rank five with the columns of the carts, too
    assert values[-2] > 0.1
    assert np.abs(left[:3, -1]).max() < 1e-9  # the tensions that do nothing are of arm 3 alone,
    assert abs(left[:, -1].sum()) < 1e-9  # with the sum zero


def test_tensions_grow_as_the_singular_pose_is_approached():
    robot = ROBOTS["symmetric"]
    level = six_link_motion.level_motion(robot, START, FORCE, stop=0.7)
    time = six_link_motion.singular_time(robot, level)
    whole = six_link_motion.simulate(robot, START, FORCE, stop=0.66)
    assert np.allclose(whole.y[:3, -1], level.sol(0.66)[:3], atol=1e-8)  # m, a hundred times the tolerance
    strength = []
    for before in (4e-3, 2e-3, 1e-3):
        now = six_link_motion.level_state(level.sol(time - before))
        strength.append(before * np.abs(six_link.accelerations(robot, *now, FORCE).tension).max())
    assert np.ptp(strength) < 0.01 * strength[-1]  # tension is as 1 / (time - t), to first order


def test_no_singular_pose_is_refused():
    motion = six_link_motion.level_motion(ROBOTS["nominal"], START, FORCE, stop=0.1)
    with pytest.raises(ValueError, match=r"keeps its sign until 0\.1 s"):
        six_link_motion.singular_time(ROBOTS["nominal"], motion)


def test_unreachable_pose_is_refused():
    with pytest.raises(ArithmeticError, match="start nearer to the pose"):
        six_link.plate_pose(ROBOTS["nominal"], np.array([-5.0, 0.0, 5.0]), START, np.eye(3))
