"""`Mpc` from outputs alone, with estimators: no offset in spite of another plant, noise, and refusals."""

from typing import Any

import numpy as np
import pytest

from gantrytau import Input, Model, ModelError, Parameter, Real, der
from gantrytau_optimica import ExtendedKalman, MovingHorizon, Mpc, Optimization

PERIOD = 0.05


class Mass(Model):
    """A mass on a spring that a force moves, in bare numbers."""

    m, c, d = Parameter(1.0, min=0.1), Parameter(4.0), Parameter(2.0)
    s, v = Real(start=0.0), Real(start=0.0)
    f = Input(min=-20.0, max=20.0)
    place = Real()

    def equations(self):
        yield der(self.s) == self.v
        yield self.m * der(self.v) == self.f - self.c * self.s - self.d * self.v
        yield self.place == self.s


class Reach(Optimization):
    """The mass shall stand at 1."""

    mass = Mass()

    def integrand(self):
        return 10 * (self.mass.s - 1.0) ** 2 + 0.1 * self.mass.v**2


class Smoothly(Reach):
    """The same by a force without jumps."""

    def integrand(self):
        return super().integrand() + 1e-3 * der(self.mass.f) ** 2


PLANT: Any = dict(m=1.3, c=5.0, d=1.5)


@pytest.mark.parametrize(
    ("problem", "kind", "name", "terminal", "stop"),
    [
        (Reach, ExtendedKalman, "mass.f", "lqr", 8.0),
        (Reach, MovingHorizon, "mass.f", None, 8.0),
        (Reach, ExtendedKalman, "mass.place", None, 20.0),
        (Smoothly, ExtendedKalman, "mass.f", None, 20.0),
    ],
)
def test_a_disturbance_that_is_estimated_leaves_no_offset(problem, kind, name, terminal, stop):
    mpc = Mpc(problem, period=PERIOD, elements=30, disturbance=[name], terminal=terminal)
    estimator = kind(problem, period=PERIOD, measured={"mass.place": 1e-3}, disturbance={name: 1.0})
    loop = mpc.run(problem(mass=PLANT), stop=stop, estimator=estimator)
    assert abs(loop["mass.s"][-1] - 1.0) < 1e-6
    lacking = -1.0 if name == "mass.f" else -0.25  # the plant's spring wants 5 in the place of 4
    assert loop.estimates[f"disturbance({name})"][-1] == pytest.approx(lacking, abs=1e-5)
    offset = Mpc(problem, period=PERIOD, elements=30, terminal=terminal).run(problem(mass=PLANT), stop=6.0)
    assert abs(offset["mass.s"][-1] - 1.0) > 1e-3


@pytest.mark.parametrize("kind", [ExtendedKalman, MovingHorizon])
def test_a_loop_with_an_estimator_goes_on_as_if_it_had_not_ended(kind):
    mpc = Mpc(Reach, period=PERIOD, elements=10, disturbance=["mass.f"])
    own: Any = dict(period=PERIOD, measured={"mass.place": 1e-3}, disturbance={"mass.f": 1.0})
    given: Any = dict(noise={"mass.place": 1e-3}, seed=4, estimator=kind(Reach, **own))
    plant: Any = Reach(mass=PLANT)
    whole, first = (mpc.run(plant, stop=periods * PERIOD, **given) for periods in (10, 4))
    found = mpc.run(plant, stop=10 * PERIOD, after=first, **given)
    np.testing.assert_allclose(found["mass.f"], whole["mass.f"], rtol=1e-6)
    name = "disturbance(mass.f)"
    np.testing.assert_allclose(found.estimates[name], whole.estimates[name], rtol=1e-6)
    with pytest.raises(ModelError, match="found the estimator None, expected that of the loop before"):
        mpc.run(plant, stop=10 * PERIOD, after=first)


def test_a_parameter_that_is_estimated_is_taken_by_the_controller():
    given: Any = dict(period=PERIOD, measured={"mass.s": 1e-3, "mass.v": 1e-2}, parameters={"mass.c": 2.0})
    mpc = Mpc(Reach, period=PERIOD, elements=30, parameters=["mass.c"])
    loop = mpc.run(Reach(mass=dict(c=5.0)), stop=6.0, estimator=ExtendedKalman(Reach, **given))
    assert loop.estimates["mass.c"][-1] == pytest.approx(5.0, abs=1e-3)
    assert loop["mass.s"][-1] == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("kind", [ExtendedKalman, MovingHorizon])
def test_noisy_outputs_are_enough(kind):
    mpc = Mpc(Reach, period=PERIOD, elements=20, terminal="lqr", delay=1)
    noise = {"mass.s": 0.01}
    estimator = kind(Reach, period=PERIOD, measured=noise, noise={"mass.v": 0.05})
    loop = mpc.run(stop=6.0, noise=noise, estimator=estimator, seed=2)
    assert np.abs(loop["mass.s"][60:] - 1.0).max() < 0.05
    assert np.std(loop.estimates["mass.s"][60:] - loop["mass.s"][60:-1]) < 0.005
    again = mpc.run(stop=6.0, noise=noise, estimator=estimator, seed=2)
    np.testing.assert_array_equal(loop["mass.s"], again["mass.s"])


def test_an_estimate_that_is_told_is_kept():
    told, state = Mpc(Reach, period=PERIOD, disturbance="mass.f"), {"mass.s": 1.0, "mass.v": 0.0}
    first = told.step(state | {"disturbance(mass.f)": -1.0})
    assert told.estimated == ("disturbance(mass.f)",)
    assert told.step(state, PERIOD)["mass.f"] == pytest.approx(first["mass.f"], abs=1e-6)
    assert told.step(state | {"disturbance(mass.f)": np.nan}, 2 * PERIOD)["mass.f"] == pytest.approx(
        5.0, abs=1e-6
    )


SEEN: Any = dict(period=PERIOD, measured={"mass.s": 1e-3})
SLOW = ExtendedKalman(Reach, period=0.1, measured={"mass.s": 1.0})


@pytest.mark.parametrize(
    ("keywords", "run", "told"),
    [
        (dict(disturbance=["mass.f"]), dict(estimator=ExtendedKalman(Reach, **SEEN)), "does not estimate disturbance(mass"),
        ({}, dict(estimator=SLOW), "a period of 0.1 s, expected 0.05 s"),
        ({}, dict(estimator=ExtendedKalman(Reach, **SEEN), noise={"mass.v": 1.0}), "found noise='mass.v', expected some of"),
        ({}, dict(estimator="kalman"), "found estimator='kalman', expected a MovingHorizon or an ExtendedKalman"),
        (dict(disturbance=["mass.c"]), {}, "found disturbance='mass.c', expected an input or a measured variable"),
        (dict(disturbance=["mass.g"]), {}, "has no variable or parameter 'mass.g'"),
        (dict(parameters=["mass.f"]), {}, "found parameters='mass.f', expected a parameter of the equations"),
    ],
)  # fmt: skip
def test_what_does_not_fit_together_is_told(keywords, run, told):
    with pytest.raises(ModelError) as raised:
        Mpc(Reach, period=PERIOD, **keywords).run(stop=1.0, **run)
    assert told in str(raised.value)
