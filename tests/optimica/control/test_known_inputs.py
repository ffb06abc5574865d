"""Inputs that the optimiser does not choose: numbers, functions of time, and samples."""

from typing import Any

import numpy as np
import pytest

from gantrytau import Input, Model, ModelError, Parameter, Real, der, exp, multisine, prbs, steps, white_noise
from gantrytau_optimica import Free, Optimization, Samples, final, link, optimize, sum_of_squares


def problem(base: type[Optimization], **members):
    """The problem with other members."""
    return type("Problem", (base,), members)


def message(wrong, **policy) -> str:
    with pytest.raises(ModelError) as caught:
        optimize(wrong, **policy)
    return str(caught.value)


class Integrator(Model):
    """x' = u + w."""

    x = Real(start=0.0, fixed=True, description="integral")
    u = Input(unit="1/s", description="known")
    w = Input(unit="1/s", description="chosen", start=0.0)
    twice = Real(unit="1/s", description="two times the known input")

    def equations(self):
        yield der(self.x) == self.u + self.w
        yield self.twice == 2 * self.u


class Held(Optimization):
    """Bring x to 5 in 2 s with the least effort: (5 - integral of u)^2 / 2."""

    model = Integrator()

    final_time = 2.0

    def integrand(self):
        return self.model.w**2

    def constraints(self):
        yield final(self.model.x) == 5


STEPS = Samples([0.0, 0.7, 1.1], [1.0, 3.0, 0.5], kind="constant")
LINES = Samples([0.0, 0.8, 2.0], [1.0, 3.0, 0.0])


@pytest.mark.parametrize(
    ("course", "whole"),
    [
        (1.5, 3.0),
        (lambda t: 3 * t**2, 8.0),
        (lambda t: exp(t), np.exp(2) - 1),
        (STEPS, 0.7 + 1.2 + 0.45),
        (LINES, 1.6 + 1.8),
        (([0.0, 0.8, 2.0], [1.0, 3.0, 0.0]), 3.4),
        (steps([0.0, 0.7, 1.1], [1.0, 3.0, 0.5]), 2.35),
        (multisine([0.5, 1.5], [1.0, 2.0], phases=[0.0, 0.3]), 0.0),
        (prbs(3, 0.2, 2.0, seed=5), 0.2 * np.sum(prbs(3, 0.2, 2.0, seed=5).values(0.2 * np.arange(10)))),
    ],
)
def test_a_known_input(course, whole):
    # the kink of the straight lines lies on a border of 20 elements; quadrature of exp: 0.1^6 of the way
    optimum = optimize(problem(Held, inputs={"model.u": course}), elements=20)
    assert optimum.objective == pytest.approx((5 - whole) ** 2 / 2, abs=1e-7)
    assert optimum.playback.defect < 1e-7
    assert optimum.playback.objective == pytest.approx(optimum.objective, abs=1e-7)
    assert optimum.free == {}
    assert "model.u" in optimum


@pytest.mark.parametrize("scheme", ["gauss", "shooting"])
@pytest.mark.parametrize(("course", "whole"), [(STEPS, 2.35), (LINES, 3.4)])
def test_a_known_input_in_other_schemes(scheme, course, whole):
    optimum = optimize(problem(Held, inputs={"model.u": course}), elements=20, scheme=scheme)
    assert optimum.objective == pytest.approx((5 - whole) ** 2 / 2, abs=1e-7)


def test_samples_longer_than_the_horizon():
    # from -1 to 3.5 s: 2 at the start, 3 at 0.5 s, 1.5 at the end
    longer = Samples([-1.0, 0.5, 3.5], [0.0, 3.0, 0.0])
    optimum = optimize(problem(Held, inputs={"model.u": longer}), elements=20)
    assert optimum.objective == pytest.approx((5 - 2.5 * 0.5 - 2.25 * 1.5) ** 2 / 2, abs=1e-7)


def test_steps_of_a_known_input_become_borders():
    optimum = optimize(problem(Held, inputs={"model.u": STEPS}), elements=3)
    for jump in (0.7, 1.1):
        assert np.min(np.abs(optimum.breaks - jump)) < 1e-9
    inside = np.array([0.69, 0.71, 1.09, 1.11])
    np.testing.assert_allclose(optimum.signal("model.u")(inside), [1.0, 3.0, 3.0, 0.5])
    np.testing.assert_allclose(optimum.signal("model.twice")(inside), [2.0, 6.0, 6.0, 1.0])


def test_the_integral_of_a_known_input_with_steps():
    optimum = optimize(problem(Held, inputs={"model.u": STEPS}), elements=3)
    whole = 0.7 + 1.2 + 0.45
    assert optimum.integral("model.twice") == pytest.approx(2 * whole, abs=1e-9)
    # what flows in is what arrives
    assert optimum.integral("model.u") + optimum.integral("model.w") == pytest.approx(5.0, abs=1e-8)


def test_a_kink_of_a_known_input_off_the_mesh_is_refined():
    optimum = optimize(problem(Held, inputs={"model.u": LINES}), elements=7, refine=1e-6)
    assert optimum.refinement.reached
    assert optimum.objective == pytest.approx(1.6**2 / 2, rel=3e-6)


def test_a_vector_of_known_inputs():
    class Plane(Model):
        r = Real(2, start=0.0, fixed=True, description="place")
        f = Input(2, unit="1/s", description="known")
        g = Input(2, unit="1/s", description="chosen")

        def equations(self):
            yield der(self.r) == self.f + self.g

    class Move(Optimization):
        plane = Plane()
        inputs: Any = {"plane.f": Samples([0.0, 1.0], [[1.0, 4.0], [3.0, 0.0]])}

        def integrand(self):
            return self.plane.g[0] ** 2 + self.plane.g[1] ** 2

        def constraints(self):
            yield final(self.plane.r) == [3, 3]

    assert optimize(Move, elements=4).objective == pytest.approx(1.0 + 1.0, abs=1e-7)
    one = problem(Move, inputs={"plane.f[0]": 2.5, "plane.f[1]": lambda t: 6 * t**2})
    assert optimize(one, elements=4).objective == pytest.approx(0.25 + 1.0, abs=1e-7)
    with pytest.raises(ModelError, match=r"input plane\.f: found 1 columns, expected 2"):
        optimize(problem(Move, inputs={"plane.f": Samples([0.0, 1.0], [1.0, 2.0])}))


def test_the_same_course_in_other_phases_has_its_own_time():
    class Second(Held):
        start_time = 2.0
        final_time = 4.0
        inputs: Any = {"model.u": Samples([2.0, 3.0], [1.0, 4.0], kind="constant")}
        model = Integrator(x=dict(fixed=False))

        def constraints(self):
            yield final(self.model.x) == 0

    class Both(Optimization):
        first = problem(Held, inputs={"model.u": STEPS})()
        second = Second()

        def constraints(self):
            yield link(self.first, self.second)

    # from 5 to 0 while 1 + 4 flow in
    optimum = optimize(Both, elements=4)
    assert optimum.objective == pytest.approx((5 - 2.35) ** 2 / 2 + 10**2 / 2, abs=1e-6)
    assert optimum.playback.objective == pytest.approx(optimum.objective, abs=1e-6)


@pytest.mark.parametrize(
    ("members", "words"),
    [
        ({"inputs": {"model.z": 1.0}}, "model.z"),
        ({"inputs": {"model.x": 1.0}}, "Problem: model.x is no input here, expected one of model.u, model.w"),
        ({"inputs": [1.0]}, "Problem.inputs: found [1.0], expected {name: course}"),
        ({"inputs": {"model.u": ([0.0, 2.0, 1.0], [1.0, 2.0, 3.0])}}, "input model.u: Samples: the time"),
        ({"inputs": {"model.u": white_noise(1.0, 0.1)}}, "input model.u: white_noise(std=1.0, period=0.1"),
        (
            {
                "inputs": {"model.u": prbs(5, 0.1, seed=1)},
                "final_time": Free(2.0, unit="s", min=1.0, max=2.0),
            },
            "model.u is held from time to time, which needs fixed times; give start_time and final_time as numbers",
        ),
        ({"inputs": {"model.u": Samples([0.0, 1.5], [1.0, 2.0])}}, "input model.u: samples cover 0 to 1.5"),
        ({"inputs": {"model.u": Samples([0.5, 1.5], [1.0, 2.0], kind="constant")}}, "samples cover 0.5 to"),
        ({"inputs": {"model.u": Samples([0, 0.1, 0.2, 2], [1, 2, 3, 4])}}, "input model.u: a gap from 0.2"),
        (
            {"inputs": {"model.u": LINES}, "final_time": Free(2.0, unit="s", min=1.0, max=2.0)},
            "model.u is known by samples, which needs fixed times; give start_time and final_time as numbers",
        ),
        ({"inputs": {"model.u": np.nan}}, "model.u"),
        ({"inputs": {"model.u": "fast"}}, "model.u"),
    ],
)
def test_known_inputs_that_cannot_be(members, words):
    assert words in message(problem(Held, **members), elements=3)


def test_a_known_input_may_hold_a_parameter_of_the_fit():
    class Gain(Model):
        x = Real(start=0.0, fixed=True, description="integral")
        k = Parameter(1.0, unit="1/s", description="gain")
        u = Input(description="known")

        def equations(self):
            yield der(self.x) == self.k * self.u

    class Fit(Optimization):
        model = Gain(k=Free(0.5, unit="1/s", min=0.0, max=9.0))
        inputs: Any = {"model.u": Samples([0.0, 0.37], [1.0, -2.0], kind="constant")}

        def objective(self):
            measured = [2 * 0.37, 2 * (0.37 - 0.2), 2 * (0.37 - 2 * 0.63)]
            return sum_of_squares(self.model.x, Samples([0.37, 0.47, 1.0], measured))

    optimum = optimize(Fit, elements=3)
    assert optimum["model.k"] == pytest.approx(2.0, abs=1e-7)
    assert optimum.objective == pytest.approx(0.0, abs=1e-9)


def test_free_lengths_beside_a_known_input_with_steps():
    """Borders at the steps and borders that move do not go together, as samples of straight lines are refused."""
    with pytest.raises(ModelError, match=r"model\.u: found lengths='free', expected 'given', as borders"):
        optimize(problem(Held, inputs={"model.u": STEPS}), elements=4, lengths="free")
