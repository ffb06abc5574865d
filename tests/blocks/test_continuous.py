"""Integrators, lags and transfer functions against closed forms and SciPy, in time and in frequency."""

from typing import Any

import numpy as np
import pytest
import scipy.signal

from gantrytau import Fixed, Input, Model, ModelError, connect, cos, linearize, simulate
from gantrytau.blocks import Derivative, FirstOrder, Integrator, TransferFunction

signal: Any = scipy.signal  # most of it is made at run time, out of sight of type checkers
TOLERANCE = 1e-10
NEAR = 1e3 * TOLERANCE  # the integrator holds its tolerance per step; over some seconds errors add up


class Driven(Model):
    """A signal through one block."""

    signal = Input()
    block = Integrator(k=2.0)

    def equations(self):
        yield connect(self.signal, self.block.u)


def through(block, signal, stop=2.0):
    """Times and output of a block."""
    model = type("Through", (Driven,), {"block": block})()
    found = simulate(model, stop=stop, inputs={"signal": signal}, tolerance=TOLERANCE)
    return found.time, found["block.y"]


def transfer(block, w):
    """The linear system of a block at angular frequencies."""
    system = linearize(type("Through", (Driven,), {"block": block})(), inputs=["signal"], outputs=["block.y"])
    unit = np.eye(len(system.A))
    return np.array(
        [(system.C @ np.linalg.solve(1j * x * unit - system.A, system.B) + system.D)[0, 0] for x in w]
    )


def test_an_integrator_integrates():
    t, y = through(Integrator(k=2.0, y=Fixed(-1.0)), lambda t: cos(3 * t))
    np.testing.assert_allclose(y, -1.0 + 2 / 3 * np.sin(3 * t), atol=NEAR)


def test_a_lag_answers_to_a_step_as_its_exponential():
    t, y = through(FirstOrder(k=-4.0, T=0.3, y=Fixed(0.5)), 1.0)
    np.testing.assert_allclose(y, -4.0 + 4.5 * np.exp(-t / 0.3), atol=NEAR)


def test_a_derivative_begins_at_rest_and_follows_a_ramp_with_its_time_constant():
    t, y = through(Derivative(k=5.0, T=0.2), lambda t: 7.0 + 3.0 * t)
    np.testing.assert_allclose(y, 15.0 * (1 - np.exp(-t / 0.2)), atol=NEAR)


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])  # of the time
@pytest.mark.parametrize(
    ("numerator", "denominator"),
    [
        ([3.0], [0.5, 1.0]),
        ([2.0, -1.0, 4.0], [1.0, 3.0, 10.0]),  # feeds through
        ([1.0], [1.0, 2.0, 0.0]),  # integrates
        ([1.0, 0.5], [2.0, 0.0, 0.0]),  # twice
        ([5.0], [1.0, 0.0]),
        ([1.0, 0.0], np.poly([-1.0, -50.0, -2.0 + 9.0j, -2.0 - 9.0j])),  # differentiates slow signals
        ([-3.0], np.poly([-1.0] * 6)),
        ([0.0, 0.0, 7.0], [-1.0, -4.0, -5.0]),  # zeros in front, signs
    ],
)
def test_transfer_functions_are_those_of_scipy(numerator, denominator, scale):
    upper, lower = (
        [c * scale ** (k - len(side) + 1) for k, c in enumerate(side)] for side in (numerator, denominator)
    )  # polynomials of s / scale
    block = TransferFunction(numerator=upper, denominator=lower)
    t, y = through(block, 1.0, stop=4.0 / scale)
    _, expected = signal.step((np.trim_zeros(numerator, "f"), denominator), T=t * scale)
    np.testing.assert_allclose(y, expected, atol=NEAR * max(1.0, np.ptp(expected)))
    w = np.array([0.01, 1.0, 7.0, 300.0])
    _, response = signal.freqs(numerator, denominator, w)
    np.testing.assert_allclose(transfer(block, w * scale), response, rtol=1e-10)  # condition of the form


def test_states_of_a_transfer_function_have_the_size_of_its_input():
    # a drive of twelfth order with poles about 1000 rad/s: its coefficients go up to 1e36
    poles = 1000.0 * np.exp(1j * np.pi * (0.5 + (np.arange(12) + 0.5) / 12))
    denominator = np.real(np.poly(poles))
    block = TransferFunction(numerator=[denominator[-1]], denominator=list(denominator))
    model = type("Through", (Driven,), {"block": block})()
    found = simulate(model, stop=0.05, inputs={"signal": 1.0}, tolerance=TOLERANCE)
    assert np.max(np.abs(found["block.x"])) < 10.0
    poles = signal.buttap(12)[1]
    _, expected = signal.step(([], poles, 1.0), T=found.time * 1000.0)
    np.testing.assert_allclose(found["block.y"], expected, atol=NEAR)


def test_coefficients_are_parameters():
    block = TransferFunction(numerator=[1.0], denominator=[1.0, 1.0])
    model = type("Through", (Driven,), {"block": block})()
    found = simulate(
        model,
        stop=1.0,
        inputs={"signal": 1.0},
        parameters={"block.denominator": [0.5, 2.0]},
        tolerance=TOLERANCE,
    )
    np.testing.assert_allclose(found["block.y"], (1 - np.exp(-4 * found.time)) / 2, atol=NEAR)


@pytest.mark.parametrize(
    ("block", "words"),
    [
        (
            TransferFunction(numerator=[1.0, 0.0, 2.0], denominator=[1.0, 3.0]),
            r"block \(TransferFunction\), equation 1: found a numerator of degree 2 over a denominator of degree 1, "
            "expected at most the same: .* put a filter in series",
        ),
        (TransferFunction(numerator=[1.0], denominator=[2.0]), "denominator of degree 0"),
        (TransferFunction(numerator=1.0, denominator=2.0), "denominator of degree 0"),
        (TransferFunction(numerator=[1.0], denominator=[0.0, 2.0]), "does not begin with zero"),
        (TransferFunction(denominator=[1.0, 2.0]), r"block.numerator .* has no value, expected one"),
        (Derivative(T=0.0), "expected a time constant T above zero: a derivative alone is not proper"),
        (FirstOrder(T=0.0), "expected a time constant T above zero; a Gain has none"),
        (FirstOrder(T=-1.0), r"block\.T: value is -1, expected at least 0"),
    ],
)
def test_wrong_blocks(block, words):
    with pytest.raises(ModelError, match=words):
        through(block, 1.0)
