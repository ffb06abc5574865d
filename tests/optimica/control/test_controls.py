"""Inputs in pieces: constant, linear and ramps, with limits and costs on their steps."""

from typing import Any

import numpy as np
import pytest

from gantrytau import Fixed, Input, Model, ModelError, Real, SolveError, der
from gantrytau_optimica import Optimization, final, optimize
from tests.optimica.problems import BoundedOscillator, FastestMass, Mass


class Effort(Optimization):
    """Least effort from rest at 0 to rest at 1 in 1 s."""

    mass: Any = Mass(x=Fixed(0.0), v=Fixed(0.0))

    def integrand(self):
        return self.mass.u**2

    def constraints(self):
        yield final(self.mass.x) == 1
        yield final(self.mass.v) == 0


def best_pieces(widths, penalty=0.0) -> tuple[float, np.ndarray]:
    """Least effort and force of constant pieces of these widths: a quadratic program with two conditions.

    A piece of width w whose middle is m adds w u to the speed, and w (1 - m) u to the way.
    """
    widths = np.asarray(widths, dtype=float)
    middle = np.cumsum(widths) - widths / 2
    conditions = np.vstack([widths, widths * (1 - middle)])
    steps = np.diff(np.eye(widths.size), axis=0)
    weights = np.diag(widths) + penalty * steps.T @ steps
    towards = np.linalg.solve(weights, conditions.T)
    force = towards @ np.linalg.solve(conditions @ towards, [0.0, 1.0])
    return float(force @ weights @ force), force


def pieces(optimum, name="mass.u") -> np.ndarray:
    """Values in the middle of all elements."""
    borders = np.concatenate([[optimum.start_time], optimum.breaks, [optimum.final_time]])
    return optimum.signal(name)((borders[1:] + borders[:-1]) / 2)


@pytest.mark.parametrize("scheme", ["radau", "gauss", "shooting"])
@pytest.mark.parametrize(
    ("elements", "group", "widths"),
    [
        (6, 1, np.full(6, 1 / 6)),
        (12, 2, np.full(6, 1 / 6)),
        (5, 2, [0.4, 0.4, 0.2]),  # what remains is a shorter piece
        ([1, 2, 1], 1, [0.25, 0.5, 0.25]),
    ],
)
def test_constant_pieces_are_the_best_ones(scheme, elements, group, widths):
    controls = {"mass.u": dict(kind="constant", elements=group)}
    optimum = optimize(Effort, elements=elements, scheme=scheme, controls=controls)
    least, force = best_pieces(widths)
    assert optimum.objective == pytest.approx(least, abs=1e-9)
    np.testing.assert_allclose(np.unique(pieces(optimum).round(7)), np.unique(force.round(7)), atol=1e-7)
    assert optimum.playback.defect < 1e-8


def test_more_elements_in_a_group_than_there_are():
    class Pushed(Effort):
        def constraints(self):
            yield final(self.mass.x) == 1

    optimum = optimize(Pushed, elements=4, controls={"mass.u": dict(kind="constant", elements=99)})
    assert optimum.objective == pytest.approx(4.0, abs=1e-8)  # u = 2 all the time
    np.testing.assert_allclose(optimum["mass.u"], 2.0, atol=1e-8)


def test_a_blocked_oscillator():
    """Problem 6 of the reference problems."""
    optimum = optimize(BoundedOscillator, elements=40, controls={"oscillator.u": "constant"})
    assert optimum.objective == pytest.approx(3.31090705, abs=1e-6)


@pytest.mark.parametrize("kind", ["linear", "ramps"])
def test_linear_pieces_carry_a_linear_force(kind):
    optimum = optimize(Effort, elements=5, controls={"mass.u": kind})
    assert optimum.objective == pytest.approx(12.0, abs=1e-9)
    t = np.linspace(0.0, 1.0, 21)
    np.testing.assert_allclose(optimum.signal("mass.u")(t), 6 - 12 * t, atol=1e-7)


def test_linear_pieces_over_groups_are_straight_and_continuous():
    class Pushed(Effort):
        """Reward for the way, so that the best force is a parabola: u = 6 (1 - t)^2 would be best."""

        def objective(self):
            return -12 * final(self.mass.x)

        def constraints(self):
            yield final(self.mass.v) == 1

    optimum = optimize(Pushed, elements=6, controls={"mass.u": dict(kind="linear", elements=3)})
    force = optimum.signal("mass.u")
    ends = force(np.array([0.0, 0.5, 1.0]))
    t = np.linspace(0.0, 1.0, 25)
    np.testing.assert_allclose(force(t), np.interp(t, [0.0, 0.5, 1.0], ends), atol=1e-9)


def test_linear_pieces_keep_limits_everywhere():
    controls = {"mass.u": dict(kind="linear", elements=2)}
    optimum = optimize(FastestMass, elements=20, controls=controls)
    t = np.linspace(0.0, optimum.final_time, 1001)
    force = optimum.signal("mass.u")(t)
    assert np.max(np.abs(force)) <= 1 + 1e-7
    assert np.max(np.abs(np.diff(force))) < 0.05  # no jump: at most 2 in a tenth of the time
    # ten groups: from +1 to -1 within the two in the middle, T^2 (1/4 - 0.1^2 / 3) = 1
    assert optimum.final_time == pytest.approx(1 / np.sqrt(0.25 - 0.01 / 3), abs=1e-6)


def test_linear_pieces_over_groups_are_refused_where_borders_move():
    controls = {"mass.u": dict(kind="linear", elements=2)}
    with pytest.raises(ModelError, match="lengths='free', expected 'given' beside straight lines over"):
        optimize(FastestMass, elements=4, lengths="free", controls=controls)


def test_a_limit_on_steps():
    controls = {"mass.u": dict(kind="constant", max_step=0.5)}
    optimum = optimize(FastestMass, elements=10, controls=controls)
    steps = np.diff(pieces(optimum))
    assert np.max(np.abs(steps)) <= 0.5 + 1e-6
    # from 1 to -1 in steps of a half takes three pieces of 1/10 between; by hand: 1, 1, 1, 3/4, 1/4, ...
    force = np.array([1, 1, 1, 0.75, 0.25])
    force = np.concatenate([force, -force[::-1]])
    way = np.sum(force * (0.95 - 0.1 * np.arange(10))) / 10
    assert optimum.final_time == pytest.approx(1 / np.sqrt(way), abs=1e-6)


def test_without_steps_there_is_one_value():
    class Pushed(Effort):
        def constraints(self):
            yield final(self.mass.x) == 1

    for kind in ("constant", "linear"):
        optimum = optimize(Pushed, elements=4, controls={"mass.u": dict(kind=kind, max_step=0)})
        np.testing.assert_allclose(optimum["mass.u"], 2.0, atol=1e-7)


@pytest.mark.parametrize("scheme", ["radau", "gauss"])
def test_a_cost_of_steps(scheme):
    controls = {"mass.u": dict(kind="constant", step_penalty=0.1)}
    optimum = optimize(Effort, elements=4, scheme=scheme, controls=controls)
    least, force = best_pieces(np.full(4, 0.25), penalty=0.1)
    assert optimum.objective == pytest.approx(least, abs=1e-8)
    np.testing.assert_allclose(pieces(optimum), force, atol=1e-7)
    assert optimum.playback.objective == pytest.approx(least, abs=1e-7)


def test_limits_of_steps_of_linear_pieces():
    # the best force falls by 2 per sixth of the time; what may fall by 1.5 only cannot bring the mass there
    for step in (2.0 + 1e-6, 2.5):
        controls = {"mass.u": dict(kind="linear", max_step=step)}
        assert optimize(Effort, elements=6, controls=controls).objective == pytest.approx(12.0, abs=1e-6)
    with pytest.raises(SolveError, match="no solution"):
        optimize(Effort, elements=6, controls={"mass.u": dict(kind="linear", max_step=1.5)})


class Plane(Model):
    """Two forces."""

    r = Real(2, start=0.0, fixed=True, description="place")
    f = Input(2, unit="1/s", description="speed")

    def equations(self):
        yield der(self.r) == self.f


class Drawn(Optimization):
    """Two coordinates to be brought to 1, with a cost that changes over time."""

    plane = Plane()

    def integrand(self):
        f = self.plane.f
        return (f[0] - 1) ** 2 + (f[1] - self.plane.r[0]) ** 2

    def constraints(self):
        yield final(self.plane.r[0]) == 1


def test_a_vector_of_inputs_and_inputs_of_their_own():
    # f0 = 1, r0 = t; f1 = t at best, or its mean 1/2 as one piece: integral of (t - 1/2)^2
    both = optimize(Drawn, elements=4, controls={"plane.f": dict(elements=4)})
    assert both["plane.f"][:, 0] == pytest.approx(1.0, abs=1e-6)
    assert both.objective == pytest.approx(1 / 12, abs=1e-7)
    one = optimize(Drawn, elements=4, controls={"plane.f[0]": dict(elements=4)})
    assert one.objective == pytest.approx(0.0, abs=1e-9)
    two = optimize(Drawn, elements=4, controls={"plane.f[0]": "linear", "plane.f[1]": "constant"})
    assert two.objective == pytest.approx(1 / 12 / 16, abs=1e-7)


@pytest.mark.parametrize(
    ("controls", "words"),
    [
        ("constant", "controls='constant', expected {name of an input: dict(kind="),
        ({"mass.u": 3}, "controls mass.u: found controls=3, expected dict(kind="),
        ({"mass.u": dict(element=2)}, "did you mean 'elements'"),
        ({"mass.u": "cubic"}, "controls mass.u: found kind='cubic', expected 'constant', 'linear' or"),
        ({"mass.u": dict(kind="ramps", max_step=1.0)}, "ramps jump at every border, expected no other"),
        ({"mass.u": dict(elements=1.5)}, "found elements=1.5, expected a whole number"),
        ({"mass.u": dict(max_step=-1)}, "found max_step=-1"),
        ({"mass.u": dict(step_penalty=None)}, "found step_penalty=None, expected a number"),
        ({"mass.x": "constant"}, "controls: mass.x is no input that the optimiser chooses, expected one of"),
        ({"mass.w": "constant"}, "mass.w"),
    ],
)
def test_controls_that_cannot_be(controls, words):
    with pytest.raises(ModelError) as caught:
        optimize(FastestMass, controls=controls)
    assert words in str(caught.value)


def test_controls_of_a_known_input():
    class Known(Optimization):
        mass = Mass(x=Fixed(0.0), v=Fixed(0.0))
        inputs: Any = {"mass.u": 1.0}

    with pytest.raises(ModelError, match=r"mass\.u is no input .* expected one of none \(there is no"):
        optimize(Known, controls={"mass.u": "constant"})


def test_a_limit_on_steps_that_leaves_no_solution_is_named():
    class Sudden(Effort):
        def constraints(self):
            yield from super().constraints()
            yield self.mass.u <= 3

    with pytest.raises(SolveError) as caught:
        optimize(Sudden, elements=4, controls={"mass.u": dict(kind="constant", max_step=0.5)})
    assert "step" in str(caught.value)
