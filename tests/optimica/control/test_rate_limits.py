"""Limits on rates and jerks as written are those of a model that integrates itself; those without an input are refused."""

from typing import Any

import numpy as np
import pytest

from gantrytau import Fixed, Input, Model, ModelError, Parameter, Real, Samples, between, der, dot
from gantrytau.commands.demo.motion_problems import OnLine
from gantrytau_optimica import Free, Optimization, final, initial, optimize
from tests.optimica.known_answers.test_state_constraints import Crane, CraneMove
from tests.optimica.problems import Mass

SOLVED = 1e-6  # a hundred times the tolerance of the solver


class Jerked(Optimization):
    """1 m from rest to rest with a limit on the jerk, of which the model knows only the force."""

    mass: Any = Mass(x=Fixed(0.0), v=Fixed(0.0))
    rate: Any = Parameter(32.0)
    final_time: Any = Free(1.5, min=0.1, max=20.0)

    def objective(self):
        return self.final_time

    def constraints(self):
        yield between(-self.rate, der(der(self.mass.v)), self.rate)
        yield initial(self.mass.u) == 0
        yield final(self.mass.u) == 0
        yield final(self.mass.x) == 1
        yield final(self.mass.v) == 0


@pytest.mark.parametrize(
    "policy",
    [
        {},
        dict(scheme="gauss"),
        dict(scheme="shooting"),
        dict(points=1),
        dict(refine=1e-6),
        dict(controls={"der(mass.u)": "constant"}),
        dict(starts=3),
    ],
)
def test_a_jerk_is_limited_where_the_model_has_none(policy):
    found = optimize(Jerked, elements=40, **policy)
    assert found.objective == pytest.approx((32 / 32.0) ** (1 / 3), rel=SOLVED)
    t = np.linspace(0.0, found.final_time, 1001)
    assert np.max(np.abs(found.signal("der(der(mass.v))")(t))) <= 32 * (1 + SOLVED)
    assert np.ptp(found.signal("der(mass.v)")(t)) == pytest.approx(16.0, abs=0.1)
    assert "der(mass.u) at its upper limit 32" in found.report()


class HandCrane(Crane):
    """The crane with forces that are integrated."""

    u1 = Real(min=-2.83374, max=2.83374)
    u2 = Real(min=-0.80865, max=0.71265)
    r1 = Input()
    r2 = Input()

    def equations(self):
        yield from super().equations()
        yield der(self.u1) == self.r1
        yield der(self.u2) == self.r2


class Rates(CraneMove):
    def constraints(self):
        yield from super().constraints()
        yield between(-1, der(self.crane.u1), 1)
        yield between(-0.3, der(self.crane.u2), 0.3)


class RatesByHand(CraneMove):
    crane = HandCrane()

    def constraints(self):
        yield from super().constraints()
        yield between(-1, self.crane.r1, 1)
        yield between(-0.3, self.crane.r2, 0.3)


class Jerks(CraneMove):
    def constraints(self):
        yield from super().constraints()
        yield between(-1, der(der(self.crane.x4)), 1)
        yield between(-0.3, der(der(self.crane.x5)), 0.3)


class JerksByHand(CraneMove):
    crane = HandCrane()

    def constraints(self):
        c = self.crane
        yield from super().constraints()
        yield between(-1, c.r1 + 17.2656 * c.x6, 1)
        yield between(-0.3, c.r2, 0.3)


@pytest.mark.parametrize("policy", [{}, dict(scheme="gauss"), dict(scheme="shooting"), dict(points=1)])
@pytest.mark.parametrize(("written", "by_hand"), [(Rates, RatesByHand), (Jerks, JerksByHand)])
def test_a_crane_as_written_and_by_hand(written, by_hand, policy):
    rates = {"der(crane.u1)": "constant", "der(crane.u2)": "constant"}
    one = optimize(written, elements=40, controls=rates, **policy)
    other = optimize(
        by_hand, elements=40, controls={"crane.r1": "constant", "crane.r2": "constant"}, **policy
    )
    assert one.objective == pytest.approx(other.objective, rel=2e-6)  # of 0.04, at a tolerance of 1e-8
    t = np.linspace(0.0, 9.0, 91)
    for name in ("x1", "x2", "u1", "u2"):
        np.testing.assert_allclose(
            one.signal(f"crane.{name}")(t), other.signal(f"crane.{name}")(t), atol=5e-3
        )


def test_a_robot_on_a_line_as_written_and_by_hand():
    class Rate(OnLine):
        def constraints(self):
            yield from super().constraints()
            yield between(-150, der(self.torque[2]), 150)

    class ByHand(OnLine):
        given = ("rate",)
        rate = Input(unit="N.m/s", min=-150, max=150, description="of the torque")

        def equations(self):
            yield from super().equations()
            yield der(self.torque[2]) == self.rate

    one = optimize(Rate, controls={"der(torque[2])": "constant"})
    other = optimize(ByHand, controls={"rate": "constant"})
    assert one.final_time == pytest.approx(other.final_time, rel=SOLVED)


class Planes(Model):
    """Three masses, or four, by one vector or matrix of forces."""

    shape: Any = 3
    r = Real(shape, start=0.0, fixed=True)
    v = Real(shape, start=0.0, fixed=True)
    f = Input(shape)

    def equations(self):
        yield der(self.r) == self.v
        yield der(self.v) == self.f


def test_vectors_of_rates_have_limits_of_their_own():
    class All(Jerked):
        mass = Planes()
        rate = Parameter([32.0, 32.0, 64.0])

        def constraints(self):
            yield between(-self.rate, der(der(self.mass.v)), self.rate)
            yield initial(self.mass.f) == 0
            yield final(self.mass.f) == 0
            yield final(self.mass.r) == [1, 0.5, 2]
            yield final(self.mass.v) == 0

    class Round(All):
        def constraints(self):
            yield dot(der(self.mass.f), der(self.mass.f)) <= 32**2
            yield from list(super().constraints())[1:]

    assert optimize(All, elements=40).objective == pytest.approx(1.0, rel=SOLVED)
    # along one line, of the length of the vector
    way = np.linalg.norm([1, 0.5, 2])
    assert optimize(Round, elements=40).objective == pytest.approx(way ** (1 / 3), rel=1e-5)


def test_matrices_of_inputs_have_rates():
    class Square(Model):
        r = Real((2, 2), start=0.0, fixed=True)
        f = Input((2, 2))

        def equations(self):
            yield der(self.r) == self.f

    class Whole(Jerked):
        mass = Square()

        def constraints(self):
            yield between(-4, der(self.mass.f), 4)
            yield initial(self.mass.f) == 0
            yield final(self.mass.f) == 0
            yield final(self.mass.r) == np.array([[1, 0.5], [0.2, 0.3]])

    found = optimize(Whole, elements=40)
    assert found.objective == pytest.approx(1.0, rel=SOLVED)  # up and down with 4: d = 4 T^2 / 4
    assert found["der(mass.f)"].shape == (found.time.size, 2, 2)


class Fading(Model):
    """Fades away by itself."""

    x = Real(start=1.0, fixed=True)
    y = Real()

    def equations(self):
        yield der(self.x) == -self.x
        yield self.y == self.x**2


@pytest.mark.parametrize(
    ("rate", "words"),
    [
        (lambda p: der(p.fading.y), r"der\(fading\.y\), which no chosen input and no free number moves"),
        (lambda p: der(der(p.fading.y)), r"der\(der\(fading\.y\)\), which no chosen input"),
        (lambda p: der(p.rate), "constraint 1: found limits of 0, which is a number whatever is chosen"),
        (lambda p: der(p.final_time), "constraint 1: found limits of 0"),
    ],
)
def test_a_limit_on_a_rate_without_an_input_is_refused(rate, words):
    class Without(Jerked):
        fading = Fading()

        def constraints(self):
            yield between(-1, rate(self), 1)
            yield final(self.mass.x) == 1

    with pytest.raises(ModelError, match=words):
        optimize(Without)


def test_what_would_have_to_be_chosen_is_named():
    class Without(Jerked):
        fading = Fading()

        def constraints(self):
            yield der(self.fading.y) <= 1

    with pytest.raises(ModelError, match=r"limit the rate of what an input moves, as der\(mass\.u\), or"):
        optimize(Without)


@pytest.mark.parametrize(
    ("course", "words"),
    [
        (lambda t: 0.1 * t, r"der\(other\.v\).*no chosen input .* what `inputs` gives"),
        (Samples([0.0, 30.0], [0.0, 1.0]), r"derivative of the input other\.u, .* leave it out there"),
    ],
)
def test_the_rate_of_a_given_course_is_not_chosen(course, words):
    class Given(Jerked):
        other = Mass(x=Fixed(0.0), v=Fixed(0.0))
        inputs = {"other.u": course}

        def constraints(self):
            yield from super().constraints()
            yield between(-1, der(der(self.other.v)), 1)

    with pytest.raises(ModelError, match=words):
        optimize(Given)


def test_a_free_start_or_number_is_reason_enough():
    class Gentle(Optimization):
        fading: Any = Fading(x=dict(start=1.0, fixed=False))
        final_time = 1.0

        def objective(self):
            return -initial(self.fading.x)

        def constraints(self):
            yield der(self.fading.y) >= -2
            yield initial(self.fading.x) >= 0

    # der(y) = -2 x^2, the steepest at the start: x = 1 within what the first point is later
    assert optimize(Gentle)["fading.x"][0] == pytest.approx(1.0, abs=5e-3)
