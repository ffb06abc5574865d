"""Legendre-Gauss-Lobatto points: the equations of the model hold at both ends of every element.

    x'(c_j) = h f(c_j, x(c_j), z_j, u_j)    c_1 = 0, ..., c_k = 1; x: the polynomial of degree k in an element

Lobatto IIIA (Hairer, Wanner, Solving ODEs II, IV.5): states at the borders and costs have order 2 k - 2, chosen inputs
k - 1. Two points are the trapezoidal rule, three the method of Hermite and Simpson. Inputs and algebraics have values of
their own on both sides of a border, so that they may jump there, and equations hold at the first instant, too. The unknowns
of a state are its values at the k + 1 Lobatto points, where its limits hold; other limits hold at the points c_j.

It is A-stable, but its stability function tends to -1 or 1: stiff decay is not damped, as it is by Radau points. Its
adjoint is another method, Lobatto IIIB: multipliers at single points are no costates at these times, while those of
conditions and limits are sensitivities as with other schemes. It is refined as they are.
"""

import numpy as np
from numpy.polynomial.legendre import Legendre

from gantrytau_optimica.transcription.scheme import Collocation, collocation


def lobatto(count: int) -> Collocation:
    """The scheme with `count` points per element, at least two."""
    return collocation("lobatto", _points(count), _points(count + 1))


def _points(count: int) -> np.ndarray:
    """Lobatto points (count,) on [0, 1]: the ends, and extrema of Legendre's polynomial between them."""
    inner = np.sort(Legendre.basis(count - 1).deriv().roots().real)
    return np.concatenate([[0.0], (1 + inner) / 2, [1.0]])
