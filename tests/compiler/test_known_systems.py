"""Models with known answers: index, states, closed forms, and what causality asks for."""

import casadi as ca
import numpy as np
import pytest

from gantrytau import (
    Array,
    Connector,
    Flow,
    Input,
    Model,
    Parameter,
    Propagated,
    Real,
    StructureError,
    connect,
    cos,
    der,
    exp,
    root,
    sin,
    time,
    translate,
)
from gantrytau.electrical import Capacitor, Ground, Inductor, Pin, Resistor, VoltageSource
from gantrytau.mechanics import translational


class Parallel(Model):
    """Two resistors inside a component whose outer pins pass the current on."""

    p, n = Pin(), Pin()
    first, second = Resistor(R=2.0), Resistor(R=3.0)

    def equations(self):
        for resistor in (self.first, self.second):
            yield connect(self.p, resistor.pin_a)
            yield connect(resistor.pin_b, self.n)


class Circuit(Model):
    """A source, a resistor, a pair of parallel resistors one level down, and a capacitor in a ring."""

    source, resistor, pair = VoltageSource(), Resistor(R=0.8), Parallel()
    capacitor, ground = Capacitor(C=0.5), Ground()

    def equations(self):
        yield connect(self.source.pin_a, self.resistor.pin_a)
        yield connect(self.resistor.pin_b, self.pair.p)
        yield connect(self.pair.n, self.capacitor.pin_a)
        yield connect(self.capacitor.pin_b, self.source.pin_b)
        yield connect(self.capacitor.pin_b, self.ground.pin)


def test_circuit_with_inside_and_outside_connectors():
    dae = translate(Circuit())
    assert len(dae.states) == 1
    at = dae.evaluate({"capacitor.v": 2.0, "source.v": 6.0})
    # 4 V over 0.8 Ohm + 2 || 3 Ohm = 2 Ohm
    wanted = {
        "capacitor.i": 2.0,
        "der(capacitor.v)": 4.0,
        "pair.first.i": 1.2,
        "pair.p.i": 2.0,
        "pair.n.i": -2.0,
    }
    wanted |= {"source.pin_a.i": -2.0, "ground.pin.i": 0.0}
    assert {n: at[n] for n in wanted} == pytest.approx(wanted, rel=1e-14, abs=1e-14)
    rate = dae.function(["capacitor.v", "source.v"], ["der(capacitor.v)"])
    assert float(rate(2.0, 6.0)) == pytest.approx(4.0, rel=1e-14)


def test_capacitors_in_parallel_and_coils_in_series_are_one_state_each():
    class Doubled(Model):
        source, coil, second = VoltageSource(), Inductor(L=1.0), Inductor(L=3.0)
        a, b, ground = Capacitor(C=1.0), Capacitor(C=2.0), Ground()

        def equations(self):
            yield connect(self.source.pin_a, self.coil.pin_a)
            yield connect(self.coil.pin_b, self.second.pin_a)
            yield connect(self.second.pin_b, self.a.pin_a)
            yield connect(self.a.pin_a, self.b.pin_a)
            yield connect(self.a.pin_b, self.b.pin_b)
            yield connect(self.a.pin_b, self.source.pin_b)
            yield connect(self.a.pin_b, self.ground.pin)

    dae = translate(Doubled())
    assert len(dae.states) == 2
    at = dae.evaluate({"a.v": 1.0, "coil.i": 6.0, "source.v": 9.0})
    assert [at[n] for n in ("der(coil.i)", "der(b.v)", "a.i")] == pytest.approx([2.0] * 3, rel=1e-13)


def test_unconnected_connectors_carry_no_flow():
    at = translate(translational.Mass(m=2.0)).evaluate({"v": 3.0})
    assert (at["flange.f"], at["der(v)"], at["der(flange.s)"]) == (0.0, 0.0, 3.0)


def test_cooled_reactor_with_given_temperature_has_index_three():
    # Pantelides 1988: concentration, temperature, and the cooling that holds the temperature
    class Reactor(Model):
        c = Real(unit="1", start=0.5)
        T = Real(unit="1", start=1.0)
        cooling = Real(unit="1")

        def equations(self):
            rate = self.c * exp(-1 / self.T)
            yield der(self.c) == 1 - self.c - rate
            yield der(self.T) == 1 - self.T + rate - self.cooling
            yield self.c == 0.5 + 0.1 * sin(time)

    dae = translate(Reactor(), units=False)
    assert dae.indexed.structural_index == 3
    assert dae.states == ()
    at = dae.evaluate({"time": 0.0})
    # c' = 0.1 = 0.5 - r, so r = 0.4 = 0.5 exp(-1/T)
    assert at["T"] == pytest.approx(-1 / np.log(0.8), rel=1e-12)


def test_index_two_and_index_one():
    class Held(Model):
        x, force = Real(unit="1"), Real(unit="1")

        def equations(self):
            yield der(self.x) == (1 + self.x**2) * self.force
            yield self.x == sin(time)

    dae = translate(Held(), units=False)
    assert dae.indexed.structural_index == 2
    assert float(dae.function(["time"], ["force"])(0.3)) == pytest.approx(
        np.cos(0.3) / (1 + np.sin(0.3) ** 2), rel=1e-14
    )
    with pytest.raises(StructureError, match="depends on time explicitly; name 'time' among the given"):
        dae.function([], ["force"])


def test_tanks_with_a_rigid_pipe_share_a_state():
    class Tank(Model):
        area = Parameter(2.0, unit="m2")
        level = Real(unit="m", start=1.0)
        inflow = Real(unit="m3/s")

        def equations(self):
            yield self.area * der(self.level) == self.inflow

    class Plant(Model):
        first, second = Tank(), Tank(area=3.0)
        pump = Input(unit="m3/s")
        pipe = Real(unit="m3/s")

        def equations(self):
            yield self.first.level == self.second.level + 0.5
            yield self.first.inflow == self.pump - self.pipe
            yield self.second.inflow == self.pipe

    dae = translate(Plant())
    assert len(dae.states) == 1
    at = dae.evaluate({"first.level": 2.0, "pump": 1.0})
    assert at["second.level"] == 1.5
    assert at["der(first.level)"] == pytest.approx(0.2, rel=1e-14)
    assert at["pipe"] == pytest.approx(0.6, rel=1e-14)


class Growth(Model):
    u = Input(unit="1")
    x = Real(unit="1")

    def equations(self):
        yield der(self.x) == self.u * self.x


@pytest.mark.parametrize("wanted", [(), ("der(der(x))",)])
def test_higher_derivatives_of_a_state(wanted):
    dae = translate(Growth(), units=False, find=wanted)
    second = dae.function(["x", "u", "der(u)"], ["der(der(x))"])
    assert float(second(2.0, 3.0, 5.0)) == 5.0 * 2.0 + 3.0 * 3.0 * 2.0


def test_rates_of_time_and_of_parameters():
    class Fall(Model):
        g = Parameter(9.81, unit="m/s2")
        v = Real(unit="m/s")

        def equations(self):
            yield der(self.v) == -self.g

    dae = translate(Fall())
    assert [float(dae.expression(n)) for n in ("der(time)", "der(der(time))", "der(g)")] == [1.0, 0.0, 0.0]


def test_connectors_inside_connectors():
    class Cable(Connector):
        line = Array(Pin, 2)

    class Left(Model):
        cable = Cable()

        def equations(self):
            yield self.cable.line[0].v == 1.0
            yield self.cable.line[1].i == 0.5

    class Right(Model):
        cable = Cable()

        def equations(self):
            yield self.cable.line[1].v == 3.0
            yield self.cable.line[0].i == 0.25

    class Both(Model):
        left, right = Left(), Right()

        def equations(self):
            yield connect(self.left.cable, self.right.cable)

    at = translate(Both()).evaluate({})
    names = ("right.cable.line[0].v", "left.cable.line[1].v", "left.cable.line[0].i", "right.cable.line[1].i")
    assert [at[n] for n in names] == [1.0, 3.0, -0.25, -0.5]


def test_matrices():
    class Mapped(Model):
        A = Parameter([[1.0, 2.0], [3.0, 4.0]], unit="1")
        X, y, u = Real((2, 2), unit="1"), Real(2, unit="1"), Input(2, unit="1")

        def equations(self):
            yield self.X == self.A @ self.A
            yield self.y == self.A.T @ self.u

    at = translate(Mapped()).evaluate({"u": [1.0, 2.0]})
    np.testing.assert_array_equal(at["X"], [[7.0, 10.0], [15.0, 22.0]])
    np.testing.assert_array_equal(at["y"], [7.0, 10.0])


def test_algebraic_loops():
    class Nonlinear(Model):
        x, y = Real(unit="1", start=2.5), Real(unit="1", start=-0.8)
        u = Input(unit="1", start=3.0)  # the branch of u = 0 ends at 2.912

        def equations(self):
            yield self.x + exp(self.y) == self.u
            yield self.y == cos(self.x)

    dae = translate(Nonlinear())
    x, y = (float(v) for v in dae.function(["u"], ["x", "y"])(3.0))
    assert x + np.exp(y) == pytest.approx(3.0, abs=1e-13)
    assert y == pytest.approx(np.cos(x), abs=1e-13)
    slope = dae.function(["u"], ["x"]).jacobian()(3.0, 0.0)
    assert float(slope) == pytest.approx(1 / (1 - np.exp(y) * np.sin(x)), rel=1e-10)


def test_models_without_states_and_without_variables():
    class Plain(Model):
        a = Parameter(3.0, unit="m")
        b = Parameter(2 * a, unit="m")

    dae = translate(Plain())
    assert (dae.states, dae.variables) == ((), ())
    assert dae.evaluate({"a": 4.0})["b"] == 8.0
    assert float(dae.function(["a"], ["b"])(5.0)) == 10.0

    class Statics(Model):
        x = Real(2, unit="1")

        def equations(self):
            yield ca.DM([[2, 1], [1, 3]]) @ self.x == ca.DM([3, 5])

    np.testing.assert_allclose(translate(Statics()).evaluate({})["x"], [0.8, 1.4], rtol=1e-14)


def test_aliases_carry_signs_offsets_and_derivatives():
    class Signs(Model):
        offset = Parameter(0.5, unit="m")
        x, y, z = Real(unit="m"), Real(unit="m"), Real(unit="m")
        v, w, a = Real(unit="m/s"), Real(unit="m/s"), Real(unit="m/s2")

        def equations(self):
            yield self.x + self.y == self.offset
            yield 2 * self.z == -self.y
            yield self.v == der(self.y)
            yield self.w + der(self.z) == 0
            yield self.a == der(self.v)
            yield self.a == -4.0 * self.y

    dae = translate(Signs(), units=False, states=["y", "v"])
    assert len(dae.reduced.residuals) == 1
    at = dae.evaluate({"y": 0.2, "v": 0.6})
    wanted = {"x": 0.3, "z": -0.1, "w": 0.3, "a": -0.8, "der(x)": -0.6, "der(z)": -0.3, "der(der(x))": 0.8}
    assert {n: at[n] for n in wanted} == pytest.approx(wanted, rel=1e-14)


def test_the_text_of_the_equations_names_blocks_and_their_origin():
    text = translate(Circuit()).equations("text")
    assert "known: source.v" in text
    assert "states: capacitor.v" in text
    assert "capacitor (Capacitor), equation " in text
    assert all("from" in line for line in text.splitlines() if line.startswith("["))


class Arrow(Connector):
    """A direction in a plane, whose derivative the angular velocity gives, and the torque about it."""

    e = Propagated(2, rate=lambda self: self.w * ca.vertcat(-self.e[1], self.e[0]))
    w = Propagated()
    t = Flow()


def test_a_direction_whose_derivative_is_given_by_the_angular_velocity_is_locked():
    class Wheel(Model):
        """A wheel under a torque, its direction of two half-angle coordinates and locked at 0.5 rad."""

        arrow = Arrow()
        q = Real(2, start=[0.97, 0.25])
        w, torque = Real(), Real()

        def equations(self):
            c, s = self.q.elements()
            yield root(self.arrow, e=ca.vertcat(c**2 - s**2, 2 * c * s), w=self.w)
            yield self.w == 2 * (c * der(s) - s * der(c))
            yield c**2 + s**2 == 1
            yield 3 * der(self.w) == self.torque + 5
            yield ca.atan2(self.arrow.e[1], self.arrow.e[0]) == 0.5

    assert translate(Wheel()).start["torque"] == pytest.approx(-5)
