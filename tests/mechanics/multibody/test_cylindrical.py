"""The cylindrical joint: a falling nut, a nut on a screw, the same joint as two in series, and in a closed loop."""

import numpy as np
import pytest

from gantrytau import Fixed, Model, Start, connect, simulate, translate
from gantrytau.mechanics import rotational, translational
from gantrytau.mechanics.gears import BallScrew
from gantrytau.mechanics.multibody import Body, Cylindrical, Prismatic, Revolute, World
from tests.mechanics.multibody.test_loops import SliderCrank, crank_acceleration
from tests.mechanisms.rows import row

G = 9.81  # m/s2
ROUNDING = 1e-10  # of blocks of a dozen linear equations, relative
SKEW = dict(n=[0.3, -0.5, 0.8])
LUMP = dict(m=1.3, r_cm=[0.1, 0.2, -0.5], J=np.diag([0.1, 0.2, 0.15]))


class Nut(Model):
    """A body on an upright rod without friction."""

    world = World()
    joint = Cylindrical(n=[0.0, 0.0, 1.0])
    body = Body(m=0.4, J=np.diag([0.02, 0.02, 0.03]))

    def equations(self):
        yield from row(self.world, self.joint, self.body)


class NutOnScrew(Nut):
    """The nut turns as it sinks, by the lead of its thread."""

    thread = BallScrew(lead=0.1)

    def equations(self):
        yield from super().equations()
        yield connect(self.thread.flange_a, self.joint.axis_phi)
        yield connect(self.thread.flange_b, self.joint.axis_s)


def test_a_nut_falls_freely_while_it_spins():
    fall = simulate(
        Nut(joint=dict(s=Fixed(0.0), v=Fixed(1.0), phi=Fixed(0.2), w=Fixed(7.0))), stop=1.0, tolerance=1e-10
    )
    t = fall.time
    np.testing.assert_allclose(fall["joint.s"], t - G * t**2 / 2, atol=1e-8)  # a hundred tolerances
    np.testing.assert_allclose(fall["joint.phi"], 0.2 + 7.0 * t, atol=1e-8)
    np.testing.assert_allclose(fall["body.r"][:, :2], 0.0, atol=1e-12)
    np.testing.assert_allclose(fall["body.w"], np.outer(np.ones_like(t), [0.0, 0.0, 7.0]), atol=1e-8)


def test_a_nut_on_a_screw_falls_with_its_inertia_added():
    dae = translate(NutOnScrew())
    assert dae.diagnosis.mobility == 1
    # m g = (m + J (2 pi / lead)^2) a
    expected = -0.4 * G / (0.4 + 0.03 * (2 * np.pi / 0.1) ** 2)
    assert dae.evaluate()["der(joint.v)"] == pytest.approx(expected, rel=ROUNDING)


class OneJoint(Model):
    """A lump on a cylindrical joint with a skew axis, driven along and about it."""

    world = World()
    joint = Cylindrical(**SKEW)
    body = Body(**LUMP)
    push = translational.Force(f=3.0)
    twist = rotational.Torque(tau=-0.7)

    def equations(self):
        yield from row(self.world, self.joint, self.body)
        yield connect(self.push.flange, self.joint.axis_s)
        yield connect(self.twist.flange, self.joint.axis_phi)


class TwoJoints(Model):
    """The same lump on a prismatic joint that carries a revolute one."""

    world = World()
    slide, hinge = Prismatic(**SKEW), Revolute(**SKEW)
    body = Body(**LUMP)
    push = translational.Force(f=3.0)
    twist = rotational.Torque(tau=-0.7)

    def equations(self):
        yield from row(self.world, self.slide, self.hinge, self.body)
        yield connect(self.push.flange, self.slide.axis)
        yield connect(self.twist.flange, self.hinge.axis)


class Reversed(OneJoint):
    """The joint the other way round, so that its coordinates change their signs."""

    def equations(self):
        yield connect(self.world.frame_b, self.joint.frame_b)
        yield connect(self.joint.frame_a, self.body.frame_a)
        yield connect(self.push.flange, self.joint.axis_s)
        yield connect(self.twist.flange, self.joint.axis_phi)


@pytest.mark.parametrize(("model", "sign"), [(OneJoint, 1.0), (Reversed, -1.0)])
def test_it_is_a_prismatic_and_a_revolute_joint_in_series(model, sign):
    one = translate(model(push=dict(f=sign * 3.0), twist=dict(tau=sign * -0.7)))
    two = translate(TwoJoints())
    for s, phi, v, w in np.random.default_rng(0).normal(size=(4, 4)):
        at = two.evaluate({"slide.s": s, "hinge.phi": phi, "slide.v": v, "hinge.w": w})
        here = one.evaluate(
            {"joint.s": sign * s, "joint.phi": sign * phi, "joint.v": sign * v, "joint.w": sign * w}
        )
        assert here["der(joint.v)"] == pytest.approx(sign * at["der(slide.v)"], rel=ROUNDING)
        assert here["der(joint.w)"] == pytest.approx(sign * at["der(hinge.w)"], rel=ROUNDING)
        for name in ("r", "v", "w", "frame_a.R", "frame_a.f", "frame_a.t"):
            np.testing.assert_allclose(here[f"body.{name}"], at[f"body.{name}"], rtol=1e-9, atol=1e-9)


class CylindricalSliderCrank(SliderCrank):
    """The piston may turn about the rail: one redundant constraint less."""

    rail = Cylindrical(n=[1.0, 0.0, 0.0])


def test_it_closes_a_loop():
    for phi, w in [(0.6, 0.0), (2.0, 5.0), (-1.2, -8.0)]:
        p = -np.arcsin(0.2 * np.sin(phi) / 0.6)
        dae = translate(
            CylindricalSliderCrank(
                crank=dict(phi=Fixed(phi), w=Fixed(w)),
                knee=dict(phi=Start(p - phi)),
                wrist=dict(phi=Start(-p)),
                rail=dict(s=Start(0.2 * np.cos(phi) + 0.6 * np.cos(p))),
            )
        )
        assert (dae.diagnosis.mobility, len(dae.diagnosis.redundant)) == (1, 2)
        at = dae.evaluate()
        # differences of the second derivative leave 1e-8
        assert at["der(crank.w)"] == pytest.approx(crank_acceleration(phi, w), rel=1e-6)
        assert at["rail.phi"] == pytest.approx(0.0, abs=1e-12)
