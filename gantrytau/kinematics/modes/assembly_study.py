"""The assembly modes of robots with six links over many poses: how many are real, how far apart, and what they look like.

|r + R B_j - A_j(q)| = L_j, j = 1..6, has 40 solutions in complex poses, of which the real ones are the ways in which the
robot could be put together with its actuators at q. Dressler (2012), section 4.5 and Figures 4.16 to 4.18.
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from gantrytau.border.checks import array, number, whole
from gantrytau.border.refusal import ModelError, StructureError
from gantrytau.describing.record import Record
from gantrytau.kinematics.kinematics import Kinematics
from gantrytau.kinematics.modes.assembly_modes import AssemblyModes, assembly_modes
from gantrytau.kinematics.modes.figures import draw_histogram, draw_modes, mode_scene
from gantrytau.kinematics.rods.rod_geometry import RodGeometry
from gantrytau.language.model import Model
from gantrytau.results.result import Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from gantrytau.viewing.page import Page

FileName = str | os.PathLike[str]
SAME = 1e-6  # m, of the joints on the plate in a mode that the robot's own kinematics answers


@dataclass(frozen=True, eq=False)
class AssemblyStudy(Record):
    """The modes of each row, a robot at actuator coordinates; prints itself as a table.

    names: of the robots; robot: (N,), index of the robot of each row; q: (N, n), m and rad; modes: the record of
    `assembly_modes` of each row, real modes first; branch: (N,), index of the mode given by `Kinematics.fk`, -1 without
    one; angles: for each row the largest angle of a ball joint in each real mode, (k,) in rad, from axes along the links in
    the home pose. Rows are all poses of the first robot, then those of the next one.
    """

    names: tuple[str, ...]
    robot: np.ndarray
    q: np.ndarray
    modes: tuple[AssemblyModes, ...]
    branch: np.ndarray
    angles: tuple[np.ndarray, ...]
    _geometries: tuple[RodGeometry, ...] = field(repr=False)

    def __len__(self) -> int:
        return len(self.modes)

    def __str__(self) -> str:
        words = ", ".join(dict.fromkeys(self.names))
        lines = [
            f"Assembly modes of {words}, {len(self)} pose{'s' * (len(self) > 1)}: {_span(self.counts)} real ones, "
            f"{self.counts.mean():.3g} in the mean",
            "  real modes  poses  without crossed links",
        ]
        for count, poses in self.histogram.items():
            free = self.feasible[self.counts == count]
            lines.append(f"  {count:10d}  {poses:5d}  {_span(free)}")
        lines.append(f"all 40 found in {int(self.complete.sum())} of {len(self)} poses")
        if np.isfinite(self.nearest).any():
            least, far = np.nanmin(self.nearest), np.nanmax(self.nearest)
            lines.append(f"the two nearest modes are {least:.3g} to {far:.3g} m apart")
        if np.isfinite(self.to_next).any():
            row = int(np.nanargmin(self.to_next))
            lines.append(
                f"another mode is {self.to_next[row]:.3g} m from that of the robot, at the nearest (row {row})"
            )
        return "\n".join(lines)

    @cached_property
    def counts(self) -> np.ndarray:
        """Number of real modes, (N,)."""
        return np.array([int(found.real.sum()) for found in self.modes])

    @cached_property
    def feasible(self) -> np.ndarray:
        """Number of real modes without crossed links, and with links `diameter` apart, (N,)."""
        return np.array([int(found.feasible.sum()) for found in self.modes])

    @cached_property
    def complete(self) -> np.ndarray:
        """Whether all 40 modes were found, (N,)."""
        return np.array([found.complete for found in self.modes])

    @cached_property
    def groups(self) -> np.ndarray:
        """Number of real modes on either side of the plane through the joints on the carts, (N, 2)."""
        return np.array([[int((found.group == side).sum()) for side in (1, -1)] for found in self.modes])

    def within(self, limit: float) -> np.ndarray:
        """Number of real modes with all ball joints within an angle in rad, (N,): the modes possible for the robot."""
        limit = number("within", "limit", limit, unit="rad", above=0.0, most=np.pi)
        return np.array([int((angles <= limit).sum()) for angles in self.angles])

    @property
    def histogram(self) -> dict[int, int]:
        """Number of poses for each number of real modes."""
        numbers, poses = np.unique(self.counts, return_counts=True)
        return dict(zip(numbers.tolist(), poses.tolist(), strict=True))

    @cached_property
    def nearest(self) -> np.ndarray:
        """Distance of the two nearest real modes of a pose, (N,) in m, see `distances`; NaN for fewer than two."""
        found = np.array([self._gaps(row).min(initial=np.inf) for row in range(len(self))])
        return np.where(self.counts < 2, np.nan, found)

    @cached_property
    def to_next(self) -> np.ndarray:
        """Distance from the mode of the robot to the nearest other real mode, (N,) in m; NaN without one of the two."""
        found = [self._gaps(row)[k].min() if k >= 0 else np.nan for row, k in enumerate(self.branch)]
        return np.where(self.counts < 2, np.nan, found)

    def _gaps(self, row: int) -> np.ndarray:
        """`distances`, infinite from a mode to itself."""
        found = self.distances(row)
        np.fill_diagonal(found, np.inf)
        return found

    def distances(self, row: int = 0) -> np.ndarray:
        """Distances between the real modes of a row, (k, k) in m: root mean square displacements of the plate's joints."""
        r, R = self.modes[self._row(row)].poses
        joints = r[:, None] + self._geometries[self.robot[row]].on_plate @ np.swapaxes(R, 1, 2)
        return np.sqrt(((joints[:, None] - joints) ** 2).sum(-1).mean(-1))

    def plot(self, *, file: FileName | None = None) -> "Figure":
        """Histograms of the numbers of real modes, and of how far apart the two nearest ones are (Figure 4.17)."""
        return draw_histogram(self.counts, self.feasible, self.nearest, file)

    def plot_modes(self, row: int = 0, *, file: FileName | None = None) -> "Figure":
        """The robot in each real mode of a row, links that cross in red (Figure 4.18).

        Raises ModelError for a row out of range or without a real mode.
        """
        modes = self._with_modes(row)
        captions = [
            f"mode {k}, side {'+' if modes.group[k] > 0 else '−'}{', the robot’s' if k == self.branch[row] else ''}\n"
            f"ball joints to {np.degrees(angle):.0f}°"
            for k, angle in enumerate(self.angles[row])
        ]
        return draw_modes(self._geometries[self.robot[row]], self.q[row], modes, captions, file)

    def motion(self, row: int = 0) -> Result:
        """The real modes of a row one after the other, from the second k on that of number k, for `animate`.

        Raises ModelError as `plot_modes`.
        """
        modes = self._with_modes(row)
        return mode_scene(self._geometries[self.robot[row]], self.q[row], modes, self.names[self.robot[row]])

    def view(self, row: int = 0, *, file: FileName | None = None) -> "Page":
        """`motion` as a page for a browser, whose slider goes from mode to mode (extra `view`)."""
        from gantrytau.viewing.animate import animate

        return animate(self.motion(row), file=file)

    def _with_modes(self, row: int) -> AssemblyModes:
        found = self.modes[self._row(row)]
        if not found.real.any():
            raise ModelError(
                f"assembly_study: found no real mode in row {row}, expected one to show; {found.findings[-1]}"
            )
        return found

    def _row(self, row: int) -> int:
        return whole("assembly_study", "row", row, least=0, most=len(self) - 1)


def assembly_study(
    robot: Model | Kinematics | Sequence[Model | Kinematics], q: Any, *, diameter: float = 0.0
) -> AssemblyStudy:
    """All assembly modes of a robot with six links at many actuator coordinates, or of several robots at the same ones.

        study = assembly_study(F1GantryTau(prototypes.F1), q)
        print(study)
        study.plot(file="modes.png")

    robot: an instance such as F1GantryTau(prototypes.F1), its Kinematics, or a list of them: `Kinematics.replaced` gives
    other geometries; q: (N, n) or (n,) in m and rad; diameter: of the links, which feasible modes keep, in m.
    Raises ModelError for robots without six links, shapes and numbers that do not fit, StructureError where modes are no
    separate poses.
    """
    diameter = number("assembly_study", "diameter", diameter, unit="m", least=0.0)
    given = list(robot) if isinstance(robot, (list, tuple)) else [robot]
    if not given:
        raise ModelError("assembly_study: found no robot, expected one or several; give instances")
    robots = [_with_six_links(one) for one in given]
    places = [_coordinates(one, q) for one in robots]
    modes, branch, angles = [], [], []
    for one, rows in zip(robots, places, strict=True):
        geometry = one.linked("assembly_study").geometry
        r, R = one.fk(rows)
        for k, base in enumerate(geometry.cart_joints(rows)):
            try:
                found = assembly_modes(base, geometry.on_plate, geometry.length, diameter=diameter)
            except StructureError as error:
                raise StructureError(f"row {k} of {one.dae.name}: {error}") from error
            modes.append(found)
            branch.append(_own(found, geometry, r[k], R[k]))
            angles.append(_largest_angles(one, rows[k], found))
    return AssemblyStudy(
        names=tuple(one.dae.name for one in robots),
        robot=np.repeat(np.arange(len(robots)), [len(rows) for rows in places]),
        q=np.concatenate(places),
        modes=tuple(modes),
        branch=np.array(branch),
        angles=tuple(angles),
        _geometries=tuple(one.linked().geometry for one in robots),
    )


def _with_six_links(robot: Any) -> Kinematics:
    """The kinematics of a robot; ModelError unless it has six links."""
    found = robot if isinstance(robot, Kinematics) else Kinematics(robot)
    links = len(found.linked("assembly_study").geometry.length)
    if links != 6:
        raise ModelError(
            f"assembly_study: found {found.dae.name} with {links} links, expected six; a robot with three has two poses, "
            "Kinematics.configurations(q=...)"
        )
    return found


def _coordinates(robot: Kinematics, q: Any) -> np.ndarray:
    """Actuator coordinates (N, n), N above 0, all finite."""
    count = len(robot.joints)
    rows = np.atleast_2d(array("assembly_study", "q", q, (count,), (None, count)))
    if not len(rows):
        raise ModelError(
            "assembly_study: found no rows of q, expected coordinates in m and rad", argument="q"
        )
    return rows


def _own(modes: AssemblyModes, geometry: RodGeometry, r: np.ndarray, R: np.ndarray) -> int:
    """Which real mode is the pose r (3,), R (3, 3), -1 if none is."""
    if np.isnan(r).any() or not modes.real.any():
        return -1
    here, turn = modes.poses
    joints = here[:, None] + geometry.on_plate @ np.swapaxes(turn, 1, 2)
    away = np.abs(joints - (r + geometry.on_plate @ R.T)).max(axis=(1, 2))
    return int(away.argmin()) if away.min() < SAME else -1


def _largest_angles(robot: Kinematics, q: np.ndarray, modes: AssemblyModes) -> np.ndarray:
    """The largest angle of a ball joint in each real mode, (k,) in rad."""
    r, R = modes.poses
    return robot.ball_joint_angles(r, R, np.tile(q, (len(r), 1))).max(axis=(1, 2), initial=0.0)


def _span(numbers: np.ndarray) -> str:
    least, most = int(numbers.min()), int(numbers.max())
    return str(least) if least == most else f"{least} to {most}"
