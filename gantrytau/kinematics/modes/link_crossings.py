"""Which assembly modes can be built: links as straight lines between their joints.

Two links whose joints are about as far apart on the base as on the platform should form something like a
parallelogram. They are crossed where, seen along them, their joints change sides from one end to the other.
"""

from itertools import combinations
from typing import NamedTuple

import numpy as np

from gantrytau.kinematics.workspace.obstacles import between_segments

ALIKE = 2.0  # ratio of distances of joints, base by platform; above, and below its inverse, links form no parallelogram
# square of the sine of the angle of two links, and distance of two joints by the length of links
PARALLEL = 1e-9
PAIRS = np.array(list(combinations(range(6), 2)))


class LinkGaps(NamedTuple):
    """Per mode: pairs of links that cross (k, 15), in the order of PAIRS, and the least distance of two links."""

    crossed: np.ndarray
    clearance: np.ndarray


def link_geometry(base: np.ndarray, ends: np.ndarray) -> LinkGaps:
    """Links from the base joints (6, 3) to the joints on the platform (k, 6, 3), all in the world, in m.

    Pairs that share a joint do not count.
    """
    a, b, u, v, shared, crossed = _pairs(base, ends)
    return LinkGaps(crossed, np.where(shared, np.inf, between_segments(a, a + u, b, b + v)).min(1))


def crossings(base: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Pairs of links that cross, (k, 15); base joints (6, 3) or (k, 6, 3), as in `link_geometry`."""
    return _pairs(base, ends)[5]


def _pairs(base: np.ndarray, ends: np.ndarray) -> tuple[np.ndarray, ...]:
    """Per pair of links: base joints and vectors along both (k, 15, 3), whether they share a joint, whether they cross."""
    i, j = PAIRS.T
    starts = np.broadcast_to(base, ends.shape)
    a, b = starts[:, i], starts[:, j]
    u, v = ends[:, i] - a, ends[:, j] - b
    at_base, at_platform = (np.linalg.norm(gap, axis=2) for gap in (a - b, a + u - b - v))
    shared = np.minimum(at_base, at_platform) < PARALLEL * np.linalg.norm(u, axis=2)
    alike = (at_base < ALIKE * at_platform) & (at_platform < ALIKE * at_base)
    crossed = alike & ~shared & (_seen_along(a - b, a + u - b - v, u, v) < 0)
    return a, b, u, v, shared, crossed


def _seen_along(first: np.ndarray, second: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Product of two vectors seen along two links u and v, (k, 15)."""
    mean = u / np.linalg.norm(u, axis=2)[..., None] + v / np.linalg.norm(v, axis=2)[..., None]
    size = np.maximum((mean * mean).sum(2), PARALLEL)  # links of opposite directions have none in common
    return (first * second).sum(2) - (first * mean).sum(2) * (second * mean).sum(2) / size


def sides(base: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Side (k,) of the plane through the base joints on which the middle of the platform is, 1 or -1.

    The largest component of the normal of the plane is positive.
    """
    middle = base.mean(0)
    normal = np.linalg.svd(base - middle)[2][2]
    normal = normal * np.sign(normal[np.argmax(np.abs(normal))])
    return np.where((ends.mean(1) - middle) @ normal >= 0, 1, -1)


def signs(base: np.ndarray, ends: np.ndarray, r: np.ndarray) -> np.ndarray:
    """Sign (k,) of the determinant of the forces of the links on the platform, 1 or -1: a singular pose divides them."""
    along = ends - base
    return np.where(np.linalg.det(np.concatenate([along, np.cross(ends - r[:, None], along)], 2)) >= 0, 1, -1)
