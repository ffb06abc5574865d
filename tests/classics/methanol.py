"""Methanol to hydrocarbons, COPS 3 (Dolan, More and Munson, 2004), problem 5; data of Maria (1989)."""

import numpy as np

from gantrytau import Model, Real, der
from gantrytau_optimica import Free, Optimization, at

DATA = [  # time, and three concentrations
    [0.0, 1.0, 0.0, 0.0], [0.050, 0.7085, 0.1621, 0.0811], [0.065, 0.5971, 0.1855, 0.0965],
    [0.080, 0.5537, 0.1989, 0.1198], [0.123, 0.3684, 0.2845, 0.1535], [0.233, 0.1712, 0.3491, 0.2097],
    [0.273, 0.1198, 0.3098, 0.2628], [0.354, 0.0747, 0.3576, 0.2467], [0.397, 0.0529, 0.3347, 0.2884],
    [0.418, 0.0415, 0.3388, 0.2757], [0.502, 0.0261, 0.3557, 0.3167], [0.553, 0.0208, 0.3483, 0.2954],
    [0.681, 0.0085, 0.3836, 0.2950], [0.750, 0.0053, 0.3611, 0.2937], [0.916, 0.0019, 0.3609, 0.2831],
    [0.937, 0.0018, 0.3485, 0.2846], [1.122, 0.0006, 0.3698, 0.2899],
]  # fmt: skip


class Methanol(Model):
    """Concentrations of methanol and of two groups of products."""

    k = Free([1.0, 1.0, 1.0, 1.0, 1.0], min=0.0, description="rates")
    y = Real(3, start=[1.0, 0.0, 0.0], fixed=True)

    def equations(self):
        k, a, b = self.k, self.y[0], self.y[1]
        shared = k[0] * a / ((k[1] + k[4]) * a + b)
        yield der(self.y[0]) == shared * b - (2 * k[1] + k[2] + k[3]) * a
        yield der(self.y[1]) == shared * (k[1] * a - b) + k[2] * a
        yield der(self.y[2]) == shared * (b + k[4] * a) + k[3] * a


class MethanolFit(Optimization):
    """COPS 3: 9.02229e-3."""

    reaction = Methanol()
    final_time = 1.122

    def objective(self):
        y = self.reaction.y
        return sum((at(t, y)[i] - seen) ** 2 for t, *row in DATA for i, seen in enumerate(row))


def rates(k: np.ndarray, z: np.ndarray) -> list[float]:
    """The same reaction for another integrator."""
    a, b, _ = z
    shared = k[0] * a / ((k[1] + k[4]) * a + b)
    return [
        shared * b - (2 * k[1] + k[2] + k[3]) * a,
        shared * (k[1] * a - b) + k[2] * a,
        shared * (b + k[4] * a) + k[3] * a,
    ]
