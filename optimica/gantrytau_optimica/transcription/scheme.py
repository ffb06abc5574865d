"""Collocation on one element: points, differentiation, interpolation and quadrature on [0, 1]."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from gantrytau import ModelError

SCHEMES = {"radau": "radau", "gauss": "legendre"}
MOST_POINTS = 9


@dataclass(frozen=True, eq=False)
class Collocation:
    """A collocation scheme.

    points: (k,) in (0, 1]; nodes: (k + 1,) with 0 before them; differentiation: (k + 1, k), derivative at
    point j of the polynomial through values v at the nodes is v @ differentiation[:, j]; end: (k + 1,) its
    value at 1; weights: (k,) of the quadrature over the points.
    """

    scheme: str
    points: np.ndarray
    nodes: np.ndarray
    differentiation: np.ndarray
    end: np.ndarray
    weights: np.ndarray


def collocation(scheme: str, count: int) -> Collocation:
    """The scheme "radau" or "gauss" with `count` points per element. Raises ModelError for others."""
    if scheme not in SCHEMES:
        raise ModelError(
            f"scheme={scheme!r}: expected one of {', '.join((*SCHEMES, 'shooting'))}", argument="scheme"
        )
    if isinstance(count, bool) or not isinstance(count, int) or not 1 <= count <= MOST_POINTS:
        raise ModelError(
            f"points={count!r}: expected a whole number from 1 to {MOST_POINTS}", argument="points"
        )
    points = np.array(ca.collocation_points(count, SCHEMES[scheme]))
    nodes = np.concatenate([[0.0], points])
    powers = np.arange(count + 1)
    # columns of `coefficients`: the polynomials that are one at one node and zero at the others
    coefficients = np.linalg.inv(nodes[:, None] ** powers)
    slopes = powers[1:] * points[:, None] ** powers[:-1]
    weights = np.linalg.solve((points[:, None] ** powers[:-1]).T, 1.0 / powers[1:])
    return Collocation(
        scheme,
        points,
        nodes,
        (slopes @ coefficients[1:]).T,
        coefficients.sum(axis=0),
        weights,
    )
