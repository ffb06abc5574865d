"""Tables as blocks against SciPy's interpolators, and delays against closed forms."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from gantrytau import Fixed, Model, ModelError, simulate, sin, translate
from gantrytau.blocks import Delay, Integrator, Ramp, Table1, Table2
from tests.mechanisms.rows import in_a_row, row

XS, YS = [-1.0, 0.0, 0.5, 2.0, 3.0], [2.0, -1.0, 0.0, 4.0, 1.0]


@pytest.mark.parametrize(
    ("kind", "expected"),
    [("linear", lambda u: np.interp(u, XS, YS)), ("spline", CubicSpline(XS, YS, bc_type="not-a-knot"))],
)
def test_a_table_of_one_argument(kind, expected):
    dae = translate(Table1(XS, YS, kind=kind))
    for u in np.linspace(-1.0, 3.0, 17):
        assert dae.evaluate({"u": u})["y"] == pytest.approx(float(expected(u)), abs=1e-13)


def test_outside_a_table_holds_or_goes_on():
    held, continued = (translate(Table1(XS, YS, outside=way)) for way in ("hold", "linear"))
    assert held.evaluate({"u": 5.0})["y"] == 1.0
    assert continued.evaluate({"u": 5.0})["y"] == pytest.approx(1.0 - 3.0 * 2.0, abs=1e-13)
    assert held.evaluate({"u": -5.0})["y"] == 2.0


def test_a_table_of_two_arguments():
    ys = [0.0, 1.0, 4.0]
    values = np.random.default_rng(2).normal(size=(5, 3))
    dae = translate(Table2(XS, ys, values))
    for u in ([-0.3, 0.2], [2.5, 3.9], [0.5, 1.0], [3.0, 0.0]):
        along = [np.interp(u[0], XS, column) for column in values.T]  # bilinear: one after the other
        assert dae.evaluate({"u": u})["y"] == pytest.approx(np.interp(u[1], ys, along), abs=1e-13)


def test_the_kinks_of_a_table_are_exact_in_time():
    Looked = in_a_row("Looked", ramp=Ramp(height=4.0, offset=-1.0), table=Table1(XS, YS), memory=Integrator())

    found = simulate(Looked(), stop=1.0, points=2, tolerance=1e-10)
    assert found.final("memory.y") == pytest.approx(np.trapezoid(YS, XS) / 4.0, abs=1e-8)


def test_wrong_tables():
    for block, words in (
        (Table1([0.0, 0.0], [1.0, 2.0]), r"Table1\), equation 1: table: .*rise"),
        (Table1([0.0, 1.0], [1.0, 2.0, 3.0]), "found ys of 3"),
        (Table1(XS, YS, kind="cubic"), "found kind='cubic'"),
        (Table2([0.0, 1.0], [0.0, 1.0], [[1.0, 2.0]]), "found values of"),
    ):
        with pytest.raises(ModelError, match=words):
            translate(block)


def test_a_delayed_sine_is_a_sine_later():
    found = simulate(Delay(T=0.3), stop=2.0, inputs={"u": lambda t: sin(5 * t)}, tolerance=1e-10)
    expected = np.where(found.time > 0.3, np.sin(5 * (found.time - 0.3)), 0.0)
    np.testing.assert_allclose(found["y"], expected, atol=1e-7)


def test_an_integrator_fed_back_with_a_delay_follows_its_polynomials():
    """x' = -x(t - 1) from 1: the method of steps gives 1 - t, then 1 - t + (t - 1)^2 / 2, ..."""

    class Oscillator(Model):
        memory, past = Integrator(k=-1.0, y=Fixed(1.0)), Delay(T=1.0)

        def equations(self):
            yield from row(self.memory, self.past, self.memory)

    found = simulate(Oscillator(), stop=2.0, tolerance=1e-10)
    t = found.time
    np.testing.assert_allclose(found["memory.y"], 1 - t + np.maximum(t - 1, 0) ** 2 / 2, atol=1e-7)


def test_a_delay_is_above_zero():
    for T, words in (
        (0.0, "found T = 0; expected a time above zero"),
        (-1.0, "T: value is -1, expected at least 0"),
    ):
        with pytest.raises(ModelError, match=words):
            simulate(Delay(T=T), stop=1.0, inputs={"u": 1.0})
