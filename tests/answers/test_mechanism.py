"""The four systems of equations extracted from the robot, against Lagrange's equations written by hand.

Dressler (2012), 6.3 to 6.7: D_i = T - A_i - s_i e_i is the link vector, e_i the direction of guideway i as printed, W = J^-1
with rows D_i' / (D_i' e_i). Kinetic energy with a point mass in the middle of each link, at (T + A_i + s_i e_i) / 2:
the virtual work of the inertia forces of the plate m_p T'', the carts m_i e_i s_i'', the links m_a,i (T'' + e_i s_i'') / 2
along dT and ds = W dT gives

    M1 = (m_p + sum m_a / 4) 1 + sum m_a,i / 4 W_i e_i'
    M2 = column i: (m_i + m_a,i / 4) |e_i|^2 W_i + m_a,i / 4 e_i
    G  = g (m_p + sum m_a / 2) e_z + sum g e_i,z (m_i + m_a,i / 2) W_i         W_i: row i of W as a column
"""

import dataclasses
import re
from functools import cache

import casadi as ca
import numpy as np
import pytest

from gantrytau import translate
from gantrytau.answers.extraction.extraction import extract_mechanism
from gantrytau.language.symbols import derivative_name
from gantrytau.mechanics.translational import TanhFriction
from gantrytau_models import GantryTau, prototypes
from tests.benchmarks import closed_form

CARTS = [f"carts[{i}].s" for i in range(3)]
FORCES = [f"carts[{i}].f" for i in range(3)]
LINKS = {"light": (0.0, 0.0, 0.0), "heavy links": (1.0, 2.0, 3.0)}


@cache
def robot(name, links):
    """A robot with other links; L1 and D1 have guideways that are neither parallel nor of unit length."""
    return dataclasses.replace(getattr(prototypes, name), link_masses=LINKS[links])


@cache
def dae_of(name, links, friction=TanhFriction):
    return translate(GantryTau(robot(name, links), friction=friction))


@cache
def mechanism_of(name, links, friction=TanhFriction):
    return extract_mechanism(dae_of(name, links, friction), tool="tool.r", joints=CARTS, forces=FORCES)


def arrays(prototype):
    return (np.array([getattr(arm, n) for arm in prototype.arms]) for n in ("offset", "direction", "length"))


def carts_behind(prototype, T):
    """Cart positions (3,) in m: the smaller root of |T - A - s e| = L."""
    offset, e, length = arrays(prototype)
    gap = T - offset
    a, b = (e**2).sum(axis=1), (e * gap).sum(axis=1)
    return (b - np.sqrt(b**2 - a * ((gap**2).sum(axis=1) - length**2))) / a


def poses(prototype, count=50, seed=0):
    """Tool positions between the guideways, (count, 3), at least a third of a link ahead of the carts."""
    random = np.random.default_rng(seed)
    offset, _, length = arrays(prototype)
    found = []
    while len(found) < count:
        T = random.uniform([-1.0, *offset[:, 1:].min(axis=0)], [2.0, *offset[:, 1:].max(axis=0)])
        if np.all(np.linalg.norm((T - offset)[:, 1:], axis=1) < 0.9 * length):
            found.append(T)
    return np.array(found)


def by_hand(prototype, T, q):
    """W, M1, M2 and G as derived above."""
    offset, e, _ = arrays(prototype)
    D = T - offset - q[:, None] * e
    W = D / (D * e).sum(axis=1)[:, None]
    quarter, carts = np.array(prototype.link_masses) / 4, np.array(prototype.cart_masses)
    M1 = (prototype.plate_mass + quarter.sum()) * np.eye(3) + (W * quarter[:, None]).T @ e
    M2 = (W * ((carts + quarter) * (e**2).sum(axis=1))[:, None]).T + (e * quarter[:, None]).T
    G = (prototype.plate_mass + 2 * quarter.sum()) * np.eye(3)[2] + W.T @ (e[:, 2] * (carts + 2 * quarter))
    return W, M1, M2, 9.81 * G


def numbers(function, *arguments):
    return np.squeeze(np.array(function(*arguments)))


@pytest.mark.parametrize("links", LINKS)
@pytest.mark.parametrize("name", ["L1", "D1", "GT_A"])
def test_jacobian_masses_and_gravity_equal_the_derivation_by_hand(name, links):
    prototype, mechanism = robot(name, links), mechanism_of(name, links)
    for T in poses(prototype):
        q = carts_behind(prototype, T)
        expected = by_hand(prototype, T, q)
        for function, value in zip(
            (mechanism.velocity_jacobian, mechanism.M1, mechanism.M2, mechanism.G), expected, strict=True
        ):
            # roundings of a dozen operations, relative to the largest entry
            assert np.abs(numbers(function, T, q) - value).max() < 1e-12 * np.abs(value).max()


@pytest.mark.parametrize("links", LINKS)
def test_masses_equal_the_closed_form_of_the_benchmark(links):
    prototype, mechanism = robot("GT_A", links), mechanism_of("GT_A", links)
    peer = dataclasses.replace(closed_form.GT_A, link_masses=LINKS[links])
    for T in poses(prototype, seed=1):
        q = carts_behind(prototype, T)
        at = ca.SX(ca.DM(T))
        for function, value in (
            (mechanism.velocity_jacobian, closed_form.velocity_jacobian(peer, at)),
            (mechanism.M1, closed_form.mass_matrix_tool(peer, at)),
            (mechanism.M2, closed_form.mass_matrix_carts(peer, at)),
            (mechanism.G, closed_form.gravity(peer)),
        ):
            expected = np.array(ca.DM(ca.evalf(ca.SX(value))))
            off = np.abs(numbers(function, T, q) - np.squeeze(expected)).max()
            assert off < 1e-12 * np.abs(expected).max()


@pytest.mark.parametrize("name", ["L1", "D1", "GT_A"])
def test_constraints_are_squared_lengths_less_squared_distances(name):
    prototype, mechanism = robot(name, "light"), mechanism_of(name, "light")
    offset, e, length = arrays(prototype)
    random = np.random.default_rng(2)
    for T in poses(prototype, count=20):
        q = random.uniform(-1.0, 1.0, 3)  # anywhere: the residual need not be zero
        D = T - offset - q[:, None] * e
        expected = length**2 - (D**2).sum(axis=1)
        np.testing.assert_allclose(numbers(mechanism.constraints, T, q), expected, atol=1e-13)
        assert np.abs(numbers(mechanism.constraints, T, carts_behind(prototype, T))).max() < 1e-13


@pytest.mark.parametrize("name", ["L1", "D1", "GT_A"])
def test_accelerations_equal_equation_6_6(name):
    prototype, mechanism = robot(name, "light"), mechanism_of(name, "light")
    offset, e, _ = arrays(prototype)
    random = np.random.default_rng(3)
    for T in poses(prototype):
        q, dT, ddq = carts_behind(prototype, T), random.normal(size=3), random.normal(size=3)
        D = T - offset - q[:, None] * e
        dq = (D @ dT) / (D * e).sum(axis=1)
        c = ((dT - dq[:, None] * e) ** 2).sum(axis=1)
        expected = np.linalg.solve(D, (D * e).sum(axis=1) * ddq - c)
        found = numbers(mechanism.accelerations, T, q, dT, dq, ddq)
        # both solve with D: its condition times rounding
        assert np.abs(found - expected).max() < 1e-14 * np.linalg.cond(D) ** 2 * np.abs(expected).max()


@pytest.mark.parametrize("friction", [TanhFriction, None])
@pytest.mark.parametrize("name", ["L1", "D1", "GT_A"])
def test_balance_holds_along_any_motion(name, friction):
    prototype, mechanism = robot(name, "heavy links"), mechanism_of(name, "heavy links", friction)
    inverse = dae_of(name, "heavy links", friction).function(
        ["tool.r", "tool.v", "der(tool.v)"],
        [*CARTS, *(f"carts[{i}].v" for i in range(3)), *(f"der(carts[{i}].v)" for i in range(3)), *FORCES],
    )
    random = np.random.default_rng(4)
    for T in poses(prototype, count=30):
        dT, ddT = random.normal(size=3), random.normal(size=3)
        q, dq, ddq, f = np.squeeze(np.array(inverse(T, dT, ddT))).reshape(4, 3)
        bias = numbers(mechanism.bias, T, q, dT, dq)
        left = numbers(mechanism.M1, T, q) @ ddT + numbers(mechanism.M2, T, q) @ ddq
        left += numbers(mechanism.G, T, q) + bias
        right = numbers(mechanism.velocity_jacobian, T, q).T @ f
        # f is itself solved with the transposed Jacobian, whose condition reaches a thousand
        np.testing.assert_allclose(left, right, rtol=0, atol=1e-11 * np.abs(right).max())
        if friction is None:
            assert np.abs(bias).max() < 1e-12  # N; nothing else depends on velocity (6.7)


def test_bias_is_friction_seen_from_the_tool_and_zero_at_rest():
    prototype, mechanism = robot("L1", "heavy links"), mechanism_of("L1", "heavy links")
    T = np.array([0.5, 3.0, -0.6])
    q, dT = carts_behind(prototype, T), np.array([0.3, -0.2, 0.1])
    W = numbers(mechanism.velocity_jacobian, T, q)
    dq = W @ dT
    friction = np.array(prototype.coulomb) * np.tanh(dq / 0.05) + np.array(prototype.viscous) * dq
    np.testing.assert_allclose(numbers(mechanism.bias, T, q, dT, dq), W.T @ friction, rtol=1e-12)
    np.testing.assert_array_equal(numbers(mechanism.bias, T, q, np.zeros(3), np.zeros(3)), 0.0)


def test_net_forces_instead_of_actuator_forces_leave_no_friction():
    prototype = robot("L1", "heavy links")
    rails = [f"arms[{i}].rail.f" for i in range(3)]
    net = extract_mechanism(dae_of("L1", "heavy links"), tool="tool.r", joints=CARTS, forces=rails)
    T = np.array([0.5, 3.0, -0.6])
    q = carts_behind(prototype, T)
    assert np.abs(numbers(net.bias, T, q, [0.3, -0.2, 0.1], [0.1, 0.2, 0.3])).max() < 1e-12
    np.testing.assert_allclose(numbers(net.M2, T, q), by_hand(prototype, T, q)[2], rtol=1e-12)


def test_equations_are_printed_with_the_names_of_the_model():
    mechanism = mechanism_of("GT_A", "light")
    text = str(mechanism)
    assert mechanism.tool == ("tool.r[0]", "tool.r[1]", "tool.r[2]")
    parts = (
        "(6.3)",
        "(6.5)",
        "(6.6)",
        "(6.7)",
        "arms[2].length^2",
        "J^-1[0,0] = 1",
        "carts[1].law.f_v",
        "plate_mass",
    )
    assert [part for part in parts if part not in text] == []
    assert "M1[0,1]" not in text  # zero for parallel guideways along x
    for part in ("world.gravity", "(G + bias)", "G[0]", "G[1]"):
        assert part not in text  # gravity pulls along z
    assert "M2[0,0] = 0.5*arms[0].link_mass + carts[0].m" in text
    assert "bias[0] = #" in text


def read_back(text, values):
    """Numbers of the left sides of a printed mechanism by Python's own arithmetic; "0" has those of all `0 = ...`."""
    numbers_of, zeros = dict(values), []
    name = re.compile("|".join([r"#\d+", *(re.escape(n) for n in sorted(values, key=len, reverse=True))]))
    for line in text.splitlines():
        left, equals, right = line.strip().partition(" = ")
        if line.startswith("  ") and equals:
            inserted = name.sub(lambda found: f"({float(numbers_of[found[0]])!r})", right)
            value = eval(inserted.replace("^", "**"), {"tanh": np.tanh})
            zeros += [value] if left == "0" else []
            numbers_of[left] = value
    return {**numbers_of, "0": zeros}


@pytest.mark.parametrize("name", ["L1", "GT_A"])
def test_printed_equations_have_the_values_of_the_functions(name):
    dae, mechanism = dae_of(name, "heavy links"), mechanism_of(name, "heavy links")
    random = np.random.default_rng(7)
    T, q = np.array([0.5, 3.0, -0.6]), random.uniform(-0.2, 0.2, 3)
    dT, dq = random.normal(size=3), random.normal(size=3)
    ddT, ddq = random.normal(size=3), random.normal(size=3)
    values = dict(dae.table.values)
    for columns, variables in (((T, dT, ddT), mechanism.tool), ((q, dq, ddq), mechanism.joints)):
        for order, column in enumerate(columns):
            values |= {derivative_name(n, order): x for n, x in zip(variables, column, strict=True)}
    found = read_back(str(mechanism), values)
    for head in ("J^-1", "M1", "M2", "G", "bias"):
        function = getattr(mechanism, {"J^-1": "velocity_jacobian"}.get(head, head))
        expected = numbers(function, *((T, q, dT, dq) if head == "bias" else (T, q)))
        for at in np.ndindex(expected.shape):
            place = f"{head}[{','.join(str(k) for k in at)}]"
            # the text has 14 digits of numbers that arise from others
            assert abs(found.get(place, 0.0) - expected[at]) < 1e-11 * np.abs(expected).max(), place
    constraints, relations = np.reshape(found["0"], (2, 3))
    np.testing.assert_allclose(constraints, numbers(mechanism.constraints, T, q), rtol=1e-12)
    offset, e, _ = arrays(robot(name, "heavy links"))
    D = T - offset - q[:, None] * e
    by_hand = (D * (ddT - ddq[:, None] * e)).sum(axis=1) + ((dT - dq[:, None] * e) ** 2).sum(axis=1)
    np.testing.assert_allclose(relations, by_hand, rtol=1e-12)  # (6.6)
