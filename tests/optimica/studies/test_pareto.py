"""Trade-offs along a weight, against a formula and the published rows of the robot's motion."""

import csv
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gantrytau import Fixed, ModelError, Parameter, Real, SolveError
from gantrytau.commands.demo.motion_problems import FreePath
from gantrytau_optimica import Free, Optimization, final, optimize
from gantrytau_optimica.studies import continuation
from gantrytau_optimica.studies.pareto import pareto
from tests.optimica.problems import Mass

ENERGY = {"final_time": "final_time", "energy": "integral(square)"}


class Gentle(Optimization):
    """From rest to rest over 1 m: time and the integral of the squared acceleration, which is 12 / T^3 at least."""

    mass: Any = Mass(x=Fixed(0.0), v=Fixed(0.0))
    square = Real(unit="m2/s4", description="squared acceleration")
    weight = Parameter(1.0, unit="s4/m2", description="weight of the acceleration")
    pair = Parameter([1.0, 2.0], unit="1", description="without effect")
    final_time: Any = Free(2.0, unit="s", min=0.1, max=50.0, description="duration")

    def equations(self):
        yield self.square == self.mass.u**2

    def objective(self):
        return self.final_time

    def integrand(self):
        return self.weight * self.square

    def constraints(self):
        yield final(self.mass.x) == 1
        yield final(self.mass.v) == 0


@pytest.fixture(scope="module")
def gentle():
    return pareto(Gentle, "weight", [0.01, 0.1, 1.0], along=["final_time", "integral(square)"], elements=5)


@pytest.fixture(scope="module")
def gantry():
    return pareto(FreePath, "weight", [0.1, 0.03, 0.01, 0.003, 0.001], along=ENERGY)


def test_the_trade_off_of_a_mass_is_a_formula(gentle):
    # min T + w 12 / T^3: T = (36 w)^(1/4)
    times = (36 * gentle["weight"]) ** 0.25
    np.testing.assert_allclose(gentle["final_time"], times, rtol=1e-6)
    np.testing.assert_allclose(gentle["integral(square)"], 12 / times**3, rtol=1e-6)
    assert gentle.findings == ()
    assert gentle.failures == {}
    assert [point.final_time for point in gentle.points] == gentle["final_time"].tolist()
    assert repr(gentle) == "<TradeOff Gentle: 3 points along weight>"


def test_without_names_it_records_the_two_parts_of_the_objective(gentle):
    parts = pareto(Gentle, "weight", [0.01, 1.0], elements=5)
    np.testing.assert_allclose(parts["unweighed"], gentle["final_time"][[0, 2]], rtol=1e-6)
    np.testing.assert_allclose(parts["weighed"], gentle["integral(square)"][[0, 2]], rtol=1e-6)


def test_quantities_of_every_kind():
    found = pareto(
        Gentle,
        "weight",
        [1.0],
        elements=5,
        along={"cost": "objective", "end": "final(mass.x)", "fastest": lambda o: np.max(o["mass.v"])},
    )
    assert found["cost"][0] == pytest.approx(found.points[0].objective)
    assert found["end"][0] == pytest.approx(1.0)
    # the parabola of least effort has its top between the points, 1.5 / T
    assert found["fastest"][0] == pytest.approx(1.5 / found.points[0].final_time, rel=1e-2)


def test_time_and_energy_of_the_robot(gantry):
    # benchmarks of the motion from A to B, energies to three digits
    np.testing.assert_allclose(gantry["final_time"][[2, 4]], [0.97598, 0.92103], atol=2e-5)
    np.testing.assert_allclose(gantry["energy"][[2, 4]], [54.5, 72.4], atol=0.05)
    assert np.all(np.diff(gantry["final_time"]) < 0)
    assert np.all(np.diff(gantry["energy"]) > 0)
    assert gantry.findings == ()
    # along optima dT + w dE = 0: the slope between two weights lies between them
    slopes = -np.diff(gantry["final_time"]) / np.diff(gantry["energy"])
    assert np.all((slopes < gantry["weight"][:-1]) & (slopes > gantry["weight"][1:]))


def test_each_point_starts_from_the_one_before(gantry):
    cold = [optimize(FreePath(weight=w)).iterations for w in (0.03, 0.01)]
    assert sum(point.iterations for point in gantry.points[1:3]) < sum(cold)


def test_one_picture_and_one_table(gantry, gentle, tmp_path):
    figure = gantry.plot(tmp_path / "knee.png")
    assert (tmp_path / "knee.png").stat().st_size > 10_000
    (axis,) = figure.axes
    assert axis.get_xlabel() == "energy [N2.m2.s]"
    assert axis.get_ylabel() == "final_time [s]"
    assert [text.get_text() for text in axis.texts] == ["0.1", "0.03", "0.01", "0.003", "0.001"]
    path = gentle.save(tmp_path / "gentle.csv")
    with path.open(encoding="utf-8") as stream:
        head, *rows = csv.reader(stream)
    assert head == ["weight", "final_time", "integral(square)", "objective", "iterations"]
    np.testing.assert_array_equal([float(row[1]) for row in rows], gentle["final_time"])
    assert gentle.report().splitlines()[0].split()[:2] == ["weight", "final_time"]
    with pytest.raises(ModelError, match=r"found the suffix '\.txt', expected \.csv"):
        gentle.save(tmp_path / "gentle.txt")


class Reachable(Gentle):
    """The same where the acceleration is at most 1 / weight and the time at most 5 s: no solution beyond 6.25."""

    def constraints(self):
        yield from super().constraints()
        yield self.mass.u * self.weight <= 1
        yield self.mass.u * self.weight >= -1
        yield self.final_time <= 5


def test_a_weight_without_solution_does_not_lose_the_others():
    found = pareto(
        Reachable, "weight", [1.0, 40.0, 2.0], along=["final_time"], elements=5, max_iterations=200
    )
    assert found["weight"].tolist() == [1.0, 2.0]
    assert list(found.failures) == [40.0]
    assert "weight = 40: Reachable" in found.report()
    first = pareto(Reachable, "weight", [40.0, 1.0], along=["final_time"], elements=5, max_iterations=200)
    assert first["weight"].tolist() == [1.0]
    with pytest.raises(SolveError, match=r"no value of weight was solved; the first said:") as caught:
        pareto(Reachable, "weight", [40.0, 50.0], elements=5, max_iterations=200)
    assert caught.value.optimum is not None


def test_a_step_that_fails_is_made_smaller(monkeypatch):
    solve_from = continuation.solve_from

    def timid(prepared, name, start, value):
        before = dict(zip((n.name for n in start.program.problem.free), start.solution.w, strict=False))[name]
        if value > 4.5 * before:
            raise SolveError("too far", optimum=start)
        return solve_from(prepared, name, start, value)

    monkeypatch.setattr(continuation, "solve_from", timid)
    found = pareto(Gentle, "weight", [0.01, 0.16], along=["final_time"], elements=5)
    np.testing.assert_allclose(found["final_time"], (36 * found["weight"]) ** 0.25, rtol=1e-6)
    assert found.findings == ("weight = 0.16 was reached from 0.01 by way of 0.04 only",)


class Around(Optimization):
    """Two ways around: q in [-2, 2] with two minima, one at a high price."""

    q: Any = Free(-1.0, unit="1", min=-2.0, max=2.0, description="where")
    price = Parameter(1.0, unit="1", description="weight")

    def objective(self):
        return (self.q**2 - 1) ** 2 + 0.3 * self.q + self.price * (self.q + 1.2) ** 2


HIGH, LOW = 0.294, -0.305  # the two minima of the first part, near q = 1 and q = -1


def test_a_local_minimum_is_left_for_the_motion_of_another_weight():
    alone = pareto(Around, "price", [0.0], guess={"q": 1.0})
    assert alone["unweighed"][0] == pytest.approx(HIGH, abs=1e-3)
    # at a price of 0.5 there is one minimum only, from which the lower one for nothing is found
    both = pareto(Around, "price", [0.0, 0.5], guess={"q": 1.0})
    assert both["unweighed"][0] == pytest.approx(LOW, abs=1e-3)
    assert both.findings == ()


def test_a_local_minimum_that_stays_is_told(monkeypatch):
    solve_from = continuation.solve_from

    def stuck(prepared, name, start, value):
        if value == 0.0:
            raise SolveError("stuck", optimum=start)
        return solve_from(prepared, name, start, value)

    monkeypatch.setattr(continuation, "solve_from", stuck)
    found = pareto(Around, "price", [0.0, 0.5], guess={"q": 1.0})
    assert found["unweighed"][0] == pytest.approx(HIGH, abs=1e-3)
    lower, dominated = found.findings
    assert lower.startswith("price = 0 has the objective 0.294")
    assert "the motion of price = 0.5 would have -0.30" in lower
    assert dominated.startswith(
        "price = 0 is dominated by price = 0.5, which is no worse in unweighed and weighed: a local minimum"
    )


def test_what_was_found_before_ctrl_c_is_kept(monkeypatch):
    def stopped(prepared, name, start, value):
        raise SolveError("interrupted", optimum=SimpleNamespace(status="interrupted"))

    monkeypatch.setattr(continuation, "solve_from", stopped)
    found = pareto(Gentle, "weight", [0.1, 0.2, 0.3], elements=5)
    assert found["weight"].tolist() == [0.1]
    assert found.failures == {0.2: "interrupted"}


def test_what_is_written_wrongly_is_said():
    with pytest.raises(ModelError, match=r"no variable or parameter 'wieght'; did you mean 'weight'"):
        pareto(Gentle, "wieght", [1.0])
    with pytest.raises(ModelError, match=r"mass\.x is no parameter, expected one; declare it as a Parameter"):
        pareto(Gentle, "mass.x", [1.0])
    for weight in ("final_time", "pair"):  # chosen by the optimiser, and two elements
        with pytest.raises(ModelError, match="expected a Parameter with one value") as caught:
            pareto(Gentle, weight, [1.0])
        assert caught.value.argument == "weight"
    wrong: Any = ([], [1.0, np.nan], [np.inf], "many", [[1.0]], 1.0, [1.0, 2.0, 1.0])
    for values in wrong:
        with pytest.raises(ModelError) as caught:
            pareto(Gentle, "weight", values)
        assert caught.value.argument == "values"


@pytest.mark.parametrize(
    ("along", "words"),
    [
        (["energy"], r"along: energy: Gentle has no quantity 'energy'"),
        (["final_tme"], r"no quantity 'final_tme'; did you mean 'final_time'"),
        (["square"], r"square varies over time, expected a number; write 'final\(square\)' or"),
        (["final(pair)"], r"along: final\(pair\): pair has 2 elements, expected one; name it"),
        (["integral(nothing)"], "no variable or parameter 'nothing'"),
        ({"a": 3.0}, "along: a: found 3.0, expected a name or a function of an Optimum"),
        ("final_time", "along='final_time', expected a list of quantities or"),
        ([], r"along=\[\], expected a list of quantities"),
        ({"a": lambda o: o["nothing"]}, r"along: a: ModelError: .*expected a function from an Optimum to a"),
    ],
)
def test_quantities_written_wrongly_are_said(along, words):
    with pytest.raises(ModelError, match=words):
        pareto(Gentle, "weight", [1.0], along=along, elements=3)


def test_a_quantity_that_was_not_recorded(gentle):
    with pytest.raises(ModelError, match=r"the points have no 'fina_time'; did you mean 'final_time'"):
        gentle["fina_time"]


def test_an_objective_that_grows_with_its_weight_dominates_nothing():
    curve = pareto(Gentle, "weight", [0.01, 0.1, 1.0], along=["final_time", "objective"], elements=5)
    assert not curve.findings
