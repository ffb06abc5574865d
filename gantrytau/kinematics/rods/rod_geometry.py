"""Guideways, turntables and links of a robot as arrays: where the joints are, and how they move.

    A_j(q) = frame of cart or turntable applied to the joint on it       Dressler (2012), (4.16) to (4.24)
    B_j(r, R) = r + R b_j                                                (4.6)
    |B_j - A_j| = L_j                                                    for every link j

The first axis of all arrays is the pose, the second the link. Lengths in m, angles in rad.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from gantrytau.describing.record import Record
from gantrytau.kinematics.rotations import about, cross, of_quaternion
from gantrytau.language.self_description.rods import Rods


@dataclass(frozen=True, eq=False)
class TurntableFrame(Record):
    """A turntable on an arm: its place and orientation in what carries it, its axis in its own frame."""

    arm: int
    offset: np.ndarray
    R: np.ndarray
    axis: np.ndarray


@dataclass(frozen=True, eq=False)
class RodGeometry(Record):
    """Where guideways, turntables and joints are.

    names: of the actuator coordinates, carts first, then turntables, a column of q each; offset, direction: (arms, 3), carts
    at s = 0 and guideways. The rest has a row a link: arm (m,), length (m,), on_cart (m, 3) in the frame of the outermost
    turntable or of the cart, on_plate (m, 3) in plate axes.
    """

    names: tuple[str, ...]
    offset: np.ndarray
    direction: np.ndarray
    arm: np.ndarray
    length: np.ndarray
    on_cart: np.ndarray
    on_plate: np.ndarray
    turntables: tuple[TurntableFrame, ...] = ()

    @property
    def arms(self) -> range:
        """Numbers of the arms, which are the columns of their carts in q."""
        return range(len(self.offset))

    def links_of(self, arm: int) -> np.ndarray:
        """Numbers of the links of an arm."""
        return np.flatnonzero(self.arm == arm)

    def of_arm(self, arm: int) -> "RodGeometry":
        """The same robot with the links of one arm only."""
        links = self.links_of(arm)
        parts = {n: getattr(self, n)[links] for n in ("arm", "length", "on_cart", "on_plate")}
        return replace(self, **parts)

    def columns_of(self, arm: int) -> list[int]:
        """Numbers of the actuator coordinates that move an arm."""
        return [
            arm,
            *(len(self.arms) + k for k, turntable in enumerate(self.turntables) if turntable.arm == arm),
        ]

    def plate_joints(self, r: np.ndarray, R: np.ndarray) -> np.ndarray:
        """Joints on the plate, (N, m, 3)."""
        return r[:, None] + self.on_plate @ np.swapaxes(R, 1, 2)

    def cart_joints(self, q: np.ndarray) -> np.ndarray:
        """Joints on carts and turntables, (N, m, 3)."""
        A = np.empty((len(q), len(self.length), 3))
        for arm in self.arms:
            links = self.links_of(arm)
            if links.size == 0:
                continue
            place, R, _ = self.frames(arm, q)
            A[:, links] = place[:, None] + self.on_cart[links] @ np.swapaxes(R, 1, 2)
        return A

    def carriers(self, arm: int, q: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """Origin (N, 3) and orientation (N, 3, 3) of the cart of an arm, then of each turntable upon it."""
        place = self.offset[arm] + q[:, arm, None] * self.direction[arm]
        R = np.broadcast_to(np.eye(3), (len(q), 3, 3))
        found = [(place, R)]
        for k, turntable in enumerate(self.turntables):
            if turntable.arm == arm:
                place = place + R @ turntable.offset
                R = R @ turntable.R @ about(turntable.axis, q[:, len(self.arms) + k])
                found.append((place, R))
        return found

    def frames(self, arm: int, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, list]:
        """Origin (N, 3) and orientation (N, 3, 3) of what carries the links of an arm; axis and origin of its turntables."""
        _, *turning = carriers = self.carriers(arm, q)
        tables = [turntable for turntable in self.turntables if turntable.arm == arm]
        # a turntable leaves its own axis where it is
        turns = [(R @ table.axis, place) for table, (place, R) in zip(tables, turning, strict=True)]
        return (*carriers[-1], turns)

    def link_directions(self, q: np.ndarray, r: np.ndarray, R: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Vectors along the links from cart to plate in the axes of what carries them, and in plate axes, (N, m, 3) in m."""
        along = self.plate_joints(r, R) - self.cart_joints(q)
        on_cart = np.empty_like(along)
        for arm in self.arms:
            links = self.links_of(arm)
            on_cart[:, links] = along[:, links] @ self.frames(arm, q)[1]
        return on_cart, along @ R

    def slopes(
        self, q: np.ndarray, r: np.ndarray, R: np.ndarray, *, joints: bool = True
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Lengths (N, m), unit vectors from cart to plate u (N, m, 3), and the slopes of the lengths.

        By the pose (N, m, 6), the last three for a rotation vector resolved in the world; by the actuators (N, m, n), zero
        if no slopes by joints are wanted.
        (4.31) holds for any angles, with the joint on the plate in plate axes; a rotation vector has no singular pose.
        """
        B, A = self.plate_joints(r, R), self.cart_joints(q)
        gap = B - A
        length = np.linalg.norm(gap, axis=2)
        u = gap / length[:, :, None]
        by_pose = np.concatenate([u, cross(B - r[:, None], u)], axis=2)
        by_joints = np.zeros((*length.shape, len(self.names)))
        for arm in np.unique(self.arm) if joints else ():
            links, (cart, *others) = self.links_of(arm), self.columns_of(arm)
            by_joints[:, links, cart] = -(u[:, links] @ self.direction[arm])
            turns = self.frames(arm, q)[2] if others else []
            for column, (axis, place) in zip(others, turns, strict=True):
                moved = cross(axis[:, None], A[:, links] - place[:, None])
                by_joints[:, links, column] = -np.sum(u[:, links] * moved, axis=2)
        return length, u, by_pose, by_joints

    def reach(self) -> tuple[np.ndarray, np.ndarray]:
        """How far the tool can be from a point on the cart at s = 0, for each link: points (m, 3), distances (m,) in m."""
        around = self.offset[self.arm]
        reach = self.length + np.linalg.norm(self.on_plate, axis=1)
        if not self.turntables:
            return around + self.on_cart, reach
        tables = np.zeros(len(self.offset))
        np.add.at(
            tables, [t.arm for t in self.turntables], [np.linalg.norm(t.offset) for t in self.turntables]
        )
        return around, reach + np.linalg.norm(self.on_cart, axis=1) + tables[self.arm]

    def could_reach(self, r: np.ndarray) -> np.ndarray:
        """Whether each link is as long as the tool is far from its guideway, in any orientation, (N,); not with NaN."""
        around, reach = self.reach()
        v = self.direction[self.arm]
        v = v / np.linalg.norm(v, axis=1, keepdims=True)
        gap = r[:, None] - around
        away = gap - (gap * v).sum(-1, keepdims=True) * v
        return ((away**2).sum(-1) <= reach**2 * (1 + 1e-12)).all(axis=1)

    def mean_arms(self) -> tuple[np.ndarray, np.ndarray]:
        """Each arm as one link: mean joint on the plate (arms, 3), mean length (arms,)."""
        on_plate = np.stack([self.on_plate[self.links_of(arm)].mean(axis=0) for arm in self.arms])
        return on_plate, np.array([self.length[self.links_of(arm)].mean() for arm in self.arms])

    def mean_joints(self, q: np.ndarray) -> np.ndarray:
        """Mean joint of each arm on its cart or turntable, (N, arms, 3)."""
        A = self.cart_joints(q)
        return np.stack([A[:, self.links_of(arm)].mean(axis=1) for arm in self.arms], axis=1)


def geometry_of(rods: Rods, values: Mapping[str, float]) -> RodGeometry:
    """The geometry that a robot says of itself, with numbers of all scalar parameters by name."""

    def vector(name: str | None, size: int = 3) -> np.ndarray:
        return np.zeros(size) if name is None else np.array([values[f"{name}[{k}]"] for k in range(size)])

    links = [(i, rod) for i, arm in enumerate(rods.arms) for rod in arm.rods]
    return RodGeometry(
        names=rods.joints,
        offset=np.stack([vector(arm.offset) for arm in rods.arms]),
        direction=np.stack([vector(arm.direction) for arm in rods.arms]),
        arm=np.array([i for i, _ in links]),
        length=np.array([values[rod.length] for _, rod in links]),
        on_cart=np.stack([vector(rod.offset) for _, rod in links]),
        on_plate=np.stack([vector(rod.plate_offset) for _, rod in links]),
        turntables=tuple(
            TurntableFrame(i, vector(t.offset), of_quaternion(vector(t.orientation, 4)), vector(t.axis))
            for i, arm in enumerate(rods.arms)
            for t in arm.turntables
        ),
    )
