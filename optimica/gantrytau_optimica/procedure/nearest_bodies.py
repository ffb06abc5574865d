"""Which bodies of a cell are nearest to each other, in words."""

from collections.abc import Iterator

import numpy as np

from gantrytau.kinematics import Limits
from gantrytau.kinematics.rods.rod_geometry import RodGeometry
from gantrytau.kinematics.workspace.obstacles import between_segments, segment_distance
from gantrytau.kinematics.workspace.pose_limits import touching_links


def nearest_bodies(geometry: RodGeometry, limits: Limits, q: np.ndarray, r: np.ndarray, R: np.ndarray) -> str:
    """The two bodies that are nearest to each other in one pose, q (n,), r (3,), R (3, 3): "link 1 of arm 0 and ..."."""
    return min(_pairs(geometry, limits, q[None], r[None], R[None]))[1]


def _pairs(
    geometry: RodGeometry, limits: Limits, q: np.ndarray, r: np.ndarray, R: np.ndarray
) -> Iterator[tuple[float, str]]:
    """Distance in m and names of all pairs that count."""
    start, end = geometry.cart_joints(q), geometry.plate_joints(r, R)
    links = [_link(geometry, k) for k in range(len(geometry.length))]
    for n, obstacle in enumerate(limits.obstacles):
        named = f"obstacles[{n}] ({type(obstacle).__name__})"
        for k, apart in enumerate(segment_distance(obstacle, start, end)[0]):
            yield float(apart) - limits.link_radius, f"{links[k]} and {named}"
        for p, body in enumerate(limits.plate):
            apart = segment_distance(obstacle, r + R @ body.start, r + R @ body.end)[0]
            yield float(apart) - body.radius, f"plate[{p}] and {named}"
    if limits.link_radius:
        for i, j in touching_links(geometry):
            apart = between_segments(start[:, i], end[:, i], start[:, j], end[:, j])[0]
            yield float(apart) - 2 * limits.link_radius, f"{links[j]} and {links[i]}"


def _link(geometry: RodGeometry, k: int) -> str:
    """The name of a link, as parameters have it."""
    arm = int(geometry.arm[k])
    own = np.flatnonzero(geometry.arm == arm)
    return f"arms[{arm}]" if len(own) == 1 else f"arms[{arm}].links[{int(np.flatnonzero(own == k)[0])}]"
