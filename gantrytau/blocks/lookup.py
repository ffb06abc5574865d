"""Blocks that look a signal up: in a table of numbers, or in its own past."""

from typing import Any, Literal

from gantrytau import Input, Model, Output, Parameter, delay, table
from gantrytau.blocks.block import Block


class Table1(Block):
    """y at u in a table: `Table1([0, 1, 2], [0, 1, 4])`, by straight lines or `kind="spline"`.

    xs rise, ys are as many. outside: "hold" the value of the end, go on "linear", or end with an "error"; see `table`,
    whose ModelErrors these are.
    """

    kind: Literal["linear", "spline"] = "linear"
    outside: Literal["hold", "linear", "error"] = "hold"

    def __init__(self, xs: Any, ys: Any, *, unit: str | tuple[str, str] | None = None, **modifications: Any):
        self.xs, self.ys = xs, ys
        super().__init__(unit=unit, **modifications)

    def equations(self):
        yield self.y == table(self.u, self.xs, self.ys, kind=self.kind, outside=self.outside)


class Table2(Model):
    """y at u[0] and u[1] in a table of two arguments: `Table2(xs, ys, values)`, values (n, m) for xs (n,) and ys (m,).

    kind and outside as of `Table1`; between the numbers it is bilinear, or bicubic.
    """

    kind: Literal["linear", "spline"] = "linear"
    outside: Literal["hold", "linear", "error"] = "hold"
    u = Input(2, description="the two arguments")
    y = Output(description="output")

    def __init__(self, xs: Any, ys: Any, values: Any, **modifications: Any):
        self.xs, self.ys, self.values = xs, ys, values
        super().__init__(**modifications)

    def equations(self):
        arguments, axes = (self.u[0], self.u[1]), (self.xs, self.ys)
        yield self.y == table(arguments, axes, self.values, kind=self.kind, outside=self.outside)


class Delay(Block):
    """y is u as it was a time T ago, before that as it was at the start; see `delay`."""

    T = Parameter(0.1, unit="s", min=0.0, description="delay, above zero")

    def equations(self):
        yield self.y == delay(self.u, self.T)
