"""Limits taken apart into scalar rows with bounds that do not move during a solve."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from gantrytau_optimica.control_problem import Bound, Limit, Parameter

Array = NDArray[np.float64]


class Row(NamedTuple):
    """lower <= expression <= upper, scalar; bounds depend on parameters at most."""

    expression: ca.SX
    lower: ca.SX
    upper: ca.SX
    name: str
    unit: str
    moving: str  # "lower" or "upper": the expression is the distance from a bound that moves; else ""


def rows_of(limits: Sequence[Limit], parameters: Sequence[Parameter]) -> list[Row]:
    """Scalar rows; a bound that depends on more than parameters goes to the other side of its inequality."""
    fixed = {symbol.element_hash() for item in parameters for symbol in ca.symvar(item.symbol)}
    rows = []
    for limit in limits:
        count = limit.expression.numel()
        lower, upper = (_column(limit, bound, count) for bound in (limit.lower, limit.upper))
        for i in range(count):
            expression, low, high = ca.vec(limit.expression)[i], lower[i], upper[i]
            name = limit.name if count == 1 else f"{limit.name}[{i}]"
            moves = [any(s.element_hash() not in fixed for s in ca.symvar(bound)) for bound in (low, high)]
            if not any(moves):
                rows.append(Row(expression, low, high, name, limit.unit, ""))
                continue
            infinite = ca.SX(np.inf)
            if ca.is_equal(low, high):
                rows.append(Row(expression - low, ca.SX(0), ca.SX(0), name, limit.unit, "lower"))
                continue
            if moves[0] or _finite(low):
                rows.append(Row(expression - low, ca.SX(0), infinite, name, limit.unit, "lower"))
            if moves[1] or _finite(high):
                rows.append(Row(expression - high, -infinite, ca.SX(0), name, limit.unit, "upper"))
    return rows


def _finite(bound: ca.SX) -> bool:
    return not bound.is_constant() or bool(np.isfinite(float(bound)))


def _column(limit: Limit, bound: Bound, count: int) -> ca.SX:
    column = (
        ca.vec(bound) if isinstance(bound, ca.SX) else ca.SX(ca.DM(np.asarray(bound, dtype=float).ravel()))
    )
    if column.numel() not in (1, count):
        raise ValueError(f"limit '{limit.name}': {column.numel()} bounds for {count} elements")
    if any(entry.is_constant() and np.isnan(float(entry)) for entry in ca.vertsplit(column)):
        raise ValueError(f"limit '{limit.name}': a bound is not a number")
    return column if column.numel() == count else ca.repmat(column, count, 1)


@dataclass(frozen=True, eq=False)
class Bounds:
    """Lower and upper bounds of n quantities; some follow from the parameters."""

    lower: Array
    upper: Array
    entries: NDArray[np.int64]  # which of them follow
    function: ca.Function | None  # parameters -> (lower, upper) of these entries

    def at(self, parameters: Array) -> tuple[Array, Array]:
        """The bounds for given parameters."""
        lower, upper = self.lower.copy(), self.upper.copy()
        if self.function is not None:
            low, high = (np.asarray(side).ravel() for side in self.function(parameters))
            np.maximum.at(lower, self.entries, low)
            np.minimum.at(upper, self.entries, high)
        return lower, upper


class BoundsDraft:
    """Collects bounds while a problem is being transcribed; several on one quantity are intersected."""

    def __init__(self, count: int) -> None:
        self.lower, self.upper = np.full(count, -np.inf), np.full(count, np.inf)
        self.entries: list[NDArray[np.int64]] = []
        self.low: list[ca.SX] = []
        self.high: list[ca.SX] = []

    def limit(self, entries: NDArray[np.int64], lower: ca.SX | float, upper: ca.SX | float) -> None:
        """Hold lower <= each of the entries <= upper."""
        low, high = ca.SX(lower), ca.SX(upper)
        if low.is_constant() and high.is_constant():
            self.lower[entries] = np.maximum(self.lower[entries], float(low))
            self.upper[entries] = np.minimum(self.upper[entries], float(high))
            return
        self.entries.append(entries)
        self.low.append(ca.repmat(low, len(entries), 1))
        self.high.append(ca.repmat(high, len(entries), 1))

    def finish(self, parameters: ca.SX) -> Bounds:
        """The collected bounds as a record."""
        function = None
        if self.entries:
            function = ca.Function("bounds", [parameters], [ca.vertcat(*self.low), ca.vertcat(*self.high)])
        entries = np.concatenate(self.entries) if self.entries else np.zeros(0, dtype=np.int64)
        return Bounds(self.lower, self.upper, entries, function)
