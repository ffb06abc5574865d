"""Which parameters measured poses determine, and which they cannot tell apart.

    J S = U diag(s) V'      s_i = 0: no pose tells anything in the direction V_i;
                            s_i < noise / tape: less than a tape measure

J: Jacobian of the closure errors of all links of an arm at all poses. Each null direction, s_i = 0, is named by one
redundant parameter, its last, and by the parameters collinear with it. Dressler (2012), section 5.4 and Table 5.4.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from gantrytau import Model, ModelError, StructureError
from gantrytau.border.checks import array, check_words, number
from gantrytau.describing.record import Record
from gantrytau_optimica.calibration.links.arm_closure import ArmClosure, Orientation, read_arms
from gantrytau_optimica.calibration.links.arm_factors import (
    NOISE,
    checked_poses,
    half_covariance,
    scales,
    triangle,
)
from gantrytau_optimica.calibration.links.arm_poses import pose_rows
from gantrytau_optimica.calibration.links.groups import TAPE
from gantrytau_optimica.fitting.rank import dependencies, indistinguishable

NOTHING = 1e-9  # of the largest singular value: rounding leaves 1e-14, the weakest of the F1 is 1e-4


class PoseArrays(NamedTuple):
    """Measured poses: actuator positions (N, n), positions (N, 3) in m, orientations (N, 3, 3) or None."""

    q: np.ndarray
    r: np.ndarray
    R: np.ndarray | None


@dataclass(frozen=True, eq=False)
class ArmIdentifiability(Record):
    """Rank of the Jacobian of one arm, with its redundant parameters.

    name: path of the arm; names: its parameters, `count` of them; rank: of the Jacobian; deficiency: count - rank;
    redundant: parameters to fix, each with the parameters collinear with it; collinear: the same for directions with
    a larger standard deviation than a tape measure has; singular_values: of J S, descending, (count,), S as in `fit_arm`.
    """

    name: str
    names: tuple[str, ...]
    count: int
    rank: int
    deficiency: int
    redundant: Mapping[str, list[str]]
    collinear: Mapping[str, list[str]]
    singular_values: np.ndarray
    _half: np.ndarray = field(repr=False)  # root of the covariance, in the determined directions
    _directions: np.ndarray = field(repr=False)  # (count, count), rows as singular_values
    _held: np.ndarray = field(repr=False)  # directions known better than by a tape measure

    def covariance(self, names: Sequence[str]) -> np.ndarray:
        """Covariance (k, k) of parameters, names being those of vectors or of their elements.

        Raises ModelError for unknown names, StructureError for undetermined parameters, with the group of each.
        """
        rows = [k for name in names for k in self._rows(name)]
        lost = np.abs(self._directions[~self._held][:, rows]).max(axis=0, initial=0.0)
        for k, share in zip(rows, lost, strict=True):
            if share > 1e-3:  # 10 um of the centimetre that a tape measure leaves
                raise StructureError(self._refusal(k))
        return self._half[rows] @ self._half[rows].T

    def _rows(self, name: str) -> list[int]:
        found = [k for k, each in enumerate(self.names) if each == name or each.rpartition("[")[0] == name]
        if not found:
            raise ModelError(
                f"{self.name}: there is no unknown {name!r}, expected one of {', '.join(self.names)}"
            )
        return found

    def _refusal(self, row: int) -> str:
        name = self.names[row]
        groups = [
            (redundant, group) for redundant, group in (*self.redundant.items(), *self.collinear.items())
        ]
        inside = [(r, g) for r, g in groups if name == r or name in g]
        if inside:
            redundant, group = inside[0]
            together = indistinguishable([*group, redundant])
            return f"{name}: {together}; fix {redundant}, or give a prior for it"
        fixed = ", ".join(redundant for redundant, _ in groups)
        return (
            f"{name}: these poses do not determine it alone, expected {fixed} to be fixed or to have priors"
        )

    def __str__(self) -> str:
        lines = [f"{self.name}: {self.count} parameters, rank {self.rank}"]
        lines += [
            f"  {indistinguishable([*others, name])}: {name} may be fixed"
            for name, others in self.redundant.items()
        ]
        lines += [
            f"  {name} is known worse than by a tape measure"
            + (f", with {', '.join(others)}" if others else "")
            for name, others in self.collinear.items()
        ]
        return "\n".join(lines)


@dataclass(frozen=True, eq=False)
class Identifiability(Record):
    """Ranks and redundant parameters of the arms of a robot, `arms[i]`; prints itself."""

    arms: tuple[ArmIdentifiability, ...]

    def __str__(self) -> str:
        return "\n".join(map(str, self.arms))


def identifiability(
    robot: Model,
    measurements: Any,
    orientation: Orientation = "local",
    *,
    gains: bool = False,
    noise: float = NOISE,
    angle: float = 0.0,
    tape: float = TAPE,
) -> Identifiability:
    """Which parameters of a robot measured poses determine, by the Jacobian at the parameters of the model.

    measurements: a record with q, r and R, or (q, r) or (q, r, R), whose rows with NaN are left out; orientation:
    parameters of turntables, "local", "unit" or "free" as in `read_arms`; gains: with the gains of turntables; noise,
    angle: standard deviations of the measured pose per axis, in m and rad; tape: standard deviation of a tape measure, m.
    Raises ModelError for another robot, or for arrays that do not fit.
    """
    check_words(identifiability, locals())
    check_deviations("identifiability", noise, angle, tape)
    poses, _ = finite_poses(measurements)
    return Identifiability(
        tuple(_of_arm(arm, poses, (noise, angle), tape) for arm in read_arms(robot, orientation, gains=gains))
    )


def measured_poses(measurements: Any) -> PoseArrays:
    """The arrays of measurements, a record with q, r and R, or a tuple of them; ModelError for anything else."""
    if hasattr(measurements, "q") and hasattr(measurements, "r"):
        return PoseArrays(
            np.asarray(measurements.q), np.asarray(measurements.r), getattr(measurements, "R", None)
        )
    if isinstance(measurements, Iterable) and len(items := list(measurements)) in (2, 3):
        return PoseArrays(np.asarray(items[0]), np.asarray(items[1]), items[2] if len(items) == 3 else None)
    raise ModelError(
        f"measurements: found {type(measurements).__name__}, expected Measurements, or (q, r, R)"
    )


def finite_poses(measurements: Any) -> tuple[PoseArrays, np.ndarray]:
    """The poses of measurements whose numbers are finite, and their rows; ModelError if there are none."""
    found = measured_poses(measurements)
    q = array("measurements", "q", found.q, (None, None), finite=False)
    r = array("measurements", "r", found.r, (len(q), 3), finite=False)
    R = None if found.R is None else array("measurements", "R", found.R, (len(q), 3, 3), finite=False)
    arrays = [q, r, *([] if R is None else [R])]
    rows = np.flatnonzero(
        np.all([np.isfinite(each).all(axis=tuple(range(1, each.ndim))) for each in arrays], axis=0)
    )
    if rows.size == 0:
        raise ModelError(
            f"measurements: found no finite numbers in any of {len(q)} rows, expected poses; give some that were seen"
        )
    return PoseArrays(q[rows], r[rows], None if R is None else R[rows]), rows


def check_deviations(place: str, noise: float, angle: float, tape: float) -> None:
    """ModelError for standard deviations of measurement and tape that are not above zero, or of angles below it."""
    noise = number(place, "noise", noise, above=0.0)
    angle = number(place, "angle", angle, least=0.0)
    tape = number(place, "tape", tape, above=0.0)


def _of_arm(
    arm: ArmClosure, poses: PoseArrays, noise: tuple[float, float], tape: float
) -> ArmIdentifiability:
    scale, data = scales(arm), checked_poses(arm, *poses)
    factor = triangle(arm, *data, scale)[:, :-1]
    _, s, directions = np.linalg.svd(factor, full_matrices=True)
    s = np.concatenate([s, np.zeros(arm.count)])[: arm.count]
    determined, least = s > NOTHING * s[0], noise[0] / tape
    rank = int(determined.sum())
    # links of one pose share the error of its measurement
    spread = triangle(arm, *data, scale, root=pose_rows([arm], *data) * deviations(noise, data[2]))[:, :-1]
    return ArmIdentifiability(
        name=arm.name,
        names=arm.names,
        count=arm.count,
        rank=rank,
        deficiency=arm.count - rank,
        redundant=dependencies(directions[~determined], scale, arm.names),
        collinear=dependencies(directions[determined & (s < least)], scale, arm.names),
        singular_values=s,
        _half=scale[:, None] * half_covariance(factor, spread, max(least, NOTHING * s[0])),
        _directions=directions,
        _held=determined & (s >= least),
    )


def deviations(noise: tuple[float, float], R: np.ndarray | None) -> np.ndarray:
    """Standard deviations of the coordinates of a measured pose, (3,) in m, or (6,) in m and rad."""
    return np.repeat(noise, 3)[: 3 if R is None else 6]
