"""Signal blocks: what computes one signal from others, and what begins one."""

from gantrytau import StateSpace
from gantrytau.blocks.arithmetic import Gain, Product, Sum
from gantrytau.blocks.block import Block, Source
from gantrytau.blocks.continuous import Derivative, FirstOrder, Integrator, TransferFunction
from gantrytau.blocks.limiters import DeadZone, Limiter, RateLimiter, Unlimited
from gantrytau.blocks.pid import DiscretePid, Pid
from gantrytau.blocks.sampled_blocks import DiscreteTransferFunction, SampleHold
from gantrytau.blocks.sources import Noise, Pulse, Ramp, Sine, Step
from gantrytau.mechanics.filters import LowPass

__all__ = [
    "Block",
    "DeadZone",
    "Derivative",
    "DiscretePid",
    "DiscreteTransferFunction",
    "FirstOrder",
    "Gain",
    "Integrator",
    "Limiter",
    "LowPass",
    "Noise",
    "Pid",
    "Product",
    "Pulse",
    "Ramp",
    "RateLimiter",
    "SampleHold",
    "Sine",
    "Source",
    "StateSpace",
    "Step",
    "Sum",
    "TransferFunction",
    "Unlimited",
]
