"""The hand-written closed form against Lagrange's equations with multipliers, derived by CasADi."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from tests.benchmarks import closed_form as cf

ROBOTS = {
    "massless links": cf.GT_A,
    "heavy links": cf.GT_A_HEAVY_LINKS,
    "piecewise linear friction": replace(cf.GT_A_HEAVY_LINKS, friction="piecewise linear"),
    "no friction": replace(cf.GT_A_HEAVY_LINKS, friction=None),
}


def lagrange(robot: cf.ThreeLink, T, dT, f):
    """(T'', q'', q, q') from the energies in the six coordinates (T, q), and three multipliers."""
    x, v, net = ca.SX.sym("x", 6), ca.SX.sym("v", 6), ca.SX.sym("net", 3)
    carts = [ca.vertcat(x[3 + i], 0, 0) + ca.DM(robot.offsets[i]) for i in range(3)]
    constraint = ca.vertcat(*(ca.sumsqr(x[:3] - carts[i]) - robot.lengths[i] ** 2 for i in range(3)))
    places = [(robot.plate_mass, x[:3])]
    places += [(robot.cart_masses[i], carts[i]) for i in range(3)]
    places += [(robot.link_masses[i], (x[:3] + carts[i]) / 2) for i in range(3)]
    kinetic = sum(m * ca.sumsqr(ca.jtimes(r, x, v)) / 2 for m, r in places)
    potential = robot.g * (robot.plate_mass * x[2] + sum(robot.link_masses) * x[2] / 2)
    mass, _ = ca.hessian(kinetic, v)
    A = ca.jacobian(constraint, x)
    curvature = ca.jtimes(ca.jtimes(constraint, x, v), x, v)
    force = ca.vertcat(0, 0, 0, net) - ca.gradient(potential, x)
    matrix = ca.blockcat([[mass, A.T], [A, ca.SX(3, 3)]])
    system = ca.Function("system", [x, v, net], [matrix, ca.vertcat(force, -curvature), A])

    tool = np.asarray(T)
    offsets = np.array(robot.offsets)
    across = tool[1:] - offsets[:, 1:]
    q = tool[0] - offsets[:, 0] - np.sqrt(np.array(robot.lengths) ** 2 - (across**2).sum(axis=1))
    point = np.concatenate([tool, q])
    A = np.asarray(system(point, np.zeros(6), np.zeros(3))[2])
    dq = -np.linalg.solve(A[:, 3:], A[:, :3] @ dT)
    friction = [float(ca.DM(ca.evalf(cf.friction_force(robot, i, ca.SX(dq[i]))))) for i in range(3)]
    matrix, right, _ = system(point, np.concatenate([dT, dq]), np.asarray(f) - friction)
    solution = np.linalg.solve(np.asarray(matrix), np.asarray(right).ravel())
    return solution[:3], solution[3:6], q, dq


def states(n: int):
    """Random tool positions in the workspace, velocities and forces, fixed seed."""
    random = np.random.default_rng(2012)
    for _ in range(n):
        yield (
            random.uniform([0.0, 2.5, -1.1], [1.8, 3.5, -0.2]),
            random.uniform(-2, 2, 3),
            random.uniform(-1200, 1200, 3),
        )


@pytest.mark.parametrize("name", ROBOTS)
def test_forward_and_inverse_dynamics_are_lagranges_equations(name):
    robot = ROBOTS[name]
    T, dT, w = (ca.SX.sym(n, 3) for n in ("T", "dT", "w"))
    forward = cf.forward_dynamics_function(robot)
    inverse = ca.Function("inverse", [T, dT, w], [cf.inverse_dynamics(robot, T, dT, w)])
    for tool, velocity, force in states(40):
        ddT, *_ = lagrange(robot, tool, velocity, force)
        mine = np.asarray(forward(tool, velocity, force)).ravel()
        assert np.linalg.norm(mine - ddT) < 1e-11 * np.linalg.norm(ddT)
        back = np.asarray(inverse(tool, velocity, mine)).ravel()
        assert np.linalg.norm(back - force) < 1e-11 * np.linalg.norm(force)


def test_matrices_and_kinematics_satisfy_the_printed_relations():
    robot = cf.GT_A_HEAVY_LINKS
    T, dT, q, dq, ddq = (ca.SX.sym(n, 3) for n in ("T", "dT", "q", "dq", "ddq"))
    kinematics = ca.Function(
        "kinematics", [T], [cf.inverse_kinematics(robot, T), cf.velocity_jacobian(robot, T)]
    )
    tool_of = ca.Function("tool", [q], [cf.forward_kinematics(robot, q)])
    relation = ca.Function("relation", [T, dT, dq, ddq], [cf.accelerations(robot, T, dT, dq, ddq)])
    matrices = ca.Function("matrices", [T], [cf.mass_matrix_tool(robot, T), cf.mass_matrix_carts(robot, T)])
    for tool, velocity, force in states(40):
        ddT, ddq_, q_, dq_ = lagrange(robot, tool, velocity, force)
        carts, W = (np.asarray(value) for value in kinematics(tool))
        assert np.allclose(carts.ravel(), q_, rtol=0, atol=1e-14)
        assert np.allclose(np.asarray(tool_of(carts)).ravel(), tool, rtol=0, atol=1e-12)
        assert np.allclose(W @ velocity, dq_, rtol=0, atol=1e-12)
        back = np.asarray(relation(tool, velocity, dq_, ddq_)).ravel()
        assert np.linalg.norm(back - ddT) < 1e-11 * np.linalg.norm(ddT)
        M1, M2 = (np.asarray(value) for value in matrices(tool))
        friction = [float(ca.DM(ca.evalf(cf.friction_force(robot, i, ca.SX(dq_[i]))))) for i in range(3)]
        power = W.T @ (force - friction)
        balance = M1 @ ddT + M2 @ ddq_ + np.asarray(cf.gravity(robot)).ravel() - power
        assert np.linalg.norm(balance) < 1e-11 * np.linalg.norm(power)


def test_the_right_hand_side_is_as_short_as_a_careful_engineer_writes_it():
    assert cf.forward_dynamics_function(cf.GT_A).n_instructions() <= 256
