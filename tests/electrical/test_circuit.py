"""Circuits against their closed forms, balances of power, and circuits that cannot be."""

from itertools import pairwise

import numpy as np
import pytest
from scipy import signal

from gantrytau import (
    Fixed,
    GantryTauError,
    Model,
    ModelError,
    Parameter,
    connect,
    linearize,
    simulate,
    sin,
    translate,
)
from gantrytau.electrical import Capacitor, CurrentSource, Ground, Inductor, Resistor, TwoPins, VoltageSource
from tests.mechanisms.rows import row

TOLERANCE = 1e-10
NEAR = 1e3 * TOLERANCE  # the integrator holds its tolerance per step; over some time constants errors add up


def series(*parts, source=None):
    """A model of a source and parts in a ring: parts are named p0, p1, ...; the source is `source`."""
    names = [f"p{k}" for k in range(len(parts))]

    def equations(self):
        ring = [self.source, *(getattr(self, name) for name in names)]
        yield connect(self.source.pin_b, self.ground.pin)
        yield connect(self.source.pin_a, ring[1].pin_a)
        for one, other in pairwise(ring[1:]):
            yield connect(one.pin_b, other.pin_a)
        yield connect(ring[-1].pin_b, self.source.pin_b)

    body = dict(zip(names, parts, strict=True))
    body |= dict(source=source or VoltageSource(), ground=Ground(), equations=equations)
    return type("Series", (Model,), body)()


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e3])  # of the time constant
def test_a_capacitor_is_charged_through_a_resistor(scale):
    model = series(Resistor(R=2e3), Capacitor(C=scale / 2e3, v=Fixed(1.0)))
    found = simulate(model, stop=5 * scale, inputs={"source.v": 12.0}, tolerance=TOLERANCE)
    expected = 12.0 - 11.0 * np.exp(-found.time / scale)
    np.testing.assert_allclose(found["p1.v"], expected, atol=12 * NEAR)
    np.testing.assert_allclose(found["source.i"], (12.0 - expected) / 2e3, atol=12 * NEAR / 2e3)


def test_a_current_rises_in_an_inductor():
    model = series(Resistor(R=0.5), Inductor(L=2e-3, i=Fixed(0.0)))
    found = simulate(model, stop=0.02, inputs={"source.v": 6.0}, tolerance=TOLERANCE)
    np.testing.assert_allclose(found["p1.i"], 12.0 * (1 - np.exp(-found.time / 4e-3)), atol=12 * NEAR)


@pytest.mark.parametrize("R", [0.0, 2.0, 20.0, 80.0])  # undamped, ringing, critical, creeping
def test_a_resonant_circuit_rings_as_its_transfer_function(R):
    L, C = 1e-3, 1e-5
    model = series(Resistor(R=R), Inductor(L=L, i=Fixed(0.0)), Capacitor(C=C, v=Fixed(0.0)))
    found = simulate(model, stop=3e-3, inputs={"source.v": 1.0}, tolerance=TOLERANCE)
    _, expected = signal.step(([1.0], [L * C, R * C, 1.0]), T=found.time)
    np.testing.assert_allclose(found["p2.v"], expected, atol=10 * NEAR)
    poles = np.sort_complex(linearize(model, inputs=["source.v"], outputs=["p2.v"]).poles)
    # a double pole is known to the root of rounding
    np.testing.assert_allclose(poles, np.sort_complex(np.roots([L * C, R * C, 1.0])), rtol=1e-7, atol=1e-7)


class Bridge(Model):
    """Wheatstone's bridge with a resistor between its middles."""

    source, ground = VoltageSource(v=10.0), Ground()
    upper_a, lower_a, upper_b, lower_b = (Resistor(R=R) for R in (100.0, 200.0, 300.0, 600.0))
    middle = Resistor(R=50.0)

    def equations(self):
        yield connect(self.source.pin_b, self.ground.pin)
        for upper, lower, end in (
            (self.upper_a, self.lower_a, self.middle.pin_a),
            (self.upper_b, self.lower_b, self.middle.pin_b),
        ):
            yield from row(self.source.pin_a, upper, lower)
            yield connect(upper.pin_b, end)
            yield connect(lower.pin_b, self.source.pin_b)


def test_a_bridge_is_balanced_and_else_solves_its_node_equations():
    assert translate(Bridge()).evaluate()["middle.i"] == pytest.approx(0.0, abs=1e-17)
    found = translate(Bridge(lower_b=dict(R=100.0))).evaluate()
    conductance = np.array([[1 / 100 + 1 / 200 + 1 / 50, -1 / 50], [-1 / 50, 1 / 300 + 1 / 100 + 1 / 50]])
    v = np.linalg.solve(conductance, [10 / 100, 10 / 300])
    assert found["middle.i"] == pytest.approx((v[0] - v[1]) / 50, rel=1e-13)
    assert found["source.i"] == pytest.approx((10 - v[0]) / 100 + (10 - v[1]) / 300, rel=1e-13)


def test_what_a_source_delivers_is_lost_and_stored():
    model = series(Resistor(R=3.0), Inductor(L=2e-3), Capacitor(C=1e-4), Resistor(R=1.0))
    wave = {"source.v": lambda t: 5 * sin(900 * t)}
    found = simulate(model, stop=0.02, inputs=wave, tolerance=TOLERANCE, points=201, outputs=None)
    stored = found["p1.v"] * found["p1.i"] + found["p2.v"] * found["p2.i"]
    lost = 3.0 * found["p0.i"] ** 2 + 1.0 * found["p3.i"] ** 2
    delivered = found["source.v"] * found["source.i"]
    np.testing.assert_allclose(delivered, stored + lost, atol=1e-12)
    assert np.ptp(delivered) > 1.0  # W


def test_capacitors_side_by_side_have_one_state():
    class Parallel(Model):
        source, ground = CurrentSource(i=2e-3), Ground()
        one, other = Capacitor(C=3e-6, v=Fixed(1.0)), Capacitor(C=1e-6)

        def equations(self):
            yield connect(self.source.pin_b, self.ground.pin)
            for capacitor in (self.one, self.other):
                yield from row(self.source.pin_a, capacitor, self.ground)

    dae = translate(Parallel())
    assert len(dae.states) == 1
    found = simulate(dae, stop=0.01, tolerance=TOLERANCE)
    np.testing.assert_allclose(found["other.v"], 1.0 + 2e-3 / 4e-6 * found.time, rtol=NEAR)
    np.testing.assert_allclose(found["one.i"], 1.5e-3, rtol=1e-12)  # as 3 to 1


def test_inductors_in_series_have_one_state_and_share_the_voltage():
    model = series(Inductor(L=3e-3, i=Fixed(0.0)), Inductor(L=1e-3), Resistor(R=2.0))
    dae = translate(model)
    assert len(dae.states) == 1
    found = simulate(dae, stop=0.01, inputs={"source.v": 8.0}, tolerance=TOLERANCE)
    np.testing.assert_allclose(found["p1.i"], 4.0 * (1 - np.exp(-found.time / 2e-3)), atol=4 * NEAR)
    np.testing.assert_allclose(found["p0.v"], 3 * found["p1.v"], atol=1e-11)


def test_a_capacitor_on_a_source_takes_the_derivative_of_its_voltage():
    model = series(Capacitor(C=1e-3))
    found = simulate(model, stop=1.0, inputs={"source.v": lambda t: sin(7 * t)}, tolerance=TOLERANCE)
    np.testing.assert_allclose(found["source.i"], 7e-3 * np.cos(7 * found.time), atol=1e-14)
    with pytest.raises(ModelError, match=r"input source.v is differentiated 1 times"):
        simulate(model, stop=1.0, inputs={"source.v": ([0.0, 1.0], [0.0, 1.0])})


def test_a_circuit_of_a_current_source_alone_takes_any_resistance():
    found = translate(series(Resistor(R=1e9), source=CurrentSource(i=1e-9))).evaluate()
    assert found["p0.v"] == pytest.approx(1.0, rel=1e-14)
    assert found["source.v"] == found["p0.v"]


def test_a_component_of_ones_own_has_one_equation():
    class Varistor(TwoPins):
        """i = g v^3."""

        g = Parameter(1e-3, unit="A/V3", description="current at one volt")

        def equations(self):
            yield from super().equations()
            yield self.i == self.g * self.v**3

    found = translate(series(Varistor(), source=CurrentSource(i=8.0))).evaluate()
    assert found["p0.v"] == pytest.approx(20.0, rel=1e-10)


class Floating(Model):
    """A ring without a ground."""

    source, resistor = VoltageSource(v=1.0), Resistor()

    def equations(self):
        yield connect(self.source.pin_a, self.resistor.pin_a)
        yield connect(self.source.pin_b, self.resistor.pin_b)


class Doubled(Floating):
    """Two voltage sources side by side."""

    other, ground = VoltageSource(v=2.0), Ground()

    def equations(self):
        yield from super().equations()
        yield connect(self.other.pin_a, self.source.pin_a)
        yield connect(self.other.pin_b, self.source.pin_b)
        yield connect(self.ground.pin, self.source.pin_b)


@pytest.mark.parametrize(
    ("model", "words"),
    [
        (Floating(), "no Ground holds the potential of this circuit; connect one"),
        (Doubled(), "two voltage sources stand side by side"),
        (series(Inductor(L=0.0)), r"found p0\.L = 0; expected an inductance L above zero"),
        (series(Capacitor(C=0.0)), r"found p0\.C = 0; expected a capacitance C above zero"),
        (series(Resistor(R=-1.0)), r"p0\.R: value is -1, expected at least 0"),
    ],
)
def test_circuits_that_cannot_be(model, words):
    with pytest.raises(GantryTauError, match=words):
        translate(model)
