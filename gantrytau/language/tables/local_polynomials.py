"""Piecewise polynomials as expressions: which piece holds the argument, and the polynomial there.

A piece is a difference of two conditions, 1 where it holds the argument and 0 elsewhere, and each coefficient is the sum of
its numbers times these. One term of the sum counts, so that it is exact; conditions have no derivatives, so that those of
the whole are those of the polynomial. With 1000 points this takes 9,000 instructions, a tree of choices 14,000; the sum of
kinks with 12,000 loses digits with the number of points.
"""

from dataclasses import dataclass
from itertools import pairwise
from math import factorial

import casadi as ca
import numpy as np

LINEAR, CUBIC = 1, 3


@dataclass(frozen=True, eq=False)
class Polynomials:
    """Functions of one argument, each a polynomial between edges (pieces - 1,), in the argument less origins (pieces,).

    coefficients: (order + 1, pieces, functions), the highest power first; ends: whether the first and last piece lie
    beyond the table, where it holds or is not defined.
    """

    edges: np.ndarray
    origins: np.ndarray
    coefficients: np.ndarray
    ends: bool

    def at(self, x: ca.SX) -> tuple[list[ca.SX], ca.SX]:
        """The functions of a scalar expression, and 1 beyond the ends, else 0."""
        last = len(self.edges) - 1
        reached = [
            x > edge if self.ends and k == last else x >= edge for k, edge in enumerate(self.edges.tolist())
        ]
        sides = [ca.SX(1), *reached]
        inside = [before - after for before, after in pairwise(sides)]
        inside.append(1 - (1 - reached[-1]))  # a difference, too: so units know a number of a table
        local = x - _chosen(inside, self.origins)
        values = []
        for function in np.moveaxis(self.coefficients, -1, 0):
            value = _chosen(inside, function[0])
            for numbers in function[1:]:
                value = value * local + _chosen(inside, numbers)
            values.append(value)
        return values, inside[0] + inside[-1] if self.ends else ca.SX(0)


def _chosen(inside: list[ca.SX], numbers: np.ndarray) -> ca.SX:
    """Of one number for each piece that of the piece that holds the argument."""
    value = ca.SX(0)
    for here, number in zip(inside, numbers.tolist(), strict=True):
        value += ca.SX.binary(ca.OP_IF_ELSE_ZERO, here, ca.SX(number)) if number else 0
    return value


def splines(x: np.ndarray, kind: str) -> tuple[np.ndarray, int]:
    """Knots and order of the splines through points x (n,), rising: cubic ones are not-a-knot (de Boor 1978, IV)."""
    from scipy.interpolate import make_interp_spline

    order = LINEAR if kind == "linear" else min(CUBIC, x.size - 1)
    return make_interp_spline(x, np.zeros(x.size), order).t, order


def interpolating(x: np.ndarray, values: np.ndarray, kind: str) -> np.ndarray:
    """Coefficients (n, ...) of the B-splines that have values (n, ...) at x (n,)."""
    from scipy.interpolate import make_interp_spline

    return make_interp_spline(x, values, LINEAR if kind == "linear" else min(CUBIC, x.size - 1)).c


def polynomials(x: np.ndarray, weights: np.ndarray, kind: str, outside: str) -> Polynomials:
    """Sums of B-splines over points x (n,), weights (n, functions), as polynomials; outside: how they go on."""
    from scipy.interpolate import BSpline

    knots, order = splines(x, kind)
    breaks = knots[order : knots.size - order]
    edges, origins = breaks[1:-1], breaks[:-1]
    spline = BSpline(knots, weights, order)
    coefficients = np.array([spline(origins, k) / factorial(k) for k in range(order, -1, -1)])
    if outside == "linear" and order == LINEAR:
        if edges.size:
            return Polynomials(edges, origins, coefficients, ends=False)
        both = np.repeat(coefficients, 2, axis=1)  # its numbers are known by their choice
        return Polynomials(breaks.mean(keepdims=True), np.repeat(origins, 2), both, ends=False)
    beyond = np.zeros((order + 1, 2, weights.shape[1]))
    last = breaks[-1] - breaks[-2]
    powers = last ** np.arange(order, -1, -1)
    beyond[-1] = [coefficients[-1, 0], np.einsum("k,kf->f", powers, coefficients[:, -1])]
    if outside == "linear":
        slopes = np.arange(order, 0, -1) * powers[1:]
        beyond[-2] = [coefficients[-2, 0], np.einsum("k,kf->f", slopes, coefficients[:-1, -1])]
    return Polynomials(
        breaks,
        np.concatenate([breaks[:1], origins, breaks[-1:]]),
        np.concatenate([beyond[:, :1], coefficients, beyond[:, 1:]], axis=1),
        ends=True,
    )
