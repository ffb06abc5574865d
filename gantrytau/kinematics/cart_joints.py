"""The chain from carts to joints: frames of carts and turntables, joints on both ends of links, angles of passive joints.

    [A_ij; 1] = H_i [a_ij; 1],      B_ij = r + R b_ij                      Dressler (2012), (4.16) to (4.19)
    H_1 = [I, A_1 + q_1 v_1]                                              (4.20)
    H_2 = [R(1u_2) Ry(q_4), A_2 + q_2 v_2]                                (4.21), (4.22)
    H_3 = [R(1u_3) Ry(q_5) R(2u_3) Rx(q_6), A_3 + q_3 v_3 + R(1u_3) Ry(q_5) r_3]      (4.23), (4.24)

Robots without turntables have frames such as H_1 on all carts.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from gantrytau.border.checks import number
from gantrytau.border.refusal import ModelError
from gantrytau.describing.record import Record
from gantrytau.kinematics.kinematics import Kinematics
from gantrytau.kinematics.poses import mounting_axes, poses, vectors
from gantrytau.kinematics.rods.rod_geometry import RodGeometry
from gantrytau.kinematics.rotations import angle_between
from gantrytau.language.model import Model


@dataclass(frozen=True, eq=False)
class CartJoints(Record):
    """Frames and joints of N poses; those of one pose have no first axis. Lengths in m, angles in rad.

    links: paths of the m links; q (N, n), r (N, 3), R (N, 3, 3): the poses. chain: for each arm the frames of its cart and
    of the turntables upon it, (N, 1 + turntables, 4, 4) homogeneous, from their axes to the world. A, B: joints of the links
    on carts and on the plate, (N, m, 3) in the world. length: between them, (N, m). ball: angles between links and the
    axes of their joints, on the cart and on the plate, (N, m, 2). universal: the same as two angles of a universal joint,
    (N, m, 2, 2): first about that of the axes x, y, z of what carries the joint which is most across the axis of the
    joint, then about one across both; cos(ball) is the product of their cosines.
    """

    links: tuple[str, ...]
    q: np.ndarray
    r: np.ndarray
    R: np.ndarray
    chain: tuple[np.ndarray, ...]
    A: np.ndarray
    B: np.ndarray
    length: np.ndarray
    ball: np.ndarray
    universal: np.ndarray

    @property
    def H(self) -> np.ndarray:
        """Frames of the carts or turntables that carry the links of each arm, H_1 to H_3, (N, arms, 4, 4)."""
        return np.stack([frames[..., -1, :, :] for frames in self.chain], axis=-3)

    def left(self, limit: float) -> np.ndarray:
        """Distance of each ball joint from its largest angle in rad, (N, m, 2); negative beyond it."""
        return number("CartJoints.left", "limit", limit, unit="rad", above=0.0, most=math.pi) - self.ball

    def inside(self, limit: float) -> np.ndarray:
        """Whether all ball joints of a pose are within a largest angle, (N,); False without a pose."""
        with np.errstate(invalid="ignore"):
            return np.all(self.left(limit) >= 0, axis=(-2, -1))


def cart_joints(
    robot: Model | Kinematics,
    q: Any,
    r: Any = None,
    R: Any = None,
    *,
    cart_axes: Any = None,
    plate_axes: Any = None,
) -> CartJoints:
    """Frames H_1 to H_3 of carts and turntables, the joints of all links, and the angles of their passive joints.

        joints = cart_joints(F1GantryTau(prototypes.F1), q)
        joints.H[:, 1]                          # (N, 4, 4), the turntable that carries links 2a and 2b
        joints.inside(math.radians(45))         # (N,)

    robot: an instance such as F1GantryTau(prototypes.F1), or its Kinematics; q: (N, n) or (n,) in m and rad; r, R: the pose
    of the plate, by default `Kinematics.fk(q)`. cart_axes, plate_axes: mounting axes of the ball joints, (m, 3) or (3,),
    in axes of what carries them, from cart to plate; by default along the links in the home pose. Without a pose,
    quantities depending on it are NaN. Raises ModelError for robots not made of links, and for wrong shapes.
    """
    kinematics = robot if isinstance(robot, Kinematics) else Kinematics(robot)
    linked = kinematics.linked("cart_joints")
    geometry, rods = linked.geometry, kinematics.dae.flat.rods
    assert rods is not None  # as it is a robot on links
    rows, one = vectors(q, len(kinematics.joints), "q", "cart_joints")
    place, turn = _pose(kinematics, rows, r, R)
    chain = tuple(_chain(geometry, arm, rows) for arm in geometry.arms)
    A, B = geometry.cart_joints(rows), geometry.plate_joints(place, turn)
    home = linked.home
    at_home = geometry.link_directions(home.q[None], home.r[None], home.R[None])
    along = [geometry.link_directions(rows, place, turn), [axes[0] for axes in at_home]]
    ends = [
        _of_joint(u, _axes(name, given, usual))
        for name, given, u, usual in zip(
            ("cart_axes", "plate_axes"), (cart_axes, plate_axes), *along, strict=True
        )
    ]
    ball, universal = (np.stack(part, axis=2) for part in zip(*ends, strict=True))
    arrays = dict(
        q=rows,
        r=place,
        R=turn,
        A=A,
        B=B,
        length=np.linalg.norm(B - A, axis=2),
        ball=ball,
        universal=universal,
    )
    return CartJoints(
        links=tuple(rod.name for arm in rods.arms for rod in arm.rods),
        chain=tuple(frames[0] if one else frames for frames in chain),
        **{name: array[0] if one else array for name, array in arrays.items()},
    )


def _pose(kinematics: Kinematics, q: np.ndarray, r: Any, R: Any) -> tuple[np.ndarray, np.ndarray]:
    """Poses r (N, 3), R (N, 3, 3) that are given, or those that q leads to."""
    if r is None:
        if R is not None:
            raise ModelError("cart_joints: found R without r, expected both or neither; give r, too")
        return kinematics.fk(q)
    at = poses(r, R, "cart_joints")
    if len(at.r) != len(q):
        raise ModelError(
            f"cart_joints: found {len(at.r)} positions r for {len(q)} rows of q, expected one for each; leave r out where "
            "it follows from q"
        )
    return at.r, kinematics.linked().repeated(len(q)) if at.R is None else at.R


def _chain(geometry: RodGeometry, arm: int, q: np.ndarray) -> np.ndarray:
    """Frames of the cart of an arm and of its turntables, (N, 1 + turntables, 4, 4)."""
    frames = geometry.carriers(arm, q)
    found = np.zeros((len(q), len(frames), 4, 4))
    for k, (place, R) in enumerate(frames):
        found[:, k, :3, :3], found[:, k, :3, 3], found[:, k, 3, 3] = R, place, 1.0
    return found


def _axes(name: str, given: Any, home: np.ndarray) -> np.ndarray:
    """Mounting axes of joints as unit vectors, (m, 3)."""
    axes = home if given is None else mounting_axes("cart_joints", name, given, (3,), home.shape)
    return np.broadcast_to(axes / np.linalg.norm(axes, axis=-1, keepdims=True), home.shape)


def _of_joint(u: np.ndarray, axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angles of a ball joint (N, m), and of a universal joint (N, m, 2), of vectors u (N, m, 3) from axes (m, 3)."""
    first = np.eye(3)[np.abs(axes).argmin(axis=1)]
    first = first - (first * axes).sum(axis=1, keepdims=True) * axes
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(axes, first)
    unit = u / np.linalg.norm(u, axis=2, keepdims=True)
    along, one, two = ((unit * way).sum(axis=2) for way in (axes, first, second))
    both = np.stack([np.arctan2(-two, along), np.arcsin(np.clip(one, -1.0, 1.0))], axis=2)
    return angle_between(unit, np.broadcast_to(axes, unit.shape)), both
