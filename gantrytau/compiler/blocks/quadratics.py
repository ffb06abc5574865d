"""The roots of a quadratic in forms that hold where its leading coefficient vanishes or changes its sign.

f = a/2 x^2 + b x + c with slope a x + b = side * w at a root, w^2 = b^2 - 2 a c. The side of the start stays the same
as long as the roots do not meet, whatever becomes of a. Of x = (side * w - b) / a = -2 c / (b + side * w) that one is
taken whose sum does not cancel.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from gantrytau.compiler.blocks.pivots import Guide

ACROSS = 1e-9  # cosine of two directions that count as orthogonal


@dataclass(frozen=True, eq=False)
class QuadraticRoot:
    """An unknown as an expression of a square root: `value` in the symbol `root`, with root^2 = radicand, root >= 0."""

    root: ca.SX
    radicand: ca.SX
    value: ca.SX

    @property
    def closed(self) -> ca.SX:
        """The unknown without the symbol."""
        return ca.substitute(self.value, self.root, ca.sqrt(self.radicand))


def quadratic_root(f: ca.SX, x: ca.SX, guide: Guide) -> QuadraticRoot:
    """The root of a quadratic in x on the branch where the sample lies."""
    slope = ca.densify(ca.jacobian(f, x))
    curvature = ca.densify(ca.jacobian(slope, x))
    root = ca.SX.sym(f"sqrt({x.name()})")
    b, c = ca.substitute(slope, x, 0), ca.substitute(f, x, 0)
    if curvature.is_constant():
        # f = f(middle) + a / 2 * (x - middle)^2, the shorter form
        middle = -b / curvature
        radicand = -2 * ca.substitute(f, x, middle) / curvature
        if _reaches_alike(middle, radicand, guide):
            return QuadraticRoot(root, radicand, middle + _side(slope / curvature, guide) * root)
    side = _side(slope, guide)
    return QuadraticRoot(root, b**2 - 2 * curvature * c, root_of(curvature, b, c, side * root))


def root_of(a: ca.SX, b: ca.SX, c: ca.SX, w: ca.SX) -> ca.SX:
    """The root of a/2 x^2 + b x + c where its slope is w; NaN where that root is infinitely far.

    One quotient, whose terms are chosen before: a term that is not used would spoil derivatives by 0 * inf.
    """
    flat = b * w > 0
    far = ca.if_else(a == 0, ca.SX.nan(), a)
    return ca.if_else(flat, -2 * c, w - b) / ca.if_else(flat, b + w, far)


def _side(slope: ca.SX, guide: Guide) -> float:
    return 1.0 if float(guide.at_start(slope)[0, 0]) >= 0 else -1.0


def _reaches_alike(middle: ca.SX, radicand: ca.SX, guide: Guide) -> bool:
    """Whether a move of the middle leaves the root as it is, as where a rod reaches a rail.

    Elsewhere the root may grow with the middle, and their difference loses digits.
    """
    if middle.is_zero():
        return True
    leaves = ca.symvar(middle)
    if not leaves:
        return False
    gradients = guide.around(ca.jacobian(ca.vertcat(middle, radicand), ca.vertcat(*leaves)))
    both = np.linalg.norm(gradients, axis=2).prod(axis=1)
    return bool(np.all(np.abs((gradients[:, 0] * gradients[:, 1]).sum(axis=1)) <= ACROSS * both))
