"""Results keep their tolerance to the end, where the integrator starts anew at events, and at any number of points."""

import math

import pytest

from gantrytau import Discrete, Model, Real, der, reinit, simulate, when

KEPT = 3.0  # tolerances, of the size of the motion; 1 where it is smooth
TOLERANCE = 1e-8


class Decay(Model):
    x = Real(start=1.0, fixed=True)

    def equations(self):
        yield der(self.x) == -1.5 * self.x


class Thermostat(Model):
    x = Real(start=20.0, fixed=True, description="temperature, degC")
    on = Discrete(1)

    def equations(self):
        yield der(self.x) == -0.05 * (self.x - 10) + 0.9 * self.on
        yield when(self.x > 21.0, self.on == 0).elsewhen(self.x < 19.0, self.on == 1)


class Ball(Model):
    x = Real(start=1.37, fixed=True)
    v = Real(start=0.0, fixed=True)

    def equations(self):
        yield der(self.x) == self.v
        yield der(self.v) == -9.81
        yield when(self.x < 0, reinit(self.v, -0.8 * self.v))


def temperature(stop: float) -> float:
    t, now, goal = 0.0, 20.0, 21.0
    while True:
        limit = 28.0 if goal == 21.0 else 10.0
        wait = -20 * math.log((goal - limit) / (now - limit))
        if t + wait > stop:
            return limit + (now - limit) * math.exp(-(stop - t) / 20)
        t, now, goal = t + wait, goal, 40.0 - goal


def height(stop: float) -> float:
    t, x, v = 0.0, 1.37, 0.0
    while True:
        wait = (v + math.sqrt(v**2 + 2 * 9.81 * x)) / 9.81
        if t + wait > stop:
            return x + v * (stop - t) - 9.81 * (stop - t) ** 2 / 2
        t, x, v = t + wait, 0.0, -0.8 * (v - 9.81 * wait)


@pytest.mark.parametrize("points", [11, 501])
@pytest.mark.parametrize(
    ("model", "stop", "exact", "size"),
    [
        (Decay, 1.0, math.exp(-1.5), 1.0),
        (Thermostat, 200.0, temperature(200.0), 20.0),
        (Ball, 3.0, height(3.0), 1.37),
    ],
    ids=["decay", "22 switchings", "bounces"],
)
def test_the_tolerance_is_kept_to_the_end(model, stop, exact, size, points):
    found = simulate(model(), stop=stop, points=points, tolerance=TOLERANCE).final("x")
    assert abs(found - exact) < (KEPT if size > 1 else 1.0) * TOLERANCE * size
