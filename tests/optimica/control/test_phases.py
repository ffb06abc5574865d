"""Several phases, linked: a mass there and back, a ball that bounces, and what cannot be linked."""

from typing import Any

import numpy as np
import pytest

from gantrytau import Array, Fixed, Model, ModelError, Parameter, Real, der
from gantrytau_optimica import Free, Optimization, at, final, initial, link, optimize
from tests.optimica.problems import Mass


class Leg(Optimization):
    """A stretch of the way of a mass."""

    mass: Any = Mass(u=dict(min=-1.0, max=1.0))
    start_time: Any = Free(1.5, unit="s", min=0.0, max=100.0)
    final_time: Any = Free(3.0, unit="s", min=0.1, max=100.0)


class First(Leg):
    """The stretch that begins at 0 s."""

    start_time = 0.0


class ThereAndBack(Optimization):
    """1 m and back with a stop there: 2 s each."""

    out: Any = First()
    back: Any = Leg()

    def objective(self):
        return self.back.final_time

    def constraints(self):
        yield initial(self.out.mass.x) == 0
        yield initial(self.out.mass.v) == 0
        yield final(self.out.mass.x) == 1
        yield final(self.out.mass.v) == 0
        yield link(self.out, self.back)
        yield final(self.back.mass.x) == 0
        yield final(self.back.mass.v) == 0


@pytest.fixture(scope="module")
def there_and_back():
    return optimize(ThereAndBack, elements=10)


def test_there_and_back_takes_four_seconds(there_and_back):
    assert there_and_back.objective == pytest.approx(4.0, abs=1e-6)
    assert there_and_back.start_time == 0.0
    assert there_and_back.final_time == pytest.approx(4.0, abs=1e-6)
    assert there_and_back["out.final_time"] == pytest.approx(2.0, abs=1e-6)
    assert there_and_back["back.start_time"] == pytest.approx(there_and_back["out.final_time"], abs=1e-9)


def test_every_phase_has_its_times(there_and_back):
    t = there_and_back.time_of("back.mass.x")
    assert t[0] == pytest.approx(2.0, abs=1e-6)
    assert t[-1] == there_and_back.final_time
    assert there_and_back["out.mass.x"].shape == there_and_back.time_of("out.mass.x").shape
    middle = there_and_back.signal("back.mass.x")(3.0)
    assert float(middle) == pytest.approx(0.5, abs=1e-6)
    assert there_and_back.integral("out.mass.v") == pytest.approx(1.0, abs=1e-8)
    assert there_and_back.integral("back.mass.v") == pytest.approx(-1.0, abs=1e-8)
    with pytest.raises(ModelError, match=r"ThereAndBack has phases .* ask one of .phases\[...\]: 'out'"):
        _ = there_and_back.time
    with pytest.raises(ModelError, match="has phases"):
        _ = there_and_back.result


def test_phases_are_played_back(there_and_back):
    assert there_and_back.playback.complete
    assert there_and_back.playback.defect < 1e-7
    assert there_and_back.playback.objective == pytest.approx(4.0, abs=1e-6)
    report = there_and_back.report()
    assert "out 0 to 2 s, back 2 to 4 s" in report
    assert "`back.mass.x begins where out.mass.x ends` is missed by" in report


def test_a_playback_of_phases_has_no_common_result(there_and_back):
    with pytest.raises(ModelError, match="has phases"):
        _ = there_and_back.playback.result


def test_phases_declared_in_another_order_than_they_happen():
    class Reversed(Optimization):
        back: Any = Leg()
        out: Any = First()
        objective = ThereAndBack.objective
        constraints = ThereAndBack.constraints

    optimum = optimize(Reversed, elements=6)
    assert optimum.objective == pytest.approx(4.0, abs=1e-6)
    assert (optimum.start_time, optimum.final_time) == pytest.approx((0.0, 4.0), abs=1e-6)


def test_phases_refined_on_borders_that_do_not_fit():
    optimum = optimize(ThereAndBack, elements=7, refine=1e-6)
    assert optimum.refinement.reached
    assert optimum.objective == pytest.approx(4.0, abs=4e-6)
    assert optimum.playback.violation <= 1e-6
    assert optimum.playback.defect <= 1e-6
    assert len(optimum.refinement.switches) == 2


def test_three_phases_of_an_array():
    class Tour(Optimization):
        legs = Array(Leg, 3)

        def objective(self):
            return self.legs[2].final_time

        def constraints(self):
            first, second, third = self.legs
            yield first.start_time == 0
            yield initial(first.mass.x) == 0
            yield initial(first.mass.v) == 0
            for leg, after, goal in ((first, second, 1), (second, third, 0)):
                yield final(leg.mass.x) == goal
                yield final(leg.mass.v) == 0
                yield link(leg, after)
            yield final(third.mass.x) == 4
            yield final(third.mass.v) == 0

    optimum = optimize(Tour, elements=10)
    assert optimum.objective == pytest.approx(2 + 2 + 4, abs=1e-5)
    assert optimum["legs[1].final_time"] == pytest.approx(4.0, abs=1e-5)


class Ball(Model):
    """Free fall."""

    h = Real(unit="m", description="height")
    v = Real(unit="m/s", description="speed upwards")
    g = Parameter(9.81, unit="m/s2", description="gravity")

    def equations(self):
        yield der(self.h) == self.v
        yield der(self.v) == -self.g


class Flight(Optimization):
    """Between two contacts."""

    ball: Any = Ball()
    start_time: Any = Free(0.5, unit="s", min=0.0)
    final_time: Any = Free(1.0, unit="s", min=0.0)


class Fall(Flight):
    """Until the first contact."""

    start_time = 0.0


class Bounce(Optimization):
    """From 1 m at rest; restitution e; as high as possible."""

    fall = Fall()
    rise = Flight()
    e = Parameter(0.8, unit="1", description="restitution")

    def objective(self):
        return -final(self.rise.ball.h)

    def constraints(self):
        yield initial(self.fall.ball.h) == 1
        yield initial(self.fall.ball.v) == 0
        yield final(self.fall.ball.h) == 0
        yield link(self.fall, self.rise, jump=["ball.v"])
        yield initial(self.rise.ball.v) == -self.e * final(self.fall.ball.v)


def test_a_ball_bounces():
    optimum = optimize(Bounce, elements=3)
    fall = np.sqrt(2 / 9.81)
    assert optimum.objective == pytest.approx(-(0.8**2), abs=1e-8)  # e^2 h
    assert optimum["fall.final_time"] == pytest.approx(fall, abs=1e-7)
    assert optimum["rise.final_time"] == pytest.approx(1.8 * fall, abs=1e-5)  # the top is flat
    assert optimum["rise.ball.h"][0] == pytest.approx(0.0, abs=1e-8)


def test_the_restitution_that_reaches_a_height():
    class Matched(Bounce):
        e = Free(0.5, unit="1", min=0.0, max=1.0, description="restitution")

        def objective(self):
            return (final(self.rise.ball.h) - 0.25) ** 2

        def constraints(self):
            yield from super().constraints()
            yield final(self.rise.ball.v) == 0

    assert optimize(Matched, elements=3)["e"] == pytest.approx(0.5, abs=1e-4)


def test_a_jump_by_the_name_of_an_alias():
    class Named(Ball):
        up = Real(unit="m/s", description="another name of the speed")

        def equations(self):
            yield from super().equations()
            yield self.up == self.v

    class Renamed(Bounce):
        fall = Fall(ball=Named())
        rise = Flight(ball=Named())

        def constraints(self):
            yield initial(self.fall.ball.h) == 1
            yield initial(self.fall.ball.v) == 0
            yield final(self.fall.ball.h) == 0
            yield link(self.fall, self.rise, jump=["ball.up"])
            yield initial(self.rise.ball.up) == -self.e * final(self.fall.ball.up)

    assert optimize(Renamed, elements=3).objective == pytest.approx(-0.64, abs=1e-8)


class Effort(Optimization):
    """Least effort to go on, within a fixed time."""

    mass: Any = Mass()
    start_time: Any = 0.0
    final_time: Any = 1.0

    def integrand(self):
        return self.mass.u**2


class Later(Effort):
    """The same, one second later."""

    start_time = 1.0
    final_time = 2.0


def test_costs_and_limits_of_phases_and_of_the_whole_add_up():
    class Weighed(Later):
        bonus = Parameter(2.0, description="reward per speed")

        def objective(self):
            return -self.bonus * final(self.mass.v)

        def constraints(self):
            yield self.mass.u <= 0.6

    class Both(Optimization):
        first = Effort(mass=Mass(x=Fixed(0.0), v=Fixed(0.0)))
        second = Weighed()

        def objective(self):
            return -final(self.second.mass.v)

        def constraints(self):
            yield link(self.first, self.second)

    # u^2 - 3 u per second: 3/2 in the first, 0.6 in the second
    optimum = optimize(Both, elements=4)
    assert optimum.objective == pytest.approx(-2.25 + 0.36 - 1.8, abs=1e-6)
    np.testing.assert_allclose(optimum["first.mass.u"], 1.5, atol=1e-5)
    np.testing.assert_allclose(optimum["second.mass.u"], 0.6, atol=1e-5)


def test_one_motion_in_two_phases_is_the_same_motion():
    class Halves(Optimization):
        first = Effort(mass=Mass(x=Fixed(0.0), v=Fixed(0.0)))
        second = Later()

        def constraints(self):
            yield link(self.first, self.second)
            yield final(self.second.mass.x) == 1
            yield final(self.second.mass.v) == 0

    # u = 6 (1 - t) / 4 ... over 2 s: 12 / 2^3
    assert optimize(Halves, elements=4).objective == pytest.approx(12 / 8, abs=1e-6)
    assert optimize(Halves, elements=4, scheme="gauss").objective == pytest.approx(12 / 8, abs=1e-6)


def test_a_point_inside_of_a_phase():
    class Through(ThereAndBack):
        def constraints(self):
            yield from super().constraints()
            half = 0.5 * (self.back.start_time + self.back.final_time)
            yield at(half, self.back.mass.x) == 0.3

    optimum = optimize(Through, elements=10)
    half = 0.5 * (optimum["back.start_time"] + optimum["back.final_time"])
    assert float(optimum.signal("back.mass.x")(half)) == pytest.approx(0.3, abs=1e-8)
    assert optimum.final_time > 4.0


def test_controls_and_guesses_of_a_phase():
    guess = {"back.mass.x": lambda t: 1.0, "out.final_time": 3.0, "back.final_time": 8.0}
    controls = {"out.mass.u": dict(kind="constant", elements=5), "back.mass.u": dict(kind="linear")}
    optimum = optimize(ThereAndBack, elements=10, controls=controls, guess=guess)
    # two pieces are enough there; a continuous input cannot switch at once
    assert optimum["out.final_time"] == pytest.approx(2.0, abs=1e-6)
    assert 4.0 < optimum.final_time < 4.2
