"""What a problem that is written wrongly, or that has no solution, gets."""

import math
import signal
from typing import Any

import numpy as np
import pytest

from gantrytau import Input, Model, ModelError, Real, SolveError, between, der
from gantrytau_optimica import Free, Optimization, Samples, at, final, initial, optimize
from tests.optimica.problems import BoundedOscillator, FastestMass, Mass


def problem(body):
    """The fastest motion of a mass with more constraints: `body(problem)` gives them."""

    class Problem(FastestMass):
        def constraints(self):
            yield from super().constraints()
            yield from body(self)

    return Problem


def message(wrong, **policy) -> str:
    """What optimize says."""
    with pytest.raises(ModelError) as caught:
        optimize(wrong, **policy)
    return str(caught.value)


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (lambda p: [True], "Problem, constraint 5: found True, expected a constraint; both sides were"),
        (lambda p: [None], "Problem, constraint 5: found None, expected a constraint"),
        (lambda p: [[p.mass.x, p.mass.v]], "joined by casadi.vertcat(*list)"),
        (lambda p: [p.mass], "expected a constraint; write `a == b`"),
        (lambda p: [p.mass.x], "found `mass.x`, expected `a == b`, `a <= b` or between(a, x, b)"),
        (lambda p: [p.mass.x != 1], "found `(mass.x!=1)`, expected"),
        (lambda p: [0 <= p.mass.x <= 1], "Problem, constraint 5: Cannot compute the truth value of a"),
        (lambda p: [p.mass.speed <= 1], "Problem, constraint 5: Mass has no 'speed'"),
        (lambda p: [between(2, p.mass.v, 1)], "`2 <= mass.v <= 1` has the limits 2 and 1, expected a lower"),
        (lambda p: [p.mass.v <= math.nan], "has a limit that is not a number"),
        (lambda p: [between([1, 2], p.mass.x, 3)], "a limit has shape (2, 1), the expression (1, 1)"),
        (lambda p: [p.mass.v <= -1, p.mass.v >= 1], "`mass.v >= 1` and `mass.v <= -1` contradict each"),
        (lambda p: [p.mass.u >= 3], "`mass.u >= 3` and `limits of mass.u` contradict each other"),
        (lambda p: [initial(p.mass.x) == 1], "`initial(mass.x) == 1` contradicts other conditions at the"),
        (lambda p: [final(p.mass.x) == final(p.mass.v)], "constraint 5: units disagree"),
        (lambda p: [p.mass.x <= p.mass.v], "the left side is in 'm', the right side in 'm/s'"),
        (lambda p: [p.mass.x + p.mass.v <= 1], "`mass.x` is in 'm', `mass.v` in 'm/s'"),
        (lambda p: [at(p.mass.x, p.mass.v) == 0], "at(mass.x, ...) depends on mass.x, expected a time of"),
        (lambda p: [at(2 * p.final_time, p.mass.x) == 0], "of its length; choose a time inside of it"),
        (lambda p: [initial(final(p.mass.x)) == 0], "found final(mass.x), which has its time already"),
        (lambda p: [final("x") == 0], "constraint 5: final: found str, expected a variable"),
        (lambda p: [p.mass.x <= final(p.mass.x)], "mixes a signal over the whole path with its value at"),
        (lambda p: [p.mass.x == 1 - p.mass.x, p.mass.u**2 == 1], "conditions for"),
    ],
)
def test_a_constraint_that_cannot_be(body, words):
    assert words in message(problem(body))


@pytest.mark.parametrize(
    ("members", "words"),
    [
        (dict(objective=lambda p: p.mass.x), "depends on mass.x, which changes over time; say at which"),
        (dict(objective=lambda p: None), ".objective: found None, expected a number or an expression"),
        (dict(objective=lambda p: "time"), ".objective: found 'time', expected"),
        (dict(objective=lambda p: [p.final_time, 1]), ".objective: found ["),
        (dict(objective=lambda p: p.mass.energy), ".objective: Mass has no 'energy'"),
        (dict(integrand=lambda p: 1 / 0), ".integrand: division by zero"),
        (dict(constraints=lambda p: None), ".constraints: found None, expected constraints; give each out"),
        (dict(constraint=lambda p: []), "nothing asks for a method of this name; did you mean"),
        (dict(final_time="soon"), ".final_time: found 'soon', expected a number in s"),
        (dict(final_time=[1.0, 2.0]), ".final_time: found"),
        (dict(final_time=0.0), "start_time 0 s and final_time 0 s, expected the first to be the smaller"),
        (dict(final_time=Free(1.0, unit="m")), ".final_time: units disagree"),
        (dict(final_time=Free(1.0, unit="s", min=3, max=2)), "final_time: limits 3 and 2 cross"),
        (dict(given=("mass.z",)), "'mass.z'; did you mean 'mass.x'"),
        (dict(given="mass.u"), "write ['mass.u']"),
    ],
)
def test_a_member_that_cannot_be(members: dict[str, Any], words: str):
    wrong = type("Wrong", (FastestMass,), {"objective": lambda p: 0.0, "integrand": lambda p: 0.0, **members})
    assert words in message(wrong)


@pytest.mark.parametrize(
    ("guess", "words"),
    [
        ({"mass.y": 1.0}, "'mass.y'; did you mean 'mass.x'?"),
        ({"mass.x": [1.0, 2.0]}, "guess mass.x: found 2 values, expected 1"),
        ({"mass.x": math.nan}, "guess mass.x: found values that are not finite"),
        ({"mass.x": lambda t: [t, t]}, "guess mass.x: found 2 values, expected 1"),
        ({"mass.x": "far"}, "guess mass.x: found 'far', expected a number and its unit"),
        ({"mass.x": lambda t: 1 / 0}, "guess mass.x: ZeroDivisionError"),
        ({"final_time": math.nan}, "guess final_time: found nan, expected a finite number"),
        ({"final_time": "long"}, "guess final_time: found 'long', expected a number"),
        ({"final_time": -3.0}, "expected the first to be the smaller"),
        (3.0, "found guess=3.0, expected {name:"),
    ],
)
def test_a_guess_that_cannot_be(guess, words):
    assert words in message(FastestMass, guess=guess)


def test_a_guess_from_another_model():
    other = optimize(BoundedOscillator, elements=5)
    assert "the given solution has no variable of the problem, as" in message(FastestMass, guess=other)


def test_what_is_no_problem():
    for wrong in (Mass, Mass(), 3, "FastestMass"):
        assert "expected a subclass of Optimization or an instance of it" in message(wrong)


def test_points_outside_of_a_problem():
    with pytest.raises(ModelError, match="initial was used outside of an optimisation problem"):
        initial(3.0)


def test_a_time_outside_of_a_fixed_horizon():
    for late in (2.5, -0.1):

        class Late(Optimization):
            mass = Mass()
            final_time = 2.0

            def constraints(self, late=late):
                yield at(late, self.mass.x) == 0

        assert f"at({late}, ...): lies outside of the horizon" in message(Late)


def test_a_time_that_only_the_guess_leaves_outside_names_the_guess():
    class Late(FastestMass):
        final_time = Free(1.0, unit="s", min=0.1)

        def constraints(self):
            yield from super().constraints()
            yield at(1.5, self.mass.x) >= 0.5

    assert "at 1.5 of its length with the guess final_time = 1; guess it so" in message(Late)


def test_nothing_to_choose():
    class Empty(Optimization):
        """Nothing at all."""

    assert "nothing is free; declare a Free number or an Input" in message(Empty)


def test_the_rate_of_an_input_that_is_known_from_samples():
    class Geared(Model):
        u = Input(unit="m", description="hand")
        v = Real(unit="m/s", description="its speed")
        x = Real(unit="m", start=0.0, fixed=True, description="what follows")
        k = Free(1.0, unit="1", description="how well")

        def equations(self):
            yield self.v == der(self.u)
            yield der(self.x) == self.k * self.v

    class Problem(Optimization):
        geared = Geared()
        inputs = {"geared.u": Samples([0.0, 1.0], [0.0, 1.0])}

        def objective(self):
            return (final(self.geared.x) - 1) ** 2

    assert "needs the derivative of the input geared.u, of which there are samples only" in message(Problem)


def test_limits_that_contradict_each_other_are_named():
    with pytest.raises(SolveError) as caught:
        optimize(problem(lambda p: [final(p.mass.x) >= 5]))
    error = caught.value
    assert "no solution: the limits contradict each other" in str(error)
    assert "`final(mass.x) >= 5` is off by" in str(error)
    assert "`final(mass.x) == 1` is off by" in str(error)
    assert error.optimum is not None
    assert not error.optimum.success
    assert np.all(np.isfinite(error.optimum["mass.x"]))


def test_limits_that_leave_too_little_time_are_named_with_their_times():
    class Hasty(FastestMass):
        final_time = 1.9  # 2 s are needed

        def objective(self):
            return 0.0

    with pytest.raises(SolveError) as caught:
        optimize(Hasty)
    assert "mass.u at its upper limit 1 from t = " in str(caught.value)
    assert "mass.u at its lower limit -1 from t = " in str(caught.value)


def test_an_iteration_limit():
    with pytest.raises(SolveError, match="iteration limit reached after 2 iterations") as caught:
        optimize(FastestMass, max_iterations=2)
    assert "Allow more with max_iterations=" in str(caught.value)
    assert caught.value.optimum.status == "iteration limit reached"


def test_ctrl_c_stops_with_what_was_found():
    before = signal.getsignal(signal.SIGINT)

    def press(iteration: int, objective: float) -> None:
        if iteration == 3:
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(SolveError, match="FastestMass: interrupted after") as caught:
        optimize(FastestMass, progress=press)
    assert caught.value.optimum.status == "interrupted"
    assert caught.value.optimum["mass.x"].shape == (151,)
    assert signal.getsignal(signal.SIGINT) is before


def test_progress_is_reported_and_its_errors_are_not_swallowed():
    seen: list[int] = []
    optimum = optimize(FastestMass, progress=lambda iteration, objective: seen.append(iteration))
    assert seen == list(range(1, len(seen) + 1))
    assert abs(len(seen) - optimum.iterations) <= 1

    def broken(iteration: int, objective: float) -> None:
        raise LookupError("no screen")

    with pytest.raises(LookupError, match="no screen"):
        optimize(FastestMass, progress=broken)
