"""Robots that a tape measure cannot tell apart: what is safe for all of them is safe for the one that stands there."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from gantrytau import Model, ModelError
from gantrytau.kinematics import Kinematics, Limits
from gantrytau.kinematics.linked import SixLinks, ThreeLinks, TurningLinks
from gantrytau.kinematics.workspace_limits import REASONS, Examiner
from gantrytau_optimica.calibration.arm_fit import scales
from gantrytau_optimica.calibration.arms import Arm, read_arms
from gantrytau_optimica.calibration.devices import Device
from gantrytau_optimica.calibration.sight import Bars

DRAWS = 50  # of parameters, until links meet
SAME = 1e-6  # m and rad, between actuators commanded and those of the pose they lead to: else it is on another branch


@dataclass(frozen=True, eq=False)
class Judged:
    """Actuator coordinates (N, n) judged for one robot: reason (N,), a number of REASONS; pose r, R, and what is left."""

    reason: np.ndarray
    r: np.ndarray
    R: np.ndarray
    angle: np.ndarray
    clearance: np.ndarray

    @property
    def safe(self) -> np.ndarray:
        """Whether all limits are kept, (N,)."""
        return self.reason == 0


class Member:
    """One robot of a fleet, made ready to be judged at actuator coordinates."""

    def __init__(self, kinematics: Kinematics, limits: Limits):
        self.kinematics = kinematics
        self.limits = limits
        self.linked = kinematics.linked("plan_calibration")
        self._examiner = Examiner(kinematics, limits)

    @property
    def strokes(self) -> np.ndarray:
        """Least and largest coordinate of each actuator, (n, 2)."""
        return self._examiner.strokes

    @property
    def turns(self) -> bool:
        """Whether the plate can turn at all, so that poses have orientations."""
        return not isinstance(self.linked, ThreeLinks)

    def pose(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where this robot goes when told q (N, n): r (N, 3), R (N, 3, 3), NaN where its links do not meet."""
        return self.kinematics.fk(q)

    def joints(self, r: np.ndarray, R: np.ndarray | None) -> np.ndarray:
        """The actuator coordinates of poses, NaN rows out of reach."""
        return self.kinematics.ik(r, R)

    def judged(self, q: np.ndarray) -> Judged:
        """What commanded coordinates q (N, n) do to this robot; on another branch counts as out of reach."""
        r, R = self.pose(q)
        found = self._examiner(r, R if self.turns else None)
        with np.errstate(invalid="ignore"):
            other = ~(np.abs(found.q - q).max(axis=1) < SAME)
        return Judged(
            np.where(other, REASONS.index("out of reach"), found.reason), r, R, found.angle, found.clearance
        )

    def bars(self, q: np.ndarray, r: np.ndarray, R: np.ndarray) -> Bars | None:
        """The links as bars that hide what is behind them; None where they have no radius."""
        if not self.limits.link_radius:
            return None
        geometry = self.linked.geometry
        return Bars(geometry.cart_joints(q), geometry.plate_joints(r, R), self.limits.link_radius)

    def seen(self, device: Device, q: np.ndarray, r: np.ndarray, R: np.ndarray) -> np.ndarray:
        """Whether a device sees the target at poses of this robot, (N,)."""
        seen = np.zeros(len(q), dtype=bool)
        good = np.isfinite(r).all(axis=1)
        if good.any():
            seen[good] = device.sees(r[good], R[good], bars=self.bars(q[good], r[good], R[good]))
        return seen


@dataclass(frozen=True, eq=False)
class Fleet:
    """The nominal robot and those that differ from it by errors of a tape measure.

    robot: as measured by tape; members: nominal first; parameters: of the others, by name.
    """

    robot: Model
    members: tuple[Member, ...]

    @property
    def nominal(self) -> Member:
        """The robot as the tape measure says it is."""
        return self.members[0]

    @property
    def others(self) -> tuple[Member, ...]:
        """The disturbed robots."""
        return self.members[1:]

    @cached_property
    def arms(self) -> tuple[Arm, ...]:
        """The nominal robot as calibration sees it."""
        return read_arms(self.robot)

    @property
    def turntables(self) -> bool:
        """Whether the robot needs to be told its orientation."""
        return isinstance(self.nominal.linked, TurningLinks)

    @property
    def kind(self) -> str:
        """In words: "three links", "six links" or "turntables"."""
        linked = self.nominal.linked
        return (
            "six links"
            if isinstance(linked, SixLinks)
            else "turntables"
            if self.turntables
            else "three links"
        )

    def with_limits(self, limits: Limits) -> Self:
        """The same robots under other limits."""
        return replace(self, members=tuple(Member(each.kinematics, limits) for each in self.members))

    def reasons(self, q: np.ndarray) -> np.ndarray:
        """The first limit that q (N, n) breaks in the first robot that it breaks one in, (N,); 0 where all are safe."""
        reason = np.zeros(len(q), dtype=int)
        for member in self.members:
            left = np.flatnonzero(reason == 0)
            if not left.size:
                break
            reason[left] = member.judged(q[left]).reason
        return reason

    def seen(self, device: Device, q: np.ndarray) -> np.ndarray:
        """Whether a device sees the target in all robots at q (N, n), (N,)."""
        seen = np.ones(len(q), dtype=bool)
        for member in self.members:
            left = np.flatnonzero(seen)
            if not left.size:
                break
            seen[left] = member.seen(device, q[left], *member.pose(q[left]))
        return seen


def build_fleet(robot: Model, limits: Limits, *, tape: float, robots: int, seed: int) -> Fleet:
    """A robot and so many others, with the errors that a tape measure of deviation `tape` (m) leaves, normally distributed.

    Joints and lengths err by `tape` in each coordinate, directions by `tape` on a metre, frames of turntables by what moves
    the joints on them by as much. Raises ModelError for what is no Gantry-Tau robot.
    """
    kinematics = Kinematics(robot)
    kinematics.linked("plan_calibration")
    arms, random = read_arms(robot), np.random.default_rng(seed)
    members = [Member(kinematics, limits)]
    for _ in range(robots):
        members.append(Member(_other(kinematics, arms, tape, random), limits))
    return Fleet(robot, tuple(members))


def _other(
    kinematics: Kinematics, arms: Sequence[Arm], tape: float, random: np.random.Generator
) -> Kinematics:
    """A robot with other parameters, by chance."""
    home = kinematics.home.q
    for _ in range(DRAWS):
        moved = [arm.moved(tape * scales(arm) * random.standard_normal(arm.count)) for arm in arms]
        found = kinematics.replaced({name: arm.values[name] for arm in moved for name in arm.free})
        # links that do not even meet at home are not those of the robot that stands there
        if np.isfinite(found.fk(home)[0]).all():
            return found
    raise ModelError(
        f"plan_calibration.tape: found {tape:g} m, with which {DRAWS} of {DRAWS} robots could not be put together; "
        "expected an error that lets the links meet; measure joints and lengths better by hand"
    )


def check_home(fleet: Fleet, home: np.ndarray) -> None:
    """ModelError unless all robots are safe at home, (n,)."""
    for number, member in enumerate(fleet.members):
        judged = member.judged(home[None])
        reason = REASONS[int(judged.reason[0])]
        if reason == "inside":
            continue
        which = f" in robot {number} of {len(fleet.others)} that differ by the tape error" if number else ""
        if reason == "collision":
            missing = f"{-judged.clearance[0] * 1e3:.3g} mm too little clearance of links or plate"
        else:
            missing = f"the limit '{reason}' broken"
        raise ModelError(
            f"plan_calibration.home: found {missing} at home = {np.round(home, 4).tolist()}{which}; expected a place "
            "from which all robots can set out; give home= in m and rad, in the middle of the free space, smaller "
            "margins and radii, or measure the robot better by hand (tape=)"
        )
