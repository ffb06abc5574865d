"""Other start values for a translated model: as if it had been translated with them, or refused by name."""

import math
import time

import numpy as np
import pytest

from gantrytau import Fixed, Input, Model, ModelError, Parameter, Real, der, sampled, simulate, translate
from gantrytau_models import FourBar, GantryTau, Pendulum, prototypes


class Spring(Model):
    """A mass on a spring; `twice` is an alias of its place, `shape` follows from it."""

    c = Parameter(4.0)
    x = Real(2, start=[1.0, 0.0], fixed=True)
    twice = Real()
    root = Real(start=1.0)
    f = Input(start=0.0)
    count = Real(start=0.0)

    def equations(self):
        yield der(self.x[0]) == self.x[1]
        yield der(self.x[1]) == -self.c * self.x[0] + self.f
        yield self.twice == 2 * self.x[0]
        yield self.root**2 == 4.0
        yield sampled(self.count, self.count + 1, period=1.0)


def test_a_motion_begins_where_it_is_told():
    dae = translate(Spring(), events=True)
    for x, v in ((3.0, 0.0), (0.5, -2.0)):
        found = simulate(dae, stop=2.0, starts={"x": [x, v]})
        exact = x * np.cos(2 * found.time) + v / 2 * np.sin(2 * found.time)
        np.testing.assert_allclose(found["x[0]"], exact, atol=1e-6)  # a hundred times the tolerance
    assert simulate(dae, stop=0.1, starts={"x[0]": 5.0})["x"][0].tolist() == [5.0, 0.0]
    assert simulate(dae, stop=0.1, starts={"twice": 8.0})["x[0]"][0] == 4.0
    assert simulate(dae, stop=0.1)["x[0]"][0] == 1.0  # the translation is as it was
    begun = dae.with_starts({"x": [3.0, 0.0]})
    assert (
        simulate(begun, stop=2.0)["x[0]"].tolist()
        == simulate(dae, stop=2.0, starts={"x": [3.0, 0.0]})["x[0]"].tolist()
    )


def test_algebraic_variables_take_the_branch_of_their_new_start():
    dae = translate(Spring(), events=True)
    assert simulate(dae, stop=0.1).final("root") == pytest.approx(2.0)
    assert simulate(dae, stop=0.1, starts={"root": -1.0}).final("root") == pytest.approx(-2.0)


def test_what_is_sampled_begins_with_its_start():
    assert simulate(translate(Spring(), events=True), stop=2.5, starts={"count": 10.0}).final("count") == 13.0


@pytest.mark.parametrize("phi", [0.3, 2.0])
def test_positions_of_a_loop_are_made_consistent(phi):
    dae = translate(FourBar())
    found = simulate(dae, stop=0.2, starts={"crank.phi": phi, "crank.w": 1.0}, points=11)
    again = simulate(FourBar(crank=dict(phi=Fixed(phi), w=Fixed(1.0))), stop=0.2, points=11)
    np.testing.assert_allclose(found["crank.phi"], again["crank.phi"], atol=1e-6)
    assert found["crank.phi"][0] == pytest.approx(phi, abs=1e-12)
    assert found["crank.w"][0] == pytest.approx(1.0, abs=1e-12)


def test_the_tool_of_a_robot_is_put_elsewhere_at_once():
    dae = translate(GantryTau(prototypes.L1))
    place = dae.evaluate({})["tool.r"] + np.array([0.0, 0.05, 0.02])
    found = simulate(dae, stop=0.05, starts={"tool.r": place}, points=3)
    np.testing.assert_allclose(found["tool.r"][0], place, atol=1e-10)
    across = found["tool.r"][0] - found["arms[0].frame_cart.r"][0]
    assert np.linalg.norm(across) == pytest.approx(prototypes.L1.arms[0].length, abs=1e-10)


def test_it_takes_no_new_translation():
    dae = translate(Pendulum())
    begin = time.perf_counter()
    simulate(dae, stop=0.01, points=2)
    middle = time.perf_counter()
    simulate(dae, stop=0.01, points=2, starts={"x": 0.6, "y": -0.8})
    assert time.perf_counter() - middle < 2 * (middle - begin) + 0.1
    found = simulate(dae, stop=0.01, points=2, starts={"x": math.sin(0.3), "y": -math.cos(0.3)})
    assert found["x"][0] == pytest.approx(math.sin(0.3), abs=1e-9)


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        (dict(starts={"z": 1.0}), "Spring has no variable or parameter 'z'"),
        (dict(starts={"c": 1.0}), "c is a parameter, expected a variable; give it in parameters"),
        (dict(starts={"f": 1.0}), "f is an input, expected a variable; give it in inputs"),
        (dict(starts={"der(x)": 1.0}), "der(x) is no declared variable"),
        (dict(starts={"x": 1.0}), "starts: x: found 1 values, expected 2"),
        (dict(starts={"x[0]": math.nan}), "starts: x[0]: found nan, expected finite numbers"),
        (dict(starts={"x[0]": 1.0, "twice": 3.0}), "twice contradicts x[0], of which it is an alias"),
        (dict(starts=[1.0]), "Spring: found starts=[1.0], expected {name: value}"),
        (dict(parameters={"x.start": 3.0}), "x is a variable, its start goes in starts"),
        (dict(parameters={"x": 3.0}), "x is a variable, its start goes in starts"),
    ],
)
def test_wrong_starts(keywords, words):
    with pytest.raises(ModelError) as caught:
        simulate(Spring(), stop=1.0, **keywords)
    assert words in str(caught.value)


def test_a_start_of_what_is_constant():
    class Constant(Model):
        x = Real()

        def equations(self):
            yield self.x == 3.0

    with pytest.raises(ModelError, match="x is constant and equal to 3; leave it out"):
        simulate(Constant(), stop=1.0, starts={"x": 2.0})
