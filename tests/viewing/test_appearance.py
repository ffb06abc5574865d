"""What components say of their looks, by names."""

import numpy as np
import pytest

from gantrytau import Array, Model, ModelError, Parameter, Real, der, flatten
from gantrytau.language.self_description.appearance import Ball, Cuboid, Stick
from gantrytau.mechanics.multibody import FixedTranslation, PointMass, Prismatic, World
from gantrytau_models import DeltaRobot, F1GantryTau, GantryTau, Pendulum, SixLinkGantryTau, prototypes
from tests.mechanisms.rows import in_a_row, row


class Slide(Model):
    """A mass on a slide."""

    world = World()
    slide = Prismatic(n=[1.0, 0.0, 0.0], s=dict(start=0.0, fixed=True), v=dict(start=1.0, fixed=True))
    body = PointMass(m=1.0)

    def equations(self):
        yield from row(self.world, self.slide, self.body)


class Slides(Model):
    """Two of them."""

    arm = Array(Slide, 2)
    arm2 = Slide()


def owners(model):
    return {shape.owner for shape in flatten(model).shapes}


def test_components_are_seen_by_their_paths():
    assert owners(Slides()) == {
        f"{arm}.{part}" for arm in ("arm[0]", "arm[1]", "arm2") for part in ("slide", "body")
    }


def test_what_is_not_drawn_hides_what_is_in_it_and_nothing_else():
    assert owners(Slides(arm=dict(drawn=False))) == {"arm2.slide", "arm2.body"}
    assert owners(Slides(arm2=dict(body=dict(drawn=False)))) == owners(Slides()) - {"arm2.body"}
    assert owners(Slides(drawn=False)) == set()


def test_a_quantity_may_have_the_name_of_the_setting():
    class Sketch(Model):
        drawn = Real(unit="m", description="length that is drawn", start=0.0, fixed=True)
        v = Parameter(0.0, unit="m/s")

        def equations(self):
            yield der(self.drawn) == self.v

        def shapes(self):
            yield Stick(a=(0.0, 0.0, 0.0), b=("drawn", 0.0, 0.0))

    assert [shape.names for shape in flatten(Sketch()).shapes] == [("drawn",)]


@pytest.mark.parametrize(
    "make",
    [
        Pendulum,
        DeltaRobot,
        lambda: GantryTau(prototypes.L1),
        lambda: SixLinkGantryTau(prototypes.D1),
        lambda: F1GantryTau(prototypes.F1),
    ],
)
def test_every_name_of_the_robots_is_one_of_theirs(make):
    flat = flatten(make())
    assert flat.shapes
    for name in {name for shape in flat.shapes for name in shape.names}:
        assert flat.expand(name)


def test_carts_of_six_links_are_where_their_joints_are():
    shapes = flatten(SixLinkGantryTau(prototypes.D1)).shapes
    assert [s.at for s in shapes if s.owner == "carts[2]" and isinstance(s, Cuboid)] == [
        "arms[2].links[0].on_cart.frame_b.r"
    ]


class Misspelt(Slide):
    """Says a name that is not there."""

    def shapes(self):
        yield Ball(at="body.frame_a.x")


class Plain(Slide):
    """Says a text."""

    def shapes(self):
        yield "body"


def test_wrong_shapes_are_told():
    with pytest.raises(ModelError) as error:
        flatten(Slides(arm2=Misspelt()))
    assert "arm2 (Misspelt).shapes: found 'arm2.body.frame_a.x', expected the name of a" in str(error.value)
    with pytest.raises(ModelError, match=r"the model \(Plain\)\.shapes: found 'body', expected shapes, as"):
        flatten(Plain())


def test_numbers_may_be_arrays():
    class Marked(Slide):
        def shapes(self):
            yield Ball(at=np.array([0.0, 0.0, 1.0]), radius=0.1)

    assert [s.owner for s in flatten(Slides(arm2=Marked())).shapes].count("arm2") == 1


def test_a_translation_is_a_stick():
    Post = in_a_row("Post", world=World(), post=FixedTranslation(r=[0.0, 0.0, 1.0]))

    (stick,) = flatten(Post()).shapes
    assert isinstance(stick, Stick)
    assert (stick.a, stick.b) == ("post.frame_a.r", "post.frame_b.r")
