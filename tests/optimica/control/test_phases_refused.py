"""What cannot be a phase or a link."""

from typing import Any

import pytest

from gantrytau import Input, Model, ModelError, Real
from gantrytau_optimica import Optimization, final, link, optimize
from tests.optimica.control.test_phases import Ball, First, Leg, ThereAndBack
from tests.optimica.problems import Mass


def message(problem) -> str:
    with pytest.raises(ModelError) as caught:
        optimize(problem)
    return str(caught.value)


def changed(**members):
    return type("Wrong", (ThereAndBack,), members)


def having(constraint):
    return changed(constraints=lambda self: [constraint(self)])


class Nested(First):
    """A phase within a phase."""

    inner = Leg()


class Held(Model):
    """A model that holds a phase."""

    inner = Leg()


class Outside(ThereAndBack):
    """A variable that belongs to no phase."""

    load = Real(unit="N", description="load")

    def equations(self):
        yield self.load == 1


class Other(Leg):
    """A phase with another model."""

    mass = Ball()


class Chosen(ThereAndBack):
    """An input that belongs to no phase."""

    hand = Input(unit="m", description="hand")


NO_PHASE: Any = 3


@pytest.mark.parametrize(
    ("problem", "words"),
    [
        (changed(out=Nested()), "Wrong: the phase out.inner lies inside of out, expected phases as"),
        (changed(held=Held()), "Wrong: the phase held.inner lies inside of held, expected phases as"),
        (Outside, "Outside: load belongs to no phase, expected variables in phases only; declare it in one"),
        (Chosen, "Chosen: hand belongs to no phase"),
        (changed(integrand=lambda self: self.out.mass.u**2), "Wrong.integrand: found an integrand beside"),
        (having(lambda p: link(p.out, p.back, jump=["mass.y"])), "back.mass.y"),
        (having(lambda p: link(p.out, p.back, jump=["mass.u"])), "Wrong: link, jump: back.mass.u is no"),
        (having(lambda p: link(p.out, p.back, jump="mass.v")), "link: found jump='mass.v', expected a list"),
        (having(lambda p: link(p.out.mass, p.back)), "found first="),
        (having(lambda p: link(p.out, NO_PHASE)), "link: found second=3, expected a phase"),
        (having(lambda p: p.out.mass.x <= p.back.mass.x), "joins signals of"),
        (having(lambda p: final(p.out.mass.x + p.back.mass.x) == 0), "joins out and back, expected"),
        (changed(back=Other(), constraints=lambda self: [link(self.out, self.back)]), "link(out, back)"),
        (having(lambda p: final(p.out.mass.x + p.back.mass.z) == 0), "Mass has no 'z'"),
    ],
)
def test_what_cannot_be_a_phase(problem, words):
    assert words in message(problem)


def test_a_link_of_the_problem_itself():
    assert "link" in message(having(lambda p: link(p, p.back)))


def test_a_link_of_a_phase_of_another_problem():
    other = ThereAndBack()
    assert "link" in message(having(lambda p: link(p.out, other.back)))


def test_phases_whose_fixed_times_do_not_meet():
    class Stretch(Optimization):
        mass = Mass()
        final_time = 1.0

    class Twice(Optimization):
        first, second = Stretch(), Stretch()

        def constraints(self):
            yield link(self.first, self.second)

    with pytest.raises(ModelError, match=r"first ends at 1 s, where second begins at 0 s.* start_time = 1"):
        optimize(Twice)
