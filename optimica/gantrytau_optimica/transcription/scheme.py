"""Collocation on one element: points, differentiation, interpolation and quadrature on [0, 1]."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import casadi as ca
import numpy as np

from gantrytau_optimica.transcription.mesh import Mesh


@dataclass(frozen=True, eq=False)
class Collocation:
    """A collocation scheme.

    Polynomials through values v at the nodes, (k + 1,) from 0 on, are states within an element; their derivatives are
    those of the model at the points, (k,) in [0, 1]. differentiation: (k + 1, k), the derivative at point j is
    v @ differentiation[:, j]; end: (k + 1,) the value at 1; weights: (k,) of the quadrature over the points.
    compiled: whether functions of the program become kernels where that pays.
    refinable: whether inputs are free at every point, and the program may be put on other meshes, with borders that move.
    """

    scheme: str
    points: np.ndarray
    nodes: np.ndarray
    differentiation: np.ndarray
    end: np.ndarray
    weights: np.ndarray
    refinable: bool = True
    compiled: bool = True

    def divided(self, meshes: Sequence[Mesh]) -> list[Mesh]:
        """The meshes on which the program stands, from those of the caller."""
        return list(meshes)


def collocation(scheme: str, points: np.ndarray, nodes: np.ndarray) -> Collocation:
    """The scheme with these points (k,) and nodes (k + 1,)."""
    powers = np.arange(nodes.size)
    # columns of `coefficients`: the polynomials that are one at one node and zero at the others
    coefficients = np.linalg.inv(nodes[:, None] ** powers)
    derivatives = powers[1:] * points[:, None] ** powers[:-1]
    weights = np.linalg.solve((points[:, None] ** powers[:-1]).T, 1.0 / powers[1:])
    differentiation = (derivatives @ coefficients[1:]).T
    return Collocation(scheme, points, nodes, differentiation, coefficients.sum(axis=0), weights)


def _orthogonal(scheme: str, polynomials: str, count: int) -> Collocation:
    points = np.array(ca.collocation_points(count, polynomials))
    return collocation(scheme, points, np.concatenate([[0.0], points]))


radau = partial(_orthogonal, "radau", "radau")
gauss = partial(_orthogonal, "gauss", "legendre")
