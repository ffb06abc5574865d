"""Mechanisms with a fault: each is refused with the place, what was found, what was expected, and a remedy."""

import numpy as np
import pytest

from gantrytau import (
    Fixed,
    InitializationError,
    Model,
    ModelError,
    Parameter,
    SolveError,
    Start,
    StructureError,
    connect,
    simulate,
    time,
    translate,
)
from gantrytau.mechanics import rotational, translational
from gantrytau.mechanics.multibody import (
    Body,
    FixedTranslation,
    PointMass,
    Prismatic,
    Revolute,
    Spherical,
    SphericalSpherical,
    World,
)
from gantrytau.mechanics.multibody import Fixed as Mount
from gantrytau_models import FourBar, Pendulum
from tests.mechanisms.rows import in_a_row, row


class Swing(Model):
    """A body on a hinge."""

    world = World()
    hinge = Revolute(n=[0.0, 1.0, 0.0])
    body = Body(r_cm=[0.3, 0.0, 0.0])

    def equations(self):
        yield from row(self.world, self.hinge, self.body)


class Thrown(Model):
    """A body that nothing holds."""

    world = World()
    body = Body()


class Triangle(Model):
    """Two bars between two pivots."""

    world = World()
    left, right, top = Revolute(n=[0.0, 1.0, 0.0]), Revolute(n=[0.0, 1.0, 0.0]), Revolute(n=[0.0, 1.0, 0.0])
    one, two, ground = (
        FixedTranslation(r=[0.6, 0.0, 0.0]),
        FixedTranslation(r=[0.6, 0.0, 0.0]),
        FixedTranslation(),
    )
    weight = Body()

    def equations(self):
        yield from row(self.world, self.left, self.one)
        yield from row(self.world, self.ground, self.right, self.two)
        yield connect(self.one.frame_b, self.top.frame_a)
        yield connect(self.one.frame_b, self.weight.frame_a)
        yield connect(self.top.frame_b, self.two.frame_b)


def refusal(model, kind):
    """The message of what translate raises."""
    with pytest.raises(kind) as raised:
        translate(model)
    return str(raised.value)


# loops and places


def test_a_loop_that_cannot_close_says_where_and_what_to_do():
    found = refusal(Triangle(ground=dict(r=[2.0, 0.0, 0.0])), InitializationError)
    assert "Triangle: the loop through top, one, left, world, ground, right, two stays open" in found
    assert "between top.frame_b and two.frame_b, by" in found
    assert "correct lengths, offsets or joint axes" in found


@pytest.mark.parametrize(
    ("base", "gap"),
    [
        ([2.0, 0.0, 0.0], "0.8"),
        ([0.0, 0.0, 5.0], "3.8"),
        ([-1.0, 0.3, 0.0], "0.3"),
        ([2.0, 0.3, 0.0], "0.854"),
    ],
)
def test_a_loop_that_cannot_close_says_by_how_much(base, gap):
    """Two bars of 0.6 m in the plane of x and z reach 1.2 m; what is left is the gap, across the plane as well."""
    assert f"by {gap} m and 0 deg" in refusal(Triangle(ground=dict(r=base)), InitializationError)


@pytest.mark.parametrize("other", [Mount(r=[1.0, 0.0, 0.0]), World()])
def test_two_fixed_places_that_disagree(other):
    class Torn(Model):
        world = World()
        bar = FixedTranslation(r=[0.5, 0.0, 0.0])
        second = other

        def equations(self):
            yield connect(self.world.frame_b, self.bar.frame_a)
            yield connect(self.second.frame_b, self.bar.frame_b)

    words = "the loop through second, world, bar stays open between second.frame_b and bar.frame_b, by 0.5 m and 0 deg"
    found = refusal(Torn(), InitializationError)
    assert words in found
    assert "Expected frames that meet" in found


def test_two_fixed_orientations_that_disagree():
    class Twisted(Model):
        world = World()
        second = Mount(n=[0.0, 0.0, 1.0], phi=0.3)

        def equations(self):
            yield connect(self.world.frame_b, self.second.frame_b)

    assert "world.frame_b and second.frame_b, by 0 m and 17.2 deg" in refusal(Twisted(), InitializationError)


def test_fixed_places_that_agree_are_welcome():
    class Agreed(Model):
        world = World()
        bar = FixedTranslation(r=[0.5, 0.0, 0.0])
        second = Mount(r=[0.5, 0.0, 0.0])

        def equations(self):
            yield connect(self.world.frame_b, self.bar.frame_a)
            yield connect(self.second.frame_b, self.bar.frame_b)

    assert len(translate(Agreed()).diagnosis.redundant) == 6


def test_two_worlds_with_different_gravity_are_refused():
    class Worlds(Thrown):
        moon = World(g=1.62)

    found = refusal(Worlds(), ModelError)
    assert "moon" in found
    assert "World" in found


def test_a_body_without_a_world():
    class Lost(Model):
        body = Body()

    found = refusal(Lost(), ModelError)
    assert "body (Body): found no World" in found
    assert "declare `world = World()` in the body of Lost" in found


def test_joints_that_hang_in_the_air():
    class Loose(Model):
        world = World()
        hinge = Revolute()
        bar = FixedTranslation(r=[1.0, 0.0, 0.0])

        def equations(self):
            yield connect(self.hinge.frame_b, self.bar.frame_a)

    found = refusal(Loose(), StructureError)
    assert "hinge.frame_a: nothing determines the orientation" in found
    assert "Connect it to the world" in found


# motions that nothing determines, or several things do


def test_rotation_without_inertia():
    Spindle = in_a_row("Spindle", world=World(), hinge=Revolute(), mass=PointMass())

    assert "Undetermined: hinge.phi (nothing holds the rotation about" in refusal(Spindle(), StructureError)


def test_sliding_without_mass():
    Empty = in_a_row("Empty", world=World(), rail=Prismatic())

    assert "Undetermined: rail.s (nothing holds the sliding along its" in refusal(Empty(), StructureError)


def test_rotation_between_a_rod_and_a_bar():
    Hanging = in_a_row(
        "Hanging",
        world=World(),
        rod=SphericalSpherical(),
        bar=FixedTranslation(r=[0.0, 0.0, -1.0]),
        mass=PointMass(),
    )

    found = refusal(Hanging(), StructureError)
    assert "bar.frame_a: nothing determines the orientation" in found
    assert "its rotation is free" in found


# A massless bar in a ball joint, with a point mass at its end: it may spin about itself.
SpinningBar = in_a_row(
    "SpinningBar", world=World(), ball=Spherical(), bar=FixedTranslation(r=[0.0, 0.0, -1.0]), mass=PointMass()
)


def test_rotation_of_a_bar_about_itself_is_named():
    found = refusal(SpinningBar(), StructureError)
    assert "ball.q" in found
    assert "nothing holds the rotation in the ball joint" in found


class Driven(Swing):
    """A hinge with a position source."""

    source = rotational.Position()

    def equations(self):
        yield from super().equations()
        yield connect(self.source.flange, self.hinge.axis)


@pytest.mark.parametrize(
    ("second", "word"),
    [
        (rotational.Position(), "something else holds this flange too"),
        (rotational.Speed(), "something else holds this flange too"),
        (rotational.Fixed(), "hinge.axis - source.flange - other.flange"),
    ],
)
def test_a_joint_driven_twice(second, word):
    class Twice(Driven):
        other = second

        def equations(self):
            yield from super().equations()
            yield connect(self.other.flange, self.hinge.axis)

    found = refusal(Twice(), StructureError)
    assert "Overdetermined by 1" in found
    assert "other" in found
    assert word in found


def test_a_joint_driven_and_locked():
    class Locked(Driven):
        lock = Mount()

        def equations(self):
            yield from super().equations()
            yield connect(self.hinge.frame_b, self.lock.frame_b)

    with pytest.raises((StructureError, SolveError), match="source"):
        simulate(Locked(), stop=1.0, inputs={"source.phi": lambda t: 0.2 * t})


def test_a_loop_with_more_drives_than_mobility():
    class Overdriven(Triangle):
        slide = Prismatic(s=Start(0.0))
        a, b = rotational.Position(phi=Start(-1.0)), translational.Position()

        def equations(self):
            yield from row(self.world, self.left, self.one, self.top)
            yield connect(self.one.frame_b, self.weight.frame_a)
            yield from row(self.top, self.two, self.right, self.ground.frame_b)
            yield connect(self.ground.frame_a, self.slide.frame_b)
            yield connect(self.world.frame_b, self.slide.frame_a)
            yield connect(self.a.flange, self.left.axis)
            yield connect(self.b.flange, self.slide.axis)

    along = 1.2 * np.cos(1.0)
    model = Overdriven(b=dict(s=Start(along)), top=dict(phi=Start(2.0)), right=dict(phi=Start(-1.0)))
    with pytest.raises((StructureError, SolveError)):
        simulate(model, stop=0.5, inputs={"b.s": lambda t: along + 0.2 * t})
    apart = Overdriven(b=dict(s=Start(along + 0.1)), top=dict(phi=Start(2.0)), right=dict(phi=Start(-1.0)))
    with pytest.raises(StructureError, match=r"more is driven than can move: with the inputs a\.phi"):
        simulate(apart, stop=0.5)


def test_a_loop_with_more_fixed_starts_than_mobility():
    words = (
        r"FourBar: found 2 fixed starts, of crank\.phi, rocker\.phi, where loops leave mobility 1 to these"
    )
    with pytest.raises(StructureError, match=words):
        translate(FourBar(crank=dict(phi=Fixed(1.0)), rocker=dict(phi=Fixed(1.2))))


class DrivenTwice(FourBar):
    """Crank and rocker driven by equations, where mobility is 1."""

    rate = Parameter(0.5, unit="rad/s")

    def equations(self):
        yield from super().equations()
        yield self.crank.phi == self.rate * time
        yield self.rocker.phi == 1.0 + self.rate * time


def test_joints_driven_by_more_equations_than_mobility():
    words = (
        r"found 2 driven joints, crank\.phi by .*equation 16, rocker\.phi by .*, where loops leave mobility 1"
    )
    with pytest.raises(StructureError, match=words):
        translate(DrivenTwice())


def test_a_start_outside_of_reach_is_told_with_one_that_closes():
    with pytest.raises(InitializationError, match=r"consistent near these starts: crank\.phi = ") as told:
        translate(FourBar(1.0, dict(length=1.0, phi=Fixed(3.0)), 0.6, 0.6))
    near = float(str(told.value).split("crank.phi = ")[1].split()[0])
    assert 1.2 < near < 2 * np.arcsin(0.6)  # where coupler and rocker are in line
    with pytest.raises(InitializationError, match=r"Unknowns there: x, y\..*near these starts: x = 1 in"):
        translate(Pendulum(x=Fixed(2.0), y=Fixed(0.0)))
