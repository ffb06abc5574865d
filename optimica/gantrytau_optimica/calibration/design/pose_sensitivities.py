"""How each parameter moves the plate, pose by pose.

    e(x, p) = 0      dx/dp = -(de/dx)^-1 (de/dp),   x = (T, rotation vector in the world)

e are the errors of the links' lengths, of which (5.8) and Table 5.10 sum the consequences over poses. The guideways may be
measured at places q(k), between which the carts are taken to go straight:

    A(k) = A^0 + q(k) v + eps(k)                                                          (5.6)
    A(q) = A(k) + (q - q(k)) / (q(k+1) - q(k)) (A(k+1) - A(k))                            (5.7)

so that an error eps(k) acts in proportion to a hat about q(k). Dressler (2012), section 5.3.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from gantrytau import Model, ModelError
from gantrytau.border.checks import array, check_words, number
from gantrytau.border.refusal import Given, did_you_mean
from gantrytau.describing.record import Record
from gantrytau.kinematics import Kinematics
from gantrytau.kinematics.poses import vectors
from gantrytau.results.figures import check_suffix, finished
from gantrytau_optimica.calibration.design.identifiability import PoseArrays, finite_poses, measured_poses
from gantrytau_optimica.calibration.links.arm_closure import ArmClosure, Orientation, read_arms
from gantrytau_optimica.calibration.links.arm_factors import checked_poses
from gantrytau_optimica.calibration.links.arm_poses import pose_rows, poses_of, tool_gain

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STEP = 5e-5  # m, or without unit: that of Table 5.10
FEW = 8  # curves that can be told apart
LEAST = 1e-3  # of the largest sensitivity: what pictures still tell apart


@dataclass(frozen=True, eq=False)
class PoseSensitivities(Record):
    """Derivatives of N poses by p parameters; prints itself as a table.

    names: of the parameters: `arms[0].length`, `arms[0].offset[1]`, `turntables[0].rotation[2]` (a local turn, rad), and
    `arms[0].guideway[3][1]`, the error eps(3) along y of a measured guideway. q (N, n), r (N, 3), R (N, 3, 3) or None: the
    poses. position: (N, 3, p), m for a unit of the parameter; rotation: (N, 3, p), rad for a unit, as a vector in the world,
    zero where the plate cannot turn. Rows of poses that are not finite are NaN.
    """

    names: tuple[str, ...]
    q: np.ndarray
    r: np.ndarray
    R: np.ndarray | None
    position: np.ndarray
    rotation: np.ndarray

    @property
    def sizes(self) -> np.ndarray:
        """Displacement of the tool by a unit of each parameter, (N, p)."""
        return np.linalg.norm(self.position, axis=1)

    @property
    def turns(self) -> np.ndarray:
        """By what angle a unit of each parameter turns the plate, (N, p)."""
        return np.linalg.norm(self.rotation, axis=1)

    def of(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of position and rotation by a parameter, (N, 3) each, or by a vector, (N, 3, k)."""
        rows = self._columns(name)
        which = rows[0] if self.names[rows[0]] == name else rows
        return self.position[:, :, which], self.rotation[:, :, which]

    def summed(self, step: float = STEP) -> tuple[np.ndarray, np.ndarray]:
        """What (5.8) sums over poses and both signs of a step, to first order: (p,) in m, and (p,) in rad."""
        step = number("summed", "step", step, above=0.0)
        return 2 * step * np.nansum(self.sizes, axis=0), 2 * step * np.nansum(self.turns, axis=0)

    def spread(self, deviations: float | Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
        """Standard deviation of the tool (N,) in m and of the plate (N,) in rad, for those of independent parameters.

        deviations: one number for all, in m or 1, or one by name, of vectors or of their elements; others are exact.
        Raises ModelError for unknown names, and numbers below zero.
        """
        given: Mapping[str, float] = (
            deviations if isinstance(deviations, Mapping) else dict.fromkeys(self.names, deviations)
        )
        each = np.zeros(len(self.names))
        for name, value in given.items():
            each[self._columns(name)] = number("spread", name, value, least=0.0)
        return tuple(np.sqrt((size**2) @ each**2) for size in (self.sizes, self.turns))  # type: ignore[return-value]

    def __str__(self) -> str:
        width = max(map(len, self.names))
        known = np.flatnonzero(np.isfinite(self.sizes).all(axis=1))
        sizes, turns = self.sizes[known], self.turns[known]
        turning = bool(turns.any())
        lines = [
            f"{'':{width}}    mean m     max m  in pose{'  mean rad   max rad' if turning else ''}"
            f"   for a unit of it ({len(known)} poses)"
        ]
        for k, name in enumerate(self.names):
            most = int(sizes[:, k].argmax())
            line = f"{name:{width}}  {sizes[:, k].mean():8.3g}  {sizes[most, k]:8.3g}  {known[most]:7d}"
            lines.append(line + (f"  {turns[:, k].mean():8.3g}  {turns[:, k].max():8.3g}" if turning else ""))
        return "\n".join(lines)

    def plot(self, *names: str, file: str | os.PathLike[str] | None = None) -> "Figure":
        """How far a unit of each parameter moves the tool, over the poses.

        names: parameters or vectors, a curve each (of vectors the root of the sum of squares); none means all, as colours.
        Raises ModelError for unknown names and too many curves.
        """
        import matplotlib.pyplot as plt

        if file is not None:
            check_suffix(file)
        if len(names) > FEW:
            raise ModelError(
                f"plot: found {len(names)} names, expected at most {FEW}, or none for all as colours; name fewer"
            )
        curves = {name: np.linalg.norm(self.sizes[:, self._columns(name)], axis=1) for name in names}
        rows = 3.4 if names else min(1.4 + 0.16 * len(self.names), 14.0)
        figure, axis = plt.subplots(figsize=(7.0, rows), layout="constrained")
        if names:
            for name, curve in curves.items():
                axis.plot(curve, ".-", markersize=3, linewidth=0.8, label=name)
            axis.set_ylabel("displacement for a unit [m]")
            axis.set_ylim(bottom=0.0)
            figure.legend(fontsize="small", loc="outside upper center", ncols=2, frameon=False)
            axis.grid(alpha=0.3)
        else:
            self._colours(figure, axis)
        axis.set_xlabel("pose")
        return finished(figure, file)

    def _colours(self, figure: Any, axis: Any) -> None:
        """All parameters over all poses, with levels in powers of ten."""
        from matplotlib.colors import LogNorm

        sizes = np.ma.masked_invalid(self.sizes.T)
        most = float(sizes.max())
        scale = LogNorm(LEAST * most, most)
        shown = axis.imshow(
            np.maximum(sizes, LEAST * most), aspect="auto", norm=scale, interpolation="nearest"
        )
        axis.set_yticks(range(len(self.names)), self.names, fontsize="x-small" if len(self.names) < 60 else 4)
        figure.colorbar(shown, ax=axis, label="displacement for a unit [m]")

    def _columns(self, name: str) -> list[int]:
        """The columns of a parameter or of a vector; ModelError for an unknown name."""
        found = [k for k, each in enumerate(self.names) if each == name or each.startswith(f"{name}[")]
        if not found:
            raise ModelError(
                f"pose_sensitivities: found {name!r}, expected the name of a parameter{did_you_mean(str(name), self.names)}"
            )
        return found


def pose_sensitivities(
    robot: Model,
    measurements: Any,
    *,
    orientation: Orientation = "local",
    guideways: Sequence[Any] | None = None,
) -> PoseSensitivities:
    """How each parameter of a robot moves its plate, pose by pose.

        found = pose_sensitivities(SixLinkGantryTau(prototypes.D1), q)
        print(found)
        found.spread({"arms[0].length": 50e-6})[0]        # (N,) in m

    measurements: an array q (N, n) whose poses are those of `Kinematics.fk`, or a record with q, r and R, or a tuple of
    them, near which the poses follow from q; orientation: of turntables, as in `arms`; guideways: for each arm the
    coordinates q(k) at which its guideway was measured, rising, by default those of the record's `rails`: their errors are
    parameters, too. Raises ModelError for another robot and arrays that do not fit, SolveError where links cannot be closed.
    """
    check_words(pose_sensitivities, locals())
    arms = read_arms(robot, orientation)
    at, rows, count = _poses(robot, measurements)
    q, r, R = [checked_poses(arm, *at) for arm in arms][-1]
    r, R = poses_of(arms, q, r, R)
    blocks = [gain for gain, _ in tool_gain(arms, q, r, R)]
    names = [name for arm in arms for name in arm.names]
    measured = guideways if guideways is not None else _rail_places(measurements)
    if measured is not None:
        if len(measured) != len(arms):
            raise ModelError(
                f"guideways: found places of {len(measured)} guideways, expected {len(arms)}; give one list for each arm",
                argument="guideways",
            )
        carts = _cart_gains(arms, q, r, R)
        for i, (arm, gain) in enumerate(zip(arms, carts, strict=True)):
            places = _rising(measured[i], i)
            names += [f"{arm.name}.guideway[{k}][{x}]" for k in range(len(places)) for x in range(3)]
            hats = _hats(places, q[:, arm.cart])
            blocks.append(np.einsum("nxy,nk->nxky", gain, hats).reshape(len(q), gain.shape[1], -1))
    whole = np.full((count, 6, len(names)), np.nan)
    whole[rows] = 0.0
    gains = np.concatenate(blocks, axis=2)
    whole[rows, : gains.shape[1]] = gains
    return PoseSensitivities(
        names=tuple(names),
        q=_whole(q, rows, count),
        r=_whole(r, rows, count),
        R=None if R is None else _whole(R, rows, count),
        position=whole[:, :3],
        rotation=whole[:, 3:],
    )


def _poses(robot: Model, measurements: Any) -> tuple[PoseArrays, np.ndarray, int]:
    """Finite poses, their rows, and how many rows there are."""
    if isinstance(measurements, np.ndarray):
        kinematics = Kinematics(robot)
        q, _ = vectors(measurements, len(kinematics.joints), "q", "pose_sensitivities")
        measurements = (q, *kinematics.fk(q))
    at, rows = finite_poses(measurements)
    return at, rows, len(measured_poses(measurements).q)


def _rail_places(measurements: Any) -> Sequence[Any] | None:
    rails = getattr(measurements, "rails", None)
    return None if rails is None else [np.asarray(rail)[:, 0] for rail in rails]


def _rising(places: Any, guideway: int) -> np.ndarray:
    """Coordinates at which a guideway was measured, (k,) in m, two at least."""
    name = f"guideways[{guideway}]"
    found = array("pose_sensitivities", name, places, (None,))
    if len(found) < 2 or not (np.diff(found) > 0).all():
        raise ModelError(
            "expected two coordinates at least, in m, each above the one before",
            place="pose_sensitivities",
            found=Given(name, places),
        )
    return found


def _hats(places: np.ndarray, q: np.ndarray) -> np.ndarray:
    """How much of eps(k) a cart at q has, (N, k), by (5.7); beyond the ends it goes on straight."""
    k = np.clip(np.searchsorted(places, q) - 1, 0, len(places) - 2)
    share = (q - places[k]) / (places[k + 1] - places[k])
    found = np.zeros((len(q), len(places)))
    rows = np.arange(len(q))
    found[rows, k], found[rows, k + 1] = 1 - share, share
    return found


def _cart_gains(
    arms: Sequence[ArmClosure], q: np.ndarray, r: np.ndarray, R: np.ndarray | None
) -> list[np.ndarray]:
    """Derivatives of the pose by the place of each cart in the world, (N, 3 or 6, 3)."""
    inverse = np.linalg.inv(pose_rows(arms, q, r, R))
    gains, start = [], 0
    for arm in arms:
        # e = (|B - A|^2 - L^2) / 2 L: by A it is minus the direction of the link
        gains.append(inverse[:, :, start : start + len(arm.links)] @ arm.directions(q, r, R))
        start += len(arm.links)
    return gains


def _whole(values: np.ndarray, rows: np.ndarray, count: int) -> np.ndarray:
    """All rows, those that were left out NaN."""
    found = np.full((count, *values.shape[1:]), np.nan)
    found[rows] = values
    return found
