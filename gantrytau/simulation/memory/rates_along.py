"""Expressions along a motion: their values, rates and second rates."""

from collections.abc import Sequence

import casadi as ca
import numpy as np

from gantrytau.language.symbols import time


class RatesAlong:
    """Expressions of x, z, time, t0 and w with their first and second total time derivatives.

    x' = ode and 0 = algebraic, of which z' and z'' follow.
    """

    def __init__(self, expressions: ca.SX, arguments: Sequence[ca.SX], ode: ca.SX, algebraic: ca.SX):
        """arguments: x, z, time, t0, w."""
        x, z, _, t0, w = arguments
        first, second = ca.SX.sym("first", z.numel()), ca.SX.sym("second", z.numel())
        rate = ca.jtimes(
            ca.vertcat(expressions, algebraic), ca.vertcat(x, z, time), ca.vertcat(ode, first, 1)
        )
        rates = ca.jtimes(rate, ca.vertcat(x, z, first, time), ca.vertcat(ode, first, second, 1))
        self.count, self._algebraics = expressions.numel(), z.numel()
        found = [ca.densify(e) for e in (expressions, rate, rates, ca.jacobian(algebraic, z))]
        self._look = ca.Function("along", [x, z, first, second, time, t0, w], found, {"cse": True})

    def at(self, x: np.ndarray, z: np.ndarray, t: np.ndarray, t0: np.ndarray, w: np.ndarray) -> np.ndarray:
        """Values, rates and second rates at places, (places, expressions, 3); x (places, n), t (places,), t0 too."""
        first = second = np.zeros_like(z)
        if self._algebraics:
            _, rate, _, matrix = self._called(x, z, first, second, t, t0, w)
            first = self._solved(matrix, rate)
            _, _, rates, _ = self._called(x, z, first, second, t, t0, w)
            second = self._solved(matrix, rates)
        value, rate, rates, _ = self._called(x, z, first, second, t, t0, w)
        return np.stack([value, rate[:, : self.count], rates[:, : self.count]], axis=-1)

    def _called(self, x, z, first, second, t, t0, w) -> list[np.ndarray]:
        """Values, rates and second rates with those of the residuals, a row a place; the Jacobians side by side."""
        found = self._look(x.T, z.T, first.T, second.T, t[None], t0[None], w.T)
        value, rate, rates, matrix = (np.array(f) for f in found)
        return [value.T, rate.T, rates.T, matrix]

    def _solved(self, matrix: np.ndarray, rates: np.ndarray) -> np.ndarray:
        m = self._algebraics
        square = matrix.reshape(m, len(rates), m).transpose(1, 0, 2)
        return np.linalg.solve(square, -rates[:, self.count :, None])[:, :, 0]
