"""Derivatives of optima with respect to parameters, against formulas and against problems solved again."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gantrytau import Fixed, ModelError, Parameter, SolveError
from gantrytau.commands.demo.motion_problems import FreePath, OnLine
from gantrytau_optimica import Free, Optimization, final, initial, link, optimize, prepare
from gantrytau_optimica.studies.sensitivities import sensitivities
from tests.optimica.problems import LinearQuadratic, Mass

PLATE, VISCOUS = "robot.plate_mass", "robot.carts[1].law.f_v"


class Carried(Optimization):
    """From rest to rest over a way in the least time with a largest force: T = 2 sqrt(way mass / force)."""

    body: Any = Mass()
    force = Parameter(2.0, unit="N", description="largest force")
    mass = Parameter(1.5, unit="kg", description="mass")
    way = Parameter(3.0, unit="m", description="distance")
    final_time: Any = Free(2.0, unit="s", min=0.1, max=100.0, description="duration")

    def objective(self):
        return self.final_time

    def constraints(self):
        yield -self.force <= self.mass * self.body.u
        yield self.mass * self.body.u <= self.force
        yield initial(self.body.x) == 0
        yield initial(self.body.v) == 0
        yield final(self.body.x) == self.way
        yield final(self.body.v) == 0


class Ended(LinearQuadratic):
    """The quadratic cost with an end that is a vector of parameters."""

    end = Parameter([4.0, -2.0], unit="1", description="position in m and speed in m/s at the end")

    def constraints(self):
        yield final(self.mass.x) == self.end[0] * self.one_m
        yield final(self.mass.v) == self.end[1] * self.one_v


@pytest.fixture(scope="module")
def gantry():
    """The motion from A to B with a weight, and the problem that it is a solution of."""
    prepared = prepare(FreePath, parameters=["weight", PLATE, VISCOUS], elements=30, tolerance=1e-12)
    return prepared, prepared.solve({"weight": 0.01})


@pytest.fixture(scope="module")
def derivatives(gantry):
    return sensitivities(gantry[1])


def again(prepared, optimum, name, value):
    """The optimum with another value of one parameter, from where the first stands: on the same branch."""
    free = tuple(
        replace(n, guess=value, min=value, max=value) if n.name == name else n
        for n in optimum.program.problem.free
    )
    program = prepared.program.with_numbers(replace(optimum.program.problem, free=free))
    solution = prepared.solver.solve(program, optimum.solution.w)
    assert solution.success
    return replace(optimum, program=program, solution=solution)


@pytest.mark.parametrize("elements", [24, 25])  # the force switches on a border, and within an element
@pytest.mark.parametrize("parameters", [["force", "mass", "way"], ["mass"], []])
def test_the_least_time_of_a_mass_changes_as_its_formula(elements, parameters):
    optimum = prepare(Carried, parameters=parameters, elements=elements).solve()
    found = sensitivities(optimum, ["force", "mass", "way"])
    # any mesh keeps the law T ~ sqrt(way mass / force); Ipopt's tolerance relative to T is 1e-8
    for name, exponent, value in (("force", -0.5, 2.0), ("mass", 0.5, 1.5), ("way", 0.5, 3.0)):
        expected = exponent * optimum.final_time / value
        assert found.objective[name] == pytest.approx(expected, rel=1e-7)
        assert found.free["final_time", name] == pytest.approx(expected, rel=1e-6)


def test_the_motion_of_a_mass_changes_as_its_formula():
    optimum = optimize(Carried, elements=24)
    found = sensitivities(optimum, ["force", "way"])
    half = optimum.final_time / 2
    early, late = np.linspace(0.05, 0.95, 7) * half, half * np.linspace(1.05, 1.95, 7)
    # speeding up: x = F t^2 / (2 m); slowing down: x = way - F (T - t)^2 / (2 m), with T' = T / (2 way)
    np.testing.assert_allclose(found.signal("body.x", "force")(early), early**2 / 3.0, rtol=1e-6)
    np.testing.assert_allclose(found.signal("body.v", "force")(early), early / 1.5, rtol=1e-6)
    np.testing.assert_allclose(found.signal("body.x", "way")(early), 0.0, atol=1e-6)
    left = optimum.final_time - late
    expected = 1.0 - 2.0 / 1.5 * left * optimum.final_time / 6.0
    np.testing.assert_allclose(found.signal("body.x", "way")(late), expected, atol=1e-6)
    assert found.signal("body.v", "force")(0.3) == pytest.approx(0.2, rel=1e-6)


def test_a_force_that_switches_on_a_border_binds_weakly_there():
    optimum = optimize(Carried, elements=24)
    found = sensitivities(optimum, ["way"])
    assert not found.defined
    assert "different derivatives to both sides" in found.report()
    inside = sensitivities(optimize(Carried, elements=25), ["way"])
    assert inside.defined
    assert inside.weak == ()


def test_vectors_are_parameters_too():
    optimum = optimize(Ended)
    found = sensitivities(optimum, ["end"])
    assert found.parameters == ("end[0]", "end[1]")
    step = 1e-3  # the cost is quadratic in the end: central differences are exact
    for k, name in enumerate(found.parameters):
        ends = np.tile([4.0, -2.0], (2, 1))
        ends[:, k] += (step, -step)
        above, below = (prepare(Ended, parameters=["end"]).solve({"end": end}) for end in ends)
        slope = (above.objective - below.objective) / (2 * step)
        assert found.objective[name] == pytest.approx(slope, rel=1e-6)
        assert found.objective["end"][k] == found.objective[name]
        times = np.linspace(0.0, 3.0, 11)
        moved = (above.signal("mass.u")(times) - below.signal("mass.u")(times)) / (2 * step)
        np.testing.assert_allclose(found.signal("mass.u", "end")(times)[:, k], moved, atol=1e-5)
    assert found.signal("mass.x", "end")(1.0).shape == (2,)
    np.testing.assert_allclose(found.signal("mass.x", "end")(3.0), [1.0, 0.0], atol=1e-9)
    predicted = found.predict({"end": [5.0, -1.0]})
    solved = prepare(Ended, parameters=["end"]).solve({"end": [5.0, -1.0]})
    np.testing.assert_allclose(predicted["mass.u"], solved["mass.u"], atol=1e-6)  # linear in the end


@pytest.mark.parametrize(("name", "step"), [(PLATE, 0.01), (VISCOUS, 0.2), ("weight", 1e-6)])
def test_the_motion_of_the_robot_changes_as_when_solved_again(gantry, derivatives, name, step):
    prepared, optimum = gantry
    value = dict(zip([n.name for n in optimum.program.problem.free], optimum.solution.w, strict=False))[name]
    above, below = (again(prepared, optimum, name, value + d) for d in (step, -step))
    slope = (above.objective - below.objective) / (2 * step)
    # central differences of these steps are good to about 3e-5, limits start and cease to bind between
    assert derivatives.objective[name] == pytest.approx(slope, rel=1e-4)
    slope = (above.final_time - below.final_time) / (2 * step)
    assert derivatives.free["final_time", name] == pytest.approx(slope, rel=1e-4)
    times = np.linspace(0.11, 0.87, 9) * optimum.final_time  # between borders of elements
    for signal in ("robot.tool.r", "robot.tool.v"):
        slope = (above.signal(signal)(times) - below.signal(signal)(times)) / (2 * step)
        found = derivatives.signal(signal, name)(times)
        assert found.shape == (9, 3)
        np.testing.assert_allclose(found, slope, atol=2e-4 * np.max(np.abs(slope)))


def test_the_fastest_motion_of_the_robot():
    """Along the line, where it is one motion: off it, many branches lie within 1e-4 s of each other."""
    binding = "robot.carts[2].law.f_v"  # of the cart whose torque decides
    prepared = prepare(OnLine, parameters=[PLATE, binding], tolerance=1e-11)
    optimum = prepared.solve()
    found = sensitivities(optimum)
    for name, value, step in ((PLATE, 9.13, 0.02), (binding, 388.77, 0.1)):
        above, below = (again(prepared, optimum, name, value + d) for d in (step, -step))
        slope = (above.final_time - below.final_time) / (2 * step)
        assert found.objective[name] == pytest.approx(slope, rel=1e-6)
        assert slope > 0


def test_parameters_not_named_before_give_the_same_numbers(derivatives):
    fresh = optimize(FreePath(weight=0.01), elements=30, tolerance=1e-12)
    found = sensitivities(fresh, [PLATE, VISCOUS, "weight"])
    for name in found.parameters:
        assert found.objective[name] == pytest.approx(derivatives.objective[name], rel=1e-5)
    assert found.optimum.iterations == fresh.iterations  # carried over, not solved again
    assert found.optimum.objective == pytest.approx(fresh.objective, rel=1e-12)


def test_a_prediction_misses_by_the_square_of_the_change(gantry, derivatives):
    prepared, optimum = gantry
    errors = []
    for change in (0.4, 0.2):
        predicted = derivatives.predict({PLATE: 9.13 + change})
        solved = again(prepared, optimum, PLATE, 9.13 + change)
        errors.append(abs(predicted.objective - solved.objective))
        assert not predicted.success
        assert predicted.status == "predicted to first order, not solved"
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.2)
    guessed = prepared.solve({PLATE: 9.53, "weight": 0.01}, guess=derivatives.predict({PLATE: 9.53}))
    assert guessed.objective == pytest.approx(again(prepared, optimum, PLATE, 9.53).objective, rel=1e-7)


def test_a_report_ranks_parameters(derivatives):
    lines = derivatives.report().splitlines()
    assert "1 % more" in lines[0]
    assert lines[1].startswith("  weight = 0.01: objective +0.0054")


def test_phases():
    class There(Optimization):
        mass: Any = Mass(x=Fixed(0.0), v=Fixed(0.0), u=dict(min=-1.0, max=1.0))
        final_time: Any = Free(2.0, unit="s", min=0.1)

    class Back(Optimization):
        mass: Any = Mass(u=dict(min=-1.0, max=1.0))
        start_time: Any = Free(2.0, unit="s")
        final_time: Any = Free(4.0, unit="s")

    class ThereAndBack(Optimization):
        way = Parameter(1.0, unit="m", description="distance")
        one = There()
        two = Back()

        def objective(self):
            return self.two.final_time

        def constraints(self):
            yield link(self.one, self.two)
            yield final(self.one.mass.x) == self.way
            yield final(self.one.mass.v) == 0
            yield final(self.two.mass.x) == 0
            yield final(self.two.mass.v) == 0

    optimum = optimize(ThereAndBack, elements=9)
    found = sensitivities(optimum, ["way"])
    # both ways take 2 sqrt(way)
    assert found.objective["way"] == pytest.approx(optimum.objective / 2, rel=1e-6)
    assert found.free["one.final_time", "way"] == pytest.approx(optimum.objective / 4, rel=1e-5)
    assert found.signal("two.mass.x", "way")(optimum.objective / 2 + 0.2) == pytest.approx(
        1 + 0.2 * optimum.objective / 4, rel=1e-5
    )  # x = way - (t - 2 sqrt(way))^2 / 2


def test_a_limit_of_an_input_that_is_a_parameter():
    class Pushed(Optimization):
        top = Parameter(1.0, unit="m/s2", description="largest acceleration")
        mass: Any = Mass(x=Fixed(0.0), v=Fixed(0.0), u=dict(min=-1.0, max=top))
        final_time: Any = Free(1.0, unit="s", min=0.1, max=100.0, description="duration")

        def objective(self):
            return self.final_time

        def constraints(self):
            yield final(self.mass.x) == 1
            yield final(self.mass.v) == 0

    # a bound of an unknown becomes a row of its own: solved again from where it stands
    found = sensitivities(optimize(Pushed, elements=25), ["top"])
    step = 1e-3
    above, below = (
        prepare(Pushed, parameters=["top"], elements=25).solve({"top": 1 + d}).objective
        for d in (step, -step)
    )
    assert found.objective["top"] == pytest.approx((above - below) / (2 * step), rel=1e-5)


def test_borders_of_elements_may_move():
    prepared = prepare(Carried, parameters=["way"], elements=2, lengths="free")
    optimum = prepared.solve()
    found = sensitivities(optimum)
    assert found.objective["way"] == pytest.approx(optimum.final_time / 6, rel=1e-6)
    # x(t) = way X(t / T) on any mesh, with T ~ sqrt(way); x' = v at the collocation points
    times = optimum.time[[1, 2, 4, 5]]
    expected = (optimum.signal("body.x")(times) - times * optimum.signal("body.v")(times) / 2) / 3.0
    np.testing.assert_allclose(found.signal("body.x", "way")(times), expected, atol=1e-5)


def test_what_cannot_be_asked_is_said():
    optimum = prepare(Carried, parameters=["way"], elements=5).solve()
    with pytest.raises(ModelError, match="has no variable or parameter 'forse'; did you mean 'force'"):
        sensitivities(optimum, ["forse"])
    with pytest.raises(ModelError, match=r"body\.x is no parameter, expected one; declare it as a Parameter"):
        sensitivities(optimum, ["body.x"])
    with pytest.raises(ModelError, match="final_time is chosen by the optimiser, expected a parameter"):
        sensitivities(optimum, ["final_time"])
    with pytest.raises(ModelError, match=r"found the text 'force', expected a list of names"):
        sensitivities(optimum, "force")
    with pytest.raises(ModelError, match=r"no parameters are named, expected some; name them in sens"):
        sensitivities(optimize(Carried, elements=5))
    found = sensitivities(optimum)
    with pytest.raises(ModelError, match=r"force is not among the parameters way of these sensitivities"):
        found.signal("body.x", "force")
    with pytest.raises(ModelError, match=r"predict way: found nan, expected 1 finite numbers"):
        found.predict({"way": np.nan})
    with pytest.raises(SolveError) as caught:
        optimize(Carried, elements=5, max_iterations=2)
    with pytest.raises(ModelError, match="iteration limit reached; sensitivities are those of a solution"):
        sensitivities(caught.value.optimum, ["way"])


@pytest.mark.parametrize("limit", ["number", "constraint"])
def test_a_limit_of_a_free_number_that_is_a_parameter(limit):
    class Largest(Optimization):
        top = Parameter(2.0, unit="1", description="largest value")
        least = Parameter(2.0, unit="1", description="not used")
        q: Any = Free(0.5, unit="1", min=0.0, max=top if limit == "number" else None, description="where")

        def objective(self):
            return -self.q

        def constraints(self):
            if limit == "constraint":
                yield self.q <= self.top

    optimum = optimize(Largest)
    assert sensitivities(optimum, ["least"]).objective["least"] == 0.0
    if limit == "constraint":
        assert sensitivities(optimum, ["top"]).objective["top"] == pytest.approx(-1.0, rel=1e-6)
        return
    with pytest.raises(ModelError, match=r"a limit of q follows from top, .*write the limit of q in"):
        sensitivities(optimum, ["top"])
