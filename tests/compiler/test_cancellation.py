"""Derivatives that cancel between equations are taken out by combinations; where none does, the equations are named."""

import numpy as np
import pytest

import gantrytau as gt
from gantrytau import (
    Model,
    Parameter,
    Real,
    Start,
    StructureError,
    connect,
    der,
    pre,
    reinit,
    simulate,
    sin,
    time,
    translate,
    when,
)
from gantrytau.mechanics import rotational
from gantrytau.mechanics.gears import IdealGear
from gantrytau.mechanics.translational import Fixed, Mass, Spring

W = 100.0  # rad/s


class Transformer(Model):
    """Two coils with the coupling k on a source behind R1, R2 across the second."""

    L1, L2 = Parameter(0.1, unit="H"), Parameter(0.4, unit="H")
    k = Parameter(1.0, unit="1")
    R1, R2 = Parameter(1.0, unit="Ohm"), Parameter(10.0, unit="Ohm")
    i1, i2 = Real(unit="A"), Real(unit="A")
    v1, v2 = Real(unit="V"), Real(unit="V")

    def equations(self):
        mutual = self.k * gt.sqrt(self.L1 * self.L2)
        yield self.v1 == self.L1 * der(self.i1) + mutual * der(self.i2)
        yield self.v2 == mutual * der(self.i1) + self.L2 * der(self.i2)
        yield self.v2 == -self.R2 * self.i2
        yield 5 * sin(W * time) == self.R1 * self.i1 + self.v1


def test_an_ideal_transformer():
    dae = translate(Transformer())
    assert len(dae.states) == 1  # the flux, as both coils share it
    result = simulate(dae, stop=4.0, points=3, tolerance=1e-9)
    # seen from the first coil, R2 (L1 / L2) beside j W L1; what the start leaves behind has died away
    coil, load = 1j * W * 0.1, 10.0 * 0.1 / 0.4
    drawn = 5 / (1.0 + coil * load / (coil + load))
    assert result.final("i1") == pytest.approx((drawn * np.exp(4j * W)).imag, abs=1e-7)


def test_a_coupling_that_is_changed_is_no_longer_ideal():
    leaky = simulate(Transformer(k=0.9), stop=0.1, points=3)
    changed = simulate(translate(Transformer()), stop=0.1, points=3, parameters={"k": 0.9})
    assert changed.final("i1") == pytest.approx(leaky.final("i1"), abs=1e-7)


class SumAndDifference(Model):
    """Two masses of 1 kg, pushed by 1 N and held at a given distance, in the sum and the difference of their places."""

    x, y, f = Real(start=0.5), Real(), Real()
    s, d = Real(), Real()

    def equations(self):
        yield self.s == self.x + self.y
        yield self.d == self.x - self.y
        yield der(self.s, 2) + der(self.d, 2) == 2 * (1 - self.f)
        yield der(self.s, 2) - der(self.d, 2) == 2 * self.f
        yield self.x - self.y == sin(time)


def test_sums_and_differences_as_coordinates():
    result = simulate(SumAndDifference(), stop=1.0, points=3, tolerance=1e-9)
    t = result.time
    begin = result["s"][0] + (result["s"][-1] - result["s"][0] - 0.5) * t
    assert result["s"] == pytest.approx(begin + t**2 / 2, abs=1e-7)
    assert result["f"] == pytest.approx((1 + np.sin(t)) / 2, abs=1e-7)


class Shared(Model):
    """Two equations with the same combination of derivatives; what they leave is given."""

    factor = Parameter(2.0)
    x, y, z = Real(start=1.0), Real(), Real()

    def equations(self):
        yield der(self.x) + der(self.y) == 1
        yield self.factor * (der(self.x) + der(self.y)) == self.rest()
        yield self.x - self.y == self.z

    def rest(self):
        raise NotImplementedError


class Repeated(Shared):
    """The second equation contradicts the first."""

    def rest(self):
        return 3


class Changing(Shared):
    """The factor of the combination depends on the motion."""

    def equations(self):
        yield der(self.x) + self.y * der(self.y) == self.z
        yield self.y * der(self.x) + self.y**2 * der(self.y) == 2 - self.z
        yield self.z == self.x * self.y


@pytest.mark.parametrize(
    ("model", "why"), [(Repeated, "determines no unknown"), (Changing, "its factors change with the motion")]
)
def test_equations_that_cannot_be_combined_are_named(model, why):
    with pytest.raises(StructureError, match=r"equation 1 and .*equation 2.* hold their highest") as told:
        translate(model())
    assert why in str(told.value)


class BetweenSprings(Model):
    """A wall, a spring, a mass, a spring and a second mass."""

    wall, load = Fixed(), Mass(m=2.0, s=Start(1.5))
    near, far = Spring(c=100.0, s_rel0=0.5), Spring(c=200.0, s_rel0=0.5)
    body = Mass()

    def equations(self):
        yield connect(self.wall.flange, self.near.flange_a)
        yield connect(self.near.flange_b, self.body.flange)
        yield connect(self.body.flange, self.far.flange_a)
        yield connect(self.far.flange_b, self.load.flange)


def test_a_mass_of_zero_between_springs_leaves_them_in_series():
    result = simulate(BetweenSprings(), stop=1.0, points=3, parameters={"body.m": 0.0}, tolerance=1e-9)
    stiffness = 100 * 200 / (100 + 200)
    assert result.final("load.s") == pytest.approx(1 + 0.5 * np.cos(np.sqrt(stiffness / 2)), abs=1e-7)


class Geared(Model):
    """A motor whose load is turned round behind the gear; the motor's speed is what is fixed."""

    motor, load = rotational.Inertia(J=1.0, phi=gt.Fixed(0.0), w=gt.Fixed(1.0)), rotational.Inertia(J=0.5)
    gear = IdealGear(ratio=3.0)

    def equations(self):
        yield connect(self.motor.flange_b, self.gear.flange_a)
        yield connect(self.gear.flange_b, self.load.flange_a)
        yield when(time >= 0.5, reinit(self.load.w, -pre(self.load.w)))


def test_a_multiple_of_a_state_takes_a_new_value():
    assert simulate(Geared(), stop=1.0, points=3).final("motor.w") == pytest.approx(-1.0)


class Curved(Geared):
    """A reinit of what is no fixed multiple of a state."""

    c = Parameter(2.0)
    y = Real()

    def equations(self):
        yield self.y == self.c * self.motor.w**2 + self.motor.w
        yield connect(self.motor.flange_b, self.gear.flange_a)
        yield connect(self.gear.flange_b, self.load.flange_a)
        yield when(time >= 0.5, reinit(self.y, 1.0))


def test_what_is_no_multiple_of_a_state_is_refused():
    with pytest.raises(gt.ModelError, match=r"reinit\(y, ...\), but y is no state"):
        translate(Curved(), events=True)
