"""Overconstrained linkages: by their count of joints they should not move, by their geometry they do."""

import numpy as np
import pytest

from gantrytau import Array, Fixed, Model, Parameter, Start, connect, simulate, translate
from gantrytau.mechanics.multibody import (
    Body,
    FixedRotation,
    FixedTranslation,
    PointMass,
    Prismatic,
    Revolute,
    Spherical,
    SphericalSpherical,
    TwoFrames,
    Universal,
    World,
)
from tests.families import first_of
from tests.mechanisms.rows import row


def test_a_loop_of_slides():
    class Wedge(Model):
        """A wedge on the ground lifts a weight that slides in a vertical guide."""

        world = World()
        ground, slope, guide = (
            Prismatic(n=[1.0, 0.0, 0.0]),
            Prismatic(n=[-1.0, 0.0, 1.0]),
            Prismatic(n=[0.0, 0.0, 1.0]),
        )
        wedge, weight = PointMass(m=2.0), PointMass(m=3.0)

        def equations(self):
            yield from row(self.world, self.ground, self.wedge)
            yield from row(self.ground, self.slope, self.guide.frame_b)
            yield connect(self.guide.frame_b, self.weight.frame_a)
            yield connect(self.guide.frame_a, self.world.frame_b)

    dae = translate(Wedge())
    assert dae.diagnosis.mobility == 1
    assert len(dae.diagnosis.redundant) == 4
    at = dae.evaluate({"ground.s": 0.3})
    assert at["guide.s"] == pytest.approx(0.3, rel=1e-13)
    assert at["der(ground.v)"] == pytest.approx(-3.0 * 9.81 / 5.0, rel=1e-12)


class Parallel(Model):
    """A bar on four equal cranks and a rod, all parallel: two cranks would do."""

    places = (0.0, 1.0, 0.4, 0.7, 0.2)
    world = World()
    bar = Body(m=2.0)
    below = Array(FixedTranslation, [dict(r=[x, 0.0, 0.0]) for x in places])
    above = Array(FixedTranslation, [dict(r=[x, 0.0, 0.0]) for x in places])
    lower, upper = Array(Revolute, 4, n=[0.0, -1.0, 0.0]), Array(Revolute, 4, n=[0.0, -1.0, 0.0])
    cranks = Array(FixedTranslation, 4, r=[0.5, 0.0, 0.0])
    rod = SphericalSpherical(L=0.5)

    def equations(self):
        for below, above in zip(self.below, self.above, strict=True):
            yield connect(self.world.frame_b, below.frame_a)
            yield connect(above.frame_a, self.bar.frame_a)
        for k, crank in enumerate(self.cranks):
            yield from row(self.below[k], self.lower[k], crank, self.upper[k], self.above[k].frame_b)
        yield from row(self.below[4], self.rod, self.above[4].frame_b)


def test_parallel_cranks_and_rods_that_add_nothing_are_named():
    dae = translate(Parallel(lower=dict(phi=Start(0.6)), upper=dict(phi=Start(-0.6))))
    assert dae.diagnosis.mobility == 1
    # the first loop leaves three of six out, the others four each, as a parallel crank only holds its own two hinges
    assert len(dae.diagnosis.redundant) == 3 + 4 + 4 + 1
    assert "rod (SphericalSpherical), equation 1" in dae.diagnosis.redundant
    at = dae.evaluate({"lower[0].phi": 0.6, "lower[0].w": 1.5})
    assert at["rod.tension"] == 0.0
    # the bar moves on a circle without turning: a pendulum upside down
    assert at["der(lower[0].w)"] == pytest.approx(-9.81 * np.cos(0.6) / 0.5, rel=1e-10)
    np.testing.assert_allclose(at["bar.w"], 0.0, atol=1e-12)


class Spatial(TwoFrames):
    """A link after Denavit and Hartenberg: a hinge about z, then L along x and a twist about x."""

    L = Parameter(1.0, unit="m", description="length")
    twist = Parameter(0.0, unit="rad", description="twist", evaluate=True)
    hinge = Revolute(n=[0.0, 0.0, 1.0])
    body = Body(m=1.0, r_cm=[0.1, 0.05, 0.0], J=np.diag([0.01, 0.02, 0.03]))
    bar = FixedTranslation(r=lambda self: [self.L, 0.0, 0.0])
    end = FixedRotation(n=[1.0, 0.0, 0.0], phi=twist)

    def equations(self):
        yield from row(self.frame_a, self.hinge, self.body)
        yield from row(self.hinge, self.bar, self.end, self.frame_b)


LENGTHS, TWIST = (0.4, 0.7), 0.6
TWISTS = (TWIST, np.arcsin(LENGTHS[1] * np.sin(TWIST) / LENGTHS[0]))  # a / sin(alpha) = b / sin(beta)
RATIO = np.sin(sum(TWISTS) / 2) / np.sin((TWISTS[1] - TWISTS[0]) / 2)


class Bennett(Model):
    """Bennett's linkage (1903): four skew hinges in a loop that Grübler says cannot move (-2)."""

    world = World()
    links = Array(Spatial, [dict(L=LENGTHS[k % 2], twist=TWISTS[k % 2]) for k in range(4)])

    def equations(self):
        yield connect(self.world.frame_b, self.links[0].frame_a)
        for k in range(3):
            yield connect(self.links[k].frame_b, self.links[k + 1].frame_a)
        yield connect(self.links[3].frame_b, self.world.frame_b)


def bennett(first, w):
    """The linkage with its first hinge at an angle and turning with w."""
    second = 2 * np.arctan(RATIO / np.tan(first / 2))
    starts = [Fixed(first), Start(second), Start(-first), Start(-second)]
    hinges = [dict(phi=start) for start in starts]
    hinges[0] |= dict(w=Fixed(w))
    return Bennett(links=[dict(hinge=hinge) for hinge in hinges])


def test_bennett_linkage_moves():
    dae = translate(bennett(1.0, 2.0))
    assert dae.diagnosis.mobility == 1
    assert len(dae.diagnosis.redundant) == 3
    motion = simulate(dae, stop=0.7, tolerance=1e-9, points=31)
    phi = [motion[f"links[{k}].hinge.phi"] for k in range(4)]
    assert np.ptp(phi[0]) > 0.5
    # closure after Bennett, to a hundred times the tolerance of the projection
    np.testing.assert_allclose(np.tan(phi[0] / 2) * np.tan(phi[1] / 2), RATIO, rtol=1e-9)
    np.testing.assert_allclose([phi[2], phi[3]], [-phi[0], -phi[1]], atol=1e-10)


@pytest.mark.parametrize("w", first_of([2.0, 9.0]))
def test_bennett_linkage_stays_closed_through_its_flat_pose(w):
    motion = simulate(bennett(1.0, w), stop=1.5, tolerance=1e-9, points=31)
    phi = motion["links[0].hinge.phi"]
    assert phi.min() < 0.0 or phi.max() > np.pi
    # both ends of the loop are at the origin
    assert np.abs(motion["links[3].end.frame_b.r"]).max() < 1e-9
    assert motion.time == pytest.approx(np.linspace(0.0, 1.5, 31), abs=1e-12)
    # nothing jumps where other constraints are chosen: by Hermite's rule, whose error is of the fifth order in 50 ms
    h, speed, rate = 0.05, motion["links[0].hinge.w"], motion["der(links[0].hinge.w)"]
    expected = h / 2 * (speed[1:] + speed[:-1]) - h**2 / 12 * np.diff(rate)
    np.testing.assert_allclose(np.diff(phi), expected, rtol=0, atol=2e-4)


class Leg(TwoFrames):
    """Three parallel hinges and two arms."""

    n = Parameter(shape=3, unit="1", description="axis of the hinges", evaluate=True)
    arm = Parameter(shape=3, unit="m", description="from one hinge to the next")
    hinges = Array(Revolute, 3, n=n)
    bars = Array(FixedTranslation, 2, r=arm)

    def equations(self):
        yield connect(self.frame_a, self.hinges[0].frame_a)
        for k, bar in enumerate(self.bars):
            yield from row(self.hinges[k], bar, self.hinges[k + 1])
        yield connect(self.hinges[2].frame_b, self.frame_b)


class Sarrus(Model):
    """Sarrus' linkage (1853): a plate on two legs with hinges along x and along y goes straight up."""

    world = World()
    plate = Body(m=2.0)
    legs = Array(
        Leg, [dict(n=[1.0, 0.0, 0.0], arm=[0.0, 0.5, 0.0]), dict(n=[0.0, 1.0, 0.0], arm=[0.5, 0.0, 0.0])]
    )
    feet = Array(FixedTranslation, [dict(r=[0.0, 0.2, 0.0]), dict(r=[0.2, 0.0, 0.0])])
    tops = Array(FixedTranslation, [dict(r=[0.0, 0.2, 0.0]), dict(r=[0.2, 0.0, 0.0])])

    def equations(self):
        for leg, foot, top in zip(self.legs, self.feet, self.tops, strict=True):
            yield from row(self.world, foot, leg, top.frame_b)
            yield connect(top.frame_a, self.plate.frame_a)


def test_sarrus_linkage_goes_straight():
    def leg(sign, kind):
        found = [0.6, np.pi - 1.2, 0.6 - np.pi]
        return dict(hinges=[dict(phi=(kind if k == 0 else Start)(sign * phi)) for k, phi in enumerate(found)])

    dae = translate(Sarrus(legs=[leg(1, Fixed), leg(-1, Start)]))
    assert dae.diagnosis.mobility == 1
    assert len(dae.diagnosis.redundant) == 1
    at = dae.evaluate()
    np.testing.assert_allclose(at["plate.r"], [0.0, 0.0, 2 * 0.5 * np.sin(0.6)], atol=1e-12)
    # massless legs: the plate falls freely
    np.testing.assert_allclose(at["der(plate.v)"], [0.0, 0.0, -9.81], atol=1e-9)


class SixBar(Model):
    """A four-bar whose coupler drives a second loop over two more bars; the loops share crank and coupler."""

    world = World()
    hinges = Array(Revolute, 7, n=[0.0, -1.0, 0.0])
    crank, coupler, rocker = (FixedTranslation(r=[x, 0.0, 0.0]) for x in (0.3, 0.8, 0.7))
    branch, arm, last = (FixedTranslation(r=r) for r in ([0.4, 0.0, 0.4], [0.6, 0.0, 0.0], [0.6, 0.0, 0.0]))
    ground, post = FixedTranslation(r=[1.0, 0.0, 0.0]), FixedTranslation(r=[0.5, 0.0, 1.3])
    bodies = Array(Body, 5, m=1.0, r_cm=[0.2, 0.0, 0.05], J=np.diag([0.01, 0.02, 0.02]))

    def equations(self):
        h = self.hinges
        ways = [
            (self.world.frame_b, h[0], self.crank),
            (self.crank.frame_b, h[1], self.coupler),
            (self.ground.frame_b, h[2], self.rocker),
            (self.post.frame_b, h[4], self.arm),
            (self.arm.frame_b, h[5], self.last),
        ]
        for body, (before, hinge, bar) in zip(self.bodies, ways, strict=True):
            yield from row(before, hinge, bar)
            yield connect(hinge.frame_b, body.frame_a)
        for fixed in (self.ground, self.post):
            yield connect(self.world.frame_b, fixed.frame_a)
        yield connect(self.branch.frame_a, self.coupler.frame_a)
        yield from row(self.rocker, h[3], self.coupler.frame_b)
        yield from row(self.last, h[6], self.branch.frame_b)


def test_two_loops_that_share_bodies_keep_their_energy():
    phi = [Fixed(0.7), Start(-0.4), Start(1.8), Start(-1.4), Start(-2.5), Start(1.0), Start(0.0)]
    hinges = [dict(phi=start) for start in phi]
    hinges[0] |= dict(w=Fixed(3.0))
    dae = translate(SixBar(hinges=hinges))
    assert dae.diagnosis.mobility == 1
    assert len(dae.diagnosis.redundant) == 6
    motion = simulate(dae, stop=3.0, tolerance=1e-9, points=61)
    energy = np.zeros(61)
    for k in range(5):
        R, w = motion[f"bodies[{k}].frame_a.R"], motion[f"bodies[{k}].w"]
        arm = R @ [0.2, 0.0, 0.05]
        r, v = motion[f"bodies[{k}].r"] + arm, motion[f"bodies[{k}].v"] + np.cross(w, arm)
        energy += (v**2).sum(axis=1) / 2 + 0.02 * w[:, 1] ** 2 / 2 + 9.81 * r[:, 2]
    assert np.ptp(motion["hinges[0].phi"]) > 3.0
    assert np.ptp(energy) < 1e-6 * energy[0]  # a thousand times the integrator's tolerance
    for loop in dae.flat.loops:
        assert np.abs(motion[f"{loop.a}.r"] - motion[f"{loop.b}.r"]).max() < 1e-11


class Rocker(Model):
    """A crank about z drives a rocker about x; what joins their ends is put in as `rod`."""

    world = World()
    crank, rocker = Revolute(n=[0.0, 0.0, 1.0]), Revolute(n=[1.0, 0.0, 0.0])
    one = Body(m=1.0, r_cm=[0.1, 0.0, 0.0], J=np.diag([0.01, 0.02, 0.02]))
    two = Body(m=1.5, r_cm=[0.0, 0.25, 0.0], J=np.diag([0.03, 0.01, 0.03]))
    near, far = FixedTranslation(r=[0.2, 0.0, 0.0]), FixedTranslation(r=[0.0, 0.5, 0.0])
    ground = FixedTranslation(r=[1.0, 0.3, 0.2])
    rod = SphericalSpherical(L=1.1)

    def equations(self):
        yield connect(self.world.frame_b, self.ground.frame_a)
        for before, hinge, bar, body in (
            (self.world, self.crank, self.near, self.one),
            (self.ground, self.rocker, self.far, self.two),
        ):
            yield from row(before, hinge, bar)
            yield connect(hinge.frame_b, body.frame_a)
        yield from row(self.near, self.rod, self.far.frame_b)


class BallEnded(TwoFrames):
    """A rod of next to no mass between two joints."""

    first, last = Spherical(), Spherical()
    bar = FixedTranslation(r=[1.1, 0.0, 0.0])
    body = Body(m=1e-9, r_cm=[0.55, 0.0, 0.0], J=1e-10 * np.eye(3))

    def equations(self):
        yield from row(self.frame_a, self.first, self.bar)
        yield connect(self.first.frame_b, self.body.frame_a)
        yield from row(self.bar, self.last, self.frame_b)


class Cardan(BallEnded):
    """The same with a universal joint at one end, so that it cannot spin about itself."""

    first = Universal(n_a=[0.0, 0.0, 1.0], n_b=[0.0, 1.0, 0.0])


@pytest.mark.parametrize(("rod", "mobility"), [(BallEnded(), 2), (Cardan(), 1)])
def test_a_rod_with_two_joints_is_the_rod_without_rotation(rod, mobility):
    start = dict(crank=dict(phi=Fixed(0.5), w=Fixed(1.0)), rocker=dict(phi=Start(0.3)))
    one, other = translate(Rocker(**start)), translate(Rocker(**start, rod=rod))
    assert one.diagnosis.mobility == 1
    assert other.diagnosis.mobility == mobility  # a rod between balls also spins about itself
    assert other.diagnosis.redundant == ()
    a, b = one.evaluate(), other.evaluate()
    for name in ("rocker.phi", "rocker.w", "der(crank.w)", "der(rocker.w)"):
        assert b[name] == pytest.approx(a[name], rel=1e-8)  # the mass of the rod, 1e-9 of the others'
    # the length of the rod stays: its rate along itself is zero
    line = a["far.frame_b.r"] - a["near.frame_b.r"]
    assert line @ line == pytest.approx(1.1**2, rel=1e-13)
    assert line @ (a["der(far.frame_b.r)"] - a["der(near.frame_b.r)"]) == pytest.approx(0.0, abs=1e-13)
    # the force that the loop carries goes along the rod
    np.testing.assert_allclose(np.cross(b["rod.frame_b.f"], line), 0.0, atol=1e-7)
    np.testing.assert_allclose(b["rod.frame_b.f"], a["rod.frame_b.f"], atol=1e-7)
