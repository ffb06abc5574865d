"""What robots say of their rods: own models and subclasses are known by it, and wrong words are told."""

import numpy as np
import pytest

from gantrytau import Array, Model, ModelError, connect, flatten
from gantrytau.kinematics import Kinematics
from gantrytau.language.self_description.rods import RodArm, Rods, SingleRod
from gantrytau.mechanics.multibody import World
from gantrytau_models import F1GantryTau, FourBar, GantryTau, SixLinkGantryTau, prototypes
from gantrytau_models.mechanisms.gantry_tau import Arm, Cart, Tool

L1 = prototypes.L1


def arms_of(names):
    return [
        RodArm(name, f"{name}_cart.s", f"{name}.direction", f"{name}.offset", [SingleRod(f"{name}.length")])
        for name in names
    ]


def arm(number):
    found = L1.arms[number]
    return Arm(length=found.length, offset=list(found.offset), direction=list(found.direction))


class Tripod(Model):
    """An L1 whose members have names of their own."""

    world = World()
    low, high, far = arm(0), arm(1), arm(2)
    low_cart, high_cart, far_cart = (Cart(m=mass) for mass in L1.cart_masses)
    tool = Tool(m=L1.plate_mass, r=dict(start=[0.5, 3.0, -0.6]))

    def equations(self):
        for one, cart in ((self.low, self.low_cart), (self.high, self.high_cart), (self.far, self.far_cart)):
            yield connect(self.world.frame_b, one.frame_a)
            yield connect(one.frame_cart, cart.frame)
            yield connect(one.axis, cart.axis)
            yield connect(one.frame_b, self.tool.frame)

    def rods(self):
        return Rods(arms_of(["low", "high", "far"]))


@pytest.fixture(scope="module")
def tripod():
    return Kinematics(Tripod())


def test_a_model_of_ones_own_has_the_closed_form(tripod):
    assert tripod.joints == ("low_cart.s", "high_cart.s", "far_cart.s")
    r = np.array([0.5, 3.0, -0.6]) + np.random.default_rng(0).uniform(-0.3, 0.3, (50, 3))
    q = tripod.ik(r)
    assert np.isfinite(q).all()
    expected = Kinematics(GantryTau(L1))
    np.testing.assert_allclose(q, expected.ik(r), atol=1e-12)
    np.testing.assert_allclose(tripod.fk(q)[0], r, atol=1e-9)
    assert len(tripod.configurations(q=q[0])) == 2  # only links in closed form know all poses


def test_the_order_of_arms_is_that_of_the_columns_of_q(tripod):
    class Backwards(Tripod):
        def rods(self):
            return Rods(arms_of(["far", "high", "low"]))

    r = [0.5, 3.0, -0.6]
    np.testing.assert_allclose(Kinematics(Backwards()).ik(r), tripod.ik(r)[::-1], atol=1e-12)


def test_a_subclass_says_what_its_base_does():
    class Mine(SixLinkGantryTau):
        pass

    assert flatten(Mine(prototypes.D1)).rods == SixLinkGantryTau(prototypes.D1).rods()
    assert flatten(FourBar()).rods is None


@pytest.mark.parametrize(
    ("robot", "joints", "turntables"),
    [(GantryTau(L1), 3, 0), (SixLinkGantryTau(prototypes.D1), 3, 0), (F1GantryTau(prototypes.F1), 6, 3)],
)
def test_robots_name_what_they_have(robot, joints, turntables):
    rods, flat = robot.rods(), flatten(robot)
    known = [*(p.name for p in flat.parameters), *(v.name for v in flat.variables)]
    rods.check(flat.name, known)
    assert (len(rods.joints), len(rods.turntables)) == (joints, turntables)
    assert set(rods.given) <= set(rods.parameters)


class WithArray(Model):
    """A member of this name is no method."""

    rods = Array(World, 2)


def test_a_member_called_rods_says_nothing():
    assert flatten(WithArray()).rods is None


@pytest.mark.parametrize(
    ("said", "message"),
    [
        (lambda self: ["low.length"], r"Tripod\.rods: found \['low\.length'\], expected a record of names"),
        (lambda self: Rods(arms_of(["low", "hihg", "far"])), r"Tripod\.rods: found 'hihg\.offset'"),
        (
            lambda self: Rods([RodArm("low", "low_cart.s", "low.direction", "low.offset", [SingleRod(2.0)])]),  # type: ignore
            r"rods: found SingleRod\.length = 2\.0, expected the name of a parameter",
        ),
    ],
)
def test_wrong_words_are_told(said, message):
    robot = type("Tripod", (Tripod,), {"rods": said})
    with pytest.raises(ModelError, match=message):
        Kinematics(robot())
