"""The serial wrist on the plates of the six-link robot and the F1, against rigid bodies in series by hand."""

from typing import Any

import numpy as np
import pytest

from gantrytau import Dae, ModelError, simulate, translate
from gantrytau.mechanics.multibody import FixedRotation, World
from gantrytau_models import (
    F1WithWrist,
    GantryTau,
    SerialWrist,
    SixLinkGantryTau,
    SixLinkWithWrist,
    WithWrist,
    prototypes,
)
from tests.mechanisms.rows import in_a_row
from tests.references import f1, six_link
from tests.references.rotations import turn

OFFSETS = np.array([[0.0, 0.0, -0.1], [0.0, 0.0, -0.12], [0.0, 0.0, -0.15]])  # m: to the axes and the flange
AXES = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
CENTRES = np.array([[0.0, 0.0, -0.05], [0.0, 0.0, -0.06]])  # m
MASSES = np.array([2.0, 1.5])  # kg
J = np.diag([0.01, 0.01, 0.006])  # kg.m2
UP = np.array([0.0, 0.0, 9.81])  # m/s2
ANGLES = ["wrist.joints[0].phi", "wrist.joints[1].phi"]
RATES = ["wrist.joints[0].w", "wrist.joints[1].w"]
TORQUES = ["wrist.joints[0].tau", "wrist.joints[1].tau"]


@pytest.fixture(scope="module")
def robots() -> dict[str, Dae]:
    return {
        "six-link": translate(SixLinkWithWrist(prototypes.L1, friction=None)),
        "F1": translate(F1WithWrist(prototypes.F1, friction=None)),
    }


@pytest.fixture(params=["six-link", "F1"], name="name")
def each_robot(request: pytest.FixtureRequest) -> str:
    return request.param


def places(T, R, phi):
    """Origin and orientation of both bodies, then of the flange."""
    found = []
    for offset, n, angle in zip(OFFSETS[:2], AXES, phi, strict=True):
        T = T + R @ offset
        R = R @ turn(angle * n)
        found.append((T, R))
    return [*found, (T + R @ OFFSETS[2], R)]


def momentum(T, R, T_dot, w, phi, phi_dot):
    """Linear momentum (3,) and angular momentum about the origin of the world (3,), and kinetic energy of the wrist."""
    linear, angular, energy = np.zeros(3), np.zeros(3), 0.0
    r, v, spin = T, T_dot, w
    for (at, turned), n, rate, m, centre in zip(
        places(T, R, phi), AXES, phi_dot, MASSES, CENTRES, strict=False
    ):
        v = v + np.cross(spin, at - r)
        spin = spin + turned @ n * rate
        r = at
        d = turned @ centre
        velocity = v + np.cross(spin, d)
        own = turned @ J @ turned.T @ spin
        linear += m * velocity
        angular += m * np.cross(r + d, velocity) + own
        energy += m * velocity @ velocity / 2 + spin @ own / 2
    return linear, angular, energy


def height_energy(T, R, phi):
    """Potential energy of the wrist, J."""
    centres = zip(places(T, R, phi), MASSES, CENTRES, strict=False)
    return sum(m * UP @ (at + turned @ centre) for (at, turned), m, centre in centres)


def test_two_ways_to_move_more(robots):
    for name, mobility in {"six-link": 5, "F1": 8}.items():
        assert robots[name].diagnosis.mobility == mobility
        assert robots[name].diagnosis.redundant == ()
        assert robots[name].inputs[-2:] == tuple(TORQUES)
        assert len(robots[name].inputs) == mobility


def test_flange_is_where_plate_and_angles_put_it(robots, name):
    for phi in ([0.0, 0.0], [0.7, -0.4], [-2.5, 1.3]):
        found = robots[name].evaluate(
            dict(zip(ANGLES + RATES, [*phi, 0.5, -0.3], strict=True)) | {"tool.v": [0.1, 0.2, -0.3]}
        )
        r, R = places(found["tool.r"], found["tool.R"], phi)[2]
        np.testing.assert_allclose(found["wrist.r"], r, atol=1e-14, rtol=0)  # rounding of metres
        np.testing.assert_allclose(found["wrist.R"], R, atol=1e-14, rtol=0)
        first, second = places(found["tool.r"], found["tool.R"], phi)[:2]
        w = found["tool.w"] + 0.5 * first[1] @ AXES[0] - 0.3 * second[1] @ AXES[1]
        np.testing.assert_allclose(found["wrist.w"], w, atol=1e-14, rtol=0)


def test_carts_follow_from_the_flange():
    """Inverse kinematics of the five axes: the level plate is where the wrist, taken off the flange, puts it."""
    carts = [f"carts[{i}].s" for i in range(3)]
    inverse = translate(SixLinkWithWrist(prototypes.L1)).function(["wrist.r", *ANGLES], ["tool.r", *carts])
    T = np.array([0.5, 3.0, -0.6])
    for phi in ([0.0, 0.0], [0.4, 0.6], [-1.2, 0.9]):
        flange = places(T, np.eye(3), phi)[2][0]
        found = [np.array(x).ravel() for x in inverse(flange, *phi)]
        np.testing.assert_allclose(found[0], T, atol=1e-12, rtol=0)  # rounding times the condition, below 1e3
        expected = six_link.cart_positions(six_link.parameters_L1(), T, np.eye(3))
        np.testing.assert_allclose(np.ravel(found[1:]), expected, atol=1e-12, rtol=0)


def test_what_holds_the_wrist_is_the_rate_of_its_momentum(robots, name):
    """Newton's and Euler's laws for both bodies together, momenta differenced along the motion."""
    h, rng = 1e-5, np.random.default_rng(1)
    dae = robots[name]
    for _ in range(3):
        chosen = dict(zip(ANGLES + RATES + TORQUES, rng.uniform(-1, 1, 6), strict=True))
        chosen |= {"tool.v": rng.uniform(-0.5, 0.5, 3)}
        if name == "F1":
            chosen |= {"tool.w": rng.uniform(-0.5, 0.5, 3)}
        at = dae.evaluate(chosen)
        phi, phi_dot = (np.array([at[n] for n in names]) for names in (ANGLES, RATES))
        phi_ddot = np.array([at[f"der({rate})"] for rate in RATES])
        a, z = at["der(tool.v)"], at["der(tool.w)"]

        def moved(t, at=at, a=a, z=z, phi=phi, phi_dot=phi_dot, phi_ddot=phi_ddot):
            T = at["tool.r"] + t * at["tool.v"] + t**2 / 2 * a
            R = turn(t * at["tool.w"] + t**2 / 2 * z) @ at["tool.R"]
            angles = phi + t * phi_dot + t**2 / 2 * phi_ddot
            return momentum(T, R, at["tool.v"] + t * a, at["tool.w"] + t * z, angles, phi_dot + t * phi_ddot)

        ahead, behind = moved(h), moved(-h)
        linear, angular = ((x - y) / (2 * h) for x, y in zip(ahead[:2], behind[:2], strict=True))
        centres = zip(places(at["tool.r"], at["tool.R"], phi), MASSES, CENTRES, strict=False)
        weights = [(at_ + R @ c, -m * UP) for (at_, R), m, c in centres]
        force = linear - sum(weight for _, weight in weights)
        moment = angular - sum(np.cross(r, weight) for r, weight in weights)
        torque = moment - np.cross(at["tool.r"], force)
        # differences: h^2 times third derivatives, and rounding / h
        np.testing.assert_allclose(at["wrist.frame_a.f"], force, atol=1e-7, rtol=0)
        np.testing.assert_allclose(at["wrist.frame_a.t"], torque, atol=1e-7, rtol=0)


# The wrist alone, its mount turned by 0.5 rad about y.
OnAWall = in_a_row(
    "OnAWall", world=World(), wall=FixedRotation(n=[0.0, 1.0, 0.0], phi=0.5), wrist=SerialWrist()
)


def test_holding_torques_are_those_of_the_weights():
    """The angles are given as constants, the torques follow: lever arms of weights by hand, as virtual work asks for."""
    dae = translate(OnAWall(), given=ANGLES)
    hold = dae.function(
        [*ANGLES, *(f"der({n})" for n in ANGLES), *(f"der(der({n}))" for n in ANGLES)], TORQUES
    )
    wall, h = turn(np.array([0.0, 0.5, 0.0])), 1e-5
    for phi in np.random.default_rng(2).uniform(-1.5, 1.5, (5, 2)):
        found = np.ravel([np.array(x) for x in hold(*phi, 0, 0, 0, 0)])
        for k, step in enumerate(h * np.eye(2)):
            slope = [height_energy(np.zeros(3), wall, phi + side * step) for side in (1, -1)]
            # J/rad: rounding / h
            assert found[k] == pytest.approx((slope[0] - slope[1]) / (2 * h), abs=1e-8)


def test_wrist_is_modified_by_name():
    longer = dict(offset=[0.0, 0.0, -0.3], joints=[{}, dict(m=3.0)])
    found = translate(SixLinkWithWrist(prototypes.D1, wrist=longer)).evaluate()
    np.testing.assert_allclose(
        found["wrist.r"] - found["tool.r"], found["tool.R"] @ [0, 0, -0.52], atol=1e-14
    )
    assert found["wrist.joints[1].m"] == 3.0


def test_wrong_mounts_are_refused():
    with pytest.raises(ModelError, match=r"Mine: found WithWrist behind SixLinkGantryTau.*Mine\(WithWrist"):
        type("Mine", (SixLinkGantryTau, WithWrist), {})
    pointlike: Any = type("Mine", (WithWrist, GantryTau), {})
    with pytest.raises(
        ModelError, match=r"Tool has no 'frame_a'"
    ):  # a plate that cannot turn, without a Plate
        translate(pointlike(prototypes.L1))


def reference_energy(name, motion, k):
    """Energy of the robot without its wrist."""
    T, R, v, w = (motion[f"tool.{x}"][k] for x in ("r", "R", "v", "w"))
    s, s_dot = (np.array([motion[f"carts[{i}].{x}"][k] for i in range(3)]) for x in ("s", "v"))
    if name == "six-link":
        return six_link.energy(six_link.parameters_L1(), six_link.State(T, R, s, v, w, s_dot))
    phi, rate = (np.array([motion[f"turntables[{i}].{x}"][k] for i in range(3)]) for x in ("phi", "w"))
    state = f1.State(T, R, np.concatenate([s, phi]), np.concatenate([v, w, s_dot, rate]))
    return f1.energy(prototypes.F1, state)


def test_energy_grows_by_the_work_of_the_motors(robots, name):
    torques = [0.8, -1.5]
    motion = simulate(
        robots[name], stop=0.25, inputs=dict(zip(TORQUES, torques, strict=True)), tolerance=1e-10
    )
    balance = []
    for k in range(0, len(motion.time), 50):
        phi, rate = (np.array([motion[n][k] for n in names]) for names in (ANGLES, RATES))
        T, R, v, w = (motion[f"tool.{x}"][k] for x in ("r", "R", "v", "w"))
        wrist = momentum(T, R, v, w, phi, rate)[2] + height_energy(T, R, phi)
        balance.append(reference_energy(name, motion, k) + wrist - np.dot(torques, phi))
    assert np.ptp(balance) < 1e-6  # J, of which there are hundreds: ten times the tolerance of the integrator
    assert max(np.ptp(motion[n]) for n in ANGLES) > 1.0  # rad: it has turned
