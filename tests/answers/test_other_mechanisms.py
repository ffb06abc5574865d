"""Mechanisms that are no Gantry-Tau: revolute arms, passive joints, coordinates that are the same; and wrong requests."""

import numpy as np
import pytest

from gantrytau import (
    Input,
    Model,
    ModelError,
    Parameter,
    Real,
    StructureError,
    cos,
    der,
    extract_mechanism,
    sin,
    time,
    translate,
)
from gantrytau_models import GantryTau, prototypes

CARTS = [f"carts[{i}].s" for i in range(3)]
FORCES = [f"carts[{i}].f" for i in range(3)]
ARM = dict(tool=["x", "y"], joints=["phi_a", "phi_b"], forces=["tau_a", "tau_b"])


class TwoLinkArm(Model):
    """Two links in the vertical plane, point masses at elbow and tip, a motor with viscous friction in each joint."""

    a = Parameter(0.7, unit="m", description="length of the first link")
    b = Parameter(0.5, unit="m", description="length of the second link")
    m_e = Parameter(3.0, unit="kg", description="mass at the elbow")
    m_t = Parameter(2.0, unit="kg", description="mass at the tip")
    d = Parameter(0.4, unit="N.m.s/rad", description="friction of each joint")
    g = Parameter(9.81, unit="m/s2", description="gravity along -y")
    phi_a = Real(unit="rad", description="angle of the first link", start=0.3)
    phi_b = Real(unit="rad", description="angle of the second link, absolute", start=1.4)
    x = Real(unit="m", description="tip, horizontal")
    y = Real(unit="m", description="tip, vertical")
    x_e = Real(unit="m", description="elbow, horizontal")
    y_e = Real(unit="m", description="elbow, vertical")
    f_a = Real(unit="N", description="tension of the first link")
    f_b = Real(unit="N", description="tension of the second link")
    n_a = Real(unit="N", description="shear of the first link at the elbow")
    n_b = Real(unit="N", description="shear of the second link")
    tau_a = Input(unit="N.m", description="torque of the ground on the first link", start=0.0)
    tau_b = Input(unit="N.m", description="torque of the ground on the second link", start=0.0)

    def equations(self):
        along_a, along_b = (cos(self.phi_a), sin(self.phi_a)), (cos(self.phi_b), sin(self.phi_b))
        yield self.x_e == self.a * along_a[0]
        yield self.y_e == self.a * along_a[1]
        yield self.x == self.x_e + self.b * along_b[0]
        yield self.y == self.y_e + self.b * along_b[1]
        tip, elbow = (
            (-f * along[0] - n * along[1], -f * along[1] + n * along[0])
            for f, n, along in ((self.f_b, self.n_b, along_b), (self.f_a, self.n_a, along_a))
        )
        yield self.m_t * der(der(self.x)) == tip[0]
        yield self.m_t * (der(der(self.y)) + self.g) == tip[1]
        yield self.m_e * der(der(self.x_e)) == elbow[0] - tip[0]
        yield self.m_e * (der(der(self.y_e)) + self.g) == elbow[1] - tip[1]
        # massless links: torques and shear forces balance
        yield self.n_a * self.a == self.tau_a - self.d * der(self.phi_a)
        yield self.n_b * self.b == self.tau_b - self.d * der(self.phi_b)


class SliderCrank(Model):
    """A crank of radius r, a massless rod of length L at an angle p that nobody asks for, and a slider."""

    r = Parameter(0.2, unit="m", description="radius of the crank")
    L = Parameter(0.5, unit="m", description="length of the rod")
    J = Parameter(0.3, unit="kg.m2", description="inertia of the crank")
    m = Parameter(4.0, unit="kg", description="mass of the slider")
    phi = Real(unit="rad", description="angle of the crank", start=0.8)
    p = Real(unit="rad", description="angle of the rod", start=-0.3)
    x = Real(unit="m", description="position of the slider", start=0.62)
    f = Real(unit="N", description="tension of the rod")
    tau = Input(unit="N.m", description="torque on the crank", start=0.0)

    def equations(self):
        yield self.x == self.r * cos(self.phi) + self.L * cos(self.p)
        yield 0 == self.r * sin(self.phi) + self.L * sin(self.p)
        yield self.m * der(der(self.x)) == -self.f * cos(self.p)
        yield self.J * der(der(self.phi)) == self.tau + self.r * self.f * sin(self.p - self.phi)


class Lift(Model):
    """A tool that is 0.5 m beside its one joint: coordinates that are aliases of each other."""

    m = Parameter(3.0, unit="kg", description="mass")
    q = Real(unit="m", description="joint", start=0.1)
    z = Real(unit="m", description="tool")
    f = Input(unit="N", description="force of the joint", start=0.0)
    load = Input(unit="N", description="another force", start=5.0)

    def equations(self):
        yield self.z == self.q + 0.5
        yield self.m * der(der(self.z)) == self.f - self.load


@pytest.fixture(scope="module")
def robot():
    return translate(GantryTau(prototypes.L1))


def numbers(function, *arguments):
    return np.array(function(*arguments)).squeeze()


def arm_jacobian(phi):
    """d(x, y)/d(phi_a, phi_b) of TwoLinkArm."""
    return np.array([-np.sin(phi), np.cos(phi)]) * [0.7, 0.5]


@pytest.fixture(scope="module")
def arm():
    return extract_mechanism(TwoLinkArm(), **ARM)


def random_angles(count=20):
    random = np.random.default_rng(5)
    for first, bend in random.uniform([-1.5, 0.5], [1.5, 2.5], (count, 2)):
        phi = np.array([first, first + bend])
        yield phi, np.array([np.cos(phi), np.sin(phi)]) @ [0.7, 0.5], random


def test_arm_has_the_inertia_of_the_robotics_textbook(arm):
    for phi, tip, _ in random_angles():
        J = arm_jacobian(phi)
        inverse = numbers(arm.velocity_jacobian, tip, phi)
        np.testing.assert_allclose(inverse @ J, np.eye(2), atol=1e-13)
        # Lagrange in absolute angles: tip and elbow masses
        c = np.cos(phi[0] - phi[1])
        mass = np.array([[(3.0 + 2.0) * 0.49, 2.0 * 0.35 * c], [2.0 * 0.35 * c, 2.0 * 0.25]])
        whole = numbers(arm.M1, tip, phi) + numbers(arm.M2, tip, phi) @ inverse
        expected = np.linalg.solve(J.T, mass) @ np.linalg.inv(J)
        assert np.abs(whole - expected).max() < 1e-13 * np.linalg.cond(J) ** 2 * np.abs(expected).max()
        gravity = 9.81 * np.array([5.0 * 0.7 * np.cos(phi[0]), 2.0 * 0.5 * np.cos(phi[1])])
        np.testing.assert_allclose(J.T @ numbers(arm.G, tip, phi), gravity, atol=1e-12)
        assert np.abs(numbers(arm.constraints, tip, phi)).max() < 1e-14


def test_balance_of_the_arm_holds_with_friction_and_centripetal_forces(arm):
    forward = translate(TwoLinkArm()).function(
        ["phi_a", "phi_b", "der(phi_a)", "der(phi_b)", "tau_a", "tau_b"],
        ["der(der(phi_a))", "der(der(phi_b))", "der(der(x))", "der(der(y))"],
    )
    for phi, tip, random in random_angles():
        dphi, tau = random.normal(size=2), random.normal(size=2)
        J, dT = arm_jacobian(phi), arm_jacobian(phi) @ dphi
        acceleration = np.squeeze(np.array(forward(*phi, *dphi, *tau)))
        ddphi, ddT = acceleration[:2], acceleration[2:]
        left = numbers(arm.M1, tip, phi) @ ddT + numbers(arm.M2, tip, phi) @ ddphi + numbers(arm.G, tip, phi)
        left += numbers(arm.bias, tip, phi, dT, dphi)
        right = numbers(arm.velocity_jacobian, tip, phi).T @ tau
        np.testing.assert_allclose(
            left, right, rtol=0, atol=1e-12 * np.linalg.cond(J) ** 2 * np.abs(left).max()
        )
        found = numbers(arm.accelerations, tip, phi, dT, dphi, ddphi)
        np.testing.assert_allclose(found, ddT, rtol=0, atol=1e-12 * np.linalg.cond(J) * np.abs(ddT).max())
        assert not np.any(numbers(arm.bias, tip, phi, [0, 0], [0, 0]))


def test_passive_joints_are_found_by_iteration():
    mechanism = extract_mechanism(SliderCrank(), tool="x", joints=["phi"], forces=["tau"])
    for phi in (0.5, 0.8, 1.2):
        p = -np.arcsin(0.2 * np.sin(phi) / 0.5)
        x = 0.2 * np.cos(phi) + 0.5 * np.cos(p)
        # dphi/dx; L cos p dp = -r cos phi dphi
        slope = 1 / (-0.2 * np.sin(phi) + 0.2 * np.cos(phi) * np.tan(p))
        at = [x], [phi]
        assert numbers(mechanism.constraints, *at) == pytest.approx(0.0, abs=1e-12)
        assert numbers(mechanism.velocity_jacobian, *at) == pytest.approx(slope, rel=1e-10)
        assert numbers(mechanism.M1, *at) == pytest.approx(4.0, rel=1e-10)
        assert numbers(mechanism.M2, *at) == pytest.approx(0.3 * slope, rel=1e-10)
        assert numbers(mechanism.G, *at) == pytest.approx(0.0, abs=1e-12)
    assert "by iteration" in str(mechanism)


def test_coordinates_that_are_aliases_are_related_by_a_constraint():
    mechanism = extract_mechanism(Lift(), tool="z", joints=["q"], forces=["f"])
    assert abs(numbers(mechanism.constraints, [0.7], [0.1])) == pytest.approx(0.1, rel=1e-12)
    assert numbers(mechanism.velocity_jacobian, [0.6], [0.1]) == 1.0
    assert numbers(mechanism.accelerations, [0.6], [0.1], [0.0], [0.0], [2.0]) == 2.0
    inertia = numbers(mechanism.M1, [0.6], [0.1]) + numbers(mechanism.M2, [0.6], [0.1])
    assert inertia == pytest.approx(3.0, rel=1e-14)
    assert numbers(mechanism.G, [0.6], [0.1]) == 5.0  # the other input keeps its start value


class WindyLift(Lift):
    """A lift on which a wind blows that depends on time."""

    w = Parameter(2.0, unit="rad/s", description="rate of the gusts")
    idle = Input(unit="N", description="a force that pushes nothing", start=0.0)
    felt = Real(unit="N", description="what is felt of it")

    def equations(self):
        yield self.z == self.q + 0.5
        yield self.felt == 2 * self.idle
        yield self.m * der(der(self.z)) == self.f - self.load * sin(self.w * time)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (dict(tool="tol.r"), "has no variable or parameter 'tol.r'; did you mean 'tool.r'"),
        (dict(tool="tool.v"), r"tool: tool.v\[0\] of GantryTau is a speed, expected a coordinate that is"),
        (dict(tool="plate_mass"), "tool: plate_mass of GantryTau is a derivative, a parameter"),
        (dict(tool=["tool.r[0]", "tool.r[1]"]), "found 2 tool, 3 joints, 3 forces; mobility 3 needs 3 of"),
        (dict(joints="carts[0].s"), r"found the text 'carts\[0\].s', expected a list of names"),
        (dict(joints=["world.frame_b.r[0]", *CARTS[1:]]), "of GantryTau is constant, expected"),
        (dict(joints=[CARTS[0], *CARTS[:2]]), r"joints: carts\[0\].s of GantryTau is named twice"),
        (dict(forces=[*FORCES[:2], FORCES[0]]), r"forces: carts\[0\].f of GantryTau is named twice"),
    ],
)
def test_wrong_names_and_counts_are_refused(robot, change, words):
    with pytest.raises(ModelError, match=words):
        extract_mechanism(robot, **dict(tool="tool.r", joints=CARTS, forces=FORCES) | change)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (dict(joints=[*CARTS[:2], "carts[0].body.frame_a.r[1]"]), "the joints do not determine the tool"),
        (dict(tool=["tool.r[0]", "tool.r[1]", "tool.frame.r[1]"]), "cannot be moved at will by"),
        (dict(forces=[*FORCES[:2], "carts[2].friction"]), "leave accelerations of .* undetermined"),
        (dict(forces=[*FORCES[:2], "carts[0].actuator.f"]), "found . equations of balance .*, expected 3"),
    ],
)
def test_quantities_that_do_not_determine_each_other_are_refused(robot, change, words):
    with pytest.raises(StructureError, match=words):
        extract_mechanism(robot, **dict(tool="tool.r", joints=CARTS, forces=FORCES) | change)


def test_singular_starts_idle_forces_and_the_time_are_refused():
    # stretched out, the tip cannot move along the arm
    stretched = TwoLinkArm(phi_a=dict(start=0.3), phi_b=dict(start=0.3))
    with pytest.raises(StructureError, match="x, y cannot be moved at will by tau_a, tau_b"):
        extract_mechanism(stretched, **ARM)
    with pytest.raises(StructureError, match=r"z cannot be moved at will by idle, expected .* forces"):
        extract_mechanism(WindyLift(), tool="z", joints=["q"], forces=["idle"])
    with pytest.raises(StructureError, match="WindyLift: its equations depend on time explicitly, expected"):
        extract_mechanism(WindyLift(), tool="z", joints=["q"], forces=["f"])
