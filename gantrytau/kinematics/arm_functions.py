"""Kinematics of arms whose joints stand in a row and turn the tool: forward in closed form, inverse by rotations.

    J(q)' e = 0      e = (r(q) - r, w)      w: axial vector of R(q) R', zero where orientations are alike

The unknowns are the joints and the arguments the elements of r and R, so that no orientation is singular, half a turn from
the axes of the world as little as any other. Of six joints e itself is zero; of fewer, e is least, and a pose that is
missed is out of reach.
"""

from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.answers.many_points.followed_branches import FollowedBranch
from gantrytau.answers.many_points.grown_branch import GrownBranch
from gantrytau.border.refusal import ModelError
from gantrytau.kinematics.model_functions import MOVES, ModelFunctions, independent, limits_of, twists

# places from which a pose is led, before it is out of reach: of 10,000 random ones all are found
NEIGHBOURS = 12
BETWEEN = 64  # places of a way of the joints that are looked at
ROUNDS = (32, 64, 128, 256, 512)  # places by which the branch is grown


class ArmFunctions(ModelFunctions):
    """An arm in a row; see `ModelFunctions`."""

    @property
    def turning(self) -> bool:
        """See `ModelFunctions`."""
        return True

    @cached_property
    def in_a_row(self) -> bool:
        """Whether the arm has more than three joints, and its pose in closed form of them."""
        return len(self.joints) > 3 and len(self._wanted) > 1 and self._forward.closed_form is not None

    def ik(self, r, R: Any = None, sides=None):
        """Joints q, and iterations."""
        self.check(R)
        pose = np.column_stack([r, np.swapaxes(R, 1, 2).reshape(-1, 9)]).T
        q, known = np.full((len(self.joints), len(r)), np.nan), np.isfinite(pose).all(axis=0)
        q[:, known] = self._branch(pose[:, known])
        lost = np.flatnonzero(known & ~self._meets(pose, q))
        if lost.size:
            q[:, lost] = self._grown(pose[:, lost], NEIGHBOURS)
        q[:, ~self._meets(pose, q)] = np.nan
        return self.within_a_turn(q.T, limits_of(self.dae, self.joints)), np.zeros(len(r), dtype=int)

    def fk(self, q, near=None):
        """r, R and iterations: joints in a row have one pose."""
        return *self._posed(self._forward(*q.T)), np.zeros(len(q), dtype=int)

    def jacobian(self, r, R: Any = None):
        """dq/dpose (N, n, 6); zero along what the joints do not decide."""
        rates = self.rates(r, R)
        found, known = np.swapaxes(np.full_like(rates, np.nan), 1, 2), np.isfinite(rates).all(axis=(1, 2))
        found[known] = np.linalg.pinv(rates[known])
        return found

    def rates(self, r, R: Any = None):
        """Velocity and angular velocity of the tool by rates of the joints, (N, 6, n)."""
        return twists(self._forward.jacobian(*self.ik(r, R)[0].T), R)

    def variables(self, names, r, R=None):
        """Values of other variables in poses, (N, k) each."""
        return self.dae.array_function(self.joints, names)(*self.ik(r, R)[0].T)

    def solutions(self, r, R: Any = None):
        """Joints (m, n) of all m branches in one pose (1, 3), and the signs (s, m) of each branch."""
        self.check(R)
        pose = np.concatenate([r[0], R[0].T.ravel()])
        q, _ = self._branch.solutions(pose)
        q = q[:, self._meets(pose[:, None], q)]
        return q.T, self._signs(q.T) * self._signs(self.home.q[None])

    def _signs(self, q: np.ndarray) -> np.ndarray:
        """Of factors of the Jacobian's determinant, (s, N): one for each joint at whose values it vanishes, and the rest."""
        signs = np.ones((len(self._roots) + 1, len(q)))
        for row, (joint, roots) in zip(signs, self._roots.items(), strict=False):
            angle = (q[:, joint] + np.pi) % (2 * np.pi) - np.pi
            row[(angle[:, None] > roots).sum(axis=1) % 2 > 0] = -1.0
        signs[-1] = np.sign(self._minors(q)) * signs.prod(axis=0)
        return signs

    def _minors(self, q: np.ndarray) -> np.ndarray:
        """Determinants of the rows of the Jacobian that are independent at the start, (N,)."""
        rows = independent(self._home_rates)
        return np.linalg.det(twists(self._forward.jacobian(*q.T), self.fk(q)[1])[:, rows])

    @cached_property
    def _roots(self) -> dict[int, np.ndarray]:
        """Angles at which the Jacobian is singular wherever other joints stand, by the place of the joint."""
        others = np.random.default_rng(0).uniform(-np.pi, np.pi, (6, 1, len(self.joints)))
        angles = np.linspace(-np.pi, np.pi, 361) + 1e-3
        found = {}
        for joint in self._turns:
            q = np.repeat(others, len(angles), axis=1)
            q[:, :, joint] = angles
            minor = self._minors(q.reshape(-1, q.shape[2])).reshape(len(q), -1)
            turned = np.flatnonzero((minor[:, 1:] * minor[:, :-1] < 0).all(axis=0))
            if turned.size:
                before, after = minor[0, turned], minor[0, turned + 1]
                found[joint] = angles[turned] + (angles[1] - angles[0]) * before / (before - after)
        return found

    def _meets(self, pose: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Where joints q (n, N) bring the tool into its pose (12, N), (N,)."""
        with np.errstate(invalid="ignore"):
            return np.abs(np.hstack(self._forward(*q)).T - pose).max(axis=0) <= self.tolerance

    @property
    def _home_rates(self) -> np.ndarray:
        return twists(self._forward.jacobian(*self.home.q[:, None]), self.home.R[None])[0]

    @cached_property
    def _branch(self) -> FollowedBranch:
        """Joints by the pose (12,), along the straight way from the start."""
        count, rank = len(self.joints), int(np.linalg.matrix_rank(self._home_rates, MOVES))
        if rank < count:
            raise ModelError(
                f"Kinematics: found {count} joints of {self.dae.name}, which move {self.tool} in {rank} ways, "
                "expected as many; name joints= that decide on its pose, or start elsewhere if it starts in a singular one"
            )
        assert self._forward.closed_form is not None  # of joints in a row
        q, pose = ca.SX.sym("q", count), ca.SX.sym("pose", 12)
        r, R = ca.vertsplit(self._forward.closed_form(q), [0, 3, 12])
        turn = ca.reshape(R, 3, 3) @ ca.reshape(pose[3:], 3, 3).T
        e = ca.vertcat(r - pose[:3], ca.inv_skew(turn - turn.T) / (1 + ca.trace(turn)))
        f = e if count == 6 else ca.jacobian(e, q).T @ e
        begin = np.concatenate([self.home.r, self.home.R.T.ravel()])
        return FollowedBranch(ca.Function("arm", [q, pose], [f], {"cse": True}), self.home.q, begin)

    @cached_property
    def _grown(self) -> GrownBranch:
        """The branch of the start as far as it goes, grown by poses of joints that are drawn."""
        grown = GrownBranch(np.concatenate([self._branch.begin, self.home.q]), 12, self._led)
        wide = np.full(len(self.joints), np.linalg.norm(self.home.r) or 1.0)
        wide[self._turns] = np.pi
        q = self.home.q + np.random.default_rng(0).uniform(-wide, wide, (sum(ROUNDS), len(wide)))
        for part in np.split(np.hstack(self._forward(*q.T)).T, np.cumsum(ROUNDS[:-1]), axis=1):
            grown(part, 1)
        return grown

    def _led(self, pose: np.ndarray, there: np.ndarray) -> np.ndarray:
        """Joints (n, N) at poses (12, N), each from a known point (12 + n, N), by the straight way of the tool.

        Where that way ends, by the straight way of the joints to any solution, if none of them is singular on it.
        """
        q, start = self._branch.beside(pose, there[:12], there[12:]), there[12:]
        lost = np.flatnonzero(np.isnan(q[0]))
        found = self._branch.jumped(pose[:, lost], start[:, lost])
        lost, found = lost[np.isfinite(found[0])], found[:, np.isfinite(found[0])]
        moved = found - start[:, lost]
        moved[self._turns] = np.angle(np.exp(1j * moved[self._turns]))
        way = start[:, lost] + np.linspace(0, 1, BETWEEN)[:, None, None] * moved
        minor = self._minors(way.swapaxes(1, 2).reshape(-1, len(q))).reshape(BETWEEN, -1)
        # as far as a parabola bends between places
        within = np.abs(minor[1:-1]) > np.abs(np.diff(minor, 2, axis=0)) / 8
        alike = (minor * minor[:1] > 0).all(axis=0) & within.all(axis=0)
        q[:, lost[alike]] = way[-1][:, alike]
        return q
