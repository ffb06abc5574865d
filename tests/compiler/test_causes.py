"""Equations that are too many or too few: the cause is named, a modification, an input, a given name."""

import pytest

from gantrytau import (
    Array,
    Fixed,
    Input,
    Model,
    Output,
    Parameter,
    Real,
    Start,
    StructureError,
    check,
    connect,
    der,
    simulate,
    translate,
)  # fmt: skip
from gantrytau.mechanics import multibody, rotational


class Decay(Model):
    x = Real(start=1.0)
    r = Real(2, start=1.0)
    R = Real((1, 2), start=1.0)

    def equations(self):
        yield der(self.x) == -self.x
        yield der(self.r) == -self.r
        yield der(self.R) == -self.R


class Axis(Model):
    tau = Input(unit="N.m")
    motor = rotational.Torque()
    rotor = rotational.Inertia(J=1.0)

    def equations(self):
        yield connect(self.motor.flange, self.rotor.flange_a)
        yield self.motor.tau == self.tau


class Loop(Model):
    axis = Axis()
    k = Parameter(1.0, unit="N.m.s/rad")

    def drive(self):
        yield from ()

    def equations(self):
        yield from self.drive()


class Hinge(Model):
    world = multibody.World()
    joint = multibody.Revolute(n=[0.0, 1.0, 0.0], phi=0.5)
    body = multibody.Body()

    def equations(self):
        yield connect(self.world.frame_b, self.joint.frame_a)
        yield connect(self.joint.frame_b, self.body.frame_a)


def refused(model, **request):
    with pytest.raises(StructureError) as found:
        translate(model, **request)
    return str(found.value)


@pytest.mark.parametrize(
    ("model", "name", "own", "value"),
    [
        (Decay(x=2.5), "x", "x", "2.5"),
        (Decay(r=[2.5, 3.5]), "r", "r", "[2.5, 3.5]"),
        (Decay(R=[[1.5, 2.5]]), "R", "R", "[[1.5, 2.5]]"),
        (type("Around", (Model,), {"part": Array(Decay, 2, x=2.5)})(), "part[0].x", "x", "2.5"),
        (Hinge(), "joint.phi", "phi", "0.5"),
    ],
)
def test_a_modification_that_was_meant_as_a_start(model, name, own, value):
    message = refused(model)
    words = f"{name} is set by the modification {own}={value}, which is an equation; a start value is {own}=Start({value})"
    assert words in message
    assert message.index(words) < message.index("Overdetermined")
    assert words in check(model).missing


def test_what_the_message_says_is_right():
    assert simulate(Decay(x=Start(2.5)), stop=1.0, points=2)["x"][0] == 2.5
    assert simulate(Decay(x=Fixed(2.5)), stop=1.0, points=2)["x"][0] == 2.5


def loop(drive):
    return type("Driven", (Loop,), {"drive": drive})()


def test_an_input_that_is_driven_inside_and_open_outside():
    message = refused(loop(lambda m: iter([m.axis.motor.tau == -m.k * m.axis.rotor.w])))
    assert "axis.motor.tau, an input, is driven more than once, by the model (Driven), equation 1" in message
    assert "and by axis (Axis), equation 2 `axis.motor.tau == axis.tau`; leave one out" in message
    assert "axis.tau is an open input and counts as known from outside" in message
    right = loop(lambda m: iter([m.axis.tau == -m.k * m.axis.rotor.w]))  # what the message says
    assert translate(right).inputs == ()


def test_an_input_that_is_not_alone_on_its_side_stays_open():
    message = refused(loop(lambda m: iter([-m.axis.tau == m.k * m.axis.rotor.w])))
    assert "axis.tau is an open input" in message
    assert "write an equation with axis.tau alone on one side" in message


def test_an_input_that_is_driven_twice():
    twice = loop(lambda m: iter([m.axis.tau == -m.k * m.axis.rotor.w, m.axis.tau == 2.0]))
    message = refused(twice)
    assert "axis.tau, an input, is driven more than once" in message
    assert "`axis.tau == (-(k*axis.rotor.w))` and by the model (Driven), equation 2" in message
    bound = type("Bound", (Loop,), {"axis": Axis(tau=2.0), "drive": lambda m: iter([m.axis.tau == 1.0])})()
    assert "axis.tau, an input, is driven more than once" in refused(bound)


def test_more_is_given_than_can_be_chosen():
    assert "More is given than can be chosen; leave out rotor.w" in refused(Axis(), given=["tau", "rotor.w"])
    assert "leave out rotor.phi or rotor.w" in refused(Axis(), given=["rotor.w", "rotor.phi"])
    assert translate(Axis(), given=["rotor.w"]).known == ("rotor.w",)


def test_an_input_that_counts_as_set_is_named_where_nothing_sets_it():
    class Reading(Model):
        axis = Axis()
        seen = Output(unit="N.m")

        def equations(self):
            yield self.seen == self.axis.tau

    class Joined(Model):
        first, second = Axis(), Axis()

        def equations(self):
            yield connect(self.first.tau, self.second.tau)

    words = "axis.tau, an input, counts as set by the model (Reading), equation 1 `seen == axis.tau`"
    assert words in refused(Reading())
    assert "first.tau, an input, counts as set by the model (connection), equation 1" in refused(Joined())
