"""Problems that are none for a receding horizon, or doubtful ones, are told when the `Mpc` is made."""

import warnings

import pytest

from gantrytau import Discrete, DoubtfulResult, Input, Model, ModelError, Real, der, when
from gantrytau_optimica import Mpc, Optimization


class Leaning(Model):
    """Falls over with 5 1/s."""

    x = Real(start=1.0)
    u = Input()

    def equations(self):
        yield der(self.x) == 5 * self.x + self.u


class Held(Optimization):
    body = Leaning()

    def integrand(self):
        return self.body.x**2 + self.body.u**2


class Nothing(Optimization):
    body = Leaning()


class EverCheaper(Nothing):
    def integrand(self):
        return self.body.x - self.body.u


class Concave(Nothing):
    def integrand(self):
        return self.body.x**2 - 3 * self.body.u**2


class Counting(Leaning):
    passed = Discrete(start=0.0)

    def equations(self):
        yield from super().equations()
        yield when(self.x < 0, self.passed == 1)


class Jumping(Held):
    body = Counting()


@pytest.mark.parametrize(
    ("problem", "told"),
    [
        (Nothing, "there is no objective"),
        (Concave, "its second derivative by body.u is -6; give body.u a min and a max"),
        (EverCheaper, "the objective is not bounded: every plan has a cheaper one"),
        (Jumping, "found a condition at which variables jump"),
    ],
)
def test_what_has_no_best_plan_is_told(problem, told):
    with pytest.raises(ModelError) as raised:
        Mpc(problem, period=0.05, elements=5).step({"body.x": 1.0})
    assert told in str(raised.value)


def test_an_objective_that_falls_between_limits_is_one():
    mpc = Mpc(EverCheaper(body=dict(u=dict(min=-1.0, max=1.0))), period=0.05, elements=1)
    assert mpc.step({"body.x": 0.0})["body.u"] == pytest.approx(1.0)


def test_samples_slower_than_the_model_are_told_with_its_pole():
    with pytest.warns(DoubtfulResult, match=r"expected at most 0\.2 s for the pole 5 1/s of the model"):
        Mpc(Held, period=0.3)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Mpc(Held, period=0.1)


def test_a_deadline_that_no_step_keeps_is_told_once():
    mpc = Mpc(Held, period=0.05, elements=5, deadline=1e-9)
    with pytest.warns(DoubtfulResult, match=r"found a deadline of 1e-09 s, expected one above") as told:
        mpc.run(stop=0.5)
    assert len(told) == 1
