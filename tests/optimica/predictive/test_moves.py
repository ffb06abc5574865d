"""Moves of an `Mpc`'s inputs next to those of `optimize`: limits of rates, penalties, and blocks."""

import numpy as np
import pytest

from gantrytau import Input, Model, ModelError, Real, between, der
from gantrytau_optimica import Mpc, Optimization, initial, optimize

STATE = {"cart.x": 1.0, "cart.v": 0.3}


class LimitedCart(Model):
    """A cart with friction, in bare numbers."""

    x, v = Real(start=1.0), Real(start=0.3)
    u, brake = Input(min=-2.0, max=2.0), Input(min=0.0, max=0.5, nominal=7.0)

    def equations(self):
        yield der(self.x) == self.v
        yield der(self.v) == self.u - (0.5 + self.brake) * self.v


class Rest(Optimization):
    """The cart shall come to rest at 0."""

    cart = LimitedCart()
    final_time = 2.0

    def integrand(self):
        cart = self.cart
        return cart.x**2 + 0.1 * cart.v**2 + 0.05 * cart.u**2 + 0.02 * (cart.brake - 0.1) ** 2


class FromHere(Rest):
    """From the state and the inputs that the controller begins with."""

    def objective(self):
        return 0.01 * initial(self.cart.u) ** 2

    def constraints(self):
        yield initial(self.cart.x) == 1.0
        yield initial(self.cart.v) == 0.3
        yield between(-0.3, initial(self.cart.u), 0.3)


def test_limits_and_penalties_of_moves_and_equal_blocks_are_those_of_optimize():
    pieces = dict(kind="constant", elements=2)
    controls = {
        "cart.u": {**pieces, "max_step": 0.3, "step_penalty": 0.01},
        "cart.brake": {**pieces, "step_penalty": 0.0},
    }
    best = optimize(FromHere, elements=20, points=2, controls=controls)
    mpc = Mpc(
        Rest,
        period=0.1,
        elements=20,
        rates={"cart.u": 3.0},
        step_penalty={"cart.u": 0.01},
        blocks=2,
        iterations="converged",
    )
    first = mpc.step(STATE)
    assert first["cart.u"] == pytest.approx(best["cart.u"][0], abs=1e-6)
    np.testing.assert_allclose(mpc.plan["cart.x"][1:], best["cart.x"][2::2], atol=1e-5)
    for name in mpc.inputs:
        np.testing.assert_allclose(mpc.plan[name][:-1], best[name][1::2], atol=1e-5)
    assert np.abs(np.diff(mpc.plan["cart.u"][::2])).max() == pytest.approx(0.3)


def test_a_plan_of_growing_blocks_costs_least_among_its_neighbours():
    lengths, period = [1, 2, 3, 4], 0.1
    free = Rest(cart=dict(u=dict(min=-9.0, max=9.0)))
    mpc = Mpc(free, period=period, elements=10, blocks=lengths, iterations="converged")
    mpc.step(STATE)
    planned = mpc.plan["cart.u"][:10]
    values = planned[np.cumsum([0, *lengths[:-1]])]
    np.testing.assert_allclose(planned, np.repeat(values, lengths), atol=1e-12)

    def cost(u):
        """Of the motion that the controller's plan has with other blocks of u."""
        stages = mpc.stages
        x = np.array([1.0, 0.3]) / stages.sizes_x
        total, w = 0.0, np.tile(x, 2)
        for k, one in enumerate(np.repeat(u, lengths)):
            inputs = np.array([one, mpc.plan["cart.brake"][k]]) / stages.sizes_u
            w = stages.moved(x, w, inputs, 0.0)
            total, x = total + stages.spent(w, inputs, 0.0), w[stages.last]
        return total

    here = cost(values)
    for k in range(4):
        for away in (-1e-3, 1e-3):
            assert cost(values + away * np.eye(4)[k]) > here


@pytest.mark.filterwarnings("ignore:.*found a deadline")
def test_rates_hold_in_the_loop_late_or_not():
    rates = {"cart.u": (-4.0, 2.0)}
    for deadline in (None, 1e-9):
        mpc = Mpc(Rest, period=0.1, elements=10, rates=rates, deadline=deadline)
        loop = mpc.run(stop=2.0, noise={"cart.v": 0.2}, seed=3)
        # the last sample repeats an input
        moves = np.diff(np.append(0.0, loop["cart.u"][:-1]))
        assert -0.4 - 1e-9 <= moves.min() < -0.39
        assert moves.max() <= 0.2 + 1e-9


@pytest.mark.parametrize(
    ("keywords", "told"),
    [
        ({"rates": {"cart.w": 1.0}}, "expected the inputs cart.u, cart.brake"),
        ({"rates": {"cart.u": (1.0, 2.0)}}, "with 0 between them"),
        ({"rates": {"cart.u": 0.0}}, "rates[cart.u]"),
        ({"step_penalty": {"cart.u": -1.0}}, "step_penalty[cart.u]"),
        ({"blocks": 0}, "blocks"),
        ({"blocks": [10, 11]}, "expected blocks of 20 periods together at most"),
    ],
)
def test_moves_that_cannot_be_are_told(keywords, told):
    with pytest.raises(ModelError) as raised:
        Mpc(Rest, period=0.1, elements=20, **keywords)
    assert told in str(raised.value)
