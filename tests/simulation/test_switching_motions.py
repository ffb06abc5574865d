"""Motions whose equations switch on their own unknowns: simulated, linearised, called and exported in both versions."""

import math
import shutil
from typing import Any

import casadi as ca
import pytest

from gantrytau import Input, Model, Real, der, if_else, linearize, simulate, translate
from gantrytau_fmu import export_fmu, run_fmu

COMPILER = any(map(shutil.which, ("cc", "gcc", "clang")))


class Coulomb(Model):
    """Dry friction against the acceleration: 2 a = f - 1 where it moves forward."""

    f = Input(start=5.0)
    a = Real()
    v = Real(start=0.0, fixed=True)

    def equations(self):
        yield self.a == der(self.v)
        yield 2 * self.a == self.f - if_else(self.a > 0, 1.0, -1.0)


class Controlled(Model):
    """An algebraic loop through a controller with limits, which leaves its limit on the way."""

    f = Input(start=3.0)
    e = Real()
    a = Real()
    v = Real(start=0.0, fixed=True)

    def equations(self):
        yield self.e == self.f - self.a - self.v
        yield self.a == ca.fmin(ca.fmax(4 * self.e, -1), 1)
        yield der(self.v) == self.a


# at its limit until v = 1.75, then a = 0.8 (3 - v)
CONTROLLED = 3.0 - 1.25 * math.exp(-0.8 * (3.0 - 1.75))
MOTIONS: dict[str, tuple[type[Model], float, float, float, float]] = {  # v(3), then A, B and a at v = 2
    "coulomb": (Coulomb, 6.0, 0.0, 0.5, 2.0),
    "controlled": (Controlled, CONTROLLED, -0.8, 0.8, 0.8),
}


@pytest.mark.parametrize("name", MOTIONS)
def test_simulation_linearization_and_function_agree(name):
    model, final, A, B, a = MOTIONS[name]
    assert simulate(model(), stop=3.0, points=7).final("v") == pytest.approx(final, rel=1e-7)
    found = linearize(model(), at={"v": 2.0})
    assert (found.A[0, 0], found.B[0, 0]) == pytest.approx((A, B), abs=1e-14)
    dae = translate(model())
    function = dae.function(["v", "f"], ["der(v)"])
    f = dae.start["f"]
    assert float(function(2.0, f)) == pytest.approx(a, rel=1e-14)
    assert [float(d) for d in function.jacobian()(2.0, f, 0)] == pytest.approx([A, B], abs=1e-14)
    assert [float(d) for d in function.reverse(1)(2.0, f, 0, 1)] == pytest.approx([A, B], abs=1e-14)


@pytest.mark.skipif(not COMPILER, reason="no C compiler")
@pytest.mark.filterwarnings("ignore::gantrytau_fmu.UnconnectedInputs")
@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize("name", MOTIONS)
def test_fmus_move_alike(name, fmi, tmp_path):
    model, final, *_ = MOTIONS[name]
    options: dict[str, Any] = {"fmi": fmi}
    export_fmu(model(), tmp_path / "motion.fmu", **options)
    assert run_fmu(tmp_path / "motion.fmu", stop=3.0).final("v") == pytest.approx(final, rel=1e-5)
