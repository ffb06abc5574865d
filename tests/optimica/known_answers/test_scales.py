"""Problems with known answers in micrometres and megametres, microseconds and megaseconds, picograms and earth masses.

Numbers of every dimension are multiplied as units would be; what is left without a dimension must be the same.
"""

from collections.abc import Callable

import numpy as np
import pytest

from gantrytau import Fixed, Input, Model, Parameter, Real, Start, between, cos, der, sin
from gantrytau_optimica import (
    Free,
    Optimization,
    Samples,
    final,
    initial,
    link,
    optimize,
    sensitivities,
    sum_of_squares,
)
from tests.families import first_of
from tests.optimica.known_answers.known_problems import zero
from tests.optimica.problems import Mass

SCALES = [(1e-6, 1e6), (1e6, 1e-6), (1.0, 1.0), (1e-6, 1.0), (1e6, 1.0), (1e-6, 1e-6), (1e6, 1e6)]  # m, s


def fastest(length: float, time: float, guess: float = 5.0) -> list[float]:
    """Rest to rest, |u| <= 1, over 1: 2, and its slopes by the limit, -1, and by the way, 1."""

    class Fastest(Optimization):
        m = Mass()
        lim, d = Parameter(length / time**2), Parameter(length)
        final_time = Free(guess * time, min=min(1e-3, 0.1 * guess) * time, max=max(1e3, 10 * guess) * time)

        def objective(self):
            return self.final_time

        def constraints(self):
            yield between(-self.lim, self.m.u, self.lim)
            yield initial(self.m.x) == 0
            yield initial(self.m.v) == 0
            yield final(self.m.x) == self.d
            yield final(self.m.v) == 0

    optimum = optimize(Fastest)
    slopes = sensitivities(optimum, ["lim", "d"]).objective
    return [optimum.final_time / time / 2, -slopes["lim"] * length / time**3, slopes["d"] * length / time]


def least_squares(length: float, time: float) -> list[float]:
    """A regulator over 3 with weights 1, by Riccati's equation: 1.694412253; limits a million times away."""

    class LeastSquares(Optimization):
        m = Mass(
            x=Fixed(length), v=Fixed(0.0), u=dict(min=-1e6 * length / time**2, max=1e6 * length / time**2)
        )
        final_time = 3.0 * time

        def integrand(self):
            m = self.m
            return (m.x / length) ** 2 + (m.v * time / length) ** 2 + (m.u * time**2 / length) ** 2

    return [optimize(LeastSquares).objective / time / 1.694412253]


def unlimited(length: float, time: float) -> list[float]:
    """The same in SI numbers, where the cost is as small or as large as the numbers in it, up to 1e-24."""

    class Unlimited(Optimization):
        m = Mass(x=Fixed(length), v=Fixed(0.0))
        final_time = 3.0 * time

        def integrand(self):
            return self.m.x**2 + (self.m.v * time) ** 2 + (self.m.u * time**2) ** 2

    return [optimize(Unlimited).objective / time / length**2 / 1.694412253]


def bounce(length: float, time: float) -> list[float]:
    """Bryson and Denham (1963) with the limit 1/9: 4, and its slope by the limit, -36."""

    class Bounce(Optimization):
        limit = Parameter(length / 9)
        m = Mass(x=Fixed(0.0), v=Fixed(length / time))
        final_time = time

        def integrand(self):
            return self.m.u**2 / 2

        def constraints(self):
            yield self.m.x <= self.limit
            yield final(self.m.x) == 0
            yield final(self.m.v) == -length / time

    optimum = optimize(Bounce, elements=30)
    cost = length**2 / time**3
    return [optimum.objective / cost / 4]


class Bead(Model):
    """A bead on a wire."""

    g = Parameter(9.81)
    x, y, v = (Real(start=0.0, fixed=True) for _ in range(3))
    slope = Input(start=0.6, min=-np.pi / 2, max=np.pi / 2)

    def equations(self):
        yield der(self.x) == self.v * cos(self.slope)
        yield der(self.y) == self.v * sin(self.slope)
        yield der(self.v) == self.g * sin(self.slope)


def brachistochrone(length: float, time: float) -> list[float]:
    """To a point 2 across and 1 down with g = 9.81: 0.805187."""

    class Brachistochrone(Optimization):
        bead = Bead(g=9.81 * length / time**2)
        final_time = Free(time, min=0.1 * time, max=10.0 * time)

        def objective(self):
            return self.final_time

        def constraints(self):
            yield final(self.bead.x) == 2 * length
            yield final(self.bead.y) == length

    turn = zero(lambda a: (a - np.sin(a)) - 2 * (1 - np.cos(a)), 1.0, 6.0)
    duration = turn * np.sqrt(1 / (1 - np.cos(turn)) / 9.81)
    return [optimize(Brachistochrone).final_time / time / duration]


def launched(length: float, time: float) -> list[float]:
    """A mass without force is to be at 3 after 2: its speed is 1.5."""

    class Launched(Optimization):
        m = Mass(x=Fixed(0.0), v=Start(Free(length / time)), u=0.0)
        final_time = 2.0 * time

        def objective(self):
            return (final(self.m.x) - 3 * length) ** 2

    return [optimize(Launched)["m.v"][0] * time / length / 1.5]


def tracked(length: float, time: float) -> list[float]:
    """From rest at 0 towards 1 in 1 with the weight 1e-2 of the effort; nothing but the aim tells the size."""

    class Tracked(Optimization):
        m = Mass(x=Fixed(0.0), v=Fixed(0.0))
        final_time = time

        def objective(self):
            return (final(self.m.x) / length - 1) ** 2

        def integrand(self):
            return 1e-2 / time * (self.m.u * time**2 / length) ** 2

    # u = c (1 - t): x = c / 3, effort c^2 / 3; (c/3 - 1)^2 + 1e-2 c^2 / 3 is least at c = (1/3) / (1/9 + 1e-2/3)
    c = (1 / 3) / (1 / 9 + 1e-2 / 3)
    return [optimize(Tracked, elements=10).objective / ((c / 3 - 1) ** 2 + 1e-2 * c**2 / 3)]


def sampled(length: float, time: float) -> list[float]:
    """The rate of a decay from samples: 0.7."""
    times = np.linspace(0.0, 3.0, 13) * time

    class Sampled(Optimization):
        x = Real(start=length, fixed=True)
        rate = Free(0.2 / time, min=0.0)
        final_time = 3.0 * time

        def equations(self):
            yield der(self.x) == -self.rate * self.x

        def objective(self):
            return sum_of_squares(self.x, Samples(times, length * np.exp(-0.7 / time * times)))

    return [optimize(Sampled, elements=24).free["rate"] * time / 0.7]


def there_and_back(length: float, time: float) -> list[float]:
    """From rest at 0 to rest at 1 and back, |u| <= 1, in two phases: 4."""

    class Leg(Optimization):
        m = Mass()

        def constraints(self):
            yield between(-length / time**2, self.m.u, length / time**2)

    class Out(Leg):
        final_time = Free(3 * time, min=0.1 * time, max=10 * time)

    class Back(Leg):
        start_time = Free(3 * time, min=0.1 * time, max=10 * time)
        final_time = Free(6 * time, min=0.2 * time, max=20 * time)

    class ThereAndBack(Optimization):
        out, back = Out(), Back()

        def objective(self):
            return self.back.final_time

        def constraints(self):
            yield link(self.out, self.back)
            yield initial(self.out.m.x) == 0
            yield initial(self.out.m.v) == 0
            yield final(self.out.m.x) == length
            yield final(self.out.m.v) == 0
            yield final(self.back.m.x) == 0
            yield final(self.back.m.v) == 0

    return [optimize(ThereAndBack, elements=20).final_time / time / 4]


def around(length: float, time: float) -> list[float]:
    """In a plane around a disc of radius 1/4, of which only a circle's equation tells: effort of both routes."""

    class Around(Optimization):
        a, b = Mass(x=Fixed(0.0), v=Fixed(0.0)), Mass(x=Fixed(0.0), v=Fixed(0.0))
        final_time = time

        def integrand(self):
            return self.a.u**2 + self.b.u**2

        def constraints(self):
            yield final(self.a.x) == length
            yield final(self.a.v) == 0
            yield final(self.b.x) == 0
            yield final(self.b.v) == 0
            yield (self.a.x - 0.5 * length) ** 2 + (self.b.x - 0.1 * length) ** 2 >= (0.25 * length) ** 2

    # the digits are those of this mesh
    return [optimize(Around, elements=20).objective * time**3 / length**2 / 16.31999993]


def weighed(mass: float, time: float) -> list[float]:
    """A mass from rest to rest over 1 in 1 with least effort, by a force: 12 F^2."""

    class Weighed(Optimization):
        x, v, f = Real(start=0.0, fixed=True), Real(start=0.0, fixed=True), Input()
        final_time = time

        def equations(self):
            yield der(self.x) == self.v
            yield mass * der(self.v) == self.f

        def integrand(self):
            return self.f**2

        def constraints(self):
            yield final(self.x) == 1
            yield final(self.v) == 0

    return [optimize(Weighed, elements=10).objective / mass**2 * time**3 / 12]


PROBLEMS = [
    fastest, least_squares, unlimited, bounce, brachistochrone, launched, tracked, sampled, there_and_back, around,
]  # fmt: skip


@pytest.mark.parametrize(("length", "time"), first_of(SCALES, 2))
@pytest.mark.parametrize("problem", PROBLEMS)
def test_units_do_not_change_the_answer(problem: Callable, length: float, time: float):
    # g of 1e18 is refused by the model itself, whose sums must not vanish beside it
    found = problem(length, 1.0 if problem is brachistochrone else time)
    assert found == pytest.approx([1.0] * len(found), abs=1e-6)


@pytest.mark.parametrize("guess", [1e-3, 1e3, 1e6])
def test_a_guess_of_the_time_that_tells_nothing_of_its_size(guess: float):
    assert fastest(1e-6, 1e-6, guess) == pytest.approx([1.0, 1.0, 1.0], abs=1e-6)


@pytest.mark.parametrize("mass", [1e-12, 1.0, 6e24])
def test_masses_of_every_size_are_moved_with_least_effort(mass: float):
    assert weighed(mass, 2.0) == pytest.approx([1.0], abs=1e-7)


@pytest.mark.parametrize("weight", [1e-20, 1e-12, 1e12, 1e20])
def test_a_cost_of_any_size_has_its_optimum(weight: float):
    class Weighted(Optimization):
        m = Mass(x=Fixed(1.0), v=Fixed(0.0))
        final_time = 3.0

        def integrand(self):
            return weight * (self.m.x**2 + self.m.v**2 + self.m.u**2)

    optimum = optimize(Weighted)
    assert optimum.objective == pytest.approx(1.694412253 * weight, rel=1e-8)
