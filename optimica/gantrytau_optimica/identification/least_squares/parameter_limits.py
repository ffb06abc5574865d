"""What parameters can be: limits of each, and matrices of several that must have no negative eigenvalue.

Least squares within these are convex: a barrier whose weight falls to zero, each time minimised by Newton's method, ends
at the one minimum. Boyd, Vandenberghe (2004), Convex Optimization, chapter 11.
"""

from dataclasses import dataclass

import numpy as np

from gantrytau_optimica.fitting.linear import linear_least_squares
from gantrytau_optimica.identification.least_squares.factors import Factors

GAP = 1e-8  # of the sum of squares, which a minimum within conditions may leave too much
FALL, STEPS = 10.0, 50  # of the weight of the barrier; Newton steps for each


@dataclass(frozen=True, eq=False)
class Condition:
    """A matrix C (n, n) that must have no negative eigenvalue, constant + sum_j slopes[j] p[places[j]], by name."""

    name: str
    constant: np.ndarray
    places: np.ndarray
    slopes: np.ndarray

    def at(self, p: np.ndarray) -> np.ndarray:
        """The matrix at parameters p."""
        return self.constant + np.tensordot(p[self.places], self.slopes, 1)

    def interior(self, p: np.ndarray) -> np.ndarray:
        """Values at these places by which the matrix is positive definite, as close to p as it takes."""
        second = np.zeros(self.constant.shape)
        # a body that is larger in all directions
        second[range(len(second) - 1), range(len(second) - 1)] = 1.0
        away = np.linalg.lstsq(self.slopes.reshape(len(self.places), -1).T, second.ravel(), rcond=None)[0]
        begin, share = self.at(p), 1e-6 * max(np.trace(self.at(p) * second), 0.01 * self.at(p)[-1, -1])
        while np.linalg.eigvalsh(begin + share * second)[0] <= 1e-3 * share:
            share *= 10
        return p[self.places] + share * away

    def eigenvalues(self, p: np.ndarray) -> np.ndarray:
        """Eigenvalues (n,) of the matrix, scaled to a diagonal of ones."""
        C = self.at(p)
        size = np.sqrt(np.abs(np.diag(C)))
        size = np.maximum(size, 1e-9 * np.max(size))  # a thin plate has none across
        return np.linalg.eigvalsh(C / np.outer(size, size))


@dataclass(frozen=True, eq=False)
class ParameterLimits:
    """Limits of parameters: least (k,), -inf for none, and conditions on several together."""

    least: np.ndarray
    conditions: tuple[Condition, ...] = ()


def within(
    factors: Factors, begin: np.ndarray, nominal: np.ndarray, limits: ParameterLimits, free: np.ndarray
) -> np.ndarray:
    """Least squares within limits and conditions, in the free parameters; others stay as they begin.

    min |R p - d|^2 / 2 + mu (sum_i tr(C_i0^-1 C_i) - log det C_i - sum_j log(p_j - least_j)), mu falling to 0

    each by Newton's method. The first two are the distance of a body from that of the robot, so what the motion does not
    tell stays close to it. Lee, Wensing, Park (2020), Geometric robot dynamic identification, IEEE Trans. Robotics 36.
    """
    bodies = {int(j) for c in limits.conditions for j in c.places}
    bounded = np.array([j for j in free if limits.least[j] > -np.inf and j not in bodies], dtype=int)
    p = begin.copy()
    p[bounded] = np.maximum(p[bounded], limits.least[bounded] + 1e-3 * np.maximum(1.0, np.abs(p[bounded])))
    for c in limits.conditions:
        p[c.places] = c.interior(nominal)
    barrier = _Barrier(limits, bounded, [np.linalg.inv(c.at(p)) for c in limits.conditions])
    least = GAP * (factors.squares(begin) + GAP * float(factors.d @ factors.d))
    mu = factors.squares(p) / barrier.count
    while mu * barrier.count > least:
        mu /= FALL
        for _ in range(STEPS):
            S, right = barrier.linear(p)
            A = np.vstack([factors.R, np.sqrt(mu) * S])[:, free]
            b = np.concatenate([factors.d - factors.R @ p, np.sqrt(mu) * right])
            step = np.zeros(len(p))
            step[free] = linear_least_squares(A, b)
            now, decrement = (
                factors.squares(p) / 2 + mu * barrier.value(p),
                float(np.sum((A @ step[free]) ** 2)),
            )
            share = 1.0
            while share > 1e-9 and not (
                factors.squares(p + share * step) / 2 + mu * barrier.value(p + share * step)
                <= now - 1e-4 * share * decrement
            ):
                share /= 2
            if share <= 1e-9 or decrement < 1e-3 * mu:
                break
            p = p + share * step
    return p


@dataclass(frozen=True, eq=False)
class _Barrier:
    """What keeps parameters inside of limits, and bodies close to those of the robot, with its slopes."""

    limits: ParameterLimits
    bounded: np.ndarray
    references: list[np.ndarray]

    @property
    def count(self) -> int:
        """Dimensions of all that must not be negative: mu of them is what a minimum with the barrier can be too large."""
        return len(self.bounded) + sum(len(c.constant) for c in self.limits.conditions)

    def value(self, p: np.ndarray) -> float:
        """The barrier over mu, inf outside."""
        found, inside = 0.0, p[self.bounded] - self.limits.least[self.bounded]
        if np.any(inside <= 0):
            return np.inf
        for c, reference in zip(self.limits.conditions, self.references, strict=True):
            C = c.at(p)
            try:
                L = np.linalg.cholesky(C)
            except np.linalg.LinAlgError:
                return np.inf
            found += float(np.sum(reference * C)) - 2 * float(np.sum(np.log(np.diag(L))))
        return found - float(np.sum(np.log(inside)))

    def linear(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """S and r of which S'S is the Hessian and -S'r the gradient at p."""
        inside = p[self.bounded] - self.limits.least[self.bounded]
        rows = np.zeros((len(inside), len(p)))
        rows[np.arange(len(inside)), self.bounded] = 1 / inside
        parts, right = [rows], [np.ones(len(inside))]
        for c, reference in zip(self.limits.conditions, self.references, strict=True):
            L = np.linalg.cholesky(c.at(p))
            inverse = np.linalg.inv(L)
            S = np.zeros((L.size, len(p)))
            S[:, c.places] = (inverse @ c.slopes @ inverse.T).reshape(len(c.places), -1).T
            parts.append(S)
            right.append((np.eye(len(L)) - L.T @ reference @ L).ravel())
        return np.vstack(parts), np.concatenate(right)
