"""How far a model is from a pose where its equations of motion have no unique solution.

Constraints become dependent: the smallest singular value of their Jacobian falls to zero. Near such a pose the
forces grow beyond all limits, but an integrator may step over it. The determinant of the columns of the
dependent coordinates changes its sign there; it also does where only this choice of coordinates fails, and
then the singular values say so. Accelerations and forces follow from linear equations, of which elimination
leaves a small matrix per block; it is watched in the same way.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

CLOSE = 1e-3  # smallest singular value of the constraints, relative to that at the start: forces a million times larger
SOUND = 0.01  # smallest singular value of a scaled matrix that is taken as a measure at least
LEAST = 1e-6  # the same of the equations of accelerations and forces


@dataclass(frozen=True)
class Look:
    """What was seen at some points, arrays over them.

    side: sign of the determinant of the dependent coordinates; distance: smallest singular value of the
    constraints, relative to the first look; regular: whether accelerations and forces are determined.
    """

    side: np.ndarray
    distance: np.ndarray
    regular: np.ndarray

    @property
    def near(self) -> np.ndarray:
        """Whether a point counts as singular."""
        return (self.distance < CLOSE) | ~self.regular


class Conditioning:
    """Constraint Jacobian and matrices of the blocks as functions of the point.

    constraints: Jacobian by the coordinates, of which `dependent` are the columns of the dependent ones;
    divisors, matrices: of the blocks; what never changes is left out. arguments: symbols of a point.
    """

    def __init__(
        self,
        constraints: ca.SX,
        dependent: Sequence[int],
        divisors: Sequence[ca.SX],
        matrices: Sequence[ca.SX],
        arguments: Sequence[ca.SX],
    ):
        heads = [d for d in divisors if not d.is_constant()]
        changing = [ca.densify(m) for m in matrices if not m.is_constant()]
        if constraints.is_constant():
            constraints, dependent = ca.SX(0, 0), ()
        self._dependent = list(dependent) if len(dependent) == constraints.shape[0] else []
        self._shapes = [constraints.shape, *(m.shape for m in changing)]
        self._divisors = len(heads)
        parts = [ca.densify(constraints), *changing]
        everything = ca.vertcat(*heads, *(ca.vec(m) for m in parts))
        self._function = ca.Function("conditioning", list(arguments), [everything], {"cse": True})
        self._scales: list[tuple[np.ndarray, np.ndarray, float]] = []

    @property
    def needed(self) -> bool:
        """Whether anything changes at all."""
        return self._function.numel_out(0) > 0

    def look(self, *points: np.ndarray) -> Look:
        """What is to be seen at points, given by the arguments with one column per point."""
        values = np.array(self._function(*points)).reshape(-1, points[0].shape[1] or 1).T
        matrices, place = [], self._divisors
        for rows, columns in self._shapes:
            part = values[:, place : place + rows * columns]
            matrices.append(part.reshape(len(values), columns, rows).transpose(0, 2, 1))
            place += rows * columns
        constraints, *blocks = [np.nan_to_num(m, nan=0.0, posinf=0.0, neginf=0.0) for m in matrices]
        if not self._scales:
            self._scales = [_scale(m[0]) for m in (constraints, *blocks)]
        distances = [_least(m, scale) for m, scale in zip((constraints, *blocks), self._scales, strict=True)]
        side = np.ones(len(values))
        if self._dependent:
            rows, columns, _ = self._scales[0]
            side = np.linalg.slogdet((constraints / rows / columns)[:, :, self._dependent])[0]
        regular = np.all([d > LEAST for d in distances[1:]], axis=0) if blocks else np.ones(len(values), bool)
        return Look(side, distances[0], regular)


def _scale(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Lengths of rows and columns, and the smallest singular value of the matrix divided by them."""
    rows = np.maximum(np.linalg.norm(matrix, axis=1, keepdims=True), 1e-300)
    columns = np.maximum(np.linalg.norm(matrix / rows, axis=0, keepdims=True), 1e-300)
    if matrix.size == 0:
        return rows, columns, 1.0
    least = np.linalg.svd(matrix / rows / columns, compute_uv=False)[-1]
    # a start near a singular pose is no measure
    return rows, columns, max(float(least), SOUND)


def _least(matrices: np.ndarray, scale: tuple[np.ndarray, np.ndarray, float]) -> np.ndarray:
    """Smallest singular values, relative to that of the scale."""
    rows, columns, size = scale
    if matrices[0].size == 0:
        return np.ones(len(matrices))
    return np.linalg.svd(matrices / rows / columns, compute_uv=False)[:, -1] / size
