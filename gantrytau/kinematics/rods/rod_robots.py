"""Robots on links whose geometry is known: three links, six links on three or five carts, and six links on turntables.

All share the equations of their links; they differ in what of a pose is free and in what has a closed form.
Each answers arrays, the first axis the pose: q (N, n), r (N, 3), R (N, 3, 3), with numbers of iterations (N,).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gantrytau.answers.many_points.elimination import solved
from gantrytau.border.refusal import ModelError
from gantrytau.describing.record import Record
from gantrytau.kinematics.modes.link_crossings import crossings
from gantrytau.kinematics.rods.closed_form import (
    InverseOfThreeLinks,
    forward_of_three_links,
    meeting,
    slopes_of_three_links,
)
from gantrytau.kinematics.rods.lengths_by_newton import solve_lengths
from gantrytau.kinematics.rods.rod_geometry import RodGeometry
from gantrytau.kinematics.rotations import best_rotation

NO_ORIENTATION = (
    "Kinematics: found no orientation R, expected one, as this robot can turn its plate; give R of shape "
    "(3, 3) or (N, 3, 3), such as kinematics.home.R"
)
NO_TURN = 1e-9  # of an element of R - I that a plate without rotation may be asked for


@dataclass(frozen=True, eq=False)
class Home(Record):
    """A pose on the branch that the robot is meant to work on: q (n,), r (3,), R (3, 3)."""

    q: np.ndarray
    r: np.ndarray
    R: np.ndarray


@dataclass(frozen=True, eq=False)
class RodRobot(Record):
    """What all of them have.

    home: a pose of the branch; tolerance: m by which a link may miss its length where an orientation is given to a robot
    that cannot choose it.
    """

    geometry: RodGeometry
    home: Home
    tolerance: float = 1e-6

    def ik(self, r: np.ndarray, R: np.ndarray | None = None, sides: np.ndarray | None = None):
        """Coordinates q (N, n) and iterations (N,), every arm on its side; sides: 1 ahead, -1 behind, else as at home."""
        raise NotImplementedError

    def fk(self, q: np.ndarray, near: tuple[np.ndarray, np.ndarray] | None = None):
        """Poses r (N, 3), R (N, 3, 3) and iterations (N,); near: where to start, or what to be near to."""
        raise NotImplementedError

    def jacobian(self, r: np.ndarray, R: np.ndarray | None = None) -> np.ndarray:
        """dq/dpose (N, n, 3) or (N, n, 6)."""
        raise NotImplementedError

    def rates(self, r: np.ndarray, R: np.ndarray | None = None) -> np.ndarray:
        """Velocity of the tool by joint rates, (N, 3, n), or with R the angular velocity below it, (N, 6, n)."""
        matrix = self.jacobian(r, R)
        return solved(matrix, np.broadcast_to(np.eye(matrix.shape[1]), matrix.shape))

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the actuator coordinates."""
        return self.geometry.names

    @cached_property
    def sides(self) -> np.ndarray:
        """For each arm 1 if its links point along its guideway at home, -1 if against it."""
        return self.sides_of(self.home.q[None], self.home.r[None], self.home.R[None])[0]

    @cached_property
    def ahead(self) -> float:
        """1 if the tool is on that side of the plane of the carts to which the guideways point at home, -1 if not."""
        return float(self.ahead_of(self.home.q[None], self.home.r[None], self.home.R[None])[0])

    def sides_of(self, q: np.ndarray, r: np.ndarray, R: np.ndarray) -> np.ndarray:
        """(N, 3), 1 where an arm points along its guideway, -1 against, 0 across it, where it is singular."""
        _, u, _, _ = self.geometry.slopes(q, r, R)
        along = np.sum(u * self.geometry.direction[self.geometry.arm], axis=2)
        return np.sign(
            np.stack([along[:, self.geometry.links_of(i)].mean(axis=1) for i in self.geometry.arms], axis=1)
        )

    def ahead_of(self, q: np.ndarray, r: np.ndarray, R: np.ndarray) -> np.ndarray:
        """(N,), the side of the plane through the single joints of the arms (4.26) on which the tool is."""
        centres, _ = self.spheres(q, R)
        normal = np.cross(centres[:, 1] - centres[:, 0], centres[:, 2] - centres[:, 0])
        upwards = np.sign(normal @ self.geometry.direction.sum(axis=0))
        return upwards * np.sign(np.sum(normal * (r - centres[:, 0]), axis=1))

    def spheres(self, q: np.ndarray, R: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Each arm as one link to the tool: centres (N, 3, 3) and radii (3,)."""
        on_plate, length = self.geometry.mean_arms()
        return self.geometry.mean_joints(q) - on_plate @ np.swapaxes(R, 1, 2), length

    @cached_property
    def crosses_at_home(self) -> bool:
        """Whether links cross in the start of the model, so that crossed links say nothing."""
        return bool(self.crossed(self.home.q[None], self.home.r[None], self.home.R[None])[0])

    def crossed(self, q: np.ndarray, r: np.ndarray, R: np.ndarray) -> np.ndarray:
        """(N,), whether two links cross; single links all end in the tool."""
        if len(self.geometry.length) == 3:
            return np.zeros(len(q), dtype=bool)
        ends = self.geometry.plate_joints(r, R)
        return np.any(crossings(self.geometry.cart_joints(q), ends), axis=1)

    def on_branch(self, q: np.ndarray, r: np.ndarray, R: np.ndarray) -> np.ndarray:
        """(N,), whether the tool is on the side of the carts where it is at home, and no links cross that did not there."""
        with np.errstate(invalid="ignore", divide="ignore"):
            same = np.equal(self.ahead_of(q, r, R), self.ahead)
            if not self.crosses_at_home:
                same &= ~self.crossed(q, r, R)
            return same

    def single_links(self, q: np.ndarray, R: np.ndarray) -> np.ndarray:
        """The tool (N, 3), were each arm one link; over the plane of the carts where they do not meet."""
        centres, length = self.spheres(q, R)
        foot, height, _ = meeting(centres[:, :3], length[:3])
        upwards = np.sign(height @ self.geometry.direction.sum(axis=0))[:, None]
        return foot + self.ahead * upwards * height

    def carts(self, r: np.ndarray, R: np.ndarray, A: np.ndarray, sides: np.ndarray) -> np.ndarray:
        """Positions (N, m) of carts for each link alone (4.9); joints A (N, m, 3) at s = 0; nearest where out of reach."""
        v = self.geometry.direction[self.geometry.arm]
        d = self.geometry.plate_joints(r, R) - A
        vv = np.sum(v * v, axis=1)
        along = np.sum(d * v, axis=2) / vv
        away = d - along[:, :, None] * v
        square = (self.geometry.length**2 - np.sum(away * away, axis=2)) / vv
        return along - np.asarray(sides)[self.geometry.arm] * np.sqrt(np.maximum(square, 0.0))

    def pose_from(self, q: np.ndarray, r: np.ndarray, R: np.ndarray, keep: bool):
        """r, R and iterations of (4.30) from a pose; keep: NaN for what is not on the branch."""
        _, r, R, iterations = solve_lengths(self.geometry, q, r, R, range(6))
        if keep:
            other = ~self.on_branch(q, r, R)
            r[other], R[other] = np.nan, np.nan
        return r, R, iterations

    def mean_carts(self, each: np.ndarray) -> np.ndarray:
        """(N, 3), the means over the links of each arm."""
        return np.stack([each[:, self.geometry.links_of(i)].mean(axis=1) for i in self.geometry.arms], axis=1)

    def repeated(self, count: int, R: np.ndarray | None = None) -> np.ndarray:
        """The orientation at home so many times."""
        return np.array(np.broadcast_to(self.home.R if R is None else R, (count, 3, 3)))


class ThreeRods(RodRobot):
    """Three links and a plate that keeps its orientation: closed forms (4.9) both ways."""

    @cached_property
    def inverse(self) -> InverseOfThreeLinks:
        """The inverse, prepared for arrays."""
        g = self.geometry
        return InverseOfThreeLinks(g.offset, g.direction, g.length)

    def ik(self, r, R=None, sides=None):
        """Coordinates q and iterations."""
        if R is not None and not np.abs(np.nan_to_num(R - self.home.R)).max(initial=0.0) <= NO_TURN:
            raise ModelError(
                "Kinematics: found an orientation R of a plate that three links cannot turn, expected the identity; "
                "leave R out, or take a robot with six links"
            )
        return self.inverse(r, self.sides if sides is None else sides), np.zeros(len(r), dtype=int)

    def fk(self, q, near=None):
        """r, R and iterations; near: (r, R) whose nearer point is taken."""
        g = self.geometry
        r = forward_of_three_links(
            g.offset, g.direction, g.length, q, self.ahead if near is None else near[0]
        )
        R = self.repeated(len(q))
        R[np.isnan(r[:, 0])] = np.nan
        return r, R, np.zeros(len(q), dtype=int)

    def jacobian(self, r, R=None):
        """dq/dr, (N, 3, 3)."""
        q, _ = self.ik(r, R)
        return slopes_of_three_links(self.geometry.offset, self.geometry.direction, r, q)


class SixRods(RodRobot):
    """Six links on three carts: the plate turns a little as the links make it (4.14)."""

    def ik(self, r, R=None, sides=None):
        """Coordinates q and iterations. Without R the orientation follows; with R links may miss by `tolerance`."""
        sides = self.sides if sides is None else sides
        if R is None:
            q, _, iterations = self.follow(r, sides)
            return q, iterations
        A = self.geometry.cart_joints(np.zeros((len(r), len(self.joints))))
        q = self.mean_carts(self.carts(r, R, A, sides))
        length = self.geometry.slopes(q, r, R)[0]
        miss = np.abs(length - self.geometry.length).max(axis=1)
        q[~(miss <= self.tolerance)] = np.nan
        return q, np.zeros(len(r), dtype=int)

    def follow(self, r, sides):
        """Coordinates q, orientation and iterations of a tool at r: Newton in q and three rotations."""
        q, R, iterations = (
            np.full_like(r, np.nan),
            np.full((len(r), 3, 3), np.nan),
            np.zeros(len(r), dtype=int),
        )
        near = self.geometry.could_reach(r)  # iterations take longest where there is nothing to find
        r = r[near]
        turned = self.repeated(len(r))
        A = self.geometry.cart_joints(np.zeros((len(r), 3)))
        start = self.mean_carts(self.carts(r, turned, A, sides))
        found, _, turned, iterations[near] = solve_lengths(
            self.geometry, start, r, turned, (3, 4, 5, 6, 7, 8)
        )
        with np.errstate(invalid="ignore"):
            other = (self.sides_of(found, r, turned) * np.asarray(sides) <= 0).any(axis=1)
        found[other], turned[other] = np.nan, np.nan
        q[near], R[near] = found, turned
        return q, R, iterations

    def fk(self, q, near=None):
        """r, R and iterations, by (4.30) from `near`, or from the pose of single links at the orientation at home."""
        R = self.repeated(len(q), None if near is None else near[1])
        r = self.single_links(q, R) if near is None else near[0]
        return self.pose_from(q, r, R, keep=near is None)

    def jacobian(self, r, R=None):
        """dq/dr (N, 3, 3) with the orientation that follows; with R (N, 3, 6), the mean over the links of an arm (4.15)."""
        if R is None:
            q, R, _ = self.follow(r, self.sides)
            _, _, by_pose, by_joints = self.geometry.slopes(q, r, R)
            matrix = np.concatenate([by_joints, by_pose[:, :, 3:]], axis=2)
            return -solved(matrix, by_pose[:, :, :3])[:, :3]
        q, _ = self.ik(r, R)
        _, _, by_pose, by_joints = self.geometry.slopes(q, r, R)
        each = -by_pose / by_joints.sum(axis=2)[:, :, None]
        return np.stack([each[:, self.geometry.links_of(i)].mean(axis=1) for i in self.geometry.arms], axis=1)

    def rates(self, r, R=None):
        """With R by all six links, which decide more than the carts choose."""
        if R is None:
            return super().rates(r)
        q, _ = self.ik(r, R)
        _, _, by_pose, by_joints = self.geometry.slopes(q, r, R)
        return -solved(by_pose, by_joints)


class FiveRods(SixRods):
    """Six links on five carts, the first three on guideways of their own: two angles of the plate are free."""

    def follow(self, r, sides):
        """Refused, as no orientation follows from a position."""
        raise ModelError(NO_ORIENTATION)


class TurningRods(RodRobot):
    """The F1: turntables on two carts give the plate six degrees of freedom (section 4.5)."""

    def ik(self, r, R=None, sides=None):
        """Coordinates q and iterations: five degrees (4.25), then Newton arm by arm (4.27) to (4.29)."""
        if R is None:
            raise ModelError(NO_ORIENTATION)
        sides = self.sides if sides is None else sides
        q, iterations = np.full((len(r), 6), np.nan), np.zeros(len(r), dtype=int)
        rows = np.flatnonzero(self.geometry.could_reach(r))
        # where arms are so bent that (4.25) starts too far away, the angles at home may be nearer
        for start in (self.five_degrees, self.turned_as_at_home):
            place, turn = r[rows], R[rows]
            q[rows], count = self._arm_by_arm(start(place, turn, sides), place, turn, sides)
            iterations[rows] += count
            rows = rows[np.isnan(q[rows, 0])]
        return q, iterations

    def _arm_by_arm(self, q, r, R, sides):
        """Coordinates q and iterations of (4.27) from a start; NaN rows where an arm is not on its side."""
        iterations = np.zeros(len(r), dtype=int)
        for arm in self.geometry.arms:
            free = [6 + k for k in self.geometry.columns_of(arm)]
            q, _, _, count = solve_lengths(self.geometry.of_arm(arm), q, r, R, free)
            iterations = np.maximum(iterations, count)
        with np.errstate(invalid="ignore"):
            q[(self.sides_of(q, r, R) * np.asarray(sides) <= 0).any(axis=1)] = np.nan
        return q, iterations

    def turned_as_at_home(self, r, R, sides):
        """Coordinates q (N, 6) with turntables as at home, and carts where each arm, one link, meets the plate."""
        q = np.array(np.broadcast_to(self.home.q, (len(r), 6)))
        return self.with_carts(q, r, R, sides)

    def five_degrees(self, r, R, sides):
        """Coordinates q (N, 6) as if the links of an arm were parallel and of one length (4.25)."""
        q = np.zeros((len(r), 6))
        q[:, len(self.geometry.arms) :] = self.angles(R)
        return self.with_carts(q, r, R, sides)

    def with_carts(self, q, r, R, sides):
        """Coordinates with the carts where each arm, one link, meets the plate."""
        q, carts = np.array(q), slice(len(self.geometry.arms))
        q[:, carts] = 0.0
        q[:, carts] = self.mean_carts(self.carts(r, R, self.geometry.cart_joints(q), sides))
        return q

    def angles(self, R):
        """Angles (N, 3) of the turntables at which joints on the arms are parallel to those on a plate at R: f_ik,rot."""
        g = self.geometry
        first, second, third = g.turntables
        pair, three = g.links_of(first.arm), g.links_of(third.arm)
        b, c = (x[pair[1]] - x[pair[0]] for x in (g.on_plate, g.on_cart))
        differences = [x[three] - x[three].mean(axis=0) for x in (g.on_plate, g.on_cart)]
        wanted = R @ best_rotation(*(d[None] for d in differences))[0]  # of the outer turntable
        phi_0 = _turn(first.axis, c, (R @ b) @ first.R)
        phi_1 = _turn(second.axis, third.R @ third.axis, wanted @ third.axis @ second.R)
        q = np.zeros((len(R), 6))
        q[:, g.columns_of(second.arm)[1]] = phi_1
        # rotation left for the outer turntable
        rest = np.swapaxes(g.frames(third.arm, q)[1], 1, 2) @ wanted
        w = np.stack(
            [rest[:, 2, 1] - rest[:, 1, 2], rest[:, 0, 2] - rest[:, 2, 0], rest[:, 1, 0] - rest[:, 0, 1]]
        )
        axis = third.axis
        cosine = np.einsum("nii->n", rest) - (rest @ axis) @ axis
        return np.stack([phi_0, phi_1, np.arctan2(axis @ w, cosine)], axis=1)

    def fk(self, q, near=None):
        """r, R and iterations: the pose of five degrees (4.26) or `near`, then (4.30)."""
        r, R = self.pose_of_five_degrees(q) if near is None else near
        return self.pose_from(q, r, R, keep=near is None)

    def pose_of_five_degrees(self, q):
        """The pose in which arms are nearest to parallelograms (4.26): differences of joints fitted, then spheres."""
        g, A = self.geometry, self.geometry.cart_joints(q)
        own, arm = np.zeros_like(A), np.zeros_like(g.on_plate)
        for links in map(g.links_of, {table.arm for table in g.turntables}):
            own[:, links] = A[:, links] - A[:, links].mean(axis=1, keepdims=True)
            arm[links] = g.on_plate[links] - g.on_plate[links].mean(axis=0)
        R = best_rotation(own, np.broadcast_to(arm, own.shape))
        return self.single_links(q, R), R

    def jacobian(self, r, R=None):
        """dq/dpose, (N, 6, 6)."""
        q, _ = self.ik(r, R)
        assert R is not None  # else ik raised
        _, _, by_pose, by_joints = self.geometry.slopes(q, r, R)
        return -solved(by_joints, by_pose)


def robot_on(geometry: RodGeometry, home: Home, tolerance: float) -> RodRobot | None:
    """The kinematics of three rods to a plate that keeps its orientation, of six on three or five carts, or of six with the
    turntables of an F1: one under the two rods of an arm, two under the three of the next. None for other structures.
    """
    rods = [len(geometry.links_of(arm)) for arm in geometry.arms]
    if geometry.turntables:
        carried = [sum(table.arm == arm for table in geometry.turntables) for arm in geometry.arms]
        kind = TurningRods if (rods, carried) == ([1, 2, 3], [0, 1, 2]) else None
    elif rods == [1, 1, 1]:
        kind = None if geometry.on_plate.any() or geometry.on_cart.any() else ThreeRods
    else:
        kind = {3: SixRods, 5: FiveRods}.get(len(rods)) if sum(rods) == 6 and min(rods) > 0 else None
    return None if kind is None else kind(geometry, home, tolerance)


def _turn(axis: np.ndarray, moved: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Angles (N,) about a unit axis that turn `moved` (3,) nearest to `wanted` (N, 3)."""
    across = wanted @ np.cross(axis, moved)
    return np.arctan2(across, wanted @ moved - (wanted @ axis) * (axis @ moved))
