"""Robots that a tape measure cannot tell apart, among which is the one that stands there.

Of 20 robots drawn with the tape error the worst in some respect is passed by every 21st robot that is drawn after them, and
there are many respects: each pose, way, link and obstacle. So each of them is joined by one with `WIDER` times its errors:
what is safe for all of these is not safe for fewer than one in some thousand robots in any one respect.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from gantrytau import Model, ModelError
from gantrytau.describing.record import Record
from gantrytau.kinematics import Kinematics, Limits
from gantrytau.kinematics.rods.rod_robots import SixRods, ThreeRods, TurningRods
from gantrytau.kinematics.workspace.pose_limits import REASONS, Examined, Examiner
from gantrytau_optimica.calibration.devices.devices import Device
from gantrytau_optimica.calibration.devices.sight import Bars
from gantrytau_optimica.calibration.links.arm_closure import ArmClosure, read_arms
from gantrytau_optimica.calibration.links.arm_factors import scales
from gantrytau_optimica.procedure.nearest_bodies import nearest_bodies

WIDER = 2.0  # times the error of a tape measure, at which a robot must be safe too
DRAWS = 50  # of parameters, until links meet


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
        return not isinstance(self.linked, ThreeRods)

    def pose(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where this robot goes when told q (N, n): r (N, 3), R (N, 3, 3), NaN where its links do not meet."""
        return self.kinematics.fk(q)

    def joints(self, r: np.ndarray, R: np.ndarray | None) -> np.ndarray:
        """The actuator coordinates of poses, NaN rows out of reach."""
        return self.kinematics.ik(r, R)

    def judged(self, q: np.ndarray) -> Examined:
        """What commanded coordinates q (N, n) do to this robot; on another branch counts as out of reach."""
        return self._examiner.judge(q, *self.pose(q))

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
class Fleet(Record):
    """The nominal robot and those that differ from it by errors of a tape measure.

    robot: as measured by tape; members: nominal first, then those with the tape error; wider: those with more of it.
    """

    robot: Model
    members: tuple[Member, ...]
    wider: tuple[Member, ...]

    @property
    def nominal(self) -> Member:
        """The robot as the tape measure says it is."""
        return self.members[0]

    @property
    def others(self) -> tuple[Member, ...]:
        """The disturbed robots."""
        return self.members[1:]

    @property
    def judges(self) -> tuple[Member, ...]:
        """All robots that have to be safe: nominal first, then those that most likely are not."""
        return (self.nominal, *self.wider, *self.others)

    @cached_property
    def arms(self) -> tuple[ArmClosure, ...]:
        """The nominal robot as calibration sees it."""
        return read_arms(self.robot)

    @property
    def turntables(self) -> bool:
        """Whether the robot needs to be told its orientation."""
        return isinstance(self.nominal.linked, TurningRods)

    @property
    def kind(self) -> str:
        """In words: "three links", "six links" or "turntables"."""
        linked = self.nominal.linked
        return (
            "six links" if isinstance(linked, SixRods) else "turntables" if self.turntables else "three links"
        )

    def with_limits(self, limits: Limits) -> Self:
        """The same robots under other limits."""
        members, wider = (
            tuple(Member(each.kinematics, limits) for each in group) for group in (self.members, self.wider)
        )
        return replace(self, members=members, wider=wider)

    def reasons(self, q: np.ndarray) -> np.ndarray:
        """The first limit that q (N, n) breaks in the first robot that it breaks one in, (N,); 0 where all are safe."""
        reason = np.zeros(len(q), dtype=int)
        for member in self.judges:
            left = np.flatnonzero(reason == 0)
            if not left.size:
                break
            reason[left] = member.judged(q[left]).reason
        return reason

    def seen(self, device: Device, q: np.ndarray) -> np.ndarray:
        """Whether a device sees the target in all robots at q (N, n), (N,)."""
        seen = np.ones(len(q), dtype=bool)
        for member in self.judges:
            left = np.flatnonzero(seen)
            if not left.size:
                break
            seen[left] = member.seen(device, q[left], *member.pose(q[left]))
        return seen


def build_fleet(robot: Model, limits: Limits, *, tape: float, robots: int, seed: int) -> Fleet:
    """A robot and so many others, with the errors that a tape measure of deviation `tape` (m) leaves, normally distributed.

    Joints and lengths err by `tape` in each coordinate, directions by `tape` on a metre, frames of turntables by what moves
    the joints on them by as much; each robot has a wider one with `WIDER` times its errors. Raises ModelError for what is
    no Gantry-Tau robot.
    """
    kinematics = Kinematics(robot)
    kinematics.linked("plan_calibration")
    arms, random = read_arms(robot), np.random.default_rng(seed)
    found = [_others(kinematics, arms, tape, random) for _ in range(robots)]
    others, wider = (tuple(Member(each, limits) for each in group) for group in zip(*found, strict=True))
    return Fleet(robot, (Member(kinematics, limits), *others), wider)


def _others(
    kinematics: Kinematics, arms: Sequence[ArmClosure], tape: float, random: np.random.Generator
) -> tuple[Kinematics, Kinematics]:
    """A robot with other parameters, by chance, and one with `WIDER` times these errors."""
    home = kinematics.home.q
    for _ in range(DRAWS):
        errors = [tape * scales(arm) * random.standard_normal(arm.count) for arm in arms]
        one, wide = (_moved(kinematics, arms, errors, times) for times in (1.0, WIDER))
        # links that do not even meet at home are not those of the robot that stands there
        if all(np.isfinite(each.fk(home)[0]).all() for each in (one, wide)):
            return one, wide
    raise ModelError(
        f"plan_calibration.tape: found {tape:g} m, with which {DRAWS} of {DRAWS} robots could not be put together; "
        "expected an error that lets the links meet; measure joints and lengths better by hand",
        argument="tape",
    )


def _moved(
    kinematics: Kinematics, arms: Sequence[ArmClosure], errors: Sequence[np.ndarray], times: float
) -> Kinematics:
    moved = [arm.moved(times * error) for arm, error in zip(arms, errors, strict=True)]
    return kinematics.replaced({name: arm.values[name] for arm in moved for name in arm.free})


def check_home(fleet: Fleet, home: np.ndarray) -> None:
    """ModelError unless all robots are safe at home, (n,)."""
    for number, member in enumerate(fleet.judges):
        judged = member.judged(home[None])
        reason = REASONS[int(judged.reason[0])]
        if reason == "inside":
            continue
        which = f" in robot {number} of {len(fleet.judges) - 1} with the tape error or {WIDER:g} times that"
        which = which if number else ""
        if reason == "collision":
            where = nearest_bodies(member.linked.geometry, member.limits, home, judged.r[0], judged.R[0])
            missing = f"{-judged.clearance[0] * 1e3:.3g} mm too little clearance between {where}"
        else:
            missing = f"the limit '{reason}' broken"
        raise ModelError(
            f"plan_calibration.home: found {missing} at home = {np.round(home, 4).tolist()}{which}; expected a place "
            "from which all robots can set out; give home= in m and rad, in the middle of the free space, smaller "
            "margins and radii, or measure the robot better by hand (tape=)",
            argument="home",
        )
