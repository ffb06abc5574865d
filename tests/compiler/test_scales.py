"""Sound models of any size are translated and solved; what rounding alone determines is refused."""

import math

import numpy as np
import pytest

from gantrytau import (
    Fixed,
    Input,
    Model,
    Parameter,
    Real,
    Start,
    StructureError,
    connect,
    cos,
    der,
    exp,
    simulate,
    sin,
    translate,
)
from gantrytau.mechanics import rotational, translational
from gantrytau.mechanics.gears import IdealGear
from gantrytau_models import FourBar, Pendulum


class Square(Model):
    x = Real(start=1.0, fixed=True)
    y = Real()

    def equations(self):
        yield der(self.x) == -self.x
        yield self.y == self.x * self.x


class Cube(Model):
    x = Input(start=1.0)
    y = Real(start=1.0)

    def equations(self):
        yield self.y**3 == self.x


class Mass(Model):
    m = Parameter(1.0)
    f = Input(start=1.0)
    x = Real(start=0.0, fixed=True)
    v = Real(start=0.0, fixed=True)

    def equations(self):
        yield der(self.x) == self.v
        yield self.m * der(self.v) == self.f


class Pair(Model):
    """Two balances whose sizes are given."""

    row = Parameter(1.0, evaluate=True)
    column = Parameter(1.0, evaluate=True)
    u = Input(start=0.0)
    x = Real()
    y = Real()

    def equations(self):
        yield self.row * (2 * self.x + self.column * self.y) == self.row * self.u
        yield self.x - 3 * self.column * self.y == 1


class Turned(Model):
    """A coefficient that is the cosine of a quarter of a turn."""

    angle = Input(start=math.pi / 2)
    x = Real()
    y = Real()

    def equations(self):
        yield cos(self.angle) * self.x + sin(self.angle) * self.y == 1
        yield self.y == 1


@pytest.mark.parametrize("size", [1.0, 1e7, 1e15, 1e40])
def test_a_coefficient_is_not_small_because_another_is_large(size):
    final = simulate(Square(x=Fixed(size)), stop=1.0, points=2)
    assert final.final("y") == pytest.approx((size * math.exp(-1)) ** 2, rel=2e-6)


@pytest.mark.parametrize("m", [1e-30, 1e-12, 6e24])
def test_bodies_of_any_mass(m):
    assert simulate(Mass(m=m, f=Start(m)), stop=1.0, points=2).final("x") == pytest.approx(0.5, rel=1e-6)


@pytest.mark.parametrize("size", [1e-30, 1e-24, 1e-15, 1e-8, 1.0, 1e12])
def test_small_cubes_are_solved_by_their_own_terms(size):
    root = np.cbrt(1.5 * size)
    dae = translate(Cube(x=Start(size), y=Start(float(np.cbrt(size)))))
    assert dae.evaluate({"x": 1.5 * size})["y"] == pytest.approx(root, rel=1e-12, abs=0.0)


@pytest.mark.parametrize("row", [1e-20, 1e-8, 1.0, 1e20])
@pytest.mark.parametrize("column", [1e-20, 1.0, 1e20])
def test_rows_and_columns_of_linear_blocks_have_any_size(row, column):
    dae = translate(Pair(row=row, column=column))
    for x, y in (
        tuple(float(v) for v in dae.function(["u"], ["x", "y"])(2.0)),
        tuple(dae.evaluate({"u": 2.0})[n] for n in ("x", "y")),
    ):
        assert (x, y * column) == pytest.approx((1.0, 0.0), abs=1e-14)


def test_what_rounding_alone_determines_is_refused():
    with pytest.raises(StructureError, match="x is not determined at the start"):
        translate(Turned())


class Large(Model):
    """An unknown of a million, that starts at zero."""

    u = Input(start=1.0)
    x = Real(start=0.0, nominal=1e6)

    def equations(self):
        yield self.x / 1e6 + exp(self.x / 1e6) == self.u


def test_the_start_walks_as_far_as_it_has_to():
    x = translate(Large()).evaluate({"u": 1 + math.e})["x"]
    assert x == pytest.approx(1e6, rel=1e-12)


@pytest.mark.parametrize("size", [1e-9, 1e-6, 1.0, 1e10])
def test_a_linkage_of_any_size_closes_with_the_same_constraints(size):
    dae = translate(FourBar(*(size * np.array([1.0, 0.3, 0.9, 0.6]))))
    assert len(dae.redundant) == 3
    at = dae.evaluate({"crank.phi": 1.1, "crank.w": 1.3, "torque": 0.0})
    assert at["rocker.phi"] == pytest.approx(1.6164784046894802, rel=1e-12)  # of the same linkage in metres
    if size <= 1e-6:  # weight alone accelerates it
        assert at["der(rocker.w)"] * size == pytest.approx(-4.0330388, rel=1e-6)


@pytest.mark.parametrize("size", [1e-9, 1e-6, 1e-3, 1.0, 1e6])
def test_a_pendulum_of_any_size_swings_alike_on_a_rod_that_does_not_yield(size):
    at = dict(x=Start(0.8 * size), y=Start(-0.6 * size), v_x=Start(0.0), v_y=Start(0.0))
    swing = simulate(Pendulum(L=size, **at), stop=2 * math.sqrt(size), points=30)
    assert np.abs(np.hypot(swing["x"], swing["y"]) / size - 1).max() < 1e-11
    assert swing.final("x") / size == pytest.approx(
        0.76539, abs=5e-3
    )  # in metres; small ones at the default tolerance


@pytest.mark.parametrize("size", [1e-8, 1e-6, 1.0])
def test_a_loop_of_any_size_is_not_closed_beside_its_plane(size):
    dae = translate(FourBar(*(size * np.array([1.0, 0.3, 0.9, 0.6]))))
    function = dae.function(["crank.phi", "base.r"], ["rocker.phi"])
    assert np.isfinite(float(function(1.3, [size, 0.0, 0.0])))
    assert np.isnan(float(function(1.3, [size, 0.0, 1e-4 * size])))


def test_a_small_acceleration_at_the_start_is_right_beside_large_ones():
    x = 1e-13  # beside a weight of 9.81 N: y'' = x x'' of a rod of 1 m that hangs
    start = translate(Pendulum(x=Start(x), y=Start(-1.0))).start
    assert start["der(der(y))"] == pytest.approx(-9.81 * x**2, rel=1e-9, abs=0.0)


class OnSpring(Model):
    """A mass on a spring, m s'' = -c s."""

    wall, mass, spring = translational.Fixed(), translational.Mass(), translational.Spring()

    def equations(self):
        yield connect(self.wall.flange, self.spring.flange_a)
        yield connect(self.spring.flange_b, self.mass.flange)


@pytest.mark.parametrize(
    ("m", "c", "s"), [(1e-24, 1e-6, 1e-10), (1e-18, 1e-6, 1e-9), (6e24, 1e6, 1e8), (6e24, 1.0, 1e-9)]
)
def test_masses_and_springs_of_any_size(m, c, s):
    dae = translate(OnSpring(mass=dict(m=m, s=Start(s)), spring=dict(c=c)))
    assert dae.evaluate({})["der(mass.v)"] == pytest.approx(-c * s / m, rel=1e-12)
    sixth = 2 * math.pi * math.sqrt(m / c) / 6
    found = simulate(dae, stop=sixth, points=3, tolerance=1e-10).final("mass.s")
    assert found == pytest.approx(s / 2, rel=1e-6)


class Multiples(Model):
    """y = k x by a quotient, z = 2 x by a sum whose other term is as large."""

    k = Parameter(1.0)
    x, y, z = Real(start=2.0, fixed=True), Real(), Real()

    def equations(self):
        yield der(self.x) == -self.x
        yield self.y / self.k == self.x
        yield self.z * self.k + self.y == 3 * self.x * self.k


@pytest.mark.parametrize("k", [1e-30, 1e-24, 1e24, 1e30])
def test_factors_of_any_size(k):
    at = translate(Multiples(k=k)).evaluate({"x": 0.5})
    assert at["y"] / k == pytest.approx(0.5, rel=1e-12)
    assert at["z"] == pytest.approx(1.0, rel=1e-12)


class Train(Model):
    """Three wheels behind two gears, driven by 1 N m."""

    ratio = Parameter(1.0, unit="1")
    drive = rotational.Torque(tau=1.0)
    a, b, c = rotational.Inertia(J=1.0), rotational.Inertia(J=1.0), rotational.Inertia(J=2.0)
    near, far = IdealGear(ratio=ratio), IdealGear(ratio=ratio)

    def equations(self):
        yield connect(self.drive.flange, self.a.flange_a)
        yield connect(self.a.flange_b, self.near.flange_a)
        yield connect(self.near.flange_b, self.b.flange_a)
        yield connect(self.b.flange_b, self.far.flange_a)
        yield connect(self.far.flange_b, self.c.flange_a)


@pytest.mark.parametrize("ratio", [1e-9, 1e9])
def test_gear_trains_of_any_ratio_at_any_tolerance(ratio):
    inertia = 1 + 1 / ratio**2 + 2 / ratio**4
    result = simulate(Train(ratio=ratio), stop=1.0, points=3, tolerance=1e-15)
    assert result.final("a.w") == pytest.approx(1 / inertia, rel=1e-12)
