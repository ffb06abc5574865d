"""`Mpc`: next to the infinite-horizon regulator, next to `optimize`, and with a world that is not as expected."""

from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import expm, solve_discrete_are

from gantrytau import Input, Model, ModelError, Parameter, Real, animate, between, cos, der, sin
from gantrytau.viewing.film import film_of
from gantrytau.viewing.solids import ghosts, solids
from gantrytau_models import DeltaRobot
from gantrytau_optimica import Free, Mpc, Optimization, at, final, initial, optimize


class Cart(Model):
    """A cart with friction, in bare numbers."""

    x, v = Real(start=1.0), Real(start=0.3)
    u = Input()

    def equations(self):
        yield der(self.x) == self.v
        yield der(self.v) == self.u - 0.5 * self.v


class Rest(Optimization):
    """The cart shall come to rest at 0."""

    cart = Cart()

    def integrand(self):
        return self.cart.x**2 + 0.1 * self.cart.v**2 + 0.05 * self.cart.u**2


class Pole(Model):
    """A pole on a cart, upright at 0."""

    length = Parameter(0.5)
    p, th, v, w = Real(start=0.3), Real(start=0.2), Real(start=0.0), Real(start=0.0)
    f = Input(min=-20.0, max=20.0)

    def equations(self):
        inertia, swing = 1.0 + 0.1 * sin(self.th) ** 2, 0.1 * sin(self.th)
        yield der(self.p) == self.v
        yield der(self.th) == self.w
        push = self.f + swing * (self.length * self.w**2 - 9.81 * cos(self.th))
        yield der(self.v) * inertia == push
        yield der(self.w) * self.length == 9.81 * sin(self.th) - der(self.v) * cos(self.th)


class Upright(Optimization):
    """The pole shall stand, within 2 m of rail."""

    pole = Pole()
    final_time = 2.0

    def integrand(self):
        o = self.pole
        return 10 * (o.p**2 + o.th**2) + 0.1 * (o.v**2 + o.w**2) + 0.01 * o.f**2

    def constraints(self):
        yield between(-2.0, self.pole.p, 2.0)


@pytest.fixture(scope="module")
def upright():
    return Mpc(Upright, period=0.05, elements=40)


def regulated(h, x):
    """What the best input held over periods costs for ever: Riccati's equation of the sampled cart (Van Loan, 1978)."""
    A, weights = np.zeros((3, 3)), np.diag([1.0, 0.1, 0.05])
    A[0, 1], A[1, 1], A[1, 2] = 1.0, -0.5, 1.0
    whole = expm(h * np.block([[-A.T, weights], [np.zeros((3, 3)), A]]))
    F = whole[3:, 3:]
    cost = F.T @ whole[:3, 3:]
    P = solve_discrete_are(F[:2, :2], F[:2, 2:], cost[:2, :2], cost[2:, 2:], s=cost[:2, 2:])
    return x @ P @ x


def test_a_linear_loop_costs_what_the_infinite_horizon_does():
    loop = Mpc(Rest, period=0.02, elements=5, terminal="lqr").run(stop=8.0)
    assert loop.cost == pytest.approx(regulated(0.02, np.array([1.0, 0.3])), rel=1e-6)
    assert set(loop.statuses) == {"solved"}


def test_the_first_plan_is_that_of_optimize(upright):
    class FromHere(Upright):
        def constraints(self):
            yield from super().constraints()
            for name, value in {"p": 0.3, "th": 0.2, "v": 0.0, "w": 0.0}.items():
                yield initial(getattr(self.pole, name)) == value

    held = {"pole.f": dict(kind="constant", elements=1)}
    best = optimize(FromHere, elements=40, points=2, controls=held)
    upright.reset()
    first = upright.step({"pole.p": 0.3, "pole.th": 0.2, "pole.v": 0.0, "pole.w": 0.0})
    assert first["pole.f"] == pytest.approx(best["pole.f"][0], rel=1e-5)
    np.testing.assert_allclose(upright.plan["pole.p"][1:], best["pole.p"][2::2], atol=1e-5)


def test_one_iteration_a_sample_costs_as_little_as_converged_ones(upright):
    quick = upright.run(stop=2.0)
    whole = Mpc(Upright, period=0.05, elements=40, iterations="converged").run(stop=2.0)
    assert quick.cost == pytest.approx(whole.cost, rel=1e-3)
    assert abs(quick["pole.th"][-1]) < 0.01
    assert np.abs(quick["pole.f"]).max() <= 20.0


def test_a_plant_with_other_parameters_and_noise_is_held_within_the_limits_of_inputs(upright):
    noise = {"pole.p": 0.01, "pole.th": 0.01}
    loop = upright.run(Upright(pole=dict(length=0.6)), stop=3.0, noise=noise, seed=4)
    assert np.abs(loop["pole.f"]).max() <= 20.0
    assert np.abs(loop["pole.th"][-20:]).max() < 0.1


def test_a_plant_of_other_sizes_moves_the_same():
    mpc = Mpc(Rest, period=0.05, elements=20)
    own, other = (
        mpc.run(stop=1.0),
        mpc.run(Rest(cart=dict(x=dict(nominal=50.0), u=dict(nominal=7.0))), stop=1.0),
    )
    assert other.cost == pytest.approx(own.cost, rel=1e-9)
    np.testing.assert_allclose(other["cart.u"], own["cart.u"], atol=1e-7)


def test_what_is_measured_as_nothing_is_foretold(upright):
    upright.reset()
    state = {"pole.p": 0.3, "pole.th": 0.2, "pole.v": 0.0, "pole.w": 0.0}
    with pytest.raises(ModelError, match="the first measurement is not finite"):
        upright.step(state | {"pole.v": np.nan})
    upright.step(state)
    foretold = {name: upright.plan[name][1] for name in upright.states}
    lost = upright.step(state | dict.fromkeys(upright.states, np.inf), 0.05)
    assert upright.status == "lost"
    upright.reset()
    upright.step(state)
    assert lost["pole.f"] == pytest.approx(upright.step(foretold, 0.05)["pole.f"], rel=1e-9)


def test_a_step_past_its_deadline_takes_the_plan_before():
    mpc = Mpc(Upright, period=0.05, elements=10, deadline=1e-9)
    state = {"pole.p": 0.3, "pole.th": 0.2, "pole.v": 0.0, "pole.w": 0.0}
    mpc.step(state)
    planned = mpc.plan["pole.f"][1]
    assert mpc.step(state, 0.05)["pole.f"] == planned
    assert (mpc.status, mpc.timing.missed) == ("late", 1)


def test_a_limit_that_is_passed_already_gives_way_and_is_named(upright):
    upright.reset()
    upright.step({"pole.p": 2.2, "pole.th": 0.0, "pole.v": 0.0, "pole.w": 0.0})
    assert upright.status == "solved"
    assert upright.softened == ("-2 <= pole.p <= 2",)


def test_limits_that_hold_are_not_named_beside_one_that_is_passed():
    class Kept(Upright):
        def constraints(self):
            yield from super().constraints()
            yield self.pole.p <= 50

    mpc = Mpc(Kept, period=0.05, elements=5)
    mpc.step({"pole.p": 2.2, "pole.th": 0.0, "pole.v": 0.0, "pole.w": 0.0})
    assert mpc.softened == ("-2 <= pole.p <= 2",)


class Pair(Rest):
    """Two carts that nothing joins but the program."""

    other = Cart()

    def integrand(self):
        return super().integrand() + self.other.x**2 + 0.05 * self.other.u**2

    def constraints(self):
        yield self.cart.x <= 0.2
        yield between(-1.0, self.cart.u, 1.0)
        yield between(-0.5, self.other.v, 0.5)


@pytest.mark.parametrize("compiled", [False, True])
def test_a_limit_that_gives_way_lets_no_other_give_way(compiled):
    mpc = Mpc(Pair, period=0.1, elements=10)
    if compiled:
        mpc.compiled()
    mpc.step({"cart.x": 2.0, "cart.v": 0.0, "other.x": 2.0, "other.v": 0.0})
    assert mpc.softened == ("cart.x <= 0.2",)
    assert np.abs(mpc.plan["other.v"]).max() == pytest.approx(0.5, abs=1e-6)


def test_a_delay_of_a_period_is_foretold():
    loop = Mpc(Upright, period=0.02, elements=60, delay=1).run(stop=2.0)
    assert abs(loop["pole.th"][-1]) < 0.02


def test_closed_kinematic_loops_need_nothing_more():
    class Reach(Optimization):
        robot = DeltaRobot()

        def integrand(self):
            tool, arms = self.robot.tool, self.robot.arms
            away = ca.sumsqr(tool.r - np.array([0.1, 0.05, -0.75]))
            return 1e3 * away + ca.sumsqr(tool.v) + 1e-3 * sum(arm.tau**2 for arm in arms)

        def constraints(self):
            for arm in self.robot.arms:
                yield between(-15.0, arm.tau, 15.0)

    loop = Mpc(Reach, period=0.02, elements=10, terminal="lqr").run(stop=0.6)
    np.testing.assert_allclose(loop["robot.tool.r"][-1], [0.1, 0.05, -0.75], atol=1e-4)
    assert np.abs(loop["robot.arms[0].tau"]).max() <= 15.0
    assert "Reach, closed loop" in animate(loop).text
    film = film_of(loop)
    moving = [solid for solid in solids(film) if solid.role in ("bar", "ball", "body") and not solid.rests]
    seen = list(ghosts(film))
    assert film.ghost is not None
    np.testing.assert_allclose(
        film.ghost.values("robot.tool.r", (3,))[::12], loop.planned["robot.tool.r"][::10], atol=1e-12
    )
    assert {solid.owner for solid in seen} == {s.owner for s in moving if s.kind != "axes"}


class FreeEnd(Rest):
    final_time = Free(1.0)


class EndsThere(Rest):
    def constraints(self):
        yield final(self.cart.x) == 0


class PassesThere(Rest):
    def constraints(self):
        yield at(0.5, self.cart.x) == 0


@pytest.mark.parametrize(
    ("problem", "keywords", "told"),
    [
        (PassesThere, {}, "is a condition on the end or on a time between"),
        (FreeEnd, {}, "final_time is free, expected a number: a receding horizon has a fixed length"),
        (EndsThere, {}, "is a condition on the end or on a time between, expected a cost of the end"),
        (Rest, {"period": 0.0}, "period"),
        (Upright, {"hard": ["pole.p"]}, "expected some of -2 <= pole.p <= 2"),
        (Rest, {"terminal": "lq"}, "terminal"),
    ],
)
def test_what_is_no_receding_horizon_is_told(problem, keywords, told):
    with pytest.raises(ModelError) as raised:
        Mpc(problem, **{"period": 0.01, **keywords})
    assert told in str(raised.value)


def test_names_that_are_no_states_are_told(upright):
    with pytest.raises(ModelError, match=r"expected some of pole\.p, pole\.th, pole\.v, pole\.w"):
        upright.step({"pole.f": 1.0})
    with pytest.raises(ModelError, match=r"measured lacks pole\.th, pole\.v, pole\.w"):
        upright.step({"pole.p": 1.0})


@pytest.mark.parametrize("size", [1e-12, 1e12])
def test_the_unit_of_the_objective_does_not_count(size):
    class Sized(Upright):
        def integrand(self):
            return size * super().integrand()

    state = {"pole.p": 0.3, "pole.th": 0.2, "pole.v": 0.0, "pole.w": 0.0}
    given = [Mpc(one, period=0.05, elements=10).step(state)["pole.f"] for one in (Upright, Sized)]
    assert given[1] == pytest.approx(given[0], rel=1e-6)


def test_a_loop_goes_on_as_if_it_had_not_ended():
    mpc = Mpc(Upright, period=0.05, elements=10, delay=1)
    plant: Any = Upright(pole=dict(length=0.6))
    given: Any = dict(noise={"pole.th": 0.005}, seed=3)
    whole, first = mpc.run(plant, stop=0.5, **given), mpc.run(plant, stop=0.2, **given)
    found = mpc.run(plant, stop=0.5, after=first, **given)
    assert found.statuses == whole.statuses
    assert found.cost == pytest.approx(whole.cost, rel=1e-9)
    np.testing.assert_allclose(found["pole.f"], whole["pole.f"], rtol=0, atol=1e-8)
    np.testing.assert_array_equal(found["pole.th"][:5], first["pole.th"])
    assert len(found.timing.step) == 10
    others: list[Any] = [
        (dict(stop=0.2), "found stop=0.2, expected at least one period of 0.05 s after 0.2 s"),
        (dict(stop=1.0, start={"pole.p": 0.0}), "start= beside it, expected none"),
        (dict(stop=1.0, plant=Upright), "pole.length = 0.6 of its plant and 0.5 of this one"),
    ]
    for keywords, words in others:
        with pytest.raises(ModelError) as raised:
            mpc.run(**(dict(plant=plant, after=first) | keywords))
        assert words in str(raised.value)


def test_plans_are_kept_and_end_where_they_are_planned_to():
    mpc = Mpc(Upright, period=0.05, elements=10)
    loop = mpc.run(stop=0.3)
    assert loop.plans["pole.th"].shape == (6, 11)
    np.testing.assert_allclose(loop.plans["pole.th"][:, 0], loop["pole.th"][:-1], atol=1e-9)
    np.testing.assert_allclose(loop.planned["pole.th"][:-1], loop.plans["pole.th"][:, -1], atol=1e-12)
    np.testing.assert_allclose(loop.plans["pole.th"][-1], mpc.plan["pole.th"], atol=1e-12)

    figure = loop.plot("pole.th", "pole.f", plans=3)
    assert [len(axis.get_lines()) for axis in figure.axes] == [8]
