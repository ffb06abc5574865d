"""Tables as blocks against SciPy's interpolators."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from gantrytau import Model, ModelError, connect, simulate, translate
from gantrytau.blocks import Integrator, Ramp, Table1, Table2

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
    class Looked(Model):
        ramp, table, memory = Ramp(height=4.0, offset=-1.0), Table1(XS, YS), Integrator()

        def equations(self):
            yield connect(self.ramp.y, self.table.u)
            yield connect(self.table.y, self.memory.u)

    found = simulate(Looked(), stop=1.0, points=2, tolerance=1e-10)
    assert found.final("memory.y") == pytest.approx(np.trapezoid(YS, XS) / 4.0, abs=1e-8)


def test_wrong_tables():
    for block, words in (
        (Table1([0.0, 0.0], [1.0, 2.0]), r"Table1\), equation 1: table: .*rise"),
        (Table1([0.0, 1.0], [1.0, 2.0, 3.0]), r"found 2 numbers xs and ys of shape \(3,\)"),
        (Table1(XS, YS, kind="cubic"), "found kind='cubic', expected one of 'linear', 'spline'"),
        (Table2([0.0, 1.0], [0.0, 1.0], [[1.0, 2.0]]), r"found values of shape \(1, 2\), expected \(2, 2\)"),
    ):
        with pytest.raises(ModelError, match=words):
            translate(block)
