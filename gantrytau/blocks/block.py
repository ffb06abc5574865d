"""The ports of signal blocks: what they all have in common."""

from typing import Any

from gantrytau import Input, Model, Output
from gantrytau.border.refusal import ModelError


class Block(Model):
    """Base of blocks with an input u and an output y, both scalar: `unit="m"` for both, or `unit=("V", "N")`.

    Without a unit a port is open: it takes what is connected to it, and claims nothing of it. Gains and limits
    are open as well, times and frequencies are not. Raises ModelError for another unit=, and where connected units disagree.
    """

    u = Input(description="input")
    y = Output(description="output")

    def __init__(self, *, unit: str | tuple[str, str] | None = None, **modifications: Any):
        units = (unit, unit) if unit is None or isinstance(unit, str) else unit
        if not (isinstance(units, tuple) and len(units) == 2):
            raise ModelError(
                f"{type(self).__name__}: unit: found {unit!r}, expected a text for both ports, or a pair for u and y"
            )
        super().__init__(_units(("u", "y"), units), **modifications)


class Source(Model):
    """Base of signals y that are functions of time: `Step(height=2.0, unit="m")`; open without a unit."""

    y = Output(description="output")

    def __init__(self, *, unit: str | None = None, **modifications: Any):
        super().__init__(_units(("y",), (unit,)), **modifications)


def _units(ports: tuple[str, ...], units: tuple[str | None, ...]) -> dict[str, Any]:
    return {port: dict(unit=unit) for port, unit in zip(ports, units, strict=True) if unit is not None}
