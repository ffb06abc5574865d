"""The F1 against (4.16)-(4.26) and Lagrange's equations written without the package."""

import dataclasses
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gantrytau import Dae, Fixed, ModelError, Start, simulate, translate
from gantrytau.mechanics.translational import LinearFriction
from gantrytau_models import F1GantryTau, prototypes
from tests.families import first_of
from tests.references import f1

NAMES = ("F1", "F1_ideal")
POSITIONS = [f"carts[{i}].s" for i in range(3)] + [f"turntables[{k}].phi" for k in range(3)]
RATES = [f"carts[{i}].v" for i in range(3)] + [f"turntables[{k}].w" for k in range(3)]
FORCES = [f"carts[{i}].f" for i in range(3)] + [f"turntables[{k}].tau" for k in range(3)]
LINKS = [f"arms[{i}].links[{j}]" for i in range(3) for j in range(i + 1)]
POSE = ["tool.r", "tool.q[1]", "tool.q[2]", "tool.q[3]"]  # a unit quaternion has three coordinates
SIZE = 1.6  # m, mean length of the links


@pytest.fixture(scope="module")
def robots() -> dict[str, Dae]:
    return {name: translate(F1GantryTau(getattr(prototypes, name), friction=None)) for name in NAMES}


@pytest.fixture(params=first_of(NAMES), name="name")
def each_table(request: pytest.FixtureRequest) -> str:
    return request.param


def called(function, *arguments) -> list[np.ndarray]:
    return [np.array(found) for found in function(*arguments)]


def quaternion(R: np.ndarray) -> np.ndarray:
    """Scalar first and positive."""
    return Rotation.from_matrix(R).as_quat(canonical=True, scalar_first=True)


def pose_coordinates(state: f1.State) -> list:
    return [state.T, *quaternion(state.R)[1:]]


def test_six_ways_to_move_and_six_actuators(robots, name):
    diagnosis = robots[name].diagnosis
    assert diagnosis.mobility == 6
    assert diagnosis.redundant == ()
    assert robots[name].inputs == tuple(FORCES)
    assert len(robots[name].states) == 12


def test_starts_with_its_links_uncrossed_below_the_carts(robots, name):
    record, start = getattr(prototypes, name), robots[name].evaluate()
    turned = Rotation.from_matrix(start["tool.R"] @ np.array(record.plate_rotation).T).magnitude()
    assert turned < np.radians(5.0)  # crossed modes are more than 30 deg away
    q = np.array([start[name] for name in POSITIONS])
    assert np.abs(q - f1.HOME_Q).max() < 0.03  # m, rad: as far as links are from parallel
    joints = np.array([start[f"{link}.rod.frame_a.r"] for link in LINKS])
    assert start["tool.r"][2] < joints[:, 2].min()


def test_joints_are_where_the_printed_equations_put_them(robots, name):
    record = getattr(prototypes, name)
    for state in f1.consistent_states(record, 3, seed=1):
        found = robots[name].evaluate(dict(zip(POSE, pose_coordinates(state), strict=True)))
        q = np.array([found[name] for name in POSITIONS])
        here = f1.State(state.T, state.R, q, np.zeros(12))
        for link, (a, b) in zip(LINKS, f1.links(record, here), strict=True):
            # rounding of metres
            np.testing.assert_allclose(found[f"{link}.rod.frame_a.r"], a.r, atol=1e-14, rtol=0)
            np.testing.assert_allclose(found[f"{link}.rod.frame_b.r"], b.r, atol=1e-14, rtol=0)
        assert np.abs(f1.constraints(record, here)).max() < 1e-13  # rounding, after the steps of Newton


@pytest.mark.parametrize("angles", [(0.0, 0.0), (0.3, 0.0), (-0.2, 0.25), (0.1, -0.3)], ids=str)
def test_plate_of_F1_ideal_turns_with_its_turntables(robots, angles):
    # opposite q4 and q5 turn all joints about x, q6 those of arm 3 about the line 3a-3b: links stay parallel (4.26)
    alpha, tilt = angles
    values = dict(zip(POSITIONS, (0.4, -0.05, 0.1, alpha, -alpha, tilt), strict=True))
    found = robots["F1_ideal"].evaluate(values)
    expected = Rotation.from_rotvec([alpha, 0, 0]) * Rotation.from_rotvec([0, -tilt, 0])
    # rounding times the condition
    np.testing.assert_allclose(found["tool.R"], expected.as_matrix(), atol=1e-12, rtol=0)


def test_forward_and_inverse_kinematics(robots, name):
    record, dae = getattr(prototypes, name), robots[name]
    forward = dae.function(POSITIONS, ["tool.r", "tool.R"])
    inverse = dae.function(POSE, POSITIONS)
    for state in f1.consistent_states(record, 10, seed=2):
        T, R = called(forward, *state.q)
        # rounding times the condition, below 300
        np.testing.assert_allclose(T.ravel(), state.T, atol=1e-12, rtol=0)
        np.testing.assert_allclose(R.reshape(3, 3, order="F"), state.R, atol=1e-12, rtol=0)
        q = np.ravel(called(inverse, *pose_coordinates(state)))
        np.testing.assert_allclose(q, state.q, atol=1e-12, rtol=0)


def test_velocities_are_differences_of_poses(robots, name):
    record, h = getattr(prototypes, name), 1e-4
    velocity = robots[name].function([*POSITIONS, *RATES], ["tool.v", "tool.w"])
    for state in f1.consistent_states(record, 5, seed=3):
        v, w = called(velocity, *state.q, *state.u[6:])
        ahead, behind = (f1.pose_from_home(record, state.q + side * h * state.u[6:]) for side in (1, -1))
        # h^2 times third derivatives, of a condition up to 300
        np.testing.assert_allclose(v.ravel(), (ahead[0] - behind[0]) / (2 * h), atol=1e-5, rtol=1e-5)
        turned = Rotation.from_matrix(ahead[1] @ behind[1].T).as_rotvec() / (2 * h)
        np.testing.assert_allclose(w.ravel(), turned, atol=1e-5, rtol=1e-5)


def test_accelerations_and_tensions_are_those_of_lagrange(robots, name):
    record, rng = getattr(prototypes, name), np.random.default_rng(4)
    accelerations = ["der(tool.v)", "der(tool.w)", *(f"der({rate})" for rate in RATES)]
    tensions = [f"{link}.rod.tension" for link in LINKS]
    motion = robots[name].function([*POSE, "tool.v", "tool.w", *FORCES], [*accelerations, *tensions])
    for state in f1.consistent_states(record, 20, seed=4):
        force = rng.uniform(-1.0, 1.0, 6) * [100, 100, 100, 10, 10, 10]
        expected = f1.accelerations(record, state, force)
        given = [*pose_coordinates(state), state.u[:3], state.u[3:6], *force]
        found = np.concatenate([x.ravel() for x in called(motion, *given)])
        u_dot, tension = found[:12], found[12:] * f1.lengths(record)
        np.testing.assert_allclose(u_dot, expected.u_dot, atol=1e-10 * np.abs(expected.u_dot).max(), rtol=0)
        largest = np.abs(expected.tension).max()
        np.testing.assert_allclose(tension, expected.tension, atol=1e-10 * largest, rtol=0)


def test_inverse_dynamics_give_the_forces_back(robots, name):
    record, rng = getattr(prototypes, name), np.random.default_rng(5)
    accelerations = [f"der({rate})" for rate in RATES]
    needed = robots[name].function([*POSITIONS, *RATES, *accelerations], FORCES)
    for state in f1.consistent_states(record, 5, seed=5):
        force = rng.uniform(-1.0, 1.0, 6) * [100, 100, 100, 10, 10, 10]
        u_dot = f1.accelerations(record, state, force).u_dot
        found = np.ravel(called(needed, *state.q, *state.u[6:], *u_dot[6:]))
        # N: rounding times accelerations and condition
        np.testing.assert_allclose(found, force, atol=1e-8, rtol=0)


def test_without_friction_it_falls_as_one(robots):
    """Where all guideways are vertical nothing but gravity acts along them."""
    fall = simulate(robots["F1"], stop=0.2, tolerance=1e-10)
    down = -9.81 / 2 * fall.time**2
    drop = fall["tool.r"] - fall["tool.r"][0]
    # m: a thousand times the tolerance, as the first steps of the integrator are of low order
    np.testing.assert_allclose(drop, np.outer(down, [0, 0, 1]), atol=1e-7, rtol=0)
    for k in range(3):
        assert np.ptp(fall[f"turntables[{k}].phi"]) < 1e-8
        # the direction of the guideways has length 0.99, and so has the way of a cart by s
        np.testing.assert_allclose(np.ptp(fall[f"carts[{k}].s"]), -down[-1] / 0.99, atol=1e-7, rtol=0)


def test_energy_grows_by_the_work_of_the_motors(robots, name):
    record = getattr(prototypes, name)
    force = np.array([230.0, 240.0, 330.0, 3.0, -2.0, 1.0])
    motion = simulate(robots[name], stop=0.3, inputs=dict(zip(FORCES, force, strict=True)), tolerance=1e-10)
    q = np.array([motion[n] for n in POSITIONS]).T
    u = np.hstack([motion["tool.v"], motion["tool.w"], np.array([motion[n] for n in RATES]).T])
    states = [
        f1.State(T, R, *rest) for T, R, *rest in zip(motion["tool.r"], motion["tool.R"], q, u, strict=True)
    ]
    balance = [f1.energy(record, state) - force @ state.q for state in states[::25]]
    assert np.ptp(balance) < 1e-6  # J, of which there are hundreds: ten times the tolerance of the integrator
    # held at output points
    assert max(np.abs(f1.constraints(record, state)).max() for state in states) < 1e-10
    assert np.ptp(motion["tool.R"], axis=0).max() > 0.05  # the plate has turned


def test_short_motions_are_the_beginning_of_longer_ones(name):
    """Small forces that follow from large ones start with rounding errors that IDAS cannot make smaller."""
    robot = translate(F1GantryTau(getattr(prototypes, name)))
    longer = simulate(robot, stop=0.1)
    for stop in (0.01, 0.015, 0.02):
        place = round(stop / 0.1 * 500)
        short = simulate(robot, stop=stop)
        # m at the tolerance; m/s, a first step of 0.1 ms
        for variable, close in (("tool.r", 1e-8), ("tool.v", 1e-6)):
            np.testing.assert_allclose(short.final(variable), longer[variable][place], atol=close, rtol=0)


def guess_off_by_a_fifth(record, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A position 0.2 SIZE from HOME, (3,) in m, and a quaternion up to 0.35 rad from the nominal one."""
    rng = np.random.default_rng(seed)
    away = rng.normal(size=3)
    turned = Rotation.from_rotvec(0.2 * rng.uniform(-1, 1, 3)).as_matrix() @ f1.nominal_rotation(record)
    return f1.HOME + 0.2 * SIZE * away / np.linalg.norm(away), quaternion(turned)


@pytest.mark.parametrize(("name", "seed"), first_of(zip(NAMES, range(2), strict=True)))
def test_starts_from_a_guess_off_by_a_fifth_of_its_size(name, seed):
    record = getattr(prototypes, name)
    T, q = guess_off_by_a_fifth(record, seed)
    carts = [dict(s=Start(s)) for s in np.random.default_rng(seed).uniform(-0.3, 0.3, 3)]
    found = translate(F1GantryTau(record, tool=dict(r=Start(T), q=Start(q)), carts=carts)).evaluate()
    actuators = np.array([found[n] for n in POSITIONS])
    state = f1.State(found["tool.r"], found["tool.R"], actuators, np.zeros(12))
    assert np.abs(f1.constraints(record, state)).max() < 1e-12  # rounding, after the steps of Newton
    T, R = f1.pose_from_home(record, actuators)  # on the same branch
    np.testing.assert_allclose(found["tool.r"], T, atol=1e-9, rtol=0)
    np.testing.assert_allclose(found["tool.R"], R, atol=1e-9, rtol=0)


@pytest.mark.parametrize(("name", "seed"), first_of(zip(NAMES, range(2), strict=True)))
def test_fixed_pose_is_held(name, seed):
    record = getattr(prototypes, name)
    T, q = guess_off_by_a_fifth(record, seed)
    found = translate(F1GantryTau(record, tool=dict(r=Fixed(T), q=Fixed(q)))).evaluate()
    np.testing.assert_array_equal(found["tool.r"], T)
    np.testing.assert_array_equal(found["tool.q"], q)
    actuators = np.array([found[n] for n in POSITIONS])
    assert np.abs(f1.constraints(record, f1.State(T, found["tool.R"], actuators, np.zeros(12)))).max() < 1e-12
    assert np.abs(actuators - f1.HOME_Q).max() < 0.6  # m, rad: the branch with the carts above the tool


def test_friction_is_that_of_the_record():
    robot = translate(F1GantryTau(prototypes.F1, friction=LinearFriction))
    found = robot.evaluate({"carts[0].v": 0.5, "carts[1].v": -0.5})
    assert found["carts[0].friction"] == pytest.approx(100.0 + 150.0 * 0.5)  # assumed in F1.toml
    assert found["carts[1].friction"] == pytest.approx(-100.0 - 150.0 * 0.5)


def test_torque_of_a_motor_acts_back_on_what_carries_it(robots):
    found = robots["F1_ideal"].evaluate({"turntables[2].tau": 5.0})
    axis = np.array([0.0, -1.0, 0.0])  # of q6 in the world, with the plate level
    assert axis @ found["turntables[2].joint.frame_a.t"] == pytest.approx(5.0, rel=1e-12)
    assert axis @ found["turntables[2].joint.frame_b.t"] == pytest.approx(-5.0, rel=1e-12)


def test_members_are_modified_by_name(robots):
    heavier = F1GantryTau(
        prototypes.F1_ideal, friction=None, turntables=[{}, {}, dict(m=8.0)], tool=dict(m=12.0)
    )
    found = translate(heavier).evaluate()
    assert (found["turntables[2].m"], found["turntables[1].m"], found["tool.m"]) == (8.0, 4.0, 12.0)


def test_other_records_are_refused():
    f1_robot: Any = F1GantryTau
    with pytest.raises(ModelError, match=r"F1GantryTau: found Prototype\(name='L1'\), expected a Rotating"):
        f1_robot(prototypes.L1)
    with pytest.raises(TypeError, match=r"F1GantryTau: found friction='viscous', expected a class"):
        f1_robot(prototypes.F1, friction="viscous")


@pytest.mark.filterwarnings("ignore::gantrytau_models.prototypes.DoubtfulPrototype")
def test_turntables_that_are_not_rigid_are_refused():
    with pytest.raises(ModelError, match=r"F1_printed\.arms\[1\]\.turntables\[0\]\.orientation of length"):
        F1GantryTau(prototypes.F1_printed)


def test_another_structure_is_refused():
    one, two, three = prototypes.F1.arms
    fewer = dataclasses.replace(three, turntables=three.turntables[:1])
    with pytest.raises(ModelError, match=r"\(1, 3\)\) on its arms, expected \(\(0, 1\), \(1, 2\), \(2"):
        F1GantryTau(dataclasses.replace(prototypes.F1, arms=(one, two, fewer)))
