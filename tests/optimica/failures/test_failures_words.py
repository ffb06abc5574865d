"""What is said of values that are not finite, motions that run away, and conditions that depend on each other."""

import re
from dataclasses import replace
from typing import Any

import pytest

from gantrytau import (
    Bounds,
    Fixed,
    GantryTauError,
    Input,
    Model,
    ModelError,
    Parameter,
    Real,
    Start,
    der,
    log,
    sqrt,
)
from gantrytau_optimica import Free, Optimization, at, final, initial, optimize
from gantrytau_optimica.solving.ipopt import WORDS
from tests.optimica.problems import FastestMass, Mass


def said(problem: Any, **policy: Any) -> str:
    """What optimize says when it fails."""
    with pytest.raises(GantryTauError) as caught:
        optimize(problem, **policy)
    return str(caught.value)


class Root(Model):
    x = Real(start=1.0, fixed=True, description="level")
    u = Input(min=-1.0, max=1.0, description="supply")

    def equations(self):
        yield der(self.x) == self.u - sqrt(self.x)


class Empty(Optimization):
    """Empty a tank."""

    root: Any = Root()
    final_time = 4.0

    def integrand(self):
        return self.root.u**2

    def constraints(self):
        yield final(self.root.x) == 0.1


def test_the_root_of_a_negative_guess():
    text = said(Empty, guess={"root.x": -1.0})
    assert text.startswith("Empty: not begun: an expression is not finite at the first guess")
    assert "the equation of der(root.x) (root (Root), equation 1) is not finite at t = " in text
    assert "because of the square root of `root.x` = -1" in text
    assert "Guess root.x differently" in text


def test_a_root_that_is_infinitely_steep():
    text = said(Empty, guess={"root.x": 0.0})
    assert "its derivative with respect to root.x is not finite at t = " in text
    assert "the square root of `root.x` = 0, infinitely steep there" in text


def test_a_motion_that_leads_where_the_model_ends():
    class Beyond(Empty):
        def constraints(self):
            yield final(self.root.x) <= -0.5

    text = said(Beyond, elements=10)
    assert "root (Root), equation 1" in text or "`final(root.x) <= -0.5` is off by 0.5" in text


def test_a_division_by_zero_names_the_equation_and_the_variable():
    class Lever(Model):
        x = Real(start=1.0, description="way")
        y = Real(description="force")
        u = Input(description="power")

        def equations(self):
            yield der(self.x) == self.y
            yield self.y * (self.x - 2) == self.u

    class Push(Optimization):
        lever = Lever()
        final_time = 1.0

        def integrand(self):
            return self.lever.u**2

    text = said(Push, guess={"lever.x": 2.0})
    assert "the equation of lever.y (lever (Lever), equation 2) is not finite" in text
    assert "because of the division by `lever.x-2` = 0, where lever.x = 2" in text.replace(" - ", "-")
    assert "Guess lever.x differently" in text


@pytest.mark.parametrize("where", ["integrand", "objective", "constraint"])
def test_a_logarithm_of_zero(where: str):
    class Logarithm(FastestMass):
        mass = Mass(u=Bounds(-1, 1))
        final_time = 1.0
        metre = Parameter(1.0, unit="m", description="one metre")

        def integrand(self):
            return log(self.mass.x) if where == "integrand" else 0.0

        def objective(self):
            return log(final(self.mass.x)) if where == "objective" else 0.0

        def constraints(self):
            yield initial(self.mass.x) == 0
            if where == "constraint":
                yield log(final(self.mass.x) / self.metre) >= 0

    text = said(Logarithm)
    names = {
        "integrand": "the integrand",
        "objective": "the objective",
        "constraint": "`log((final(mass.x)/metre)) >= 0`",
    }
    assert f"{names[where]} is not finite" in text
    assert re.search(r"because of the logarithm of `(final\()?mass\.x\)?` = 0", text)
    assert "Guess mass.x differently" in text


def test_a_guess_at_a_limit_is_moved_inside_and_is_no_fault():
    class Bounded(Empty):
        root = Root(x=dict(min=0.0))

    text = said(Bounded, guess={"root.x": 0.0}, max_iterations=1)
    assert "Bounded: iteration limit reached" in text  # and not: not begun


def test_a_force_without_limit():
    class Throw(Optimization):
        mass: Any = Mass(x=Fixed(0.0), v=Fixed(0.0))
        final_time: Any = 1.0

        def objective(self):
            return -final(self.mass.x)

    text = said(Throw, max_iterations=300)
    assert f"Throw: {WORDS['Diverging_Iterates']} after" in text
    first = text.splitlines()[2]
    assert re.match(r"  mass\.u went from 0 to .* m/s2 at t = .*, without an upper limit", first)
    assert "Limit mass.u or what it moves" in text


def test_a_duration_without_limit():
    class Wait(Optimization):
        mass: Any = Mass(x=Fixed(0.0), v=Fixed(0.0), u=Bounds(-1, 1))
        final_time = Free(1.0, unit="s", min=0.1, description="duration")

        def objective(self):
            return -final(self.mass.x)

    text = said(Wait, max_iterations=1000)
    assert "final_time went from 1 to" in text.splitlines()[2]
    assert "s, without an upper limit" in text.splitlines()[2]
    assert "mass.u" not in text.split("At their limits")[0]


def test_an_objective_that_nothing_changes():
    class Any3(FastestMass):
        final_time = 3.0

        def objective(self):
            return 0.0

    remark = "The objective depends on nothing that is free"
    assert remark in optimize(Any3).report()
    assert remark not in optimize(FastestMass).report()


def test_too_many_conditions_are_named():
    class Many(FastestMass):
        def constraints(self):
            yield from super().constraints()
            yield self.mass.x == 1 - self.mass.x
            yield self.mass.u**2 == 1

    with pytest.raises(ModelError) as caught:
        optimize(Many)
    text = str(caught.value)
    assert "454 conditions for 302 unknowns" in text
    assert "`initial(mass.x) == 0` is decided already by the model with mass.x held by its limits" in text
    assert "`sq(mass.u) == 1` is decided already by" in text


def test_conditions_that_depend_on_each_other_are_named():
    class Repeated(FastestMass):
        final_time = 3.0

        def objective(self):
            return 0.0

        def constraints(self):
            yield from super().constraints()
            yield final(self.mass.x) - initial(self.mass.x) == 2

    text = said(Repeated)
    assert "Depending on each other:" in text
    assert "is decided already by `initial(mass.x) == 0` and `final(mass.x) == 1`" in text


def test_an_iteration_limit_says_what_is_still_missing():
    text = said(FastestMass, max_iterations=4)
    assert "Not met, the worst first:" in text
    assert "the motion of mass.x is off by" in text
    assert "The objective could still change by about 1 where final_time changes by 1 s; 0 would be" in text


def test_no_message_names_a_row_or_the_solver():
    for problem, policy in ((Empty, dict(guess={"root.x": -1.0})), (FastestMass, dict(max_iterations=3))):
        text = said(problem, **policy)
        assert not re.search(r"\brow\b|\bg\[|\bx\[\d|nan|NaN|dual|Jacobian|Hessian", text)


def test_a_start_value_of_the_model_can_be_at_fault():
    class Started(Empty):
        root = Root(x=Start(-2.0))

        def constraints(self):
            yield initial(self.root.x) >= -5

    text = said(Started)
    assert "root" in text


def test_a_solver_stuck_where_a_root_ends():
    class Held(Empty):
        """Empty for most of the time, where the outflow is infinitely steep."""

        root = Root(x=dict(min=0.0))

        def constraints(self):
            yield at(2.0, self.root.x) == 0.0

    text = said(Held)
    assert "infinitely steep there" in text
    assert "root (Root), equation 1" in text


def test_a_lower_accuracy_is_told_with_what_was_reached():
    found = optimize(FastestMass)
    lower = replace(found, solution=replace(found.solution, status=WORDS["Solved_To_Acceptable_Level"]))
    assert "FastestMass: solved to a lower accuracy than asked for after" in lower.report()
    assert "Conditions are met within" in lower.report()
    assert "0 would be an optimum" in lower.report()
    assert "0 would be an optimum" not in found.report()
