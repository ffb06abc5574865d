"""Studies of models and functions: exact solutions, one answer wherever it is computed, cases that fail."""

import os
import sys
from typing import Any

import numpy as np
import pytest

from gantrytau import (
    DoubtfulResult,
    Input,
    Model,
    ModelError,
    Parameter,
    Real,
    der,
    exp,
    simulate,
    sin,
    study,
    terminate,
    time,
    translate,
    when,
    white_noise,
)
from gantrytau.ensembles.workers import places

TOLERANCE = 1e-10
ERROR = 100 * TOLERANCE  # errors of steps add up


class Decay(Model):
    """A quantity that decays and is driven: x' = -k x + b sin(time) + u."""

    k = Parameter(1.0, unit="1/s", min=0.0, description="rate of decay")
    b = Parameter([0.0, 0.0], unit="1/s", description="amplitudes of the drive")
    x = Real(unit="1", start=1.0, fixed=True, description="what decays")
    u = Input(unit="1/s", start=0.0, description="what drives it")

    def equations(self):
        yield der(self.x) == -self.k * self.x + self.b[0] * sin(time) + self.b[1] + self.u


def same(a, b) -> bool:
    """Whether two results are equal bit by bit."""
    return a.names == b.names and all(np.array_equal(a[n], b[n]) for n in (*a.names, "time"))


def test_every_case_has_its_exact_solution():
    rates, starts = [0.5, 1.0, 2.0], [1.0, -3.0]
    found = study(Decay(), stop=2.0, over={"k": rates, "x": starts}, inputs={"u": 0.5}, tolerance=TOLERANCE)
    table = found.to_xarray()
    k, x = table["k"], table["x.start"]
    exact = 0.5 / k + (x - 0.5 / k) * np.exp(-k * table["time"])
    assert abs(table["x"] - exact.transpose(*table["x"].dims)).max() < 3 * ERROR  # of values up to 3
    assert table["x"].dims == ("k", "x.start", "time")
    assert table["x"].attrs["units"] == "1"
    assert len(found) == len(found.cases) == 6
    assert not found.failures
    assert repr(found) == "<Study Decay: 6 cases over k (3) x x.start (2)>"


def test_values_that_go_together_have_one_axis():
    found = study(
        Decay(),
        stop=1.0,
        over={"k": [1.0, 2.0], "b": [[0.0, 1.0], [0.0, 4.0]]},
        combine="zip",
        outputs=["x"],
        tolerance=TOLERANCE,
    )
    table = found.to_xarray()
    assert table["x"].dims == ("case", "time")
    assert table["b values"].values.tolist() == [[0.0, 1.0], [0.0, 4.0]]
    k, level = table["k"].values[:, None], np.array([[1.0], [4.0]])
    exact = level / k + (1.0 - level / k) * np.exp(-k * table["time"].values)
    assert np.abs(table["x"].values - exact).max() < ERROR


@pytest.mark.parametrize("translated", [False, True], ids=["model", "translated"])
def test_processes_and_this_process_agree_bit_by_bit(translated, monkeypatch):
    model = translate(Decay()) if translated else Decay()
    asked: dict[str, Any] = dict(
        stop=3.0, over={"k": [0.7, 1.3], "x": [1.0, 2.0]}, inputs={"u": lambda t: exp(-t)}
    )
    asked |= dict(parameters={"b": [1.5, 0.0]}, points=101)
    here = study(model, **asked)
    monkeypatch.setattr(places, "BEGIN", -1.0)
    there = study(model, **asked)
    for case, a, b in zip(there.cases, there.values, here.values, strict=True):
        alone = simulate(
            model,
            stop=3.0,
            points=101,
            inputs=asked["inputs"],
            parameters={"b": [1.5, 0.0], "k": case.chosen["k"]},
            starts={"x": case.chosen["x"]},
        )
        assert same(a, b)
        assert same(a, alone)


def test_cases_that_take_long_go_on_in_processes(monkeypatch):
    here, computed = places.computed, []
    asked: dict[str, Any] = dict(stop=1.0, over={"k": [0.5, 1.0, 1.5, 2.0]}, inputs={"u": 0.0})
    for budget, expected in ((float("inf"), 4), (-1.0, 0)):
        with monkeypatch.context() as patch:
            patch.setattr(places, "BEGIN", budget)
            patch.setattr(places, "computed", lambda task, case: computed.append(case) or here(task, case))
            found = study(Decay(), **asked)
        assert len(computed) == expected
        computed.clear()
        assert [value.final("x") for value in found.values] == pytest.approx(
            np.exp([-0.5, -1.0, -1.5, -2.0]), rel=1e-6
        )


@pytest.mark.parametrize(("lasting", "expected"), [([5.0, 0.1], 8), ([5.0, 5.0], 2), ([60.0], 1)])
def test_a_first_case_that_makes_what_others_find_is_not_taken_for_all(lasting, expected, monkeypatch):
    here, clock, computed = places.computed, [0.0], []

    def timed(task, case):
        clock[0] += lasting[min(len(computed), len(lasting) - 1)]
        computed.append(case)
        return here(task, case)

    monkeypatch.setattr(places, "computed", timed)
    monkeypatch.setattr(places, "perf_counter", lambda: clock[0])
    monkeypatch.setattr(places, "processors", lambda: 2)
    monkeypatch.setattr(places, "in_processes", lambda task, cases: (here(task, case) for case in cases))
    found = study(Decay(), stop=1.0, over={"k": np.linspace(0.5, 2.0, 8).tolist()}, inputs={"u": 0.0})
    assert len(computed) == expected
    assert len(found.values) == 8


class Held(Model):
    """A quantity that decays towards what a noise holds: x' = k (u - x)."""

    k = Parameter(2.0, unit="1/s", description="rate")
    x = Real(unit="1", start=0.0, fixed=True, description="what follows")
    u = Input(unit="1", description="what is followed")

    def equations(self):
        yield der(self.x) == self.k * (self.u - self.x)


def test_seeds_drive_noise_and_are_those_of_simulate(monkeypatch):
    period, rate, count = 0.1, 2.0, 12
    noise = {"u": white_noise(std=1.0, period=period)}
    asked: dict[str, Any] = dict(stop=5.0, inputs=noise, tolerance=TOLERANCE, points=51)
    found = study(Held(), **asked, seeds=count)
    table = found.to_xarray()
    assert table["x"].dims == ("seed", "time")
    keep = np.exp(-rate * period)
    for seed in range(count):
        result = found.result(seed=seed)
        held = [result.at(t + period / 2, "u") for t in np.arange(50) * period]
        exact = 0.0
        for u in held:  # the exact solution from one instant to the next
            exact = keep * exact + (1 - keep) * u
        assert result.final("x") == pytest.approx(exact, abs=ERROR)
        assert same(result, simulate(Held(), **asked, seed=seed))
    assert len({value.final("x") for value in found.values}) == count
    monkeypatch.setattr(places, "BEGIN", -1.0)
    assert all(
        same(a, b) for a, b in zip(study(Held(), **asked, seeds=count).values, found.values, strict=True)
    )


class Drained(Model):
    """A tank that is emptied at a rate, and ends the run when it is empty."""

    rate = Parameter(1.0, unit="m/s", description="fall of the level")
    h = Real(unit="m", start=1.0, fixed=True, description="level")

    def equations(self):
        yield der(self.h) == -self.rate
        yield when(self.h <= 0, terminate("the tank is empty"))


def test_runs_that_end_early_are_not_numbers_after_their_end():
    found = study(Drained(), stop=2.0, over={"rate": [0.25, 1.0, 2.0]}, points=21)
    assert [value.ended for value in found.values] == ["stop", "the tank is empty", "the tank is empty"]
    table = found.to_xarray()["h"]
    exact = 1 - table["rate"] * table["time"]
    there = exact >= -1e-12
    assert (table.notnull() == there).all()
    assert float(abs(table - exact).max()) < 1e-7  # ten times the tolerance of simulate


def test_a_result_is_found_by_what_was_chosen():
    found = study(Decay(), stop=1.0, over={"k": [0.1, 0.2], "x": [1.0, 2.0]})
    assert found.result(k=0.1 + 1e-17, x=2.0).final("x") == pytest.approx(2 * np.exp(-0.1), rel=1e-7)
    assert [case.chosen for case, _ in found][1] == {"k": 0.1, "x": 2.0}
    with pytest.raises(ModelError, match=r"Decay: 2 cases have these values; say x too"):
        found.result(k=0.1)
    with pytest.raises(ModelError, match=r"found k=0\.3, expected a value of the study; there is 0\.1, 0\.2"):
        found.result(k=0.3)
    with pytest.raises(ModelError, match=r"nothing varies by the name 'kk'; did you mean 'k'\?"):
        found.result(kk=0.1)


def test_a_function_is_called_with_every_seed():
    offset = 0.5
    found = study(
        lambda a, seed: np.random.default_rng(seed).normal() + a + offset, over={"a": [1, 2]}, seeds=3
    )
    drawn = [np.random.default_rng(seed).normal() for seed in range(3)]
    assert found.values == tuple(draw + a + 0.5 for a in (1, 2) for draw in drawn)
    table = found.to_xarray()
    assert table["value"].dims == ("a", "seed")
    assert found.result(a=2, seed=1) == table["value"].sel(a=2, seed=1)


def test_mappings_become_variables_and_a_failed_case_is_not_a_number():
    def sides(a):
        if a == 2:
            raise ValueError("no triangle")
        if a == 4:
            sys.exit(1)
        return {"sum": a + 1.0, "powers": [a, a**2]}

    found = study(sides, over={"a": [1, 2, 3]})
    table = found.to_xarray()
    assert np.array_equal(table["sum"], [2.0, np.nan, 4.0], equal_nan=True)
    assert np.array_equal(table["powers"], [[1, 1], [np.nan, np.nan], [3, 9]], equal_nan=True)
    assert str(found.failures[0]) == "a=2: ValueError: no triangle"
    with pytest.raises(ModelError, match=r"sides: a=2 failed: ValueError: no triangle"):
        found.result(a=2)
    (ended,) = study(sides, over={"a": [3, 4]}).failures
    assert str(ended).startswith("a=4: SystemExit: the case called sys.exit(1), expected a value")


def test_a_simulation_that_fails_is_a_row_and_not_the_end():
    found = study(Decay(), stop=1.0, over={"k": [1.0, -1.0, 2.0]})
    (failure,) = found.failures
    assert failure.case.chosen == {"k": -1.0}
    assert failure.kind == "ModelError"
    assert "k: value is -1, expected at least 0" in failure.message
    assert [value is None for value in found.values] == [False, True, False]


def test_a_process_that_dies_is_a_row_with_a_name_and_the_others_are_finished():
    def deadly(a):
        if a == 3:
            os._exit(9)
        return a**2

    found = study(deadly, over={"a": range(6)})
    assert found.values == (0, 1, 4, None, 16, 25)
    (failure,) = found.failures
    assert failure.kind == "WorkerDied"
    assert str(failure).startswith("a=3: WorkerDied: its process died twice")


def test_workers_have_one_thread_and_a_study_within_a_case_starts_no_others():
    def inner(a, b):
        return os.getpid(), a * b

    def outer(a):
        return os.getpid(), os.environ["OMP_NUM_THREADS"], study(partial(inner, a), over={"b": [1, 2]}).values

    from functools import partial

    found = study(outer, over={"a": [3, 4]})
    assert not found.failures
    for a, (process, threads, values) in zip((3, 4), found.values, strict=True):
        assert process != os.getpid()
        assert threads == "1"
        assert values == ((process, a), (process, 2 * a))


class Rooted(Model):
    """The root of a level that falls below zero."""

    h = Real(unit="1", start=1.0, fixed=True, description="level")
    root = Real(unit="1", description="root of the level")
    rate = Parameter(1.0, unit="1/s", description="fall of the level")

    def equations(self):
        yield der(self.h) == -self.rate
        yield self.root == self.h**0.5


@pytest.mark.parametrize("begin", [-1.0, 3.0], ids=["processes", "here"])
def test_what_is_doubtful_is_told_wherever_it_was_computed(begin, monkeypatch):
    monkeypatch.setattr(places, "BEGIN", begin)
    with pytest.warns(DoubtfulResult, match=r"^rate=2: Rooted: root is not finite from t = 0\.5"):
        found = study(Rooted(), stop=0.9, over={"rate": [1.0, 2.0]})
    assert not found.failures


def test_values_that_are_given_twice_are_told_apart_by_their_place():
    found = study(lambda a: a, over={"a": [1, 1]})
    assert found.values == (1, 1)
    with pytest.raises(ModelError, match=r"2 cases have these values; they are in \.cases and \.values"):
        found.result(a=1)
