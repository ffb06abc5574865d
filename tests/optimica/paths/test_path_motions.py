"""Motions of the three-link robot along paths, against the exact answer in the phase plane."""

import casadi as ca
import numpy as np
import pytest

from gantrytau import Bounds, Model, ModelError, Parameter, Real, StateSelect, between, der, translate
from gantrytau.language.functions import dot
from gantrytau_models import GantryTau, prototypes
from gantrytau_optimica import Free, Optimization, final, initial, optimize
from gantrytau_optimica.paths.path import Path
from gantrytau_optimica.paths.way import Way
from tests.optimica.paths.phase_plane import OnPath

START, END = np.array([0.0, 2.51, -1.03]), np.array([1.711, 3.46, -0.24])
LIMIT = 190.5 * 6.337  # N
ARC = (START, [0.3, 2.5, -0.85], [0.9, 2.75, -0.5], [1.4, 3.1, -0.35], END)


def along(path, **limits):
    """The fastest motion along a path, from rest to rest."""

    class Along(Optimization):
        robot = GantryTau(prototypes.GT_A)
        way = Way(path, **limits)
        final_time = Free(1.0, unit="s", min=0.1, max=10.0)
        given = ("robot.carts[2].f",)

        def equations(self):
            yield self.robot.tool.r == self.way.r

        def objective(self):
            return self.final_time

        def constraints(self):
            for cart in self.robot.carts:
                yield between(-LIMIT, cart.f, LIMIT)
            for end, s in ((initial, 0.0), (final, path.length)):
                yield end(self.way.s) == s
                yield end(self.way.v) == 0

    return Along


def phase_plane(path):
    """The exact answer."""

    def derivatives(s):
        inside = np.array([np.clip(s, 0.0, path.length)])
        return np.array([path.derivative(inside, k)[0] for k in range(3)])

    return OnPath(prototypes.GT_A, derivatives, path.length, LIMIT)


def test_the_straight_line_takes_the_exact_time_in_the_phase_plane():
    # benchmarks: 0.9737820 s
    assert phase_plane(Path.line(START, END)).fastest().duration == pytest.approx(0.9737820, abs=1e-7)


def test_the_straight_line_takes_the_known_time_on_its_mesh():
    found = optimize(along(Path.line(START, END)))
    assert found.final_time == pytest.approx(0.974057, abs=2e-6)  # 50 elements of three Radau points
    assert found.dae.states == ("way.s", "way.v")


def test_a_spline_takes_the_exact_time_to_the_accuracy_of_the_mesh():
    path = Path.through(ARC)
    exact = phase_plane(path).fastest()
    assert exact.least_margin > 1.0  # m/s2: the motion stays below the limit curve
    errors = [optimize(along(path), elements=n).final_time - exact.duration for n in (25, 100)]
    # limits hold at the collocation points only, so the time may be too short as well as too long
    assert abs(errors[0]) < 2e-3
    assert abs(errors[1]) < abs(errors[0]) / 4


def extrapolated(exact, steps):
    """The time by reachable speeds, whose error is of first order in the step, without that order."""
    coarse, fine = (exact.duration_by_reach(count) for count in (steps, 2 * steps))
    return 2 * fine - coarse


def test_two_ways_in_the_phase_plane_agree():
    exact = phase_plane(Path.through(ARC))
    # what extrapolation leaves shrinks with the square of the step; measured: 3e-7 s
    assert extrapolated(exact, 500) == pytest.approx(exact.fastest().duration, abs=1e-6)


def test_more_than_a_turn_of_a_circle_with_several_switches():
    """The way meets itself, the tool turns back in every coordinate, and the limit curve is in the way."""
    path = Path.of(
        lambda u: (0.7 + 0.5 * ca.cos(u), 2.9 + 0.5 * ca.sin(u), -0.7 + 0.2 * ca.sin(u)), np.pi, 2.6 * np.pi
    )
    exact = phase_plane(path)
    with pytest.raises(ValueError, match="more switches than one"):
        exact.fastest()
    # measured: 4e-5 s on this mesh, 1e-5 s on twice as many elements
    assert optimize(along(path), elements=100).final_time == pytest.approx(
        extrapolated(exact, 1000), abs=1e-4
    )


def test_the_tools_whole_acceleration_is_limited():
    path = Path.through(ARC)

    class Gentle(along(path)):
        def constraints(self):
            yield from super().constraints()
            yield dot(der(self.robot.tool.v), der(self.robot.tool.v)) <= 3.0**2

    found = optimize(Gentle, elements=12)
    whole = np.linalg.norm(found["der(robot.tool.v)"], axis=1)
    assert whole[1:].max() < 3.0 * (1 + 1e-6)
    # from rest to rest with 3 m/s2 on a straight line; a curve takes longer
    assert 2 * np.sqrt(path.length / 3.0) < found.final_time < 2.2 * np.sqrt(path.length / 3.0)


def test_a_symbol_of_ones_own_is_a_way_along_a_path():
    path = Path.through(ARC)

    class Robot(GantryTau):
        s = Real(unit="m", description="way along the path", prefer=StateSelect.ALWAYS)

        def equations(self):
            yield from super().equations()
            yield self.tool.r == path(self.s)

    dae = translate(Robot(prototypes.GT_A), given=["s"])
    s, v, a = 0.8, 0.5, 2.0
    forces = [f"carts[{k}].f" for k in range(3)]
    found = dae.function(["s", "der(s)", "der(der(s))"], forces)(s, v, a)
    mass, rest = phase_plane(path).forces(s, v)
    np.testing.assert_allclose(np.ravel(found), mass * a + rest, rtol=1e-9)


def test_speed_and_acceleration_along_the_path_are_limited():
    path = Path.through(ARC)
    found = optimize(along(path, v=Bounds(-1.0, 1.0), a=Bounds(-4.0, 4.0)))
    # a trapezoid of speed: far below the limits of the forces
    assert found.final_time == pytest.approx(path.length / 1.0 + 1.0 / 4.0, abs=2e-3)
    assert found["way.v"].max() < 1.0 + 1e-7
    np.testing.assert_allclose(
        np.linalg.norm(found["robot.tool.v"], axis=1), np.abs(found["way.v"]), atol=1e-5
    )


class Point(Model):
    """A point that goes where it is put."""

    r = Real(3, unit="m")


class OnCircle(Optimization):
    """As far as accelerations of 1 m/s2 lead in 3 s along a quarter of a circle of 1 m, from rest."""

    angles = np.linspace(0.0, np.pi / 2, 30)
    point = Point()
    way = Way(Path.through(np.column_stack([np.cos(angles), np.sin(angles), 0 * angles])))
    final_time = Parameter(3.0, unit="s")
    given = ("way.a",)

    def equations(self):
        yield self.point.r == self.way.r

    def objective(self):
        return -final(self.way.s)

    def constraints(self):
        yield between(-1, self.way.a, 1)
        yield initial(self.way.s) == 0
        yield initial(self.way.v) == 0


def test_a_motion_ends_where_its_path_does():
    # without an end of the path it would go 4.5 m
    found = optimize(OnCircle, elements=10)
    assert found["way.s"][-1] == pytest.approx(np.pi / 2, abs=1e-5)
    np.testing.assert_allclose(found["point.r"][-1], [0.0, 1.0, 0.0], atol=1e-5)


def test_an_end_beyond_the_path_is_refused_with_its_length():
    class Beyond(OnCircle):
        def constraints(self):
            yield from super().constraints()
            yield final(self.way.s) == 2.5

    with pytest.raises(ModelError, match=r"final\(way.s\) == 2.5` lies outside of the limits of way.s, 0"):
        optimize(Beyond)
