"""Kinematics of calibrated models, those with measured guideways and directions of single links included."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from gantrytau import ModelError
from gantrytau.kinematics.rods.closed_form import cross_of_columns, dot_of_columns
from gantrytau.kinematics.rotations import of_vectors
from gantrytau_optimica.calibration.links.guideway_points import between, slope

ITERATIONS = 30
BLOCK = 10_000  # poses, whose vectors stay in the cache
REACHED = 1e-12  # m and rad, of a last Newton step


@dataclass(frozen=True)
class Guideway:
    """Cart positions o + Q a(q): along measured points (k, 4), or o + q v where there are none."""

    place: np.ndarray
    along: np.ndarray
    points: np.ndarray | None = None

    def at(self, q: np.ndarray) -> np.ndarray:
        """Places of the joint on the cart, (N, 3)."""
        if self.points is None:
            return self.place + q[:, None] * self.along
        return self.place + between(self.points, q) @ self.along.T

    def across(self, q: np.ndarray) -> np.ndarray:
        """The same as (3, N), each coordinate in a row, with which numpy is quicker."""
        if self.points is None:
            return self.place[:, None] + self.along[:, None] * q
        return self.at(q).T

    def slope(self, q: np.ndarray) -> np.ndarray:
        """Their derivatives by q, (N, 3)."""
        if self.points is None:
            return np.broadcast_to(self.along, (len(q), 3))
        return slope(self.points, q) @ self.along.T


@dataclass(frozen=True)
class RodLink:
    """A link: its arm, its length, the way of its joint on the cart, its joint on the plate in plate axes."""

    arm: int
    length: float
    guideway: Guideway
    on_plate: np.ndarray


class CalibratedKinematics:
    """Forward and inverse kinematics of links on guideways, over arrays of poses.

    links: three, for a plate that keeps the orientation `R`, or six; R (3, 3) and r (3,): a pose from which forward
    kinematics starts where nothing nearer is known, `start_r` the former. `iterations` of the last Newton iteration.
    """

    def __init__(self, links: Sequence[RodLink], r: np.ndarray, R: np.ndarray):
        self.links = tuple(links)
        self.start_r, self._R = np.asarray(r, dtype=float), np.asarray(R, dtype=float)
        self.turns = len(self.links) > 3
        self.arms = 1 + max(link.arm for link in self.links)
        self.iterations = 0

    def __repr__(self) -> str:
        return f"<CalibratedKinematics: {len(self.links)} links on {self.arms} guideways>"

    def ik(self, r, R=None) -> np.ndarray:
        """Cart positions (N, arms) in m for tool positions (N, 3) and orientations (N, 3, 3); (3,) gives (arms,).

        Carts behind the tool. NaN where a link does not reach. Of several links on a cart the mean is taken, which meet
        at one q where the pose is one that the links allow.
        """
        r, R, single = self._pose(r, R)
        q = np.zeros((len(r), self.arms))
        count = np.zeros(self.arms)
        for link in self.links:
            q[:, link.arm] += _cart_position(link, r + R @ link.on_plate)
            count[link.arm] += 1
        q /= count
        return q[0] if single else q

    def fk(self, q, near=None) -> tuple[np.ndarray, np.ndarray]:
        """Tool positions (N, 3) and orientations (N, 3, 3) for cart positions (N, arms).

        near: the r (N, 3), or the pair (r, R), whose branch is wanted; by default the branch of the measured poses.
        NaN where links do not meet.
        """
        q = np.asarray(q, dtype=float)
        single = q.ndim == 1
        q = np.atleast_2d(q)
        if q.shape[1] < self.arms:
            raise ModelError(
                f"fk: found q of shape {q.shape}, expected (N, {self.arms}), a position for each cart"
            )
        r, R = (near if isinstance(near, tuple) else (near, None)) if near is not None else (None, None)
        r = np.broadcast_to(self.start_r if r is None else np.asarray(r, dtype=float), (len(q), 3))
        R = np.broadcast_to(self._R if R is None else np.asarray(R, dtype=float), (len(q), 3, 3))
        if self.turns:
            found = self._newton(q, r, R)
        else:
            parts = [slice(k, k + BLOCK) for k in range(0, len(q), BLOCK)]
            found = np.concatenate([self._three_spheres(q[k], r[k]) for k in parts]), R.copy()
        return (found[0][0], found[1][0]) if single else found

    def jacobian(self, r, R=None) -> np.ndarray:
        """dq/dpose, (N, arms, 3), or (N, links, 6) with rotations about the world axes where the plate turns."""
        r, R, single = self._pose(r, R)
        q = np.atleast_2d(self.ik(r, R))
        found = self._by_pose(q, r, R)
        along = np.stack(
            [
                np.einsum("ni,ni->n", self._vector(k, q, r, R), k.guideway.slope(q[:, k.arm]))
                for k in self.links
            ],
            axis=1,
        )
        found = found / along[..., None]
        return found[0] if single else found

    def _pose(self, r, R) -> tuple[np.ndarray, np.ndarray, bool]:
        r = np.asarray(r, dtype=float)
        single = r.ndim == 1
        r = np.atleast_2d(r)
        R = np.broadcast_to(self._R if R is None else np.asarray(R, dtype=float), (len(r), 3, 3))
        return r, R, single

    def _vector(self, link: RodLink, q: np.ndarray, r: np.ndarray, R: np.ndarray) -> np.ndarray:
        """From the joint on the cart to that on the plate, (N, 3)."""
        return r + R @ link.on_plate - link.guideway.at(q[:, link.arm])

    def _by_pose(self, q: np.ndarray, r: np.ndarray, R: np.ndarray) -> np.ndarray:
        """Half the derivatives of the closure errors by the pose, (N, links, 3 or 6)."""
        rows = []
        for link in self.links:
            y = self._vector(link, q, r, R)
            rows.append(np.hstack([y, np.cross(R @ link.on_plate, y)]) if self.turns else y)
        return np.stack(rows, axis=1)

    def _newton(self, q: np.ndarray, r: np.ndarray, R: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        r, R = r.copy(), R.copy()
        size = np.full(len(r), np.inf)
        for self.iterations in range(1, ITERATIONS + 1):
            error = np.stack(
                [(np.sum(self._vector(k, q, r, R) ** 2, axis=1) - k.length**2) / 2 for k in self.links],
                axis=1,
            )
            step = newton_steps(self._by_pose(q, r, R), error)
            size = np.abs(step).max(axis=1)
            # half a metre or radian at once
            step = step * np.minimum(1.0, 0.5 / np.maximum(size, 1e-300))[:, None]
            r -= step[:, :3]
            R = of_vectors(-step[:, 3:]) @ R
            if not np.any(size > REACHED):
                break
        lost = ~(size < 1e-8)
        r[lost], R[lost] = np.nan, np.nan
        return r, R

    def _three_spheres(self, q: np.ndarray, near: np.ndarray) -> np.ndarray:
        """The point with the distances L_i from three joints, of two the one on the side of `near`."""
        a, b, c = (link.guideway.across(np.ascontiguousarray(q[:, link.arm])) for link in self.links)
        la, lb, lc = (link.length**2 for link in self.links)
        b, c = b - a, c - a
        normal = cross_of_columns(b, c)
        with np.errstate(invalid="ignore", divide="ignore"):
            square = dot_of_columns(normal, normal)
            beta = (dot_of_columns(b, b) + la - lb) / 2
            gamma = (dot_of_columns(c, c) + la - lc) / 2
            # the foot has b.p = beta, c.p = gamma, and lies in their plane
            foot = cross_of_columns(beta * c - gamma * b, normal) / square
            height = np.sqrt((la - dot_of_columns(foot, foot)) / square)
        side = np.where(dot_of_columns(np.ascontiguousarray(near.T) - a, normal) < 0, -1.0, 1.0)
        return np.ascontiguousarray((a + foot + side * height * normal).T)


def _cart_position(link: RodLink, joint: np.ndarray) -> np.ndarray:
    """Q with |joint - A(q)| = L, the smaller of two (4.9); (N,)."""
    guideway = link.guideway
    if guideway.points is None:
        return _straight_position(link, joint, guideway.place, guideway.along)
    ends = guideway.points[[0, -1], 0]
    place, last = guideway.at(ends)
    along = (last - place) / (ends[1] - ends[0])
    q = _straight_position(link, joint, place - ends[0] * along, along)
    for _ in range(ITERATIONS):  # points are within millimetres of that line
        y = joint - guideway.at(q)
        step = (np.sum(y * y, axis=1) - link.length**2) / (2 * np.sum(y * guideway.slope(q), axis=1))
        q = q + step
        if not np.any(np.abs(step) > REACHED):
            break
    return q


def _straight_position(link: RodLink, joint: np.ndarray, place: np.ndarray, v: np.ndarray) -> np.ndarray:
    d = joint - place
    p, square = d @ v, float(v @ v)
    with np.errstate(invalid="ignore"):
        return (p - np.sqrt(p * p - square * (np.sum(d * d, axis=1) - link.length**2))) / square


def newton_steps(matrices: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Steps (N, k) of least norm: where a pose is singular, or the plate is not held, these are as good as any."""
    if matrices.shape[1] == matrices.shape[2]:
        with suppress(np.linalg.LinAlgError):
            return np.linalg.solve(matrices, right[..., None])[..., 0]
    return (np.linalg.pinv(matrices) @ right[..., None])[..., 0]
