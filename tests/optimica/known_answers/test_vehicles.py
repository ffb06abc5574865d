"""Vehicles: shortest turns, currents, bicycles on tyres."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gantrytau import Input, Model, Parameter, Real, atan, cos, der, sin, tanh
from gantrytau_optimica import Free, Optimization, final, initial, optimize
from tests.optimica.known_answers.known_problems import motion, zero, zeros


class Car(Model):
    """A car of Dubins (1957): speed 1, turning radius 1."""

    x = Real(start=0.0, fixed=True)
    y = Real(start=0.0, fixed=True)
    heading = Real(start=0.0, fixed=True)
    turn = Input(min=-1.0, max=1.0)

    def equations(self):
        yield der(self.x) == cos(self.heading)
        yield der(self.y) == sin(self.heading)
        yield der(self.heading) == self.turn


class Parking(Optimization):
    """The shortest way to (4, 0) with the car turned by a quarter to the left."""

    car = Car()
    final_time = Free(4.0, min=0.5, max=30.0)

    def objective(self):
        return self.final_time

    def constraints(self):
        yield final(self.car.x) == 4
        yield final(self.car.y) == 0
        yield final(self.car.heading) == np.pi / 2


def dubins(turns: str) -> float:
    """Length of arc, line and arc to (4, 0, quarter turn): tangents of circles of radius 1."""
    first = np.array([0.0, 1.0 if turns[0] == "L" else -1.0])
    last = np.array([4.0, 0.0]) + (np.array([-1.0, 0.0]) if turns[1] == "L" else np.array([1.0, 0.0]))
    sign = [1.0 if t == "L" else -1.0 for t in turns]

    def end(p):
        # headings of the line and its length from the ends of the arcs
        heading, length = p
        direction = np.array([np.cos(heading), np.sin(heading)])
        right = np.array([np.sin(heading), -np.cos(heading)])
        return first + sign[0] * right + length * direction - (last + sign[1] * right)

    heading, length = zeros(end, [0.0 if turns[0] == "R" else 0.1, 3.0])
    around = [(sign[0] * heading) % (2 * np.pi), (sign[1] * (np.pi / 2 - heading)) % (2 * np.pi)]
    return float(length + sum(around))


def test_the_shortest_way_of_a_car():
    shortest = min(dubins("RL"), dubins("LL"))
    # right, straight, left; two switches inside of elements of 0.09
    assert optimize(Parking, elements=100).final_time == pytest.approx(shortest, abs=1e-3)


class Boat(Model):
    """A boat of speed 1 in a current along x that grows with y (Zermelo, 1931)."""

    x = Real(start=3.66, fixed=True)
    y = Real(start=-1.86, fixed=True)
    heading = Input(start=2.0, min=-7.0, max=7.0)

    def equations(self):
        yield der(self.x) == cos(self.heading) - self.y
        yield der(self.y) == sin(self.heading)


class Crossing(Optimization):
    """To the origin in least time; Bryson and Ho (1975), section 2.7: 5.46."""

    boat = Boat()
    final_time = Free(5.0, min=0.5, max=30.0)

    def objective(self):
        return self.final_time

    def constraints(self):
        yield final(self.boat.x) == 0
        yield final(self.boat.y) == 0


def test_zermelo():
    # the heading obeys heading' = cos(heading)^2 for the current -y; two unknowns, two conditions at the end
    def end(p):
        return motion(
            lambda t, z: [np.cos(z[2]) - z[1], np.sin(z[2]), np.cos(z[2]) ** 2], [3.66, -1.86, p[0]], p[1]
        )[1][:2]

    _, duration = zeros(end, [np.radians(105.0), 5.46])
    optimum = optimize(Crossing, guess={"boat.heading": lambda t: 1.8 + 0.4 * t})
    assert optimum.final_time == pytest.approx(duration, abs=1e-6)
    assert duration == pytest.approx(5.46, abs=0.005)


class Bicycle(Model):
    """A bicycle model: steered front wheel, tyre forces along y of the car, constant speed."""

    speed = Parameter(20.0, unit="m/s", description="speed along the car")
    m = Parameter(1500.0, unit="kg", description="mass")
    J = Parameter(2500.0, unit="kg.m2", description="inertia about the vertical")
    a = Parameter(1.2, unit="m", description="front axle from the centre of mass")
    b = Parameter(1.5, unit="m", description="rear axle from the centre of mass")
    c_f = Parameter(8e4, unit="N/rad", description="cornering stiffness in front")
    c_r = Parameter(9e4, unit="N/rad", description="cornering stiffness behind")
    grip = Parameter(6e3, unit="N", description="largest force of an axle")
    x = Real(unit="m", start=0.0, fixed=True)
    y = Real(unit="m", start=0.0, fixed=True)
    psi = Real(unit="rad", start=0.0, fixed=True)
    v = Real(unit="m/s", start=0.0, fixed=True, description="sideways speed")
    w = Real(unit="rad/s", start=0.0, fixed=True, description="yaw rate")
    slip_f = Real(unit="rad", description="slip angle in front")
    slip_r = Real(unit="rad", description="slip angle behind")
    f_f = Real(unit="N", description="sideways force in front")
    f_r = Real(unit="N", description="sideways force behind")
    steer = Input(unit="rad", min=-0.3, max=0.3, description="steering angle")

    def equations(self):
        yield der(self.x) == self.speed * cos(self.psi) - self.v * sin(self.psi)
        yield der(self.y) == self.speed * sin(self.psi) + self.v * cos(self.psi)
        yield der(self.psi) == self.w
        yield self.slip_f == self.steer - atan((self.v + self.a * self.w) / self.speed)
        yield self.slip_r == -atan((self.v - self.b * self.w) / self.speed)
        yield from self.tyres()
        yield self.m * (der(self.v) + self.speed * self.w) == self.f_f * cos(self.steer) + self.f_r
        yield self.J * der(self.w) == self.a * self.f_f * cos(self.steer) - self.b * self.f_r

    def tyres(self):
        yield self.f_f == self.c_f * self.slip_f
        yield self.f_r == self.c_r * self.slip_r


class Saturated(Bicycle):
    """The same with forces that saturate."""

    def tyres(self):
        yield self.f_f == self.grip * tanh(self.c_f * self.slip_f / self.grip)
        yield self.f_r == self.grip * tanh(self.c_r * self.slip_r / self.grip)


class Pacejka(Bicycle):
    """The same by the magic formula with B = 10, C = 1.3, D = 6000 N."""

    B = Parameter(10.0, unit="1/rad", description="stiffness factor")
    C = Parameter(1.3, unit="1", description="shape factor")

    def tyres(self):
        yield self.f_f == self.grip * sin(self.C * atan(self.B * self.slip_f))
        yield self.f_r == self.grip * sin(self.C * atan(self.B * self.slip_r))


class LaneChange(Optimization):
    """3.5 m to the left, straight again at the end, in least time."""

    car: Bicycle = Bicycle()
    final_time = Free(2.0, unit="s", min=0.2, max=10.0)

    def objective(self):
        return self.final_time

    def constraints(self):
        c = self.car
        yield final(c.y) == 3.5
        for q in (c.psi, c.v, c.w):
            yield final(q) == 0


@pytest.mark.parametrize("model", [Bicycle, Saturated, Pacejka])
def test_a_lane_change_replays(model):
    """The steering of the optimum, in equations written down anew, takes the car to its lane."""
    optimum = optimize(LaneChange(car=model()), elements=40)
    steer = optimum.signal("car.steer")

    def tyre(slip, stiffness):
        if model is Bicycle:
            return stiffness * slip
        if model is Saturated:
            return 6e3 * np.tanh(stiffness * slip / 6e3)
        return 6e3 * np.sin(1.3 * np.arctan(10 * slip))

    def rates(t, z):
        _, _, psi, v, w = z
        d = float(steer(min(t, optimum.final_time)))
        front = tyre(d - np.arctan((v + 1.2 * w) / 20), 8e4) * np.cos(d)
        rear = tyre(-np.arctan((v - 1.5 * w) / 20), 9e4)
        return [
            20 * np.cos(psi) - v * np.sin(psi),
            20 * np.sin(psi) + v * np.cos(psi),
            w,
            (front + rear) / 1500 - 20 * w,
            (1.2 * front - 1.5 * rear) / 2500,
        ]

    z = np.zeros(5)
    edges = [0.0, *optimum.breaks, optimum.final_time]
    for begin, end in pairwise(edges):
        inside = (begin + 1e-12, end - 1e-12)
        z = solve_ivp(rates, inside, z, rtol=1e-8, atol=1e-10).y[:, -1]
    # the steering jumps inside of elements; polynomials of degree three over 0.03 s miss by some cm and 0.01 rad
    np.testing.assert_allclose(z[1:3], [3.5, 0.0], atol=0.05)


def test_softer_tyres_are_slower():
    linear, saturated = (
        optimize(LaneChange(car=model()), elements=40).final_time for model in (Bicycle, Saturated)
    )
    assert 0.5 < linear < saturated < 3.0
    # sideways alone, with both axles at their largest force, would take 2 sqrt(3.5 m / F)
    assert saturated > 2 * np.sqrt(3.5 * 1500 / 12e3)


def test_a_car_on_a_circle_of_least_effort():
    """Linear tyres in a steady curve: steering by geometry and the slip difference."""

    class Steady(Optimization):
        car = Bicycle(
            v=dict(fixed=False), w=dict(fixed=False), psi=dict(fixed=False), steer=dict(min=-0.5, max=0.5)
        )
        final_time = 1.0
        radius = Parameter(100.0, unit="m", description="radius of the curve")

        def integrand(self):
            return (self.car.w * self.radius - self.car.speed) ** 2 / self.car.speed**2

        def constraints(self):
            yield initial(self.car.v) == final(self.car.v)
            yield initial(self.car.w) == final(self.car.w)

    optimum = optimize(Steady, elements=10)
    assert optimum.objective == pytest.approx(0.0, abs=1e-8)
    # steady forces: f_f cos(steer) = m b / L v^2 / R, f_r = m a / L v^2 / R
    lateral = 1500 * 20 * 0.2
    rear = lateral * 1.2 / 2.7 / 9e4
    sideways = 1.5 * 0.2 - 20 * np.tan(rear)
    steer = zero(
        lambda d: 8e4 * (d - np.arctan((sideways + 1.2 * 0.2) / 20)) * np.cos(d) - lateral * 1.5 / 2.7,
        0.0,
        0.3,
    )
    middle = float(optimum.signal("car.steer")(0.5))
    assert middle == pytest.approx(steer, abs=1e-2)  # a flat minimum
