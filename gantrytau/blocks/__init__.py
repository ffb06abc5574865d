"""Signal blocks: what computes one signal from others, and what begins one."""

from gantrytau import StateSpace
from gantrytau.blocks.arithmetic import Gain, Product, Sum
from gantrytau.blocks.block import Block, Source
from gantrytau.blocks.continuous import Derivative, FirstOrder, Integrator, TransferFunction
from gantrytau.blocks.limiters import DeadZone, Limiter, RateLimiter, Unlimited
from gantrytau.blocks.pid import Pid
from gantrytau.blocks.sources import Pulse, Ramp, Sine, Step
from gantrytau.mechanics.filters import LowPass

__all__ = [
    "Block",
    "DeadZone",
    "Derivative",
    "FirstOrder",
    "Gain",
    "Integrator",
    "Limiter",
    "LowPass",
    "Pid",
    "Product",
    "Pulse",
    "Ramp",
    "RateLimiter",
    "Sine",
    "Source",
    "StateSpace",
    "Step",
    "Sum",
    "TransferFunction",
    "Unlimited",
]
