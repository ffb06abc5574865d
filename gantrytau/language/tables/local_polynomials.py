"""Piecewise polynomials as expressions: which piece holds the argument, and the polynomial there.

A piece is a difference of two conditions, 1 where it holds the argument and 0 elsewhere, and each coefficient is the sum of
its numbers times these. One term of the sum counts, so that it is exact; conditions have no derivatives, so that those of
the whole are those of the polynomial. With 1000 points this takes 9,000 instructions, a tree of choices 14,000; the sum of
kinks with 12,000 loses digits with the number of points.
"""

from dataclasses import dataclass
from importlib import import_module
from itertools import pairwise
from math import factorial
from typing import Any

import casadi as ca
import numpy as np

LINEAR, CUBIC = 1, 3


@dataclass(frozen=True, eq=False)
class Polynomials:
    """Functions of one argument, each a polynomial between edges (pieces - 1,), in the argument less origins (pieces,).

    coefficients: (order + 1, pieces, functions), the highest power first; low, high: the ends; slopes: behind them,
    (2, functions); smooth: whether the functions are smooth at the edges, but not at the ends.
    """

    edges: np.ndarray
    origins: np.ndarray
    coefficients: np.ndarray
    low: float
    high: float
    slopes: np.ndarray
    smooth: bool

    def at(self, x: ca.SX) -> tuple[list[ca.SX], ca.SX]:
        """The functions of a scalar expression, and 1 beyond the ends, else 0."""
        onwards = not self.smooth and bool(np.any(self.slopes))  # straight lines go on as they are
        # the last point belongs to a line that goes on, as every edge to the piece behind it
        below, above = x < self.low, x >= self.high if np.any(self.slopes) else x > self.high
        within = x if onwards else ca.if_else(below, self.low, ca.if_else(above, self.high, x))
        sides = [ca.SX(1), *(within >= edge for edge in self.edges.tolist())]
        inside = [before - after for before, after in pairwise(sides)]
        inside.append(1 - (1 - sides[-1]))  # a difference, too: so units know a number of a table
        inside = [ca.logic_and(1, piece) for piece in inside] if self.smooth else inside  # as `smoothly`
        local = within - _chosen(inside, self.origins)
        beyond = ca.if_else(below, x - self.low, 0), ca.if_else(above, x - self.high, 0)
        values = []
        for function, ends in zip(np.moveaxis(self.coefficients, -1, 0), self.slopes.T.tolist(), strict=True):
            value = _chosen(inside, function[0])
            for numbers in function[1:]:
                value = value * local + _chosen(inside, numbers)
            if self.smooth and any(ends):  # beyond the ends, where the first and the last piece hold
                for here, slope, rest in zip((inside[0], inside[-1]), ends, beyond, strict=True):
                    value += ca.SX.binary(ca.OP_IF_ELSE_ZERO, here, slope * rest)
            values.append(value)
        return values, below + above


def _chosen(inside: list[ca.SX], numbers: np.ndarray) -> ca.SX:
    """Of one number for each piece that of the piece that holds the argument."""
    value = ca.SX(0)
    for here, number in zip(inside, numbers.tolist(), strict=True):
        value += ca.SX.binary(ca.OP_IF_ELSE_ZERO, here, ca.SX(number)) if number else 0
    return value


def _spline(x: np.ndarray, values: np.ndarray, kind: str) -> Any:
    """Through values (n, ...) at x (n,), rising: straight lines, or the cubic one that is not-a-knot (de Boor 1978, IV)."""
    interpolate = import_module("scipy.interpolate")
    return interpolate.make_interp_spline(x, values, LINEAR if kind == "linear" else min(CUBIC, x.size - 1))


def interpolating(x: np.ndarray, values: np.ndarray, kind: str) -> np.ndarray:
    """Coefficients (n, ...) of the B-splines that have values (n, ...) at x (n,)."""
    return _spline(x, values, kind).c


def polynomials(x: np.ndarray, weights: np.ndarray, kind: str, outside: str) -> Polynomials:
    """Sums of B-splines over points x (n,), weights (n, functions), as polynomials; outside: how they go on."""
    bare = _spline(x, weights, kind)
    spline = type(bare)(bare.t, weights, bare.k)
    breaks = bare.t[bare.k : bare.t.size - bare.k]
    coefficients = np.array([spline(breaks[:-1], k) / factorial(k) for k in range(bare.k, -1, -1)])
    return pieces(breaks, coefficients, spline(breaks[[0, -1]], 1), outside, kind == "spline")


def pieces(
    breaks: np.ndarray, coefficients: np.ndarray, slopes: np.ndarray, outside: str, smooth: bool = True
) -> Polynomials:
    """Polynomials between breaks (n,), coefficients (order + 1, n - 1, functions); slopes (2, functions) at the ends."""
    edges, origins = breaks[1:-1], breaks[:-1]
    if not edges.size:  # numbers of a table are known by their choice
        edges, origins = breaks.mean(keepdims=True), np.repeat(origins, 2)
        coefficients = np.repeat(coefficients, 2, axis=1)
    ends = slopes * (outside == "linear")
    return Polynomials(edges, origins, coefficients, float(breaks[0]), float(breaks[-1]), ends, smooth)
