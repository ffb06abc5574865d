"""The ten inertial parameters of a rigid body, in which forces are linear, and which of them a body can have.

    m, h = m r_cm, I = J + m (r_cm' r_cm E - r_cm r_cm')       about the origin of the body's frame
    [[tr(I) E / 2 - I, h], [h', m]] >= 0                       second moments of a density that is nowhere negative

Wensing, Kim, Slotine (2018), Linear matrix inequalities for physically-consistent inertial parameter identification,
IEEE Robotics and Automation Letters 3.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

PAIRS = ((0, 0), (1, 1), (2, 2), (1, 0), (2, 0), (2, 1))  # of axes, one for each product of inertia


@dataclass(frozen=True)
class BodyParameters:
    """A body of a model by its path, such as `tool`; mass: the public name of its mass, element: that in the model."""

    path: str
    mass: str
    element: str

    @property
    def names(self) -> tuple[str, ...]:
        """Mass in kg, first moments in kg.m, inertia in kg.m2, both in the frame of the body, (10,)."""
        moments = (f"{self.path}.moment[{i}]" for i in range(3))
        return (self.mass, *moments, *(f"{self.path}.inertia[{i},{j}]" for i, j in PAIRS))

    @property
    def elements(self) -> tuple[str, ...]:
        """The same in the model: mass, centre of mass, inertia about it by columns, (13,)."""
        inertias = (f"{self.path}.J[{i},{j}]" for j in range(3) for i in range(3))
        return (self.element, *(f"{self.path}.r_cm[{i}]" for i in range(3)), *inertias)

    def of_model(self, values: Mapping[str, float]) -> np.ndarray:
        """The ten parameters by numbers of the model."""
        m, *rest = (values[n] for n in self.elements)
        c, J = np.array(rest[:3]), np.reshape(rest[3:], (3, 3))
        inertia = (J + J.T) / 2 + m * (c @ c * np.eye(3) - np.outer(c, c))
        return np.array([m, *(m * c), *(inertia[pair] for pair in PAIRS)])

    def in_model(self, ten: Sequence[Any]) -> dict[str, Any]:
        """Numbers or expressions of the model by the ten parameters."""
        m, *rest = ten
        c, inertia = [h / m for h in rest[:3]], dict(zip(PAIRS, rest[3:], strict=True))
        square = c[0] * c[0] + c[1] * c[1] + c[2] * c[2]
        J = [
            inertia[max(i, j), min(i, j)] - m * ((square if i == j else 0.0) - c[i] * c[j])
            for j in range(3)
            for i in range(3)
        ]
        return dict(zip(self.elements, (m, *c, *J), strict=True))


def pseudo_inertia(ten: np.ndarray) -> np.ndarray:
    """The matrix (4, 4) that has no negative eigenvalue where a body can have these ten parameters."""
    m, h, (a, b, c, yx, zx, zy) = ten[0], ten[1:4], ten[4:]
    second = (a + b + c) / 2 * np.eye(3) - np.array([[a, yx, zx], [yx, b, zy], [zx, zy, c]])
    return np.block([[second, h[:, None]], [h[None], np.array([[m]])]])
