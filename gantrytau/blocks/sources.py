"""Signals that are functions of time. What jumps or bends does it at an exact time, which `simulate` finds."""

from math import pi

from gantrytau import Input, Parameter, Real, der, floor, if_else, limit, require, sin, sqrt, tanh, time
from gantrytau.blocks.block import Source

PERIOD = "expected a period above zero, in s"


class Step(Source):
    """y = offset, and offset + height from start_time on."""

    height = Parameter(1.0, description="height of the step")
    offset = Parameter(0.0, description="output before the step")
    start_time = Parameter(0.0, unit="s", description="time of the step")

    def equations(self):
        yield self.y == self.offset + if_else(time >= self.start_time, self.height, 0)


class Ramp(Source):
    """y rises evenly from offset by height, from start_time on during `duration`."""

    height = Parameter(1.0, description="height of the ramp")
    offset = Parameter(0.0, description="output before the ramp")
    start_time = Parameter(0.0, unit="s", description="begin of the ramp")
    duration = Parameter(1.0, unit="s", min=0.0, description="length of the ramp, above zero")

    def equations(self):
        yield require(self.duration > 0, "expected a duration above zero; a Step takes no time")
        done = limit((time - self.start_time) / self.duration, 0, 1)
        yield self.y == self.offset + self.height * done


class Sine(Source):
    """y = offset + amplitude sin(2 pi frequency (time - start_time) + phase) from start_time on, before it offset."""

    amplitude = Parameter(1.0, description="amplitude")
    frequency = Parameter(1.0, unit="Hz", description="frequency")
    phase = Parameter(0.0, unit="rad", description="phase at start_time")
    offset = Parameter(0.0, description="mean")
    start_time = Parameter(0.0, unit="s", description="begin of the oscillation")

    def equations(self):
        wave = sin(2 * pi * self.frequency * (time - self.start_time) + self.phase)
        yield self.y == self.offset + if_else(time >= self.start_time, self.amplitude * wave, 0)


class Pulse(Source):
    """y = offset + amplitude during the first part `width` of every period from start_time on, else offset."""

    amplitude = Parameter(1.0, description="height of the pulses")
    period = Parameter(1.0, unit="s", min=0.0, description="from pulse to pulse, above zero")
    width = Parameter(0.5, unit="1", min=0.0, max=1.0, description="part of the period that a pulse lasts")
    offset = Parameter(0.0, description="output between the pulses")
    start_time = Parameter(0.0, unit="s", description="begin of the first pulse")

    def equations(self):
        yield require(self.period > 0, PERIOD)
        periods = (time - self.start_time) / self.period
        inside = if_else(periods - floor(periods) < self.width, self.amplitude, 0)
        yield self.y == self.offset + if_else(time >= self.start_time, inside, 0)


class Noise(Source):
    """Gaussian noise of standard deviation std, white well below `bandwidth`, falling by 20 dB a decade above.

    `white` are numbers of standard deviation 1, each held for `period`: `white_noise(1.0, period, seed)` as input. They
    pass through a lag; y begins at zero and has its standard deviation after some of 1 / bandwidth.
    """

    white = Input(unit="1", description="independent normal numbers, each held for a period", start=0.0)
    std = Parameter(1.0, min=0.0, description="standard deviation of y, in its unit")
    bandwidth = Parameter(100.0, unit="rad/s", min=0.0, description="angular frequency of -3 dB, above zero")
    period = Parameter(1e-3, unit="s", min=0.0, description="in which the numbers are held, above zero")
    x = Real(unit="1", description="filtered numbers", start=0.0, fixed=True)

    def equations(self):
        yield require(self.bandwidth > 0, "expected a bandwidth above zero")
        yield require(self.period > 0, PERIOD)
        yield der(self.x) == self.bandwidth * (self.white - self.x)
        # from number to number x = a x + (1 - a) white: its variance is (1 - a) / (1 + a)
        yield self.y == self.std * self.x / sqrt(tanh(self.bandwidth * self.period / 2))
