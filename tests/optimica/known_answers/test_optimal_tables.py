"""Tables in optimal control: the top of a curve, and a force that a table gives."""

from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from gantrytau import Input, Model, Parameter, Real, between, der, table
from gantrytau_optimica import Free, Optimization, final, initial, optimize

xs = np.array([0.0, 0.4, 1.1, 1.5, 2.3, 3.0])
ys = np.array([0.1, 0.9, 1.7, 1.6, 0.4, 0.2])


class Cart(Model):
    m = Parameter(1.0, unit="kg")
    s = Real(unit="m", start=0.3, fixed=True)
    v = Real(unit="m/s", start=0.0, fixed=True)
    u = Input(unit="N")

    def equations(self):
        yield der(self.s) == self.v
        yield self.m * der(self.v) == self.u


class Top(Optimization):
    """Stop on the top of a curve."""

    cart = Cart()
    final_time = 2.0

    def objective(self):
        return -table(final(self.cart.s), xs, ys, kind="spline")

    def constraints(self):
        yield final(self.cart.v) == 0
        yield between(-20.0, self.cart.u, 20.0)


def test_a_cart_stops_on_the_top_of_a_curve():
    spline: Any = CubicSpline(xs, ys)
    top = max(spline.derivative().roots(extrapolate=False), key=spline)
    found = optimize(Top, elements=10)
    assert abs(found["cart.s"][-1] - top) < 1e-5  # the square root of the tolerance, as the top is flat
    assert abs(-found.objective - spline(top)) < 1e-8


class Held(Optimization):
    """Move against a spring that is a table, with the least force squared."""

    cart = Cart()
    final_time = 3.0

    def integrand(self):
        return self.cart.u**2

    def constraints(self):
        yield initial(self.cart.v) == 0
        yield final(self.cart.s) == 1.0
        yield final(self.cart.v) == 0


@pytest.mark.parametrize("kind", ["linear", "spline"])
def test_a_table_that_is_a_line_gives_the_motion_of_the_line(kind):
    class Sprung(Cart):
        def equations(self):
            yield der(self.s) == self.v
            yield self.m * der(self.v) == self.u + table(
                self.s, [-9.0, 0.0, 2.0, 9.0], [18.0, 0.0, -4.0, -18.0], kind=kind
            )

    class Line(Cart):
        k = Parameter(2.0, unit="N/m")

        def equations(self):
            yield der(self.s) == self.v
            yield self.m * der(self.v) == self.u - self.k * self.s

    costs = [
        optimize(type("Held", (Held,), {"cart": model()}), elements=10).objective for model in (Sprung, Line)
    ]
    assert abs(costs[0] - costs[1]) < 1e-7 * costs[1]


class Dragged(Cart):
    """With a drag that is known up to 0.5 m/s."""

    def equations(self):
        yield der(self.s) == self.v
        drag = table(self.v, [0.0, 0.3, 0.5], [0.0, 0.05, 0.1], outside="error")
        yield self.m * der(self.v) == self.u - drag * self.one

    one = Parameter(1.0, unit="N")


class FastDragged(Optimization):
    """1 m from rest to rest, which would be faster beyond 0.5 m/s."""

    cart, final_time = Dragged(s=dict(start=0.0)), Free(2.0, unit="s", min=0.1)

    def objective(self):
        return self.final_time

    def constraints(self):
        yield between(-1.0, self.cart.u, 1.0)
        yield final(self.cart.s) == 1.0
        yield final(self.cart.v) == 0


def test_a_motion_stays_where_its_table_is_defined():
    found = optimize(FastDragged)
    # u = 1 up to 0.5 m/s, held there, u = -1: times and ways are quadratures of dv / v' and v dv / v'
    v, width = (np.arange(100000) + 0.5) * 5e-6, 5e-6
    drag = np.interp(v, [0.0, 0.3, 0.5], [0.0, 0.05, 0.1])
    inverse = 1 / (1 - drag) + 1 / (1 + drag)
    duration = width * inverse.sum() + (1 - width * (v * inverse).sum()) / 0.5
    assert found.final_time == pytest.approx(duration, abs=3e-4)  # both switches inside of elements of 0.05 s
    assert np.max(found["cart.v"]) < 0.5 + 1e-6
    assert "cart.v at its upper limit 0.5" in found.report()
