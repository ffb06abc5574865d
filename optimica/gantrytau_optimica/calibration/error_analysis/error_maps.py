"""Where a robot errs, and in which direction: error vectors over the workspace and their principal axes.

The vectors are e_k = T_k - T(q_k), measured less computed. Their principal axes are the eigenvectors of E.T E with
the vectors as rows of E, as thesis section 5.4 does it (the printed rows are lengths, and what is called covariance is
not divided by N; the vectors are meant).
"""

import os
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from gantrytau.border.refusal import ModelError
from gantrytau.describing.record import Record
from gantrytau.kinematics.poses import vectors
from gantrytau_optimica.calibration.data.findings import CalibrationError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = np.ndarray
FEWEST = 8  # vectors, from which on axes mean anything
NEIGHBOURS = 6  # poses that are asked what the error of one will be: those around it on a grid
BLOCK = 4096  # poses at once


@dataclass(frozen=True, eq=False)
class ErrorMap(Record):
    """Error vectors over the workspace: r (N, 3) and errors (N, 3) in m."""

    r: Array
    errors: Array

    @property
    def size(self) -> Array:
        """Length of each error in m, (N,) (5.5)."""
        return np.linalg.norm(self.errors, axis=1)

    @property
    def mean(self) -> float:
        """Mean length in m."""
        return float(self.size.mean())

    @property
    def bias(self) -> Array:
        """Mean vector in m, (3,): what a shift of the frame would take away."""
        return self.errors.mean(axis=0)

    @cached_property
    def _principal(self) -> tuple[Array, Array]:
        values, axes = np.linalg.eigh(self.errors.T @ self.errors)
        values, axes = np.maximum(values[::-1], 0.0), axes[:, ::-1]
        largest = axes[np.abs(axes).argmax(axis=0), np.arange(3)]
        axes = axes * np.sign(largest)  # the largest component of each axis is positive
        return values, axes * np.array([1.0, 1.0, np.sign(np.linalg.det(axes))])

    @property
    def eigenvalues(self) -> Array:
        """D of E.T E in m2, largest first, (3,): sums of squares along the axes, not divided by N."""
        return self._principal[0]

    @property
    def axes(self) -> Array:
        """W of E.T E, columns of length one, in the order of `eigenvalues`, (3, 3)."""
        return self._principal[1]

    @property
    def deviations(self) -> Array:
        """Root mean square along each axis in m, (3,): sqrt(D / N)."""
        return np.sqrt(self.eigenvalues / len(self.errors))

    @cached_property
    def systematic(self) -> float:
        """Part of the squared errors that the mean of the nearest poses' errors predicts, 0 for noise, up to 1.

        What is systematic a better model can take away. Poses that stand far apart show less of it.
        """
        count = min(NEIGHBOURS, len(self.r) - 1)
        from scipy.spatial import KDTree

        tree = KDTree(self.r)
        product, square = 0.0, 0.0
        for first in range(0, len(self.r), BLOCK):
            part = slice(first, first + BLOCK)
            near = tree.query(self.r[part], count + 1)[1]
            own = near == np.arange(len(self.r))[part, None]
            own[~own.any(axis=1), -1] = True  # several poses at one place: one of them less
            around = self.errors[near]
            mean = np.where(own[:, :, None], 0.0, around).sum(axis=1) / count
            product += float(np.sum(mean * self.errors[part]))
            square += float(np.sum(self.errors[part] ** 2))
        # neighbours share the systematic part and not the noise: their product with the error is its square
        return float(np.clip(product / square, 0.0, 1.0)) if square else 0.0

    def quantile(self, part: float) -> float:
        """Length in m that this part of the errors stays below."""
        return float(np.quantile(self.size, part))

    def plot(
        self, axes: str = "yz", *, layers: int = 1, file: str | os.PathLike[str] | None = None
    ) -> "Figure":
        """Lengths in colour and vectors as arrows on the plane of two axes, in layers along the third one."""
        from gantrytau_optimica.calibration.error_analysis.map_figures import draw_map

        return draw_map(self.r, self.errors, axes, layers, file)

    def plot_sizes(self, *, file: str | os.PathLike[str] | None = None) -> "Figure":
        """Histogram of the lengths, and of the components along the principal axes."""
        from gantrytau_optimica.calibration.error_analysis.map_figures import draw_sizes

        return draw_sizes(self.errors, self.axes, file)

    def __str__(self) -> str:
        parts = ", ".join(
            f"{1e6 * d:.1f} um along ({a[0]:.2f}, {a[1]:.2f}, {a[2]:.2f})"
            for d, a in zip(self.deviations, self.axes.T, strict=True)
        )
        return (
            f"{len(self.r)} errors: {1e6 * self.mean:.1f} um in the mean, 95 % below {1e6 * self.quantile(0.95):.1f} um, "
            f"{1e6 * self.size.max():.1f} um at most; principal axes {parts}; {100 * self.systematic:.0f} % systematic"
        )


def error_map(r: Any, errors: Any) -> ErrorMap:
    """The errors (N, 3) of a robot at r (N, 3), both in m; errors: vectors, measured less computed positions.

    Raises ModelError for other shapes, CalibrationError (`.rows`) for too few or for NaN.
    """
    place, _ = vectors(r, 3, "r", "error_map")
    found, _ = vectors(errors, 3, "errors", "error_map")
    if len(place) != len(found):
        raise ModelError(f"error_map: found {len(place)} positions and {len(found)} errors, expected as many")
    bad = np.flatnonzero(~np.isfinite(np.hstack([place, found])).all(axis=1))
    if bad.size:
        raise CalibrationError(
            f"error_map: found {bad.size} rows that are not finite, the first {bad[0]}, expected numbers; leave them out",
            kind="nan",
            rows=bad,
        )
    if len(found) < FEWEST:
        raise CalibrationError(
            f"error_map: found {len(found)} errors, expected {FEWEST} at the least; measure more poses",
            kind="too few poses",
            rows=np.arange(len(found)),
        )
    return ErrorMap(place, found)
