"""The closure equation of one link, over many poses, with its exact derivatives.

    e_k = |y_k|^2 - L^2,    y_k = T_k + R_k B - A(q_k)                                  (4.14), (5.1)
    linear guideway         A(q) = A + q v                                              (4.13)
    measured guideway       A(q) = o + Q a(q), a(q) between measured points             (5.6), (5.7)

N poses, parameters of one link in the order (L, A or o, v or turn, B): 7, or 10 where the plate turns. Q is exp(turn) times
a rotation that is given, so that turn stays small. Dressler (2012), sections 4.4, 5.2 and 5.3.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gantrytau.describing.record import Record
from gantrytau.kinematics.rotations import left_jacobian, of_vector, told_vector
from gantrytau_optimica.calibration.links.guideway_points import between

BLOCK = 2000  # poses; their columns take 160 kB, or 500 kB where the plate turns
ALL = slice(None)
# of a column, what the others leave of it; squares lose that much twice, of sixteen digits
ALIKE, ALL_ALIKE = 1e-3, 1e-6
LENGTH, OFFSET, ALONG, PLATE = slice(0, 1), slice(1, 4), slice(4, 7), slice(7, 10)


@dataclass(frozen=True)
class Chain(Record):
    """One link over the measured poses: q (N,), r (N, 3), R (N, 3, 3) or None; a guideway's points at q (N, 3) or None.

    name: of the link; cart: the column of its cart; rail: points (k, 4) of a measured guideway, turned: the rotation (3, 3)
    of it before `turn` acts.
    """

    name: str
    cart: int
    q: np.ndarray
    r: np.ndarray
    R: np.ndarray | None = None
    points: np.ndarray | None = None
    rail: np.ndarray | None = None
    turned: np.ndarray | None = None

    @property
    def size(self) -> int:
        """How many parameters the link has."""
        return 7 if self.R is None else 10

    def vector(self, p: np.ndarray) -> np.ndarray:
        """y, from the joint on the cart to that on the plate, (N, 3) in m; p: parameters of the link."""
        y = self.r - p[OFFSET]
        y -= self.q[:, None] * p[ALONG] if self.points is None else self._on_guideway(p)
        if self.R is not None:
            y += self.R @ p[PLATE]
        return y

    def error(self, p: np.ndarray) -> np.ndarray:
        """e, (N,) in m2."""
        y = self.vector(p)
        return np.einsum("ij,ij->i", y, y) - p[0] ** 2

    def jacobian(self, p: np.ndarray) -> np.ndarray:
        """de/dp, (N, 7 or 10)."""
        y = self.vector(p)
        found = np.empty((len(y), self.size))
        found[:, LENGTH] = -2.0 * p[0]
        found[:, OFFSET] = -2.0 * y
        if self.points is None:
            found[:, ALONG] = -2.0 * self.q[:, None] * y
        else:  # of Q a under a small rotation before Q: -[Q a]x
            found[:, ALONG] = -2.0 * np.cross(self._on_guideway(p), y) @ left_jacobian(p[ALONG])
        if self.R is not None:
            found[:, PLATE] = 2.0 * np.einsum("nji,nj->ni", self.R, y)
        return found

    def by_actuator(self, p: np.ndarray) -> dict[int, np.ndarray]:
        """de/dq, (N,), by columns of q; of measured guideways with their mean direction."""
        along = p[ALONG]
        if self.points is not None:
            around = self.q - self.q.mean()
            along = self.frame(p) @ (around @ self.points / max(float(around @ around), 1e-300))
        return {self.cart: -2.0 * (self.vector(p) @ along)}

    def by_pose(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """de/dT and de/dphi, phi a rotation vector in the world, (N, 3) each; zero where the plate does not turn."""
        return by_motion(2 * self.vector(p), self.R, p[PLATE])

    def distance(self, p: np.ndarray) -> np.ndarray:
        """The error as a difference of lengths, about e / 2L, (N,) in m."""
        return self.error(p) / (2 * p[0])

    def gap(self, p: np.ndarray) -> np.ndarray:
        """How far the link is from its length, (N,) in m."""
        return np.linalg.norm(self.vector(p), axis=1) - p[0]

    def told(self, p: np.ndarray) -> np.ndarray | None:
        """Jacobian (size, size) of the reported parameters by the fitted ones, None for the unit matrix.

        The turn of a measured guideway is fitted before a given rotation; reported is the rotation vector W of both:
        exp([W]x) = exp([turn]x) turned, so that J(W) dW = J(turn) dturn.
        """
        if self.points is None:
            return None
        found, W = np.eye(self.size), told_vector(self.frame(p))
        found[ALONG, ALONG] = np.linalg.solve(left_jacobian(W), left_jacobian(p[ALONG]))
        return found

    def at(self, rows: np.ndarray) -> "Chain":
        """The link over some of the poses."""
        R, points = (None if array is None else array[rows] for array in (self.R, self.points))
        return replace(self, q=self.q[rows], r=self.r[rows], R=R, points=points)

    def over(self, q: np.ndarray, r: np.ndarray, R: np.ndarray | None) -> "Chain":
        """The link over other poses, q (N, n), r (N, 3), R (N, 3, 3)."""
        own = q[:, self.cart]
        points = None if self.rail is None else between(self.rail, own)
        return replace(self, q=own, r=r, R=None if self.R is None else R, points=points)

    def _on_guideway(self, p: np.ndarray) -> np.ndarray:
        assert self.points is not None
        return self.points @ self.frame(p).T

    def frame(self, p: np.ndarray) -> np.ndarray:
        """Q, from axes of the measured guideway to those of the tool measurement, (3, 3)."""
        return of_vector(p[ALONG]) @ (np.eye(3) if self.turned is None else self.turned)


@dataclass(frozen=True)
class Condensed:
    """A chain with a linear guideway, its N poses replaced by a few rows that leave the same sum of squares.

    e is linear in functions theta of the parameters of the link: e = F theta(p), with the columns F of (1, q, q2, T, qT,
    R'T, R, qR, T.T). With F = Z U, Z of orthonormal columns, U theta(p) has the norm of e for every p, so that each
    step of Gauss-Newton costs nothing and is the same as with all poses. q and T are taken about `centre`, for rounding.
    """

    chain: Chain
    upper: np.ndarray
    centre_q: float
    centre_r: np.ndarray

    def error(self, p: np.ndarray) -> np.ndarray:
        """U theta(p), at most 31 rows."""
        return self.upper @ self._functions(p)

    def jacobian(self, p: np.ndarray) -> np.ndarray:
        """U dtheta/dp."""
        A, v = p[OFFSET] + self.centre_q * p[ALONG] - self.centre_r, p[ALONG]
        parts = [
            _squares(p[0], A, v),
            np.hstack([np.zeros((3, 1)), -2 * np.eye(3), np.zeros((3, 3))]),
            np.hstack([np.zeros((3, 4)), -2 * np.eye(3)]),
        ]
        theta = np.vstack(parts)
        if self.chain.R is not None:
            theta = self._with_plate(theta, A, v, p[PLATE])
        theta[:, ALONG] += self.centre_q * theta[:, OFFSET]  # A is counted from the centre of q
        return self.upper[:, :-1] @ theta

    def _with_plate(self, theta: np.ndarray, A: np.ndarray, v: np.ndarray, B: np.ndarray) -> np.ndarray:
        whole = np.zeros((30, 10))
        whole[:9, :7] = theta
        whole[0, PLATE] = 2 * B
        whole[9:12, PLATE] = 2 * np.eye(3)
        # of a' R B = sum_ij a_i B_j R_ij
        whole[12:21, OFFSET] = whole[21:30, ALONG] = -2 * np.kron(np.eye(3), B[:, None])
        whole[12:21, PLATE] = -2 * np.kron(A[:, None], np.eye(3))
        whole[21:30, PLATE] = -2 * np.kron(v[:, None], np.eye(3))
        return whole

    def _functions(self, p: np.ndarray) -> np.ndarray:
        A, v = p[OFFSET] + self.centre_q * p[ALONG] - self.centre_r, p[ALONG]
        theta = [[A @ A - p[0] ** 2, 2 * A @ v, v @ v], -2 * A, -2 * v]
        if self.chain.R is not None:
            B = p[PLATE]
            theta[0][0] += B @ B
            theta += [2 * B, -2 * np.outer(A, B).ravel(), -2 * np.outer(v, B).ravel()]
        return np.concatenate([*theta, [1.0]])


def by_motion(u: np.ndarray, R: np.ndarray | None, offset: Any) -> tuple[np.ndarray, np.ndarray]:
    """Gradients u (N, 3) by position, and by a rotation vector in the world for a joint at `offset` on a plate of R."""
    return u, np.zeros_like(u) if R is None else np.cross(R @ offset, u)


def _squares(length: float, A: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Derivatives of (A.A - L^2, 2 A.v, v.v) for (L, A, v), (3, 7)."""
    found = np.zeros((3, 7))
    found[0, 0] = -2 * length
    found[0, OFFSET] = 2 * A
    found[1, OFFSET], found[1, ALONG] = 2 * v, 2 * A
    found[2, ALONG] = 2 * v
    return found


def centre(chain: Chain) -> tuple[float, np.ndarray]:
    """About the mean of q and T; of some thousand poses where there are many."""
    few = slice(None, None, max(1, len(chain.q) // 5000))
    return float(chain.q[few].mean()), chain.r[few].mean(axis=0)


def columns(chain: Chain, centre_q: float, centre_r: np.ndarray, rows: slice = ALL) -> np.ndarray:
    """F of some rows, (N, 10) or (N, 31)."""
    q, r, R = chain.q[rows] - centre_q, chain.r[rows] - centre_r, chain.R
    R = None if R is None else R[rows]
    F = np.empty((10 if R is None else 31, len(q)))  # columns in rows, as LAPACK wants them
    F[0] = 1.0
    F[1] = q
    F[2] = q * q
    F[3:6] = r.T
    np.multiply(q, F[3:6], out=F[6:9])
    if R is not None:
        F[9:12] = np.einsum("nji,nj->in", R, r)
        F[12:21] = R.reshape(-1, 9).T
        np.multiply(q, F[12:21], out=F[21:30])
    F[-1] = np.einsum("jn,jn->n", F[3:6], F[3:6])
    return F.T


def condense(chain: Any, weights: np.ndarray | None = None) -> Any:
    """The link in few rows where its guideway is linear; weights (N,) of the errors of the poses, or None for 1."""
    if not isinstance(chain, Chain) or chain.points is not None or len(chain.q) < 31:
        return chain if weights is None else Weighted(chain, weights)
    centre_q, centre_r = centre(chain)
    return Condensed(chain, triangle(chain, centre_q, centre_r, weights), centre_q, centre_r)


@dataclass(frozen=True)
class Weighted:
    """A link whose errors are multiplied by weights (N,)."""

    chain: Any
    weights: np.ndarray

    def error(self, p: np.ndarray) -> np.ndarray:
        """Weighted e, (N,)."""
        return self.weights * self.chain.error(p)

    def jacobian(self, p: np.ndarray) -> np.ndarray:
        """Their derivatives, (N, 7 or 10)."""
        return self.weights[:, None] * self.chain.jacobian(p)


def triangle(
    chain: Chain, centre_q: float, centre_r: np.ndarray, weights: np.ndarray | None = None
) -> np.ndarray:
    """The upper triangle U of F = Z U, in blocks that stay in the cache.

    By Cholesky from F'F, three times as quick as QR, unless columns are so alike that squaring them loses digits.
    """
    squares = sum(F.T @ F for F in _blocks(chain, centre_q, centre_r, weights))
    size = np.sqrt(np.maximum(np.diag(squares), 1e-300))
    try:
        U = np.linalg.cholesky(squares / np.outer(size, size)).T
    except np.linalg.LinAlgError:
        U = np.zeros((1, 1))
    # the last column, T.T, is all but the closure errors in the span of the others
    if np.diag(U)[:-1].min(initial=0.0 if len(U) < 2 else 1.0) > ALIKE and U[-1, -1] > ALL_ALIKE:
        return U * size
    parts = [np.linalg.qr(F, mode="r") for F in _blocks(chain, centre_q, centre_r, weights)]
    return np.asarray(np.linalg.qr(np.concatenate(parts), mode="r"))


def _blocks(
    chain: Chain, centre_q: float, centre_r: np.ndarray, weights: np.ndarray | None
) -> Iterator[np.ndarray]:
    for first in range(0, len(chain.q), BLOCK):
        rows = slice(first, first + BLOCK)
        F = columns(chain, centre_q, centre_r, rows)
        yield F if weights is None else weights[rows, None] * F
