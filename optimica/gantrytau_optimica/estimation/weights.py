"""Weights of residuals: by given standard deviations, by the residual noise of each output, and strays less.

    noise_g^2 = sum over the values of output g of residual^2 / (their number - the share of the parameters they tell)

Without deviations, outputs of different units have no common noise. Their variances are estimated with the parameters,
each from the degrees of freedom that its values keep (restricted maximum likelihood; Harville (1977), J. American
Statistical Association 72, 320). A robust fit takes medians instead, and weighs strays down: Huber (1981), Robust
Statistics, chapter 7.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from gantrytau_optimica.fitting.linear import column_norms
from gantrytau_optimica.fitting.robust import huber_weights, robust_deviation

LEAST = 1e-7  # of the expected noise: that of computed data, which have none
FEWEST = 2  # degrees of freedom from which an output has its own noise; below, it is that of the others


@dataclass(frozen=True, eq=False)
class Weights:
    """Weights of residuals. noise (N,): standard deviation of each, in its unit; huber (N,): at most 1, of strays."""

    noise: np.ndarray
    huber: np.ndarray

    @staticmethod
    def even(count: int) -> "Weights":
        """Weights 1 for residuals over their standard deviations, without strays."""
        return Weights(np.ones(count), np.ones(count))

    @property
    def roots(self) -> np.ndarray:
        """Factors (N,) of the residuals whose squares are summed."""
        return np.sqrt(self.huber) / self.noise


@dataclass(frozen=True, eq=False)
class Weighing:
    """Rule of the weights. outputs (N,): index of the output of each residual; known: standard deviations are given."""

    outputs: np.ndarray
    known: bool
    loss: Literal["squares", "robust"]

    @property
    def count(self) -> int:
        """Number of outputs."""
        return int(np.max(self.outputs)) + 1

    @property
    def steady(self) -> bool:
        """Whether weights do not depend on the residuals."""
        return self.loss == "squares" and (self.known or self.count == 1)

    def first(self) -> Weights:
        """Weights before anything is fitted."""
        return Weights.even(self.outputs.size)

    def weights(self, errors: np.ndarray, jacobian: np.ndarray, before: Weights) -> Weights:
        """Weights by residuals (N,) and Jacobian (N, k) of a fit; before: weights of this fit."""
        noise = before.noise if self.known else self._noise(errors, jacobian, before)
        if self.loss == "squares":
            return Weights(noise, before.huber)
        return Weights(noise, huber_weights(errors / noise))

    def _noise(self, errors: np.ndarray, jacobian: np.ndarray, before: Weights) -> np.ndarray:
        mine = [np.flatnonzero(self.outputs == g) for g in range(self.count)]
        if self.loss == "robust":
            return np.maximum([robust_deviation(errors[rows]) for rows in mine], LEAST)[self.outputs]
        told = _told(jacobian * before.roots[:, None])
        freedom = np.array([rows.size - np.sum(told[rows]) for rows in mine])
        sums = np.array([np.sum(errors[rows] ** 2) for rows in mine])
        own = freedom >= FEWEST
        others = np.sqrt(np.sum(sums) / max(np.sum(freedom), 1.0))
        found = np.where(own, np.sqrt(sums / np.where(own, freedom, 1.0)), others)
        return np.maximum(found, LEAST)[self.outputs]


def _told(jacobian: np.ndarray) -> np.ndarray:
    """Leverage of each value, (N,): the diagonal of the projection on the Jacobian."""
    basis, singular, _ = np.linalg.svd(jacobian / column_norms(jacobian), full_matrices=False)
    return np.sum(basis[:, singular > 1e-12 * singular[0]] ** 2, axis=1) if singular.size else np.zeros(0)
