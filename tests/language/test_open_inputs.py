"""Which inputs stay known from outside, and the one name that no quantity of a model can have."""

import pytest

from gantrytau import (
    Array,
    Input,
    Model,
    ModelError,
    Output,
    Parameter,
    Real,
    connect,
    der,
    outer,
    simulate,
    translate,
)


class Wind(Model):
    u = Input(start=3.0)


class Reader(Model):
    wind = outer(Wind)
    y = Real()

    def equations(self):
        yield self.y == self.wind.u


class Doubled(Model):
    u = Input(start=1.0)
    y = Output()

    def equations(self):
        yield self.y == 2 * self.u


@pytest.mark.parametrize("reader", ["v", "w", "win", "wind_"])
def test_an_input_that_is_read_from_elsewhere_stays_one(reader):
    """Whatever the name of the reader, the beginning of its owner's as well."""
    model = type("Weather", (Model,), {reader: Reader(), "wind": Wind()})()
    dae = translate(model)
    assert dae.inputs == ("wind.u",)
    assert dae.evaluate({"wind.u": 4.0})[f"{reader}.y"] == 4.0
    several = type("Weather", (Model,), {reader: Array(Reader, 2), "wind": Wind()})()
    assert translate(several).inputs == ("wind.u",)


def test_an_input_stays_one_where_a_variable_is_bound_to_it():
    class Follower(Model):
        x = Real()

    class Bound(Model):
        v = Input(start=1.5)
        follower = Follower(x=2 * v)
        doubled = Doubled(u=v)
        same = Follower(x=v)

    dae = translate(Bound())
    assert dae.inputs == ("v",)
    found = dae.evaluate({"v": 3.0})
    assert (found["follower.x"], found["doubled.y"], found["same.x"]) == (6.0, 6.0, 3.0)


def test_an_input_of_an_element_is_set_by_the_model_around():
    class Pair(Model):
        parts = Array(Doubled, 2)

        def equations(self):
            yield self.parts[0].u == 5.0
            yield connect(self.parts[0].y, self.parts[1].u)

    dae = translate(Pair())
    assert dae.inputs == ()
    assert dae.evaluate()["parts[1].y"] == 20.0


def test_a_quantity_of_the_root_is_not_called_time():
    class Left(Model):
        time = Real(start=5.0, fixed=True)

        def equations(self):
            yield der(self.time) == -1.0

    class Around(Model):
        left = Left()

    words = (
        r"^time: found a quantity of the outermost model with the name of the time, .*expected another name"
    )
    for model in (Left(), type("Constant", (Model,), {"time": Parameter(2.0)})()):
        with pytest.raises(ModelError, match=words):
            translate(model)
    result = simulate(Around(), stop=1.0)
    assert result.final("left.time") == pytest.approx(4.0, abs=1e-12)
    assert result.final("time") == 1.0
