"""Signal blocks, circuits and a motor in an FMU: what simulate finds, in FMPy, in all interfaces and versions."""

from functools import cache
from typing import Literal

import numpy as np
import pytest

from gantrytau import Fixed, Input, Model, Result, connect, simulate
from gantrytau.blocks import (
    DeadZone,
    Delay,
    Derivative,
    DiscretePid,
    DiscreteTransferFunction,
    Gain,
    Hysteresis,
    Integrator,
    Noise,
    Pid,
    Pulse,
    PulseWidth,
    RateLimiter,
    SampleHold,
    Sine,
    Sum,
    TransferFunction,
)
from gantrytau.electrical import DcMotor, Ground, VoltageSource
from gantrytau_fmu import export_fmu
from tests.families import first_of

PERIOD = 0.01
EVERY = 0.0301  # s, where nothing is sampled and nothing jumps
STOP = 11 * EVERY


class Signals(Model):
    """A wave through continuous blocks, sampled ones, and those that switch."""

    wave = Sine(amplitude=2.0, frequency=3.0, start_time=0.05)
    pulse = Pulse(period=0.23, width=0.4, amplitude=0.7)
    sum = Sum(k=[1.0, -1.0])
    shape = TransferFunction(numerator=[1.0, 20.0], denominator=[1.0, 12.0, 400.0])
    slope = Derivative(k=0.1, T=0.02)
    slow = RateLimiter(rising=8.0)
    zone = DeadZone(lower=-0.5, upper=0.3)
    relay = Hysteresis(lower=-1.0, upper=1.0)
    hold = SampleHold(period=PERIOD)
    digital = DiscreteTransferFunction(numerator=[0.2, 0.1], denominator=[1.0, -1.1, 0.4], period=PERIOD)
    memory = Integrator()
    late = Delay(T=0.07)

    def equations(self):
        yield connect(self.wave.y, self.sum.u[0])
        yield connect(self.pulse.y, self.sum.u[1])
        for block in (self.shape, self.slow, self.zone, self.relay, self.hold, self.digital, self.late):
            yield connect(self.sum.y, block.u)
        yield connect(self.wave.y, self.slope.u)
        yield connect(self.zone.y, self.memory.u)


class Servo(Model):
    """A motor on pulses whose width a sampled controller sets; a continuous controller beside it; noise."""

    white = Input(unit="1", start=0.5)
    wanted, measured = Sine(amplitude=60.0, frequency=2.0), Gain(k=1.0)
    noise = Noise(std=0.1, bandwidth=200.0, period=PERIOD)
    pid = DiscretePid(kind="PI", k=0.02, T_i=0.1, period=PERIOD, limits=(0.0, 1.0))
    other = Pid(k=0.02, T_i=0.1, T_d=0.01, limits=(0.0, 0.8))
    pwm, source, ground = PulseWidth(amplitude=12.0, period=PERIOD / 4), VoltageSource(), Ground()
    motor = DcMotor(R=0.8, L=2e-3, k=0.06, J=1.5e-4, i=Fixed(0.0), rotor=dict(w=Fixed(0.0), phi=Fixed(0.0)))

    def equations(self):
        yield connect(self.white, self.noise.white)
        yield self.measured.u == self.motor.rotor.w + self.noise.y
        for controller in (self.pid, self.other):
            yield connect(self.wanted.y, controller.u_s)
            yield connect(self.measured.y, controller.u_m)
        yield connect(self.pid.y, self.pwm.u)
        yield connect(self.pwm.y, self.source.v)
        yield connect(self.source.pin_a, self.motor.pin_a)
        yield connect(self.source.pin_b, self.motor.pin_b)
        yield connect(self.source.pin_b, self.ground.pin)


OUTPUTS = {
    Signals: ["shape.y", "slope.y", "slow.y", "memory.y", "relay.y", "hold.y", "digital.y", "late.y"],
    Servo: ["motor.rotor.w", "motor.i", "pid.y", "other.y", "noise.y"],
}


@cache
def simulated(model: type[Model]) -> Result:
    return simulate(model(), stop=STOP, tolerance=1e-11, points=12)


@pytest.mark.parametrize("model", OUTPUTS, ids=lambda model: model.__name__)
@pytest.mark.parametrize("version", first_of(["3.0", "2.0"]))
def test_blocks_in_an_fmu_are_those_of_simulate(model, version: Literal["2.0", "3.0"], tmp_path):
    import fmpy

    names = OUTPUTS[model]
    path = tmp_path / "blocks.fmu"
    export_fmu(model(), path, fmi=version, tolerance=1e-11)
    expected = simulated(model)
    for kind in ("CoSimulation", "ModelExchange"):
        found = fmpy.simulate_fmu(
            str(path),
            stop_time=STOP,
            output_interval=EVERY,
            relative_tolerance=1e-11,
            fmi_type=kind,
            output=names,
        )
        rows = [np.flatnonzero(np.abs(found["time"] - k * EVERY) < 1e-9)[-1] for k in range(1, 11)]
        for name in names:
            there = [expected.at(k * EVERY, name) for k in range(1, 11)]
            size = np.ptp(there)
            assert size > 0
            # thousand times the tolerance, for errors that grow from jump to jump
            np.testing.assert_allclose(found[name][rows], there, atol=1e-8 * size, err_msg=f"{kind} {name}")
