"""Tables in costs, limits, times and known inputs of a problem are refused, as in models."""

import casadi as ca
import pytest

from gantrytau import Input, Model, ModelError, Real, between, der
from gantrytau_optimica import Optimization, Samples, final, optimize, sum_of_squares

TABLE = ca.interpolant("lut", "linear", [[0.0, 1.0, 2.0, 3.0]], [0.0, 1.0, 4.0, 9.0])
SAMPLES = Samples([0.0, 0.5, 1.0], [0.0, 1.0, 2.0])


class Push(Model):
    x = Real(start=0.0, fixed=True)
    u = Input()

    def equations(self):
        yield der(self.x) == self.u


class Base(Optimization):
    m = Push()
    final_time = 1.0


@pytest.mark.parametrize(
    ("place", "members"),
    [
        ("One.integrand", dict(integrand=lambda self: TABLE(self.m.x))),
        (r"One.objective|final\(m\.x\)", dict(objective=lambda self: TABLE(final(self.m.x)))),
        (r"final\(", dict(objective=lambda self: final(TABLE(self.m.x)))),
        ("One, constraint 1", dict(constraints=lambda self: iter([between(0, TABLE(self.m.x), 1)]))),
        ("One, constraint 1", dict(constraints=lambda self: iter([self.m.u <= TABLE(self.m.x)]))),
        ("", dict(objective=lambda self: sum_of_squares(TABLE(self.m.x), SAMPLES))),
        ("input m.u", dict(inputs={"m.u": TABLE})),
    ],
)
def test_a_table_is_refused_where_it_stands(place, members):
    with pytest.raises(
        ModelError, match=rf"({place}).*found a call of the function 'lut'.*write table\(x, xs, ys\)"
    ):
        optimize(type("One", (Base,), members), elements=4)
