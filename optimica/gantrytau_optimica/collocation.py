"""Radau and Gauss collocation on the unit interval: points and weights from their definitions."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

Array = NDArray[np.float64]
SchemeName = Literal["radau", "gauss"]


@dataclass(frozen=True, eq=False)
class Scheme:
    """One element of collocation with k points; its polynomials of degree k run through 0 and the points."""

    name: SchemeName
    points: Array  # (k,) in (0, 1]
    differentiation: Array  # (k, k + 1): derivative at the points from the values at (0, points)
    end: Array  # (k + 1,): value at 1 from the values at (0, points)
    quadrature: Array  # (k,): integral over [0, 1] from the values at the points

    @property
    def nodes(self) -> Array:
        """0 and the points, (k + 1,)."""
        return np.concatenate([[0.0], self.points])


@cache
def scheme(name: SchemeName, points: int) -> Scheme:
    """The Radau scheme (last point at 1, order 2k - 1) or the Gauss scheme (order 2k) of k points."""
    if name not in ("radau", "gauss"):
        raise ValueError(f"scheme: found '{name}', expected 'radau' or 'gauss'")
    if not 1 <= points <= 9:
        raise ValueError(f"points per element: found {points}, expected 1 to 9")
    # roots of P_k (Gauss), or of P_k - P_(k-1) (Radau, right end included)
    series = np.zeros(points + 1)
    series[points] = 1.0
    if name == "radau":
        series[points - 1] -= 1.0
    tau = np.sort((1 + np.real(legendre.legroots(series))) / 2)
    if name == "radau":
        tau[-1] = 1.0
    nodes = np.concatenate([[0.0], tau])
    powers = np.vander(tau, points, increasing=True)
    moments = 1 / np.arange(1, points + 1)
    return Scheme(
        name=name,
        points=tau,
        differentiation=_derivatives(nodes)[1:],
        end=np.array(lagrange(nodes, 1.0)),
        quadrature=np.linalg.solve(powers.T, moments).astype(np.float64),
    )


def lagrange(nodes: Any, s: Any) -> list[Any]:
    """The Lagrange polynomials of the nodes at s; nodes and s hold numbers, arrays or symbols."""
    basis = []
    for k in range(len(nodes)):
        value = 1.0 + 0 * s
        for m in range(len(nodes)):
            if m != k:
                value = value * ((s - nodes[m]) / (nodes[k] - nodes[m]))
        basis.append(value)
    return basis


def _derivatives(nodes: Array) -> Array:
    """Differentiation matrix of the nodes, barycentric; the rows sum to zero by construction."""
    distance = nodes[:, None] - nodes[None, :] + np.eye(len(nodes))
    weights = 1 / distance.prod(axis=1)
    matrix = weights[None, :] / weights[:, None] / distance
    np.fill_diagonal(matrix, 0.0)
    np.fill_diagonal(matrix, -matrix.sum(axis=1))
    return matrix
