"""The Gantry-Tau built from components against its closed form, Lagrange's equations, and its power balance.

Dressler (2012), section 6.3; the closed form holds for guideways along e_x, Lagrange's equations for any.
"""

import dataclasses

import numpy as np
import pytest

from gantrytau import translate
from gantrytau.border.refusal import InitializationError, StructureError
from gantrytau.mechanics.translational import LinearFriction, TanhFriction
from gantrytau_models import prototypes
from gantrytau_models.mechanisms.gantry_tau import GantryTau
from tests.benchmarks import closed_form
from tests.benchmarks.closed_form import ThreeLink

FORCES = ["carts[0].f", "carts[1].f", "carts[2].f"]
CARTS = ["carts[0].s", "carts[1].s", "carts[2].s"]
RATES = ["carts[0].v", "carts[1].v", "carts[2].v"]
HEAVY_LINKS = dataclasses.replace(prototypes.GT_A, link_masses=(0.9, 1.7, 2.4))
FRICTIONS = {"tanh": TanhFriction, "piecewise linear": LinearFriction, None: None}


def peer(prototype, friction="tanh"):
    """The closed form with the parameters of a prototype."""
    return ThreeLink(
        lengths=tuple(arm.length for arm in prototype.arms),  # pyright: ignore[reportArgumentType]
        offsets=tuple(arm.offset for arm in prototype.arms),  # pyright: ignore[reportArgumentType]
        plate_mass=prototype.plate_mass,
        cart_masses=prototype.cart_masses,
        link_masses=prototype.link_masses,
        coulomb=prototype.coulomb,
        viscous=prototype.viscous,
        friction=friction,  # pyright: ignore[reportArgumentType]
    )


def random_motions(prototype, count=200, seed=0):
    """Tool positions in the workspace, velocities, and one more vector per motion, each (count, 3)."""
    random = np.random.default_rng(seed)
    offsets = np.array([arm.offset for arm in prototype.arms])
    shortest = min(arm.length for arm in prototype.arms)
    positions = np.empty((0, 3))
    while len(positions) < count:
        new = random.uniform(
            [-1.0, *offsets[:, 1:].min(axis=0)], [2.0, *offsets[:, 1:].max(axis=0)], (count, 3)
        )
        across = np.linalg.norm(new[:, None, 1:] - offsets[None, :, 1:], axis=2)
        positions = np.vstack([positions, new[(across < 0.9 * shortest).all(axis=1)]])
    return positions[:count], random.normal(size=(count, 3)), random.normal(size=(count, 3))


def relative(found, expected):
    """Largest difference per row, relative to the largest number of the row."""
    assert np.all(np.isfinite(found))
    return np.max(np.abs(found - expected), axis=1) / np.max(np.abs(expected), axis=1)


def mapped(function, *columns):
    """A CasADi function called for each row; the results stacked, (n, k)."""
    return np.array(
        [
            np.concatenate([np.array(r).ravel() for r in _tuple(function(*row))])
            for row in zip(*columns, strict=True)
        ]
    )


def _tuple(results):
    return results if isinstance(results, tuple) else (results,)


@pytest.fixture(scope="module")
def gt_a():
    return translate(GantryTau(prototypes.GT_A))


@pytest.mark.parametrize("friction", FRICTIONS)
@pytest.mark.parametrize("prototype", [prototypes.GT_A, HEAVY_LINKS], ids=["light", "heavy links"])
def test_forward_dynamics_equal_the_closed_form(prototype, friction):
    dae = translate(GantryTau(prototype, friction=FRICTIONS[friction]))
    forward = dae.function(["tool.r", "tool.v", *FORCES], ["der(tool.v)"])
    expected = closed_form.forward_dynamics_function(peer(prototype, friction))
    positions, velocities, forces = random_motions(prototype)
    forces *= 500.0
    found = mapped(forward, positions, velocities, *forces.T)
    assert relative(found, mapped(expected, positions, velocities, forces)).max() < 1e-10


@pytest.mark.parametrize("friction", FRICTIONS)
@pytest.mark.parametrize("prototype", [prototypes.GT_A, HEAVY_LINKS], ids=["light", "heavy links"])
def test_inverse_dynamics_equal_the_closed_form(prototype, friction):
    import casadi as ca

    dae = translate(GantryTau(prototype, friction=FRICTIONS[friction]))
    inverse = dae.function(["tool.r", "der(tool.r)", "der(der(tool.r))"], FORCES)
    T, dT, ddT = (ca.SX.sym(n, 3) for n in ("T", "dT", "ddT"))
    expected = ca.Function(
        "f", [T, dT, ddT], [closed_form.inverse_dynamics(peer(prototype, friction), T, dT, ddT)]
    )
    motions = random_motions(prototype, seed=1)
    assert relative(mapped(inverse, *motions), mapped(expected, *motions)).max() < 1e-12


def test_kinematics_equal_the_closed_form(gt_a):
    positions, velocities, _ = random_motions(prototypes.GT_A, seed=2)
    robot = peer(prototypes.GT_A)
    carts = np.array([np.array(closed_form.inverse_kinematics(robot, t)).ravel() for t in positions]).astype(
        float
    )
    found = mapped(gt_a.function(["tool.r"], CARTS), positions)
    assert np.abs(found - carts).max() < 1e-12  # m; a thousand roundings
    found = mapped(gt_a.function(CARTS, ["tool.r"]), *carts.T)
    assert np.abs(found - positions).max() < 1e-11
    speeds = mapped(gt_a.function(["tool.r", "tool.v"], RATES), positions, velocities)
    jacobians = np.array([closed_form.velocity_jacobian(robot, t) for t in positions]).astype(float)
    assert relative(speeds, np.einsum("nij,nj->ni", jacobians, velocities)).max() < 1e-12
    there = mapped(gt_a.function([*CARTS, *RATES], ["tool.v"]), *carts.T, *speeds.T)
    assert relative(there, velocities).max() < 1e-8  # inverts a Jacobian whose condition is up to a thousand


def lagrange(prototype, position, velocity, forces):
    """Tool and cart accelerations, (6,), by Lagrange's equations; guideways in any direction.

    Coordinates (T, s1, s2, s3), constraints (|T - P_i|^2 - L_i^2) / 2 = 0, a point mass in the middle of
    each link. Returns s, s' and the accelerations of T and s, (12,).
    """
    direction = np.array([arm.direction for arm in prototype.arms])
    offset = np.array([arm.offset for arm in prototype.arms])
    length = np.array([arm.length for arm in prototype.arms])
    links, carts = np.array(prototype.link_masses), np.array(prototype.cart_masses)
    # the carts lie behind the tool: the smaller root of |T - offset - s direction| = L
    gap = position - offset
    a, b = (direction**2).sum(axis=1), (direction * gap).sum(axis=1)
    s = (b - np.sqrt(b**2 - a * ((gap**2).sum(axis=1) - length**2))) / a
    link = gap - s[:, None] * direction
    rows = np.hstack([link, -np.diag((link * direction).sum(axis=1))])
    ds = -(link @ velocity) / np.diag(rows[:, 3:])
    rate = velocity - ds[:, None] * direction
    mass = np.zeros((6, 6))
    mass[:3, :3] = (prototype.plate_mass + links.sum() / 4) * np.eye(3)
    mass[3:, 3:] = np.diag((carts + links / 4) * a)
    mass[:3, 3:] = direction.T * links / 4
    mass[3:, :3] = mass[:3, 3:].T
    friction = np.array(prototype.coulomb) * np.tanh(ds / 0.05) + np.array(prototype.viscous) * ds
    weight = 9.81 * (carts + links / 2) * direction[:, 2]
    driving = np.concatenate(
        [[0, 0, -9.81 * (prototype.plate_mass + links.sum() / 2)], forces - friction - weight]
    )
    saddle = np.block([[mass, rows.T], [rows, np.zeros((3, 3))]])
    right = np.concatenate([driving, -(rate**2).sum(axis=1)])
    return np.concatenate([s, ds, np.linalg.solve(saddle, right)[:6]])


@pytest.mark.parametrize("name", ["L1", "D1"])
@pytest.mark.parametrize("links", [(0.0, 0.0, 0.0), (0.9, 1.7, 2.4)], ids=["light", "heavy links"])
def test_real_robots_obey_lagranges_equations(name, links):
    prototype = dataclasses.replace(getattr(prototypes, name), link_masses=links)
    dae = translate(GantryTau(prototype))
    wanted = [*CARTS, *RATES, "der(tool.v)", *(f"der({v})" for v in RATES)]
    forward = dae.function(["tool.r", "tool.v", *FORCES], wanted)
    positions, velocities, forces = random_motions(prototype, count=100, seed=3)
    forces *= 500.0
    found = mapped(forward, positions, velocities, *forces.T)
    expected = np.array(
        [lagrange(prototype, *row) for row in zip(positions, velocities, forces, strict=True)]
    )
    assert relative(found, expected).max() < 1e-10
    # and back: inverse dynamics return the forces
    inverse = dae.function(["tool.r", "tool.v", "der(tool.v)"], FORCES)
    back = mapped(inverse, positions, velocities, found[:, 6:9])
    assert relative(back, forces).max() < 1e-9  # the accelerations carry 1e-10


def test_power_of_the_actuators_is_friction_and_the_change_of_energy():
    prototype = dataclasses.replace(prototypes.L1, link_masses=(0.9, 1.7, 2.4))
    dae = translate(GantryTau(prototype))
    gravity = np.array([0.0, 0.0, 9.81])
    for position, velocity, force in zip(*random_motions(prototype, count=20, seed=4), strict=True):
        at = dae.evaluate(
            {"tool.r": position, "tool.v": velocity, **dict(zip(FORCES, 300.0 * force, strict=True))}
        )
        s, v, a = (
            np.array([at[pattern.format(i)] for i in range(3)])
            for pattern in ("carts[{}].s", "carts[{}].v", "der(carts[{}].v)")
        )
        masses = [(prototype.plate_mass, at["tool.v"], at["der(tool.v)"])]
        for i, arm in enumerate(prototype.arms):
            way = np.array(arm.direction)
            masses.append((prototype.cart_masses[i], way * v[i], way * a[i]))
            middle = (at["tool.v"] + way * v[i]) / 2, (at["der(tool.v)"] + way * a[i]) / 2
            masses.append((prototype.link_masses[i], *middle))
        change = sum(m * w @ (dw + gravity) for m, w, dw in masses)
        friction = [at[f"carts[{i}].friction"] for i in range(3)]
        power = (300.0 * force - friction) @ v
        assert change == pytest.approx(power, rel=1e-10, abs=1e-8)
        assert np.all(np.isfinite(s))


def symmetric():
    """A robot that is its own mirror image: two equal arms beside each other, one above in their middle."""
    arms = tuple(
        prototypes.Arm(2.0, offset, (1.0, 0.0, 0.0))
        for offset in ((0.0, 1.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0))
    )
    return dataclasses.replace(
        prototypes.GT_A,
        arms=arms,
        cart_masses=(13.0, 13.0, 13.0),
        coulomb=(100.0,) * 3,
        viscous=(100.0,) * 3,
        link_masses=(1.0,) * 3,
    )


def test_exactly_symmetric_geometry_keeps_its_accuracy():
    dae = translate(GantryTau(symmetric()))
    forward = dae.function(["tool.r", "tool.v", *FORCES], ["der(tool.v)"])
    expected = closed_form.forward_dynamics_function(peer(symmetric()))
    for y, z in [(0.0, 0.0), (0.0, 0.4), (0.0, 1.0), (0.3, 0.0), (0.3, 0.4), (0.9, 0.0)]:
        arguments = [[2.0, y, z], [0.1, 0.0, 0.2], 10.0, 10.0, -20.0]
        found = np.ravel(forward(*arguments))
        wanted = np.ravel(expected(*arguments[:2], arguments[2:]))
        assert np.all(np.isfinite(found))
        np.testing.assert_allclose(found, wanted, rtol=1e-10, atol=1e-12)
    at = dae.evaluate(
        {"tool.r": [2.0, 0.0, 0.4], "tool.v": [0.1, 0.0, 0.2], "carts[0].f": 10.0, "carts[1].f": 10.0}
    )
    assert at["der(tool.v)"][1] == pytest.approx(0.0, abs=1e-13)
    assert at["carts[0].s"] == pytest.approx(at["carts[1].s"], abs=1e-15)


def test_evaluate_holds_what_is_given_and_agrees_with_the_function(gt_a):
    given = {
        "tool.r": [0.85, 2.98, -0.63],
        "tool.v": [0.3, -0.2, 0.1],
        "carts[0].f": 100.0,
        "carts[1].f": -50.0,
        "carts[2].f": 30.0,
    }
    at = gt_a.evaluate(given)
    for name, value in given.items():
        np.testing.assert_array_equal(at[name], value)
    forward = gt_a.function(list(given), ["der(tool.v)", *CARTS, *RATES])
    acceleration, *rest = forward(*given.values())
    np.testing.assert_allclose(at["der(tool.v)"], np.ravel(acceleration), rtol=1e-11)
    np.testing.assert_allclose([at[n] for n in [*CARTS, *RATES]], np.ravel(rest), rtol=1e-12)
    # carts behind the tool, and at the length of the links from it
    for i, arm in enumerate(prototypes.GT_A.arms):
        link = at["tool.r"] - (np.array(arm.offset) + at[CARTS[i]] * np.array(arm.direction))
        assert np.linalg.norm(link) == pytest.approx(arm.length, abs=1e-14)
        assert link[0] > 0
    assert set(at) >= {
        "arms[0].link.tension",
        "der(carts[0].v)",
        "arms[0].length",
        "tool.r[0]",
        "carts[1].law.f",
    }


def test_evaluate_at_given_carts_is_forward_kinematics(gt_a):
    at = gt_a.evaluate({"carts[0].s": 0.4, "carts[1].s": 0.5, "carts[2].s": 0.6})
    expected = closed_form.forward_kinematics(peer(prototypes.GT_A), [0.4, 0.5, 0.6])
    np.testing.assert_allclose(at["tool.r"], np.ravel(expected), atol=1e-11)


def test_evaluate_balances_forces_when_motion_is_given(gt_a):
    still = {"tool.r": [0.85, 2.98, -0.63], "tool.v": np.zeros(3), "der(tool.v)": np.zeros(3)}
    at = gt_a.evaluate(still)
    np.testing.assert_array_equal(at["der(tool.v)"], 0.0)
    forces = gt_a.function(list(still), FORCES)(*still.values())
    np.testing.assert_allclose([at[n] for n in FORCES], np.ravel(forces), rtol=1e-9)
    # weight has no part along the guideways
    assert sum(at[n] for n in FORCES) == pytest.approx(0.0, abs=1e-9)


def test_parameters_are_arguments_by_their_names(gt_a):
    positions, velocities, forces = random_motions(prototypes.GT_A, count=5, seed=5)
    forces *= 300.0
    state = ["tool.r", "tool.v", *FORCES]
    parameters = ["plate_mass", "arms[0].length", "arms[1].offset", "carts[2].m", "carts[0].law.f_c"]
    function = gt_a.function([*state, *parameters], ["der(tool.v)"])
    arms = list(prototypes.GT_A.arms)
    arms[0] = dataclasses.replace(arms[0], length=2.1)
    arms[1] = dataclasses.replace(arms[1], offset=(-1.8, 2.3, 0.25))
    other = dataclasses.replace(
        prototypes.GT_A,
        arms=tuple(arms),
        plate_mass=12.0,
        cart_masses=(13.58, 13.64, 40.0),
        coulomb=(99.0, 145.13, 194.57),
    )
    expected = closed_form.forward_dynamics_function(peer(other))
    for r, v, f in zip(positions, velocities, forces, strict=True):
        found = function(r, v, *f, 12.0, 2.1, [-1.8, 2.3, 0.25], 40.0, 99.0)
        np.testing.assert_allclose(np.ravel(found), np.ravel(expected(r, v, f)), rtol=1e-9)


def test_guideway_directions_are_arguments_as_they_are_given(gt_a):
    given = ["tool.r", *(f"arms[{i}].direction" for i in range(3))]
    function = gt_a.function(given, CARTS)
    tool = np.array([0.85, 2.98, -0.63])
    directions = [np.array(arm.direction) * 1.25 for arm in prototypes.L1.arms]
    carts = np.ravel(function(tool, *directions))
    for arm, direction, s in zip(prototypes.L1.arms, directions, carts, strict=True):
        link = tool - np.array(arm.offset) - s * direction
        assert np.linalg.norm(link) == pytest.approx(arm.length, abs=1e-13)
        assert link @ direction > 0


def test_evaluate_takes_parameters_too(gt_a):
    at = gt_a.evaluate({"tool.r": [0.85, 2.98, -0.63], "arms[0].length": 2.2, "plate_mass": 20.0})
    link = at["tool.r"] - np.array(prototypes.GT_A.arms[0].offset) - at["carts[0].s"] * np.array([1.0, 0, 0])
    assert np.linalg.norm(link) == pytest.approx(2.2, abs=1e-14)
    assert at["tool.m"] == at["tool.body.m"] == 20.0


def test_states_may_be_the_carts():
    dae = translate(GantryTau(prototypes.GT_A), states=[*CARTS, *RATES])
    assert set(dae.states) == {*CARTS, *RATES}
    robot = peer(prototypes.GT_A)
    positions, velocities, forces = random_motions(prototypes.GT_A, count=10, seed=6)
    carts = np.array([np.ravel(closed_form.inverse_kinematics(robot, t)) for t in positions]).astype(float)
    speeds = np.array(
        [
            np.ravel(closed_form.velocity_jacobian(robot, t) @ v)
            for t, v in zip(positions, velocities, strict=True)
        ]
    ).astype(float)
    forces *= 100.0
    found = mapped(
        dae.function([*CARTS, *RATES, *FORCES], ["tool.r", "der(tool.v)"]), *carts.T, *speeds.T, *forces.T
    )
    expected = mapped(closed_form.forward_dynamics_function(robot), positions, velocities, forces)
    assert np.abs(found[:, :3] - positions).max() < 1e-11
    assert relative(found[:, 3:], expected).max() < 1e-7  # the tool velocity carries 1e-8, see above


class AlongALine(GantryTau):
    """The robot held to a straight line by two path equations."""

    def equations(self):
        yield from super().equations()
        x, y, z = (self.tool.r[k] for k in range(3))
        yield y - 2.51 == (3.46 - 2.51) / 1.711 * x
        yield z + 1.03 == (1.03 - 0.24) / 1.711 * x


def test_path_equations_and_two_unknown_forces_leave_two_states():
    dae = translate(AlongALine(prototypes.GT_A), given=("carts[2].f",))
    assert len(dae.states) == 2
    assert dae.inputs == ("carts[2].f",)
    along = np.array([1.711, 0.95, 0.79]) / 1.711
    function = dae.function(
        ["tool.r[0]", "tool.v[0]", "carts[2].f"], ["tool.r", "tool.v", "der(tool.v)", *FORCES]
    )
    found = [np.ravel(x) for x in function(0.8, 0.5, 100.0)]
    np.testing.assert_allclose(found[0], [0.0, 2.51, -1.03] + 0.8 * along, rtol=1e-14)
    np.testing.assert_allclose(found[1], 0.5 * along, rtol=1e-14)
    expected = closed_form.forward_dynamics_function(peer(prototypes.GT_A))
    forward = expected(found[0], found[1], np.ravel(found[3:]))
    np.testing.assert_allclose(found[2], np.ravel(forward), rtol=1e-10)
    assert found[5][0] == 100.0


def test_all_forces_given_along_a_line_are_too_many():
    with pytest.raises(StructureError, match="AlongALine"):
        translate(AlongALine(prototypes.GT_A))


def test_tool_out_of_reach_names_the_rods_and_their_residuals(gt_a):
    with pytest.raises(InitializationError, match=r"arms\[\d\]\.link \(SphericalSpherical\)"):
        gt_a.evaluate({"tool.r": [0.85, 9.0, -0.63]})


def test_rods_that_cannot_meet_are_named_when_translated():
    # guideways 0 and 1 are 1.28 m apart, the two rods together 0.6 m long
    short = [dataclasses.replace(arm, length=0.3) for arm in prototypes.GT_A.arms[:2]]
    robot = GantryTau(dataclasses.replace(prototypes.GT_A, arms=(*short, prototypes.GT_A.arms[2])))
    message = r"GantryTau: .*arms\[[01]\]\.link \(SphericalSpherical\), equation 1 .* is off by"
    with pytest.raises(InitializationError, match=message):
        translate(robot)


def test_what_is_not_a_prototype_is_refused():
    for wrong, words in (("L1", "'L1'"), (prototypes.F1, r"RotatingPrototype\(name='F1'\)")):
        with pytest.raises(TypeError, match=f"GantryTau: found {words}"):
            GantryTau(wrong)  # pyright: ignore[reportArgumentType]
