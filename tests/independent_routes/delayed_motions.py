"""Random motions x' = A x + B x(t - T) + b, at rest before the start, solved exactly by the method of steps.

With y_k(s) = x(k T + s) for 0 <= s <= T the parts are one system without delay, y_k' = A y_k + B y_(k-1) + b, whose matrix
exponential takes y_0 to y_k from their values at s = 0 to the ends of their steps.
"""

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from scipy.linalg import expm

from gantrytau import Model, Parameter, Real, delay, der

END = 2.0  # s


@dataclass(frozen=True, eq=False)
class DelayedMotion:
    """A model of x (n,), and where it is at END."""

    text: str
    model: type[Model]
    end: np.ndarray


def random_delayed(rng: np.random.Generator) -> DelayedMotion:
    """One to three states and a delay of a 40th of the run to the whole of it."""
    n = int(rng.integers(1, 4))
    a, by_past = (rng.normal(size=(n, n)).round(1) - 0.5 * np.eye(n) for _ in range(2))
    b, x0 = rng.normal(size=n).round(1), rng.normal(size=n).round(1)
    late = float(rng.choice([0.05, 0.137, 0.4, 0.5, 1.0, 1.9, 2.5]))

    class Delayed(Model):
        T = Parameter(late, unit="s", description="delay")
        x = Real(n, start=x0.tolist(), fixed=True)

        def equations(self) -> Any:
            past = ca.mtimes(ca.DM(by_past), delay(self.x, self.T))
            yield der(self.x) == ca.mtimes(ca.DM(a), self.x) + past + ca.DM(b)

    text = f"A {a.tolist()}, B {by_past.tolist()}, b {b.tolist()}, x0 {x0.tolist()}, T {late}"
    return DelayedMotion(text, Delayed, _end(a, by_past, b, x0, late))


def _end(a: np.ndarray, by_past: np.ndarray, b: np.ndarray, x0: np.ndarray, late: float) -> np.ndarray:
    n, parts = len(x0), int(END / late) + 1
    begins = [x0]
    for count in range(1, parts + 1):
        whole = np.zeros((n * count + 1, n * count + 1))
        for k in range(count):
            own = slice(n * k, n * (k + 1))
            whole[own, own], whole[own, -1] = a, b
            if k:
                whole[own, n * (k - 1) : n * k] = by_past
            else:
                whole[own, -1] = b + by_past @ x0
        left = late if count < parts else END - (parts - 1) * late
        ends = expm(whole * left) @ np.append(np.concatenate(begins), 1.0)
        begins.append(ends[-1 - n : -1])
    return begins[-1]
