"""Linear systems of index 3 whose unknowns and equations are mixed by small integers, so that derivatives cancel.

    x' = L x + f(t)                                       states with a given motion
    z0 = g(t), z1 = z0', z2 = z1'                         a chain of index 3

written in w = P [x, z] and as Q times these rows. P and Q are integer matrices of determinant 1 or -1.
"""

from dataclasses import dataclass

import numpy as np

from gantrytau import Model, Real, der, sin, time


@dataclass(frozen=True)
class Mixed:
    """E w' + A w = B [sin(rates t + phases), cos(rates t + phases)], E and A (n, n); w = mixing [x, z]."""

    derivatives: np.ndarray
    values: np.ndarray
    forces: np.ndarray
    rates: np.ndarray
    phases: np.ndarray
    mixing: np.ndarray

    def motion(self, t: float) -> np.ndarray:
        """The unknowns at a time."""
        angle, size = self.rates * t + self.phases, len(self.rates)
        plain = np.sin(angle)
        chain = [plain[-1], self.rates[-1] * np.cos(angle[-1]), -(self.rates[-1] ** 2) * plain[-1]]
        return self.mixing @ np.concatenate([plain[: size - 1], chain])

    def model(self) -> Model:
        """The model, which starts on the motion."""
        mixed, n = self, len(self.values)

        class MixedEquations(Model):
            w = Real(n, start=self.motion(0.0))

            def equations(self):
                pieces = zip(mixed.rates, mixed.phases, strict=True)
                known = [sin(float(rate) * time + float(phase)) for rate, phase in pieces]
                known += [
                    sin(float(r) * time + float(p) + np.pi / 2)
                    for r, p in zip(mixed.rates, mixed.phases, strict=True)
                ]
                for e, a, b in zip(mixed.derivatives, mixed.values, mixed.forces, strict=True):
                    left = sum(float(x) * der(self.w[j]) for j, x in enumerate(e) if x)
                    left += sum(float(x) * self.w[j] for j, x in enumerate(a) if x)
                    yield left == sum(float(x) * known[j] for j, x in enumerate(b) if x)

        return MixedEquations()


def random_mixed(seed: int) -> Mixed:
    """One of 1 to 3 states and a chain."""
    random = np.random.default_rng(seed)
    states = int(random.integers(1, 4))
    n = states + 3
    # numbers with few digits, so that coefficients are sums without rounding
    decay = random.integers(-8, 9, (states, states)) / 8 - np.eye(states)
    rates = random.integers(2, 9, states + 1) / 4
    phases = random.integers(0, 9, states + 1) / 4
    derivatives, values = np.zeros((n, n)), np.zeros((n, n))
    forces = np.zeros((n, 2 * (states + 1)))
    derivatives[:states, :states], values[:states, :states] = np.eye(states), -decay
    forces[:states, :states] = -decay
    forces[range(states), range(states + 1, 2 * states + 1)] = rates[:states]
    values[range(states, n), range(states, n)] = 1.0
    forces[states, states] = 1.0
    derivatives[range(states + 1, n), range(states, n - 1)] = -1.0
    p, q = _unimodular(random, n), _unimodular(random, n)
    back = np.round(np.linalg.inv(p))
    return Mixed(q @ derivatives @ back, q @ values @ back, q @ forces, rates, phases, p)


def _unimodular(random: np.random.Generator, n: int) -> np.ndarray:
    lower, upper = (np.eye(n) + np.tril(random.integers(-1, 2, (n, n)), -1) for _ in range(2))
    return lower @ upper.T
