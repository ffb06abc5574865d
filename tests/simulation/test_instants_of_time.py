"""Instants of the time itself, both sides of a jump in results, and functions of an instant."""

import numpy as np
import pytest

from gantrytau import (
    Discrete,
    Model,
    ModelError,
    Parameter,
    Real,
    StructureError,
    der,
    pre,
    sampled,
    simulate,
    sin,
    time,
    translate,
    when,
)
from gantrytau_models import FourBar
from tests.simulation.balls import Ball, G
from tests.simulation.test_jumps import Pairs, jumps


def test_counters_and_drives_at_instants_of_time():
    class Drive(Model):
        T = Parameter(0.1, unit="s")
        duty = Parameter(0.3)
        x = Real(start=0.0, fixed=True)
        begin = Discrete(0.0, unit="s")
        on = Discrete(True)
        n = Discrete(0)

        def equations(self):
            yield der(self.x) == self.on
            yield when(time >= self.begin + self.duty * self.T, self.on == 0)
            yield when(
                time >= self.begin + self.T, self.begin == pre(self.begin) + self.T, self.n == pre(self.n) + 1
            )

    class Twice(Drive):
        def equations(self):
            yield from Drive.equations(self)
            yield when(time >= 2, self.on == 1)

    with pytest.raises(ModelError, match="sets as well"):
        simulate(Twice(), stop=1.0)

    class Pulsed(Drive):
        def equations(self):
            yield der(self.x) == self.on
            yield when(
                time >= self.begin + self.T,
                self.on == 1,
                self.begin == pre(self.begin) + self.T,
                self.n == pre(self.n) + 1,
            ).elsewhen(time >= self.begin + self.duty * self.T, self.on == 0)

    for points in (2, 11, 1001):
        found = simulate(Pulsed(), stop=10.05, points=points)
        assert found.final("n") == 100
        assert found.final("x") == pytest.approx(100 * 0.03 + 0.03, abs=1e-12)
        assert found.at(3.02, "on") == 1
        assert found.at(3.0301, "on") == 0


def test_instants_of_time_move_with_what_they_depend_on():
    class Moved(Model):
        """A level that a sine reaches, raised each time: asin(0.2), asin(0.4), ... of one swing, then none."""

        second = Parameter(1.0, unit="s")
        level = Discrete(0.2)
        x = Real(start=0.0, fixed=True)

        def equations(self):
            yield der(self.x) == 1
            yield when(sin(time / self.second) > self.level, self.level == pre(self.level) + 0.2)

    found = simulate(Moved(), stop=1.5, points=2)
    np.testing.assert_allclose(found.time[jumps(found)], np.arcsin([0.2, 0.4, 0.6, 0.8]), atol=1e-14)


@pytest.mark.parametrize("points", [2, 3, 11])
def test_instants_at_an_output_point_at_the_start_and_at_the_end(points):
    class Instants(Model):
        x = Real(start=0.0, fixed=True)
        start, middle, end, both = Discrete(0), Discrete(0), Discrete(0), Discrete(0)

        def equations(self):
            yield der(self.x) == 1
            yield when(time >= 0, self.start == 1)
            yield when(time >= 0.5, self.middle == 1)
            yield when(self.x >= 0.5, self.both == self.middle)
            yield when(time >= 1, self.end == 1)

    found = simulate(Instants(), stop=1.0, points=points)
    assert found.final("start") == 0  # it was true at the start
    assert found.final("middle") == found.at(0.5, "middle") == 1
    assert found.at(0.5 - 1e-9, "middle") == 0
    assert found.final("end") == 1
    assert found.final("both") == 1
    assert found.at(1.0, "end") == 1


def test_both_sides_of_a_jump_and_samples_at_one_instant():
    class Both(Model):
        T = Parameter(0.25, unit="s")
        one = Parameter(1.0, unit="s")
        x = Real(start=0.0, fixed=True)
        s = Real(start=-1.0)
        n = Discrete(0)

        def equations(self):
            yield der(self.x) == 1
            yield sampled(self.s, self.x + self.n, period=self.T)
            yield when(self.s >= 0.5, self.n == pre(self.n) + 10 * self.s)

    found = simulate(Both(), stop=1.0, points=5)
    np.testing.assert_allclose(found.time, [0, 0.25, 0.5, 0.5, 0.75, 1])
    np.testing.assert_allclose(found["s"], [0, 0.25, 0.25, 0.5, 0.75 + 5, 1 + 5], atol=1e-12)
    np.testing.assert_allclose(found["n"], [0, 0, 0, 5, 5, 5], atol=1e-12)
    assert found.held == {"s", "n"}
    assert found.at(0.6, "s") == pytest.approx(0.5)
    np.testing.assert_allclose(found.at([0.1, 0.6], "x"), [0.1, 0.6], atol=1e-12)
    with pytest.raises(ModelError, match=r"at: found t = 1\.5, expected times from 0 s to 1 s"):
        found.at(1.5, "x")
    lines = found.plot("s", "n").axes[0].get_lines()
    assert [line.get_drawstyle() for line in lines] == ["steps-post", "steps-post"]
    assert found.select(["n", "x"]).held == {"n"}


def test_values_between_output_points_have_the_slope_of_the_motion():
    found = simulate(Ball(), stop=0.4, points=3)
    t = np.linspace(0, 0.4, 17)
    np.testing.assert_allclose(found.at(t, "h"), 1 - G * t**2 / 2, atol=1e-8)
    np.testing.assert_allclose(found.at(t, "v"), -G * t, atol=1e-8)


def test_functions_of_an_instant():
    dae = translate(Ball(), events=True)
    behind = dae.function(["pre(h)", "pre(v)", "pre(bounces)"], ["v", "bounces", "h"])
    np.testing.assert_allclose(np.ravel(behind(1.0, -2.0, 3)), [-2, 3, 1])  # the condition does not hold
    np.testing.assert_allclose(np.ravel(behind(0.0, -2.0, 3)), [1.6, 4, 0])
    assert float(dae.function(["pre(v)", "h"], ["v"])(5.0, -1e-9)) == -4.0
    with pytest.raises(ModelError, match=r"found v among the given of an instant.*expected pre\(v\)"):
        dae.function(["pre(h)", "v"], ["bounces"])
    with pytest.raises(StructureError, match="Give also bounces"):
        dae.function(["pre(h)", "pre(v)"], ["bounces"])
    with pytest.raises(ModelError, match="there is no when in the model"):
        translate(FourBar()).function(["pre(crank.phi)"], ["rocker.phi"])


def test_a_function_of_an_instant_is_what_a_simulation_does():
    found = simulate(Pairs(), stop=1.0, points=2)
    (left,) = jumps(found)
    dae = translate(Pairs(), events=True)
    names = [f"pairs[{k}].{x}" for k in range(2) for x in ("x", "v", "hits")]
    behind = dae.function([f"pre({n})" for n in names], names)
    before = [found[n][left] for n in names]
    for name, value in zip(names, behind(*before), strict=True):
        np.testing.assert_allclose(np.ravel(value), np.ravel(found[name][left + 1]), rtol=1e-14)
