"""Tables, callbacks and functions of MX with tables in models: refused, as CasADi cannot differentiate their calls."""

import casadi as ca
import pytest

from gantrytau import Input, Model, ModelError, Parameter, Real, der, simulate, translate

WORDS = r"found a call of the function '{}'.*expected an expression of symbols; write table\(x, xs, ys\) for a table"
TABLE = ca.interpolant("lut", "linear", [[0.0, 1.0, 2.0, 3.0]], [0.0, 1.0, 4.0, 9.0])
_x = ca.MX.sym("x")
OF_MX = ca.Function("of_mx", [_x], [ca.sin(_x) + TABLE(_x)])
_y = ca.SX.sym("y")
OF_SX = ca.Function("of_sx", [_y], [_y**2])
NESTED = ca.Function("nested", [_y], [2 - TABLE(2 * _y - 0.3)])


class Called(ca.Callback):
    """A function that CasADi calls in Python."""

    def __init__(self):
        ca.Callback.__init__(self)
        self.construct("called", {})

    def eval(self, arguments):
        return [arguments[0] ** 2]


CALLED = Called()


class Falling(Model):
    x = Real(start=0.5, fixed=True)
    u = Input(start=1.0)

    def equations(self):
        yield der(self.x) == -self.u


def falling(rate):
    class Bench(Falling):
        inner = Falling()

        def equations(self):
            yield self.inner.u == rate(self)
            yield der(self.x) == -self.u

    return Bench()


@pytest.mark.parametrize("use", [translate, lambda m: simulate(m, stop=1.0)])
@pytest.mark.parametrize(
    ("function", "name"), [(TABLE, "lut"), (OF_MX, "lut"), (NESTED, "lut"), (CALLED, "called")]
)
def test_a_call_in_an_equation_is_refused(function, name, use):
    words = r"the model \(Bench\), equation 1: " + WORDS.format(name)
    for rate in (lambda m: function(m.x), lambda m: m.x - 2 * function(2 * m.inner.u - 0.3)):
        with pytest.raises(ModelError, match=words):
            use(falling(rate))


def test_a_derivative_of_a_call_is_refused():
    with pytest.raises(ModelError, match=r"the model \(Bench\), equation 1: der\(\): " + WORDS.format("lut")):
        translate(falling(lambda m: der(TABLE(m.x) ** 2)))


def test_calls_in_attributes_initial_equations_and_inputs_are_refused():
    class Numbers(Falling):
        q = Parameter(1.5)
        p = Parameter(lambda self: TABLE(self.q))

    class Begins(Numbers):
        p = Parameter(2.0)
        x = Real(start=lambda self: TABLE(self.q), fixed=True)

    class Begin(Falling):
        def initial_equations(self):
            yield TABLE(self.x) == 2

    for model, place in (
        (Numbers(), "p: value: "),
        (Begins(), "x: start: "),
        (Begin(), r"the model \(Begin\), equation 1: "),
    ):
        with pytest.raises(ModelError, match=place + WORDS.format("lut")):
            translate(model)
    for course in (TABLE, lambda t: OF_MX(t) + 1):
        with pytest.raises(ModelError, match="input u: " + WORDS.format("lut")):
            simulate(Falling(), stop=1.0, inputs={"u": course})


@pytest.mark.parametrize("square", [OF_SX, ca.Function("of_mx", [_x], [_x**2])])
def test_a_function_of_a_formula_is_an_expression(square):
    """der(x) == -x**2 from 0.5 is x = 1 / (2 + t)."""
    model = falling(lambda m: 0)

    class Squared(Model):
        x = Real(start=0.5, fixed=True)

        def equations(self):
            yield der(self.x) == -square(self.x)

    assert simulate(Squared(), stop=1.0).final("x") == pytest.approx(1 / 3, rel=1e-5)
    assert simulate(model, stop=1.0, inputs={"u": square}).final("x") == pytest.approx(0.5 - 1 / 3, rel=1e-5)
