"""Functions without closed form stay on the branch of the start, or are NaN: beyond folds, at crossings, at any scale."""

import math

import casadi as ca
import numpy as np
import pytest

from gantrytau import Input, Model, Parameter, Real, c_source, cos, exp, translate
from gantrytau_models import FourBar
from tests.answers.test_c_code import compiled_only, load

FOLD = 2 / math.sqrt(27)  # x^3 - x has slope zero at x = 1/sqrt(3)


class Cubic(Model):
    """x^3 - x = u, u and x in units of their own."""

    unit = Parameter(1.0, unit="1", description="unit of x")
    amount = Parameter(1.0, unit="1", description="unit of u")
    u = Input(start=0.0)
    x = Real(start=unit)

    def equations(self):
        x = self.x / self.unit
        yield self.amount * (x**3 - x) == self.u


class Coupled(Model):
    """Two unknowns of very different size: a^3 + b/10 = u, b^3 - a/10 = u for a = x / small, b = y / large."""

    small = Parameter(1e-9, unit="1")
    large = Parameter(1e9, unit="1")
    u = Input(start=1.0)
    x = Real(start=1e-9, nominal=1e-9)
    y = Real(start=1e9, nominal=1e9)

    def equations(self):
        a, b = self.x / self.small, self.y / self.large
        yield a**3 + 0.1 * b == self.u + 0.1
        yield b**3 - 0.1 * a == self.u - 0.1


@pytest.fixture(scope="module")
def cubic():
    return translate(Cubic()).function(["u"], ["x"])


@pytest.mark.parametrize("u", [-0.384, -0.38, -0.1, 0.3, 2.0, 1e3, 1e9])
def test_the_branch_of_the_start_is_the_largest_root(cubic, u):
    roots = np.roots([1.0, 0.0, -1.0, -u])
    largest = max(r.real for r in roots if abs(r.imag) < 1e-9 * abs(r))
    assert float(cubic(u)) == pytest.approx(largest, rel=1e-12)
    assert float(cubic.jacobian()(u, 0.0)) == pytest.approx(1 / (3 * largest**2 - 1), rel=1e-9)


@pytest.mark.parametrize("u", [-FOLD * (1 + 1e-6), -0.386, -0.5, -0.8, -3.0, -1e6])
def test_beyond_the_fold_there_is_no_number(cubic, u):
    assert math.isnan(float(cubic(u)))
    assert math.isnan(float(cubic.jacobian()(u, 0.0)))


@compiled_only
def test_c_code_knows_the_end_of_a_branch(cubic, tmp_path):
    (compiled,) = load(c_source(cubic, name="cubic"), tmp_path, "cubic")
    for u in (-0.8, -0.38, 0.3, 2.0):
        assert float(compiled(u)) == pytest.approx(float(cubic(u)), rel=1e-14, nan_ok=True)


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("amount", [1e-9, 1e9])
def test_a_branch_and_its_end_are_the_same_in_other_units(cubic, unit, amount):
    scaled = translate(Cubic(unit=unit, amount=amount)).function(["u"], ["x"])
    for u in (-0.8, -0.38, 0.3, 2.0):
        expected = float(cubic(u))
        assert float(scaled(u * amount)) / unit == pytest.approx(expected, rel=1e-9, nan_ok=True)


def test_unknowns_of_a_nanometre_and_a_gigametre_are_found_together():
    function = translate(Coupled()).function(["u"], ["x", "y"])
    for u in (0.3, 1.0, 5.0, 20.0):
        x, y = (float(v) for v in function(u))
        a, b = x * 1e9, y * 1e-9
        # the first follows from the second, as ten times the difference of b^3 and u, and is cubed
        assert abs(a**3 + 0.1 * b - u - 0.1) < 1e-15 * (10 * (b**3 + u)) ** 3
        assert abs(b**3 - 0.1 * a - u + 0.1) < 1e-13 * (1 + u)
        assert a > 0
        assert b > 0


def test_small_arguments_keep_their_digits():
    class Root(Model):
        u = Input(start=1.0)
        x = Real(start=1.0)

        def equations(self):
            yield self.x**3 == self.u

    root = translate(Root()).function(["u"], ["x"])
    for u in (1e-8, 1e-4, 8.0, 1e8):
        assert float(root(u)) == pytest.approx(u ** (1 / 3), rel=1e-12)


def test_a_linkage_ends_where_its_rods_are_stretched():
    # crank 0.3, coupler 0.2, rocker 0.25, ground 0.6: the crank reaches as far as coupler and rocker allow
    linkage = translate(FourBar(0.6, 0.3, 0.2, 0.25))
    function = linkage.function(["crank.phi"], ["rocker.phi"])
    limit = math.acos((0.6**2 + 0.3**2 - 0.45**2) / (2 * 0.6 * 0.3))
    start = linkage.start["crank.phi"]
    assert abs(start) < limit
    for share in (0.5, 0.9, 0.99, 0.9999):
        assert np.isfinite(float(function(share * limit)))
    for share in (1.0001, 1.01, 1.2, 2.0):
        assert math.isnan(float(function(share * limit)))


def test_behind_the_pose_where_a_parallelogram_is_flat_nothing_is_known():
    function = translate(FourBar(1.0, 0.3, 1.0, 0.3)).function(["crank.phi"], ["rocker.phi"])
    assert float(function(2.0)) == pytest.approx(2.0, abs=1e-9)
    assert math.isnan(float(function(4.0)))


def test_another_root_just_behind_a_fold_is_not_taken():
    class Wave(Model):
        """x + exp(cos x) rises to 2.912 at x = 0.40, falls, and rises again from 2.571 on."""

        u = Input(start=0.0)
        x = Real(start=-1.3)

        def equations(self):
            yield self.x + exp(cos(self.x)) == self.u

    function = translate(Wave()).function(["u"], ["x"])
    for u in np.linspace(2.92, 3.5, 30):
        assert math.isnan(float(function(u)))
    assert float(function(2.91)) < 0.4


def test_curves_meet_where_their_common_curvature_vanishes_along_a_line():
    class Hyperbolas(Model):
        """x^2 - y^2 = 1, and a line that comes to lie along an asymptote at k = 1."""

        k = Input(start=0.3)
        x = Real(start=1.2)
        y = Real(start=-0.7)

        def equations(self):
            yield self.x**2 - self.y**2 == 1
            yield self.x**2 - self.y**2 + self.x - self.k * self.y == 2.5

    function = translate(Hyperbolas()).function(["k"], ["x", "y"])
    for k in (0.3, 0.9, 1.0, 1.2, 2.0):
        # (k^2 - 1) y^2 + 3 k y + 1.25 = 0 with the root that stays finite
        y = -2.5 / (3 * k + math.sqrt(9 * k**2 - 5 * (k**2 - 1)))
        np.testing.assert_allclose(np.ravel(function(k)), [1.5 + k * y, y], rtol=1e-12)


def test_a_sweep_in_one_call_is_the_same_as_pose_by_pose():
    function = translate(FourBar()).function(["crank.phi"], ["rocker.phi"])
    angles = np.linspace(-3, 6, 25)
    many = np.ravel(function.map(angles.size)(ca.DM(angles).T))
    np.testing.assert_array_equal(many, [float(function(a)) for a in angles])
