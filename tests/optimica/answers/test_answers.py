"""An answer just found and the same one read from its file answer every question alike."""

import csv
from functools import cache
from typing import Any

import numpy as np
import pytest

from gantrytau import Input, Model, ModelError, Parameter, Real, der
from gantrytau_optimica import Free, Optimization, final, initial, link, load_optimum, optimize, prepare

CLOSE = 1e-10  # round-off of other orders of summation


class Cart(Model):
    """A cart in the plane that is driven by its acceleration."""

    mass = Parameter(2.0, unit="kg", description="mass")
    axes = Parameter([3.0, 4.0], unit="m", description="a vector that nothing chooses")
    r = Real(2, unit="m", description="place")
    v = Real(2, unit="m/s", description="speed")
    a = Input(2, unit="m/s2", min=-1.0, max=1.0, description="acceleration")
    energy = Real(unit="J", description="of the motion")

    def equations(self):
        yield der(self.r) == self.v
        yield der(self.v) == self.a
        yield 2 * self.energy == self.mass * (self.v[0] ** 2 + self.v[1] ** 2)


class Move(Optimization):
    """From rest to rest at a goal that is chosen as well."""

    cart: Any = Cart()
    goal: Any = Free([0.5, 0.5], unit="m", min=-1.0, max=2.0, description="where it comes to rest")
    final_time: Any = Free(2.0, unit="s", min=0.5, max=3.0, description="end")

    def objective(self):
        return (self.goal[0] - 1) ** 2 + (self.goal[1] + 2 / 5) ** 2

    def constraints(self):
        yield initial(self.cart.r) == 0
        yield initial(self.cart.v) == 0
        yield final(self.cart.v) == 0
        yield final(self.cart.r) == self.goal


class Onward(Move):
    """A second move, which begins where the first ends, and ends before the other phase does."""

    start_time: Any = Free(2.0, unit="s", min=0.5, max=3.0, description="start")
    final_time: Any = Free(5.0, unit="s", min=4.0, max=6.0, description="end")

    def constraints(self):
        yield final(self.cart.v) == 0
        yield final(self.cart.r) == self.goal


class TwoMoves(Optimization):
    """Two phases, linked; the one that ends last is named first."""

    onward: Any = Onward()
    first: Any = Move()

    def objective(self):
        return 0.1 * self.onward.final_time

    def constraints(self):
        yield link(self.first, self.onward)


@cache
def found(problem):
    return optimize(problem, elements=4)


@pytest.fixture(params=["found", "read back"])
def answer(request, tmp_path):
    """The same answer, as it was found and as it is read back."""

    def made(problem):
        optimum = found(problem)
        return optimum if request.param == "found" else load_optimum(optimum.save(tmp_path / "one.optimum"))

    return made


def test_how_it_ended(answer):
    move, original = answer(Move), found(Move)
    for word in ("name", "objective", "success", "status", "iterations", "build_time", "solve_time", "free"):
        assert getattr(move, word) == getattr(original, word)
    assert move.success
    assert move.report() == original.report()
    assert repr(move) == f"<{type(move).__name__} Move: solved, objective {move.objective:.8g}, 13 times>"


def test_names_of_one_phase(answer):
    move = answer(Move)
    assert list(move) == list(move.names) == list(found(Move).names)
    assert {"cart.r[0]", "cart.energy", "goal[0]", "final_time"} <= set(move.names)
    for name in ("cart.r", "cart.r[1]", "final_time", "goal[1]", "time"):
        assert name in move
    for name in ("cart.mass", "cart", "der(cart.r)", 1):
        assert name not in move


def test_variables_vectors_derivatives_and_numbers(answer):
    move, t = answer(Move), found(Move).time
    np.testing.assert_array_equal(move.time, t)
    np.testing.assert_array_equal(move["time"], t)
    np.testing.assert_array_equal(move.time_of("cart.v"), t)
    np.testing.assert_allclose(move.breaks, np.arange(1, 4) / 4 * move.final_time, rtol=1e-12)
    assert move["cart.r"].shape == (13, 2)
    np.testing.assert_array_equal(move["cart.r"][:, 1], move["cart.r[1]"])
    np.testing.assert_allclose(move["der(cart.r)"], move["cart.v"], atol=CLOSE)
    np.testing.assert_allclose(move["cart.energy"], np.sum(move["cart.v"] ** 2, axis=1), atol=CLOSE)
    assert isinstance(move["final_time"], float)
    assert move["final_time"] == move.final_time == move.free["final_time"]
    np.testing.assert_allclose(move["goal"], [1.0, -0.4], atol=1e-4)  # the objective is flat there
    np.testing.assert_array_equal(move["goal"], [move["goal[0]"], move["goal[1]"]])
    np.testing.assert_array_equal(move["cart.mass"], np.full(13, 2.0))
    np.testing.assert_array_equal(move["cart.axes"], np.tile([3.0, 4.0], (13, 1)))
    assert move.parameters["cart.mass"] == 2.0
    assert move.parameters["goal[1]"] == move["goal[1]"]


def test_final_values(answer):
    move = answer(Move)
    assert move.final("final_time") == move.final_time
    np.testing.assert_array_equal(move.final("goal"), move["goal"])
    np.testing.assert_allclose(move.final("cart.r"), move["goal"], atol=1e-8)  # the solver's tolerance
    assert move.final("cart.r[1]") == move["cart.r[1]"][-1]
    assert move.final("cart.mass") == 2.0
    assert move.final("time") == move.final_time


def test_signals(answer):
    move = answer(Move)
    times = np.linspace(0.0, move.final_time, 17)
    for name, shape in (("cart.r", (17, 2)), ("cart.r[0]", (17,)), ("der(cart.v)", (17, 2)), ("goal", (17, 2)),
                        ("cart.axes", (17, 2)), ("final_time", (17,)), ("time", (17,))):  # fmt: skip
        signal = move.signal(name)
        assert signal(times).shape == shape
        assert np.shape(signal(0.5)) == shape[1:]
        np.testing.assert_allclose(signal(times), found(Move).signal(name)(times), atol=CLOSE, err_msg=name)
    np.testing.assert_array_equal(move.signal("goal")(0.1), move["goal"])


def test_result_file_and_figure(answer, tmp_path):
    move = answer(Move)
    assert move.result.title == "Move"
    assert move.result.unit("cart.r") == "m"
    assert move.result.description("cart.energy") == "of the motion"
    assert move.save(tmp_path / "move.csv") is not None
    found(Move).save(tmp_path / "original.csv")
    heads, rows = zip(*(_table(tmp_path / f"{name}.csv") for name in ("move", "original")), strict=True)
    assert heads[0] == heads[1]
    np.testing.assert_allclose(*rows, atol=CLOSE)
    move.plot("cart.r", file=tmp_path / "move.png")
    assert (tmp_path / "move.png").stat().st_size > 1000


def _table(path):
    return path.read_text().splitlines()[0], np.loadtxt(path, delimiter=",", skiprows=1)


@pytest.mark.parametrize("ask", ["__getitem__", "final", "signal", "time_of"])
def test_unknown_names(answer, ask):
    for problem, name, near in (
        (Move, "cart.enrgy", "cart.energy"),
        (TwoMoves, "first.cart.enrgy", "first.cart.energy"),
    ):
        with pytest.raises(ModelError, match=rf"has no variable or parameter '{name}'; did you mean '{near}"):
            getattr(answer(problem), ask)(name)


def test_two_phases(answer):
    moves, original = answer(TwoMoves), found(TwoMoves)
    assert list(moves.phases) == ["onward", "first"]
    first, onward = moves.phases["first"], moves.phases["onward"]
    # the horizon is that of both, whichever is named first
    assert moves.start_time == first.start_time == 0.0
    assert moves.final_time == onward.final_time == pytest.approx(4.0, abs=1e-6)
    assert moves["first.final_time"] == pytest.approx(onward.start_time, abs=1e-8)
    for word in ("time", "breaks", "result"):
        with pytest.raises(ModelError, match=r"has phases with times of their own; ask one of .*'onward'"):
            getattr(moves, word)
    assert list(moves.names) == list(original.names)
    for name in ("first.cart.r", "onward.cart.v[1]", "der(onward.cart.r)", "first.cart.mass"):
        np.testing.assert_allclose(moves[name], original[name], atol=CLOSE, err_msg=name)
        path = name.removeprefix("der(").split(".")[0]
        np.testing.assert_array_equal(moves.time_of(name), moves.phases[path].time)
        assert len(moves[name]) == moves.phases[path].time.size
    np.testing.assert_allclose(moves.final("first.cart.r"), moves["onward.cart.r"][0], atol=1e-8)
    assert moves.final("onward.final_time") == moves.final_time
    np.testing.assert_array_equal(moves.final("first.goal"), moves["first.goal"])
    middle = (onward.start_time + onward.final_time) / 2
    np.testing.assert_allclose(
        moves.signal("onward.cart.r")(middle), original.signal("onward.cart.r")(middle), atol=CLOSE
    )
    assert repr(moves).startswith(f"<{type(moves).__name__} TwoMoves: solved, objective 0.4")


def test_phases_are_drawn_and_saved_in_one_table(answer, tmp_path):
    moves = answer(TwoMoves)
    first, onward = moves.phases["first"], moves.phases["onward"]
    moves.save(tmp_path / "moves.csv")
    with (tmp_path / "moves.csv").open() as file:
        header, *rows = list(csv.reader(file))
    table = dict(zip([name.split(" ")[0] for name in header], np.array(rows, float).T, strict=True))
    time = table["time"]
    for path, phase in (("first", first), ("onward", onward)):
        inside = (time >= phase.time[0]) & (time <= phase.time[-1])
        position = table[f"{path}.cart.r[0]"]
        np.testing.assert_array_equal(np.isfinite(position), inside)
        own = np.isin(time, phase.time)
        np.testing.assert_allclose(position[own], moves[f"{path}.cart.r"][:, 0], atol=CLOSE)
    names = ("first.cart.r", "onward.cart.r", "der(onward.cart.r)", "first.final_time")
    figure = moves.plot(*names, file=tmp_path / "moves.png")
    lines = {line.get_label(): line for axis in figure.axes for line in axis.get_lines()}
    drawn = lines["onward.cart.r[0]"]
    shown = np.asarray(drawn.get_xdata(), float)[np.isfinite(np.asarray(drawn.get_ydata(), float))]
    assert (shown[0], shown[-1]) == (onward.time[0], onward.time[-1])


def test_it_is_a_guess_for_the_component_that_it_is_of(answer):
    move = answer(Move)
    problem = prepare(TwoMoves, elements=4, guess={"first": move}).built.problem
    guess = {s.name: s.guess for s in problem.signals}
    np.testing.assert_allclose(
        guess["first.cart.r[0]"](np.array([0.0, 1.0])), [0.0, move["goal[0]"]], atol=1e-8
    )
    assert {n.name: n.guess for n in problem.free}["first.final_time"] == move.final_time
