"""Curves and surfaces through points by the slopes around each: parabolas are kept, monotone data stay monotone."""

from importlib import import_module
from typing import Any

import casadi as ca
import numpy as np
import pytest

from gantrytau.language.tables.hermite import SLOPES, curve, surface

interpolate: Any = import_module("scipy.interpolate")
x, y = ca.SX.sym("x"), ca.SX.sym("y")
ROUNDING = 1e-12  # of numbers below 100
RISES = np.array([0.0, 1.0, 1.5, 4.0, 5.0, 7.0]), np.array([10.0, 10.0, 10.5, 15.0, 50.0, 85.0])


def values(expression, *at):
    symbols = [x, y][: len(at)]
    return np.array(ca.Function("f", symbols, [expression]).map(at[0].size)(*(one[None, :] for one in at)))[0]


@pytest.mark.parametrize(
    ("kind", "wanted"), [("akima", "akima"), ("modified akima", "makima"), ("fritsch-butland", None)]
)
def test_curves_are_those_of_scipy(kind, wanted):
    at = np.linspace(0, 7, 57)
    if wanted is None:  # the ends differ there
        true, inside = interpolate.PchipInterpolator(*RISES)(at), (at >= 1) & (at <= 5)
    else:
        true, inside = interpolate.Akima1DInterpolator(*RISES, method=wanted)(at), at >= 0
    found = values(curve(x, *RISES, kind, "hold"), at)
    np.testing.assert_allclose(found[inside], true[inside], rtol=0, atol=ROUNDING * 100)


@pytest.mark.parametrize("kind", ["fritsch-butland", "steffen"])
def test_what_rises_stays_rising(kind):
    assert np.all(np.diff(values(curve(x, *RISES, kind, "hold"), np.linspace(0, 7, 701))) >= -ROUNDING)


@pytest.mark.parametrize("kind", SLOPES)
def test_lines_go_on_as_they_are_and_held_ends_are_held(kind):
    xs, at = np.array([0.0, 1.0, 3.0, 4.0]), np.array([-1.0, 2.0, 6.0])
    np.testing.assert_allclose(values(curve(x, xs, 2 * xs, kind, "linear"), at), 2 * at, atol=ROUNDING)
    np.testing.assert_allclose(values(curve(x, xs, 2 * xs, kind, "hold"), at), [0, 4, 8], atol=ROUNDING)


@pytest.mark.parametrize("size", [(2, 3), (3, 4), (5, 4)])
def test_a_surface_that_is_a_product_of_lines_is_kept_and_goes_on(size):
    u, v = (np.linspace(0, 2, n) ** 1.2 for n in size)
    at = np.array([-0.5, 0.3, 1.7, 3.0]), np.array([0.1, -1.0, 1.1, 2.9])
    found = values(surface((x, y), u, v, np.outer(1 + u, 2 - v), "linear"), *at)
    np.testing.assert_allclose(found, (1 + at[0]) * (2 - at[1]), atol=ROUNDING)


def test_a_surface_with_one_profile_is_its_curve():
    (u, z), v = RISES, np.array([0.0, 1.0, 3.0])
    at = np.linspace(1, 5, 23)  # further out the curve has other slopes at its ends
    found = values(surface((x, y), u, v, z[:, None] * [1, 1, 1], "hold"), at, np.full(23, 0.7))
    inside = (at >= 1.5) & (at <= 4.0)
    wanted = values(curve(x, u, z, "akima", "hold"), at)
    np.testing.assert_allclose(found[inside], wanted[inside], rtol=0, atol=ROUNDING * 100)


@pytest.mark.parametrize(("outside", "slope", "curvature"), [("linear", 2.0, 0.0), ("hold", 2.0, 2.0)])
def test_the_last_point_of_a_curve_that_goes_on_belongs_to_its_line(outside, slope, curvature):
    """Of the parabola x^2 from 0 to 1, which rises at 1 by 2."""
    parabola = curve(x, np.array([0.0, 0.5, 1.0]), np.array([0.0, 0.25, 1.0]), "akima", outside)
    at, once = np.array([1.0]), ca.jacobian(parabola, x)
    np.testing.assert_allclose(values(once, at), slope, atol=ROUNDING)
    np.testing.assert_allclose(values(ca.jacobian(once, x), at), curvature, atol=ROUNDING)
