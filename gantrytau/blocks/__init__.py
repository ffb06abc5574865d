"""Signal blocks: what computes one signal from others, and what begins one."""

from gantrytau import StateSpace
from gantrytau.blocks.arithmetic import Gain, Product, Sum
from gantrytau.blocks.block import Block, Source
from gantrytau.blocks.continuous import Derivative, FirstOrder, Integrator, TransferFunction
from gantrytau.blocks.limiters import DeadZone, Hysteresis, Limiter, RateLimiter, Unlimited
from gantrytau.blocks.lookup import Delay, Table1, Table2
from gantrytau.blocks.pid import DiscretePid, Pid
from gantrytau.blocks.sampled_blocks import DiscreteTransferFunction, PulseWidth, SampleHold
from gantrytau.blocks.sources import Noise, Pulse, Ramp, Sine, Step
from gantrytau.mechanics.filters import LowPass

__all__ = [
    "Block",
    "DeadZone",
    "Delay",
    "Derivative",
    "DiscretePid",
    "DiscreteTransferFunction",
    "FirstOrder",
    "Gain",
    "Hysteresis",
    "Integrator",
    "Limiter",
    "LowPass",
    "Noise",
    "Pid",
    "Product",
    "Pulse",
    "PulseWidth",
    "Ramp",
    "RateLimiter",
    "SampleHold",
    "Sine",
    "Source",
    "StateSpace",
    "Step",
    "Sum",
    "Table1",
    "Table2",
    "TransferFunction",
    "Unlimited",
]
