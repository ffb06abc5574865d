"""Tables give the numbers, slopes and motions of the functions that they are, in every use of a model."""

from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy import interpolate
from scipy.interpolate import CubicSpline

from gantrytau import (
    InitializationError,
    Input,
    Model,
    ModelError,
    Output,
    Parameter,
    Real,
    SolveError,
    c_source,
    der,
    linearize,
    simulate,
    table,
    time,
    translate,
)  # fmt: skip
from gantrytau.language.piecewise import switched

x, y = ca.SX.sym("x"), ca.SX.sym("y")
ROUNDING = 1e-13  # of the largest number: a few hundred times the rounding of one operation


def points(count, scale=1.0, offset=0.0):
    rng = np.random.default_rng(count)
    return offset + scale * np.cumsum(rng.uniform(0.2, 1.0, count)), rng.normal(size=count)


def course(expression, at):
    """Values, first and second derivatives of an expression of x."""
    slope = ca.jacobian(expression, x)
    function = ca.Function("course", [x], [expression, slope, ca.jacobian(slope, x)], {"cse": True})
    return [np.array(found).ravel() for found in function(np.atleast_2d(at))]


@pytest.mark.parametrize(("scale", "offset"), [(1.0, 0.0), (1e-9, 0.0), (1e9, 0.0), (1.0, 1e6)])
@pytest.mark.parametrize("count", [2, 3, 4, 5, 11, 100])
def test_lines_and_splines_are_those_of_numpy_and_scipy_at_any_scale(count, scale, offset):
    xs, ys = points(count, scale, offset)
    at = np.unique(np.concatenate([np.linspace(xs[0], xs[-1], 3 * count + 2), xs]))
    (values, *_) = course(table(x, xs, ys), at)
    assert np.allclose(values, np.interp(at, xs, ys), atol=ROUNDING * np.max(np.abs(ys)))
    spline = CubicSpline(xs, ys)
    for order, found in enumerate(course(table(x, xs, ys, kind="spline"), at)):
        true = spline(at, order)
        assert np.allclose(found, true, rtol=0, atol=1e2 * ROUNDING * np.max(np.abs(true)))


@pytest.mark.parametrize("kind", ["linear", "spline"])
def test_numbers_of_any_offset_stay_exact(kind):
    xs, ys = points(20)
    (values, *_) = course(table(x, xs, 1e6 + ys, kind=kind), xs)
    assert np.max(np.abs(values - 1e6 - ys)) < 1e-8  # rounding of 1e6, times the weights of the points around


@pytest.mark.parametrize("kind", ["linear", "spline"])
def test_what_lies_outside_holds_goes_on_or_is_not_defined(kind):
    xs, ys = points(6)
    below, above = xs[0] - 0.7, xs[-1] + 0.7
    ends = xs[[0, -1]]
    slopes = CubicSpline(xs, ys)(ends, 1) if kind == "spline" else (np.diff(ys) / np.diff(xs))[[0, -1]]
    values, first, second = course(table(x, xs, ys, kind=kind), [below, above])
    assert np.array_equal(values, ys[[0, -1]]) or np.allclose(values, ys[[0, -1]], rtol=ROUNDING)
    assert not np.any(first)
    assert not np.any(second)
    values, first, second = course(table(x, xs, ys, kind=kind, outside="linear"), [below, above])
    assert np.allclose(values, ys[[0, -1]] + [-0.7, 0.7] * slopes, rtol=1e2 * ROUNDING)
    assert np.allclose(first, slopes, rtol=1e2 * ROUNDING)
    assert not np.any(second)
    values, *_ = course(table(x, xs, ys, kind=kind, outside="error"), [below, xs[0], xs[-1], above])
    assert np.array_equal(np.isnan(values), [True, False, False, True])


@pytest.mark.parametrize(("kind", "order"), [("linear", 1), ("spline", 3)])
@pytest.mark.parametrize("shape", [(20, 20), (4, 7), (2, 3)])
def test_two_arguments_are_bilinear_or_bicubic(kind, order, shape):
    xs, ys = points(shape[0])[0], points(shape[1] + 50)[0][: shape[1]]
    values = np.random.default_rng(1).normal(size=shape)
    found = table((x, y), (xs, ys), values, kind=kind)
    slopes = ca.jacobian(found, x), ca.jacobian(found, y)
    function = ca.Function("map", [x, y], [found, *slopes], {"cse": True})
    rng = np.random.default_rng(2)
    a, b = rng.uniform(xs[0], xs[-1], 200), rng.uniform(ys[0], ys[-1], 200)
    at = [np.array(f).ravel() for f in function(a[None], b[None])]
    orders = [min(order, n - 1) for n in shape]
    surface: Any = interpolate
    true = surface.RectBivariateSpline(xs, ys, values, kx=orders[0], ky=orders[1], s=0)
    sloped = [(1, 0), (0, 1)] if min(orders) > 1 else []
    for one, (k, m) in zip(at, [(0, 0), *sloped], strict=False):
        expected = true.ev(a, b, dx=k, dy=m)
        assert np.allclose(one, expected, atol=1e2 * ROUNDING * np.max(np.abs(expected)))
    corner = np.array(ca.Function("corner", [x, y], [found])(xs[0] - 1, ys[-1] + 1))
    assert np.allclose(corner, values[0, -1], rtol=1e2 * ROUNDING)


def test_numbers_vectors_and_expressions_of_matrices_are_taken():
    assert table(0.5, [0, 1], [0, 3]) == 1.5
    assert np.array_equal(table(np.array([0.0, 0.25, 9.0]), [0, 1], [0, 4]), [0.0, 1.0, 4.0])
    whole = ca.SX.sym("whole", 2)
    of_whole = ca.Function("f", [whole], [table(whole, [0, 1], [0, 4])])
    assert np.allclose(of_whole([0.5, 2]).full().ravel(), [2, 4])
    of_mx = ca.MX.sym("of_mx")
    assert float(ca.Function("f", [of_mx], [table(of_mx, [0, 1], [0, 4])])(0.5)) == 2


def test_the_code_of_a_table_grows_with_its_points_only():
    sizes = []
    for count in (100, 1000):
        xs, ys = points(count)
        found = table(x, xs, ys, outside="linear")
        sizes.append(ca.Function("f", [x], [found, ca.jacobian(found, x)], {"cse": True}).n_instructions())
    assert sizes[1] < 10.1 * sizes[0] < 12 * 1000


def test_many_kinks_are_one_switch_that_counts():
    xs, ys = points(1000)
    found = switched([table(x, xs, ys, outside="linear"), table(x, xs + 0.05, ys, outside="linear")])
    assert [turn.counts for turn in found.switches] == [True]
    place = ca.Function("place", [x], [found.switches[0].value, found.switches[0].margin])
    at = np.linspace(xs[0] - 1e3, xs[-1] + 1e3, 5001)
    counted, margins = (np.array(f).ravel() for f in place(at[None]))
    kinks = np.sort(np.concatenate([xs[1:-1], xs[1:-1] + 0.05]))
    assert np.array_equal(counted, np.searchsorted(kinks, at, side="right"))
    assert np.all(np.diff(margins) > 0)


def test_a_spline_switches_at_its_ends_only():
    xs, ys = points(40)
    for way in ("hold", "linear", "error"):
        found = switched([table(x, xs, ys, kind="spline", outside=way)], smooth=False)
        ends = [ca.Function("end", [x], [turn.margin]) for turn in found.switches]
        assert [abs(float(end(at))) for end, at in zip(ends, xs[[0, -1]], strict=True)] == [0, 0]


class Spring(Model):
    """A mass of 1 kg on a spring whose force is a table."""

    outside: Any = "hold"
    kind: Any = "linear"
    xs, ys = np.linspace(-1.5, 1.5, 7), -np.linspace(-1.5, 1.5, 7)
    m = Parameter(1.0, unit="kg", description="mass")
    s = Real(unit="m", description="position", start=0.0, fixed=True)
    v = Real(unit="m/s", description="speed", start=1.0, fixed=True)
    f = Output(unit="N", description="force of the spring")

    def equations(self):
        yield der(self.s) == self.v
        yield self.m * der(self.v) == self.f
        yield self.f == table(self.s, self.xs, self.ys, kind=self.kind, outside=self.outside)


def spring(**members):
    return type("Spring", (Spring,), members)()


def energies(model, result):
    """Kinetic and potential energy in J, of straight lines integrated exactly."""
    xs = model.xs
    work = np.concatenate([[0.0], np.cumsum(np.diff(xs) * (model.ys[1:] + model.ys[:-1]) / 2)])
    k = np.clip(np.searchsorted(xs, result["s"]) - 1, 0, len(xs) - 2)
    at = result["s"] - xs[k]
    slopes = np.diff(model.ys) / np.diff(xs)
    return result["v"] ** 2 / 2 - (work[k] + at * (model.ys[k] + slopes[k] * at / 2))


@pytest.mark.parametrize("points_asked", [3, 501])
def test_kinks_are_events_so_that_energy_is_kept(points_asked):
    kinked = spring(xs=np.array([-1.5, -0.4, 0.0, 0.3, 1.5]), ys=np.array([9.0, 0.5, 0.0, -0.1, -7.0]))
    motion = simulate(kinked, stop=10.0, points=points_asked)
    energy = energies(kinked, motion)
    # of 4.8 J: twenty times the tolerance, for some 30 events
    assert np.max(np.abs(energy - energy[0])) < 1e-6


def test_a_spring_of_a_hundred_pieces_that_are_one_line_is_the_oscillator():
    xs = np.linspace(-1.5, 1.5, 100)
    motion = simulate(spring(xs=xs, ys=-xs), stop=6.0)
    # errors of 260 starts of the integrator add up
    assert np.max(np.abs(motion["s"] - np.sin(motion.time))) < 2e-6


@pytest.mark.parametrize("sign", [1, -1])
def test_a_simulation_that_leaves_its_table_says_where(sign):
    short = spring(outside="error", xs=np.linspace(-0.5, 0.5, 5), ys=-np.linspace(-0.5, 0.5, 5))
    words = r"Spring: at t = 0\.523599 s s leaves its table, which ends at -0\.5 and 0\.5, .*add points"
    with pytest.raises(SolveError, match=words) as stopped:
        simulate(short, stop=3.0, starts={"v": sign})
    assert abs(stopped.value.time - np.arcsin(0.5)) < 1e-7
    assert stopped.value.result.time[-1] <= stopped.value.time


def test_a_table_that_only_results_look_at_is_watched_as_well():
    class Watched(Spring):
        def equations(self):
            yield der(self.s) == self.v
            yield der(self.v) == 0
            yield self.f == table(2 * self.s + 1, [0, 3], [0, 1], outside="error")

    with pytest.raises(SolveError, match=r"at t = 1 s .*2\.\*s.* leaves its table, which ends at 0 and 3"):
        simulate(Watched(), stop=3.0)


def test_a_start_outside_of_a_table_is_refused_by_its_name():
    short = spring(outside="error", xs=[-0.5, 0.5], ys=[0.5, -0.5])
    words = r"Spring: s starts at 0\.6, expected -0\.5 to 0\.5, where its table is defined: start within"
    with pytest.raises(InitializationError, match=words):
        simulate(short, stop=1.0, starts={"s": 0.6})


@pytest.mark.parametrize("kind", ["linear", "spline"])
def test_all_routes_give_the_same_number_and_slope(kind):
    xs, ys = points(9, offset=-3.0)
    dae = translate(spring(xs=xs, ys=ys, kind=kind))
    at = 0.5 * (xs[3] + xs[4])
    value, slope, _ = (float(c[0]) for c in course(table(x, xs, ys, kind=kind), at))
    f = dae.function(["s", "v"], ["f"])
    assert abs(float(f(at, 0.0)) - value) < ROUNDING
    assert abs(float(f.jacobian()(at, 0.0, 0.0)[0]) - slope) < 1e2 * ROUNDING
    assert abs(dae.evaluate({"s": at, "v": 0.0})["f"] - value) < ROUNDING
    about = linearize(dae, at={"s": at, "v": 0.0})
    assert np.allclose(about.A, [[0, 1], [slope, 0]], atol=1e2 * ROUNDING)
    assert "f" in c_source(f, name="force", jacobian=True)


@pytest.mark.parametrize("kind", ["linear", "spline"])
def test_a_table_is_solved_for_its_argument(kind):
    curve = np.linspace(0, 3, 20), np.linspace(0, 3, 20) ** 2

    class Valve(Model):
        flow = Input(unit="m3/s", start=0.1)
        opening = Output(unit="rad", start=0.5)

        def equations(self):
            yield self.flow == table(self.opening, *curve, kind=kind)

    opened = simulate(Valve(), stop=8.0, inputs={"flow": lambda t: 0.1 + t})
    back = table(opened["opening"], *curve, kind=kind)
    assert np.max(np.abs(back - 0.1 - opened.time)) < 1e-9


def test_a_table_of_time_is_an_input_and_its_kinks_are_hit():
    class Driven(Model):
        s = Real(unit="m", start=0.0, fixed=True)
        u = Input(unit="m/s")

        def equations(self):
            yield der(self.s) == self.u

    ts, us = [0.0, 0.1, 0.100001, 2.0, 2.5], [0.0, 0.0, 1.0, 1.0, -3.0]
    driven = simulate(Driven(), stop=4.0, inputs={"u": lambda t: table(t, ts, us)}, points=5)
    assert abs(driven.final("s") - (0.5e-6 + 1.899999 - 0.5 - 4.5)) < 1e-7  # ten times the tolerance
    many = np.linspace(0.0, 4.0, 41)
    driven = simulate(Driven(), stop=4.0, inputs={"u": lambda t: table(t, many, np.cos(7 * many))}, points=5)
    assert abs(driven.final("s") - np.trapezoid(np.cos(7 * many), many)) < 1e-7


def test_a_table_stands_in_a_class_body_and_takes_the_unit_that_is_asked_for():
    class Body(Model):
        size = Parameter(0.25, unit="m")
        mass = Parameter(2 * table(size, [0, 1], [0, 8]), unit="kg")
        a = Real(unit="m/s2")

        def equations(self):
            yield self.mass * self.a == table((self.size, time), ([0, 1], [0, 2]), [[0, 2], [4, 6]])

    result = simulate(Body(size=0.5), stop=1.0)
    assert result["mass"][0] == 8.0
    assert abs(result.final("a") - (2 + 1) / 8) < ROUNDING

    class Wrong(Body):
        def equations(self):
            yield self.a == table(self.size + self.mass, [0, 1], [0, 2])

    with pytest.raises(ModelError, match="`size` is in 'm', `mass` in 'kg'"):
        translate(Wrong())


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((x, [0, 2, 2], [1, 2, 3]), r"xs\[1\] = 2 and xs\[2\] = 2 behind it, expected numbers that rise"),
        ((x, [0, 3, 2], [1, 2, 3]), r"xs\[1\] = 3 and xs\[2\] = 2 behind it, .*sort the points"),
        ((x, [0], [1]), "found 1 numbers xs, expected two or more"),
        ((x, [0, 1], [1, 2, 3]), "found ys of 3 numbers, expected 2 numbers"),
        ((x, [0, 1], x), "what varies with parameters"),
        (((x, y), ([0, 1], [0, 1, 2]), np.zeros((3, 2))), "found values of 3 x 2, expected 2 x 3 numbers"),
        (((x, y), [0, 1, 2], np.zeros((3, 2))), "found list for the numbers of two arguments"),
        (((x, ca.SX.sym("z", 2)), ([0, 1], [0, 1]), np.eye(2)), r"arguments of shapes \(1, 1\) and \(2, 1\)"),
        (("x", [0, 1], [0, 1]), r"found the argument \('x',\), expected an expression or a number"),
    ],
)
def test_a_table_that_is_none_is_refused(arguments, words):
    with pytest.raises(ModelError, match=words):
        table(*arguments)
