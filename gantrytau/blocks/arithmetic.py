"""Gains, sums and products of signals."""

from math import prod

from gantrytau import Input, Model, Output, Parameter, dot
from gantrytau.blocks.block import Block


class Gain(Block):
    """y = k u."""

    k = Parameter(1.0, description="gain, in the unit of y for one of u")

    def equations(self):
        yield self.y == self.k * self.u


class Sum(Model):
    """y = k[0] u[0] + k[1] u[1] + ...: `Sum(k=[1, -1])` is a difference; u has as many elements as k."""

    k = Parameter(description="factors of the inputs, a list")
    u = Input(lambda self: self.k.shape[0], description="inputs")
    y = Output(description="output")

    def equations(self):
        yield self.y == dot(self.k, self.u)


class Product(Model):
    """y = u[0] u[1] ... of as many inputs as `size` says."""

    size = 2
    u = Input(lambda self: self.size, description="inputs")
    y = Output(description="output")

    def equations(self):
        yield self.y == prod(self.u.elements())
