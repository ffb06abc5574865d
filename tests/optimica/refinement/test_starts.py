"""`starts=`: several first guesses, and the branches to which they lead."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import minimize

from gantrytau import Input, Model, Parameter, Real, SolveError, der, sin
from gantrytau.ensembles import parallel_map as parts
from gantrytau_optimica import Free, Optimization, final, optimize
from gantrytau_optimica.refinement import attempts
from gantrytau_optimica.refinement.branches import PASSES, SolutionBranch, ranked
from tests.optimica.control.test_controls import Effort, best_pieces
from tests.optimica.control.test_phases import ThereAndBack
from tests.optimica.problems import FastestMass


class Point(Model):
    """A point in the plane, moved by its velocity."""

    r = Real(2, unit="m", start=0.0, fixed=True, description="place")
    v = Input(2, unit="m/s", min=-3.0, max=3.0, description="velocity")

    def equations(self):
        yield der(self.r) == self.v


class Around(Optimization):
    """2 m in 1 s around a disc with least effort: the square of the length of a string around it."""

    point = Point()
    height = Parameter(0.2, unit="m", description="centre of the disc above the straight line")
    radius = Parameter(0.5, unit="m", description="of the disc")
    meter = Parameter(1.0, unit="m", description="one metre")

    def integrand(self):
        return (self.point.v[0] ** 2 + self.point.v[1] ** 2) / self.meter**2

    def constraints(self):
        x, y = self.point.r[0], self.point.r[1]
        yield final(self.point.r) == [2, 0]
        yield (x - self.meter) ** 2 + (y - self.height) ** 2 >= self.radius**2


def string(below: bool, height=0.2, radius=0.5) -> float:
    """Length of a string from (0, 0) to (2, 0) around a disc at (1, height): two tangents and an arc."""
    away = np.hypot(1.0, height)
    towards = np.arctan2(height, 1.0)  # direction of the centre above the straight line
    tangent = np.arcsin(radius / away) - (towards if below else -towards)
    return float(2 * np.sqrt(away**2 - radius**2) + 2 * tangent * radius)


@pytest.fixture(scope="module")
def around():
    return optimize(Around, elements=20, starts=10)


def test_both_ways_around_a_disc_are_found(around):
    assert string(True) == pytest.approx(np.sqrt(4.37925), abs=1e-3)
    branches = around.search.branches
    assert len(branches) == 2
    # a mesh of 20 may cut the corners of the arc a little
    assert branches[0].objective == pytest.approx(string(True) ** 2, rel=1e-3)
    assert branches[1].objective == pytest.approx(string(False) ** 2, rel=1e-3)
    assert around.objective == pytest.approx(branches[0].objective, rel=1e-6)
    sides = [branch.optimum.signal("point.r[1]")(0.5) for branch in branches]
    assert sides[0] == pytest.approx(-0.3, abs=1e-3)
    assert sides[1] == pytest.approx(0.7, abs=1e-3)


def test_branches_and_failures_add_up(around):
    search = around.search
    assert search.starts == 10
    assert sum(branch.count for branch in search.branches) + search.failures == 10
    assert [b.objective for b in search.branches] == sorted(b.objective for b in search.branches)
    text = around.report()
    assert f"10 first guesses led to 2 branches, {search.failures} to no solution:" in text
    rows = [line.split() for line in text.splitlines()]
    for number, branch in enumerate(search.branches, 1):
        row = next(r for r in rows if r[:2] == [str(number), f"{branch.objective:.8g}"])
        assert row[2:4] == [str(branch.count), "yes"]


def test_a_search_leaves_a_worse_guess():
    above = {"point.r": lambda t: [2 * t, 3 * t * (1 - t)], "point.v": lambda t: [2.0, 3 - 6 * t]}
    alone = optimize(Around, elements=20, guess=above)
    assert alone.objective == pytest.approx(string(False) ** 2, rel=1e-3)
    assert alone.search is None
    searched = optimize(Around, elements=20, guess=above, starts=20)
    assert searched.objective == pytest.approx(string(True) ** 2, rel=1e-3)
    assert sum(b.count for b in searched.search.branches) + searched.search.failures == 20


def test_a_search_on_a_coarser_mesh_ends_on_the_mesh_asked_for():
    optimum = optimize(Around, elements=40, starts=8)
    assert optimum.breaks.size == 39
    assert optimum.objective == pytest.approx(string(True) ** 2, rel=5e-4)
    assert all(branch.whole and branch.optimum.breaks.size == 39 for branch in optimum.search.branches)


def test_a_search_may_be_refined():
    optimum = optimize(Around, elements=20, starts=4, refine=1e-5)
    assert optimum.refinement.reached
    assert optimum.search.starts == 4
    assert optimum.objective == pytest.approx(string(True) ** 2, rel=2e-5)
    assert "4 first guesses led to" in optimum.report()


def test_words_say_on_which_side_a_branch_passes(around):
    below, above = around.search.branches
    assert below.words == "point.r passes 0.3 m beside the straight line, towards -point.r[1]"
    assert above.words == "point.r passes 0.7 m beside the straight line, towards +point.r[1]"
    assert below.holds
    assert above.holds
    # the arc is cut between the points by less than 1e-3 of the radius
    assert max(below.passed, above.passed) < 1e-3


def test_branches_with_the_same_objective_are_told_apart_by_their_sides():
    optimum = optimize(Around(height=0.0), elements=20, starts=6)
    one, other = optimum.search.branches
    assert one.objective == pytest.approx(other.objective, rel=1e-6)
    # a mesh of 20 may cut the corners of the arc a little
    assert one.objective == pytest.approx(string(True, height=0.0) ** 2, rel=1e-3)
    sides = {branch.words.split()[-1] for branch in (one, other)}
    assert sides == {"-point.r[1]", "+point.r[1]"}
    assert one.count + other.count + optimum.search.failures == 6


def test_a_branch_that_cheats_between_points_is_ranked_after_one_that_holds():
    """On 3 elements a motion below cuts through the disc between two points; on 20 one above it does not."""
    above = {"point.r": lambda t: [2 * t, 3 * t * (1 - t)], "point.v": lambda t: [2.0, 3 - 6 * t]}
    disc = Around(height=0.1, radius=0.3)
    cheat, honest = optimize(disc, elements=3), optimize(disc, elements=20, guess=above)
    assert cheat.objective < honest.objective
    found = [SolutionBranch(optimum.objective, 1, optimum) for optimum in (cheat, honest)]
    best, second = ranked(found)
    assert best.optimum is honest
    assert (best.holds, second.holds) == (True, False)
    assert second.passed > PASSES > best.passed


def test_a_guess_that_fails_is_counted_and_the_others_go_on(monkeypatch):
    solve = attempts.Attempts._once
    calls = []

    def second_fails(self, solver, first):
        calls.append(first)
        found, program = solve(self, solver, first)
        return (
            (replace(found, success=False, status="stuck"), program) if len(calls) == 2 else (found, program)
        )

    monkeypatch.setattr(attempts.Attempts, "_once", second_fails)
    search = optimize(Around, elements=20, starts=5).search
    assert search.failures == 1
    assert sum(branch.count for branch in search.branches) == 4
    assert "5 first guesses led to 2 branches, 1 to no solution:" in str(search)


class Pendulum(Model):
    """A pendulum with a weak motor: it has to swing before it stands upright."""

    phi = Real(unit="rad", start=0.0, fixed=True, description="angle, 0 hanging")
    w = Real(unit="rad/s", start=0.0, fixed=True, description="angular velocity")
    u = Input(unit="rad/s2", min=-0.6, max=0.6, description="torque by inertia, gravity being 1")
    stiffness = Parameter(1.0, unit="1/s2", description="gravity by length")

    def equations(self):
        yield der(self.phi) == self.w
        yield der(self.w) == self.u - self.stiffness * sin(self.phi)


class SwingUp(Optimization):
    """As fast as possible upright, on either side."""

    pendulum = Pendulum()
    final_time = Free(6.0, unit="s", min=1.0, max=40.0, description="duration")

    def objective(self):
        return self.final_time

    def constraints(self):
        yield final(self.pendulum.phi) == np.pi
        yield final(self.pendulum.w) == 0


def swing_up_time(limit: float) -> float:
    """Least time in s of one swing back and one up: three arcs of constant torque, -, +, -, the first of which is varied.

    The others follow from the energy: w^2 / 2 = cos(phi) + u phi + c on each of them, and the last ends upright at rest.
    """

    def arc(torque, start, span, backwards=1.0, until=None):
        def there(_, x):
            return x[0] - until if until is not None else 1.0

        there.terminal = True  # pyright: ignore[reportFunctionMemberAccess]

        def rate(_, x):
            return [backwards * x[1], backwards * (torque - np.sin(x[0]))]

        return solve_ivp(rate, (0.0, span), start, events=there, rtol=1e-10, atol=1e-10)

    def total(first):
        phi, w = arc(-limit, [0.0, 0.0], first).y[:, -1]
        change = (1 + limit * np.pi - (w**2 / 2 - np.cos(phi) - limit * phi)) / (2 * limit)
        rise = arc(limit, [phi, w], 20.0, until=change)
        last = arc(-limit, [np.pi - 1e-12, 0.0], 20.0, backwards=-1.0, until=change)
        return first + rise.t[-1] + last.t[-1]

    return float(minimize(lambda first: total(first[0]), [1.7], method="Nelder-Mead").fun)


@pytest.fixture(scope="module")
def swings():
    return optimize(SwingUp, elements=50, starts=8, refine=1e-5)


def test_a_pendulum_is_swung_up_in_the_least_time(swings):
    assert swings.refinement.reached
    # ten times the accuracy that was asked for
    assert swings.final_time == pytest.approx(swing_up_time(0.6), rel=1e-4)
    search = swings.search
    assert sum(branch.count for branch in search.branches) + search.failures == 8


@pytest.mark.parametrize("guessed", [2.0, 6.0, 20.0])
def test_a_search_is_never_worse_than_the_single_start(guessed):
    guess = {"final_time": guessed}
    try:
        alone = optimize(SwingUp, elements=30, guess=guess).objective
    except SolveError:
        alone = np.inf
    searched = optimize(SwingUp, elements=30, guess=guess, starts=8)
    assert searched.objective <= alone * (1 + 1e-6)  # a hundred times the solver's tolerance


class Flat(Model):
    """The point with coordinates of their own."""

    x = Real(unit="m", start=0.0, fixed=True, description="along")
    y = Real(unit="m", start=0.0, fixed=True, description="across")
    vx = Input(unit="m/s", min=-3.0, max=3.0, description="along")
    vy = Input(unit="m/s", min=-3.0, max=3.0, description="across")

    def equations(self):
        yield der(self.x) == self.vx
        yield der(self.y) == self.vy


class AroundByCoordinates(Around):
    """The same disc, no vector."""

    point = Flat()

    def integrand(self):
        return (self.point.vx**2 + self.point.vy**2) / self.meter**2

    def constraints(self):
        yield final(self.point.x) == 2 * self.meter
        yield final(self.point.y) == 0
        yield (self.point.x - self.meter) ** 2 + (self.point.y - self.height) ** 2 >= self.radius**2


def test_the_search_does_not_depend_on_how_coordinates_are_named():
    branches = optimize(AroundByCoordinates, elements=20, starts=10).search.branches
    assert len(branches) == 2


def test_several_minima_of_a_static_problem():
    class Waves(Optimization):
        """x^4 - 8 x^2 + x has minima near -2.03 and 1.97."""

        x = Free(1.9, min=-3.0, max=3.0, description="where")

        def objective(self):
            return self.x**4 - 8 * self.x**2 + self.x

    roots = np.sort(np.roots([4, 0, -16, 1]).real)
    values = np.polyval([1, 0, -8, 1, 0], roots[[0, 2]])
    optimum = optimize(Waves, starts=10)
    assert optimum.objective == pytest.approx(values[0], abs=1e-7)
    assert [b.objective for b in optimum.search.branches] == pytest.approx(list(values), abs=1e-7)
    assert optimize(Waves).objective == pytest.approx(values[1], abs=1e-7)


def test_one_minimum_is_one_branch():
    optimum = optimize(FastestMass, elements=10, starts=5)
    assert len(optimum.search.branches) == 1
    assert optimum.search.branches[0].count + optimum.search.failures == 5
    assert optimum.final_time == pytest.approx(2.0, abs=1e-6)


def test_where_no_guess_leads_to_a_solution_the_first_is_reported():
    class Hasty(FastestMass):
        final_time = 1.9

        def objective(self):
            return 0.0

    with pytest.raises(SolveError, match="no solution"):
        optimize(Hasty, elements=10, starts=3)


def test_the_answer_is_no_worse_than_its_best_branch():
    optimum = optimize(FastestMass, elements=6, lengths="free", starts=3)
    assert optimum.objective <= optimum.search.branches[0].objective + 1e-6


def test_branches_keep_the_pieces_of_the_caller():
    # eight pieces in either case; 40 elements carry them exactly, and so do 20
    controls = {"mass.u": dict(kind="constant", elements=5)}
    optimum = optimize(Effort, elements=40, starts=2, controls=controls)
    assert optimum.objective == pytest.approx(best_pieces(np.full(8, 1 / 8))[0], abs=1e-8)
    assert optimum.search.branches[0].objective == pytest.approx(optimum.objective, abs=1e-8)


def test_a_limit_on_steps_is_that_of_the_mesh_asked_for():
    # steps of 12 / 40 are needed; pieces of twice the length would need twice as much
    controls = {"mass.u": dict(kind="constant", max_step=0.35)}
    alone = optimize(Effort, elements=40, controls=controls)
    assert optimize(Effort, elements=40, controls=controls, starts=2).objective == pytest.approx(
        alone.objective
    )


def test_guesses_that_are_solved_in_processes_lead_to_the_same_answer_bit_by_bit(around, monkeypatch):
    monkeypatch.setattr(parts, "WORTH", 0.0)
    there = optimize(Around, elements=20, starts=10)
    assert np.array_equal(there.solution.w, around.solution.w)
    assert str(there.search) == str(around.search)
    assert there.objective == around.objective
    assert np.array_equal(there["point.r"], around["point.r"])
    assert str(there.playback) == str(around.playback)


def test_phases_are_searched_and_points_that_move_are_settled_in_processes_too(monkeypatch):
    here = optimize(ThereAndBack, elements=10, starts=4)
    assert here.objective == pytest.approx(4.0, abs=1e-6)
    assert sum(b.count for b in here.search.branches) + here.search.failures == 4
    monkeypatch.setattr(parts, "WORTH", 0.0)
    there = optimize(ThereAndBack, elements=10, starts=4)
    assert np.array_equal(there.solution.w, here.solution.w)
    assert str(there.search) == str(here.search)
