"""Signals that are functions of time. What jumps or bends does it at an exact time, which `simulate` finds."""

from math import pi

from gantrytau import Parameter, floor, if_else, limit, require, sin, time
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
