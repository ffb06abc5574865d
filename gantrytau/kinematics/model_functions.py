"""Kinematics of any model from its own equations, where no closed form is known: functions between joints and pose.

They are array functions of the model and answer on the branch of its start values. A robot with n joints has n
coordinates of its pose, of the position and then of the quaternion without its largest element at the start, those that its
joints move there. The rest of a pose follows from these; where another rest is asked for, the pose is out of reach.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gantrytau.answers.many_points.array_function import ArrayFunction
from gantrytau.answers.many_points.elimination import solved
from gantrytau.border.refusal import ModelError, StructureError
from gantrytau.dae import Dae
from gantrytau.kinematics.rods.lengths_by_newton import limited
from gantrytau.kinematics.rods.rod_robots import Home
from gantrytau.kinematics.rotations import of_quaternion, of_quaternions, quaternions, skewed

MOST = 30  # iterations from `near`
CLOSE = 1e-11  # of a joint, in m or rad, relative to its size: what the iteration of the inverse leaves
MOVES = 1e-6  # of the largest of its kind, by which joints move a coordinate that can be chosen
# rows and columns of the elements of a skew matrix that are those of its vector
SPIN = [[2, 1], [0, 2], [1, 0]]


@dataclass(frozen=True, eq=False)
class ModelFunctions:
    """A model with a `tool` and driven `joints`; tolerance: m and elements of R by which the rest of a pose may miss."""

    dae: Dae
    tool: str
    joints: tuple[str, ...]
    home: Home
    tolerance: float

    def ik(self, r, R=None, sides=None):
        """Joints q and iterations (none are counted: they run inside the functions)."""
        x = self._coordinates(r, R)
        q = self._joints_of(x)
        q[~self._has_rest(np.where(np.isfinite(q), x, np.nan), r, R)] = np.nan
        return q, np.zeros(len(r), dtype=int)

    def _has_rest(self, x: np.ndarray, r: np.ndarray, R: np.ndarray | None) -> np.ndarray:
        """Where the rest of a pose is what its coordinates x make it, (N,)."""
        if self.places in ((0, 1, 2), (0, 1, 2, 3, 4, 5)):
            return np.full(len(r), True)
        there, turned = self._pose_of(x)
        with np.errstate(invalid="ignore"):
            missed = np.abs(there - r).max(axis=1)
            if R is not None:
                missed = np.maximum(missed, np.abs(turned - R).max(axis=(1, 2)))
            return missed <= self.tolerance

    def solutions(self, r, R=None) -> tuple[np.ndarray, np.ndarray]:
        """Joints (m, n) of all m branches in one pose (1, 3), and the signs (s, m) of each branch."""
        x = self._coordinates(r, R)
        q, signs = self._inverse.solutions(x[0])
        here = np.full(len(q), self._has_rest(x, r, R)[0])
        return q[here], signs[:, here]

    def fk(self, q, near=None):
        """r, R and iterations; near: (r, R) where Newton on the inverse starts, else the branch of the start values."""
        if near is not None:
            return self._forward_from(self._coordinates(near[0], near[1] if self.turning else None), q)
        return *self._posed(self._forward(*q.T)), np.zeros(len(q), dtype=int)

    def jacobian(self, r, R=None):
        """dq/dpose (N, n, 3), with an orientation (N, n, 6); zero along what the joints do not decide."""
        slopes = self._slopes_of(self._coordinates(r, R))
        places = np.array(self.places)
        found = np.zeros((len(r), len(self.joints), 6 if self.turning else 3))
        moved = places[places < 3]
        found[:, :, moved] = slopes[:, :, : len(moved)]
        if R is not None:
            found[:, :, 3:] = (
                slopes[:, :, len(moved) :] @ self._turns_of_quaternions(R)[:, places[places >= 3] - 3]
            )
        return self._in_reach(found, r, R)

    def rates(self, r, R=None):
        """Velocity of the tool by rates of the joints, (N, 3, n); with R its angular velocity too, (N, 6, n)."""
        x = self._coordinates(r, R)
        count = len(self.places)
        by_joints = solved(self._slopes_of(x), np.broadcast_to(np.eye(count), (len(x), count, count)))
        if self.places == (0, 1, 2):
            return by_joints
        moves = (
            self._following.jacobian_around(*self._arguments(x)) if count < 6 else np.zeros((len(x), 0, 0))
        )
        if R is None:  # as then the joints do not choose it
            return self._in_reach(moves[:, :3] @ by_joints, r, R)
        if count == 6:
            turns = np.zeros((len(x), 6, 6))
            turns[:, :3, :3], turns[:, 3:, 3:] = np.eye(3), self._turns_of_quaternions(R)
            return solved(turns, by_joints)
        return self._in_reach(twists(moves, R) @ by_joints, r, R)

    def whole_pose(self, r, R=None):
        """The pose with the orientation that follows where none is given."""
        return (r, R) if R is not None else self._pose_of(self._coordinates(r, None))

    def variables(self, names, r, R=None):
        """Values of other variables in poses, (N, k) each, matrices column after column."""
        found = self.dae.array_function(self._given, names).around(*self._arguments(self._coordinates(r, R)))
        return [self._in_reach(each, r, R) for each in found]

    def _in_reach(self, found: np.ndarray, r, R) -> np.ndarray:
        """The same, NaN where the rest of a pose is not what its coordinates make it."""
        if self.places not in ((0, 1, 2), (0, 1, 2, 3, 4, 5)):
            found[np.isnan(self.ik(r, R)[0]).any(axis=1)] = np.nan
        return found

    @cached_property
    def _turns(self) -> list[int]:
        """Columns of angles that a whole turn leaves as they are; the angle of a screw is none."""
        found = []
        for k, name in enumerate(self.joints):
            variable = self.dae.flat.find(name)
            if variable is None or variable.unit != "rad":
                continue
            q = np.vstack([self.home.q, self.home.q + 2 * np.pi * np.eye(len(self.home.q))[k]])
            here, there = np.hstack(self._forward(*q.T))
            if not np.isfinite(there).all() or np.abs(there - here).max() <= 1e-9 * np.abs(here).max():
                found.append(k)
        return found

    @property
    def turning(self) -> bool:
        """Whether the joints decide on the orientation beside the position."""
        return max(self.places) >= 3

    @cached_property
    def places(self) -> tuple[int, ...]:
        """The coordinates of the pose that the inverse is given: 0 to 2 of the position, 3 to 5 of `_turned`."""
        count = len(self.joints)
        if count > 3 and f"{self.tool}.q" not in self.dae.vectors:
            raise ModelError(
                f"Kinematics: found {count} joints of {self.dae.name} and no quaternion {self.tool}.q, expected a tool with "
                f"an orientation: a Body behind joints in a row, on a loop {self.tool} = Body(..., free=True)"
            )
        if count == 6:
            return (0, 1, 2, 3, 4, 5)
        if count == 3:
            try:
                self.dae.function([f"{self.tool}.r"], self.joints)
                return (0, 1, 2)
            except StructureError:
                pass  # the position has other than three degrees of freedom
        chosen = independent(self._moves)
        if len(chosen) < count:
            raise ModelError(
                f"Kinematics: found {count} joints of {self.dae.name}, which move {self.tool} in {len(chosen)} ways, "
                "expected as many; name joints= that decide on its pose, or start elsewhere if it starts in a singular one"
            )
        return tuple(chosen)

    @property
    def _moves(self) -> np.ndarray:
        """What the joints do at the start to the position, and to the elements `_turned` of the quaternion, (3 or 6, n)."""
        slopes = self._forward.jacobian(*self.home.q[:, None])[0]
        if f"{self.tool}.q" not in self.dae.vectors:
            return slopes[:3]
        moves = twists(slopes[None], self.home.R[None])[0]
        return np.vstack([moves[:3], self._turns_of_quaternions(self.home.R[None])[0] @ moves[3:]])

    def _forward_from(self, x: np.ndarray, q: np.ndarray):
        """Poses of which the inverse is q, from coordinates x (N, n) near them; NaN where Newton does not end."""
        x, iterations = np.array(x), np.zeros(len(q), dtype=int)
        rows = np.flatnonzero(np.isfinite(x).all(axis=1) & np.isfinite(q).all(axis=1))
        x[np.setdiff1d(np.arange(len(q)), rows)] = np.nan
        for _ in range(MOST):
            error = q[rows] - self._joints_of(x[rows])
            ended = ~(np.abs(error) > CLOSE * (1 + np.abs(q[rows]))).any(axis=1)
            x[rows[np.isnan(error).any(axis=1)]] = np.nan
            rows, error = rows[~ended], error[~ended]
            if not rows.size:
                break
            x[rows] += limited(solved(self._slopes_of(x[rows]), error))
            iterations[rows] += 1
        x[rows] = np.nan
        return *self._pose_of(x), iterations

    def _pose_of(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Poses of coordinates."""
        if len(self.places) == 6:
            q = np.empty((len(x), 4))
            q[:, self._turned] = x[:, 3:]
            with np.errstate(invalid="ignore"):
                q[:, self._largest] = self._sign * np.sqrt(1 - np.sum(x[:, 3:] ** 2, axis=1))
            return x[:, :3], of_quaternions(q)
        return self._posed(self._following.around(*self._arguments(x)))

    def _joints_of(self, x: np.ndarray) -> np.ndarray:
        found = whole(np.hstack(self._inverse.around(*self._arguments(x))))
        return self.within_a_turn(found, limits_of(self.dae, self.joints))

    def within_a_turn(self, q: np.ndarray, limits: np.ndarray) -> np.ndarray:
        """Angles at most half a turn from the middle of their limits (n, 2), from home where these are infinite."""
        for k in self._turns:
            middle = limits[k].mean() if np.isfinite(limits[k]).all() else self.home.q[k]
            q[:, k] -= 2 * np.pi * np.round((q[:, k] - middle) / (2 * np.pi))
        return q

    def _slopes_of(self, x: np.ndarray) -> np.ndarray:
        """Slopes of the joints by the coordinates of poses, (N, n, n)."""
        return whole(self._inverse.jacobian_around(*self._arguments(x)))

    @cached_property
    def _forward(self) -> ArrayFunction:
        """Position and orientation, column after column, from the joints one by one."""
        return self.dae.array_function(self.joints, self._wanted)

    @cached_property
    def _inverse(self) -> ArrayFunction:
        """Joints from coordinates of the pose."""
        return self.dae.array_function(self._given, self.joints)

    @cached_property
    def _following(self) -> ArrayFunction:
        """The whole pose from its coordinates."""
        return self.dae.array_function(self._given, self._wanted)

    @property
    def _wanted(self) -> list[str]:
        return [f"{self.tool}.r", *(n for n in orientations(self.tool) if n in self.dae.vectors)][:2]

    @property
    def _given(self) -> list[str]:
        """Names of the coordinates of the pose; the position in one where it is whole."""
        whole = self.places[:3] == (0, 1, 2)
        names = [
            f"{self.tool}.r[{k}]" if k < 3 else f"{self.tool}.q[{self._turned[k - 3]}]" for k in self.places
        ]
        return [f"{self.tool}.r", *names[3:]] if whole else names

    def _arguments(self, x: np.ndarray) -> list[np.ndarray]:
        """Coordinates as the functions take them."""
        return [x[:, :3], *x[:, 3:].T] if self.places[:3] == (0, 1, 2) else list(x.T)

    def _posed(self, found: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Positions and orientations; a tool without orientation keeps that of the world."""
        both = whole(np.hstack(found))
        r = both[:, :3]
        if len(found) > 1:
            return r, both[:, 3:].reshape(-1, 3, 3).transpose(0, 2, 1)
        R = np.array(np.broadcast_to(np.eye(3), (len(r), 3, 3)))
        R[np.isnan(r[:, 0])] = np.nan
        return r, R

    def _coordinates(self, r: np.ndarray, R: np.ndarray | None) -> np.ndarray:
        """Coordinates (N, n) of poses."""
        self.check(R)
        if R is None:
            return r[:, list(self.places)]
        return np.concatenate([r, self._quaternions(R)[:, self._turned]], axis=1)[:, list(self.places)]

    @cached_property
    def _start_quaternion(self) -> np.ndarray:
        """Quaternion of the tool where the model starts, (4,), which may be of either sign."""
        names = self.dae.expand(f"{self.tool}.q")
        return np.array([float(self.dae.numbers([n], self.dae.start)[0]) for n in names])

    @property
    def _largest(self) -> int:
        """The element of the quaternion that follows from the others: far from zero, where its sign would be lost."""
        return int(np.argmax(np.abs(self._start_quaternion)))

    @property
    def _sign(self) -> float:
        return float(np.sign(self._start_quaternion[self._largest]))

    @property
    def _turned(self) -> list[int]:
        """The other elements."""
        return [k for k in range(4) if k != self._largest]

    def _quaternions(self, R: np.ndarray) -> np.ndarray:
        """Quaternions (N, 4) whose largest element at the start keeps its sign."""
        q = quaternions(R)
        return np.where(q[:, [self._largest]] * self._sign < 0, -q, q)

    def _turns_of_quaternions(self, R: np.ndarray) -> np.ndarray:
        """Change of the elements `_turned` of quaternions by a rotation vector in the world, (N, 3, 3)."""
        q = self._quaternions(R)
        # a rotation vector w turns the quaternion (a, v) by half of (-v . w, (a I - [v]x) w)
        whole = (
            np.concatenate([-q[:, None, 1:], q[:, 0, None, None] * np.eye(3) - skewed(q[:, 1:])], axis=1) / 2
        )
        return whole[:, self._turned]

    def check(self, R: np.ndarray | None) -> None:
        """ModelError where an orientation is missing or one too many."""
        if (R is not None) != self.turning:
            count = len(self.joints)
            raise ModelError(
                f"Kinematics: found {count} joints and {'no' if R is None else 'an'} orientation R for {self.dae.name}, "
                f"expected {'one, as joints turn the tool' if R is None else 'none, as it follows from the position'}; "
                "name others by joints="
            )


def limits_of(dae: Dae, joints: Sequence[str]) -> np.ndarray:
    """Bounds that a model declares for coordinates, (n, 2); infinite where it declares none."""
    found = np.tile([-np.inf, np.inf], (len(joints), 1))
    for row, name in enumerate(joints):
        variable = dae.flat.find(name)
        for column, bound in enumerate((variable.min, variable.max) if variable else ()):
            if bound is not None:
                found[row, column] = dae.number(bound[0])
    return found


def whole(found: np.ndarray) -> np.ndarray:
    """The same with poses NaN of which some numbers are, as where one arm of two is too short."""
    found[~np.isfinite(found).all(axis=tuple(range(1, found.ndim)))] = np.nan
    return found


def independent(moves: np.ndarray) -> list[int]:
    """Rows of the position, then of the orientation, that are independent, those that move most first; in order."""
    chosen: list[int] = []
    left = np.array(moves)
    for kind in (range(3), range(3, len(moves))):
        largest = np.linalg.norm(moves[list(kind)], axis=1).max(initial=0.0)
        while len(chosen) < moves.shape[1]:
            sizes = {k: float(np.linalg.norm(left[k])) for k in kind}
            best = max(sizes, key=lambda k: sizes[k], default=-1)
            if best < 0 or not sizes[best] > MOVES * largest:
                break
            chosen.append(best)
            along = left[best] / sizes[best]
            left = left - np.outer(left @ along, along)
    return sorted(chosen)


def twists(slopes: np.ndarray, R: np.ndarray) -> np.ndarray:
    """Velocity and angular velocity in the world, (N, 6, n), of slopes (N, 12, n) of r and R, column after column."""
    turns = (
        slopes[:, 3:].reshape(len(R), 3, 3, slopes.shape[2]).transpose(0, 3, 2, 1)
        @ np.swapaxes(R, 1, 2)[:, None]
    )
    return np.concatenate([slopes[:, :3], np.stack([turns[:, :, i, j] for i, j in SPIN], axis=1)], axis=1)


def orientations(tool: str) -> tuple[str, str]:
    """Where the orientation of a tool may stand: its own, or that of the frame of a body."""
    return f"{tool}.R", f"{tool}.frame_a.R"


def home_of(values: dict, tool: str, joints: tuple[str, ...]) -> Home:
    """The start of a model as a pose; values as `Dae.evaluate` answers."""
    R = next((values[n] for n in orientations(tool) if n in values), None)
    if R is None:
        q = values.get(f"{tool}.q")
        R = np.eye(3) if q is None else of_quaternion(np.asarray(q))
    return Home(np.array([float(values[n]) for n in joints]), np.asarray(values[f"{tool}.r"]), np.asarray(R))
