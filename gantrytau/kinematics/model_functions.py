"""Kinematics of any model from its own equations, where no closed form is known: functions between joints and pose.

The functions of `Dae.function` are evaluated for many poses at once through buffers of NumPy's memory; the way through
CasADi's own matrices takes a hundred times longer. Both answer on the branch of the start values.
"""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from gantrytau.dae import Dae
from gantrytau.errors import ModelError
from gantrytau.interruption import on_interrupt
from gantrytau.kinematics.rods.lengths_by_newton import limited, solved
from gantrytau.kinematics.rods.rod_robots import Home
from gantrytau.kinematics.rotations import of_quaternion, of_quaternions, quaternions, skewed

BLOCK = 8  # poses of one call: they take longer than the call, and Ctrl-C is heard in a second where none is in reach
MOST = 30  # iterations from `near`
CLOSE = 1e-11  # of a joint, in m or rad, relative to its size: what the iteration of the inverse leaves


@dataclass(frozen=True, eq=False)
class ModelFunctions:
    """A model with a `tool` and driven `joints`; three joints: a position is a pose, six: an orientation besides."""

    dae: Dae
    tool: str
    joints: tuple[str, ...]
    home: Home

    def ik(self, r, R=None, sides=None):
        """Joints q and iterations (none are counted: they run inside the functions)."""
        return self._joints_of(self._pose(r, R)), np.zeros(len(r), dtype=int)

    def fk(self, q, near=None):
        """r, R and iterations; near: (r, R) where Newton on the inverse starts, else the branch of the start values."""
        if near is not None:
            return self._forward_from(self._pose(near[0], near[1] if len(self.joints) == 6 else None), q)
        found = _over_poses(self._forward, list(q.T[:, :, None]))
        if self._turns:
            R = found[1].reshape(-1, 3, 3).transpose(0, 2, 1)
        else:
            R = np.array(np.broadcast_to(np.eye(3), (len(q), 3, 3)))
            R[np.isnan(found[0][:, 0])] = np.nan
        return found[0], R, np.zeros(len(q), dtype=int)

    def _forward_from(self, x: np.ndarray, q: np.ndarray):
        """Poses of which the inverse is q, from poses x (N, 3 or 6) near them; NaN where Newton does not end."""
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
        R = self._orientation(x)
        return x[:, :3], R, iterations

    def _orientation(self, x: np.ndarray) -> np.ndarray:
        """Orientations of poses as the inverse takes them."""
        if len(self.joints) == 6:
            with np.errstate(invalid="ignore"):
                scalar = np.sqrt(1 - np.sum(x[:, 3:] ** 2, axis=1))
            return of_quaternions(np.column_stack([scalar, x[:, 3:]]))
        if self._turns:
            return _over_poses(self._following, [x])[0].reshape(-1, 3, 3).transpose(0, 2, 1)
        R = np.array(np.broadcast_to(np.eye(3), (len(x), 3, 3)))
        R[np.isnan(x[:, 0])] = np.nan
        return R

    def _joints_of(self, x: np.ndarray) -> np.ndarray:
        return _over_poses(self._inverse, [x])[0]

    def _slopes_of(self, x: np.ndarray) -> np.ndarray:
        """Slopes of the joints by the elements of poses, (N, n, 3 or 6)."""
        found = _over_poses(self._slopes, [x])[0]
        return found.reshape(len(x), x.shape[1], -1).transpose(0, 2, 1)

    def jacobian(self, r, R=None):
        """dq/dpose (N, n, 3), with six joints (N, n, 6)."""
        found = self._slopes_of(self._pose(r, R))
        if R is None or found.shape[2] == 3:
            return found
        q = quaternions(R)
        # a rotation vector turns the quaternion (w, v) by half of (w I - [v]x) in its last three elements
        turn = (q[:, 0, None, None] * np.eye(3) - skewed(q[:, 1:])) / 2
        return np.concatenate([found[:, :, :3], found[:, :, 3:] @ turn], axis=2)

    @property
    def _turns(self) -> bool:
        return f"{self.tool}.R" in self.dae.vectors

    @cached_property
    def _forward(self) -> ca.Function:
        """Position and orientation, column after column, from the joints one by one."""
        wanted = [f"{self.tool}.r"] + ([f"{self.tool}.R"] if self._turns else [])
        return _dense(self.dae.function(list(self.joints), wanted))

    @cached_property
    def _following(self) -> ca.Function:
        """Orientation, column after column, that follows from a position."""
        return _dense(self.dae.function([f"{self.tool}.r"], [f"{self.tool}.R"]))

    @cached_property
    def _slopes(self) -> ca.Function:
        """Jacobian of the inverse, column after column."""
        x = ca.MX.sym("pose", self._inverse.numel_in(0))
        return ca.Function("slopes", [x], [ca.densify(ca.jacobian(self._inverse(x), x))])

    @cached_property
    def _inverse(self) -> ca.Function:
        """Joints from a pose: r, and elements 1 to 3 of the quaternion with six joints, as one column."""
        six = len(self.joints) == 6
        names = [f"{self.tool}.r"] + [f"{self.tool}.q[{k}]" for k in (1, 2, 3) if six]
        function = self.dae.function(names, list(self.joints))
        x = ca.MX.sym("pose", 6 if six else 3)
        parts = [x[:3], *(x[3 + k] for k in range(3) if six)]
        return ca.Function("inverse", [x], [ca.densify(ca.vertcat(*function.call(parts)))])

    def _pose(self, r: np.ndarray, R: np.ndarray | None) -> np.ndarray:
        """Arguments of the inverse."""
        count = len(self.joints)
        if count == 3 and R is None:
            return r
        if count == 6 and R is not None:
            return np.concatenate([r, quaternions(R)[:, 1:]], axis=1)
        raise ModelError(
            f"Kinematics: found {count} joints and {'no' if R is None else 'an'} orientation R for {self.dae.name}, "
            "expected three joints and a position, or six and an orientation besides; name others by joints="
        )


def home_of(values: dict, tool: str, joints: tuple[str, ...]) -> Home:
    """The start of a model as a pose; values as `Dae.evaluate` answers."""
    R = values.get(f"{tool}.R")
    q = values.get(f"{tool}.q")
    if R is None:
        R = np.eye(3) if q is None else of_quaternion(np.asarray(q))
    return Home(np.array([float(values[n]) for n in joints]), np.asarray(values[f"{tool}.r"]), np.asarray(R))


def _dense(function: ca.Function) -> ca.Function:
    """The same function with all zeros of its results stored."""
    x = function.mx_in()
    return ca.Function("dense", x, [ca.densify(y) for y in function.call(x)])


def _over_poses(function: ca.Function, arguments: list[np.ndarray]) -> list[np.ndarray]:
    """Results (N, k) of a function for arguments (N, l); NaN where one is not finite, which CasADi would report."""
    known = np.all([np.isfinite(argument).all(axis=1) for argument in arguments], axis=0)
    found = [np.full((len(known), function.numel_out(i)), np.nan) for i in range(function.n_out())]
    for result, part in zip(found, _in_blocks(function, [a[known] for a in arguments]), strict=True):
        result[known] = part
    return found


def _in_blocks(function: ca.Function, arguments: list[np.ndarray]) -> list[np.ndarray]:
    """The same for finite arguments, a block of poses in one call."""
    count = len(arguments[0])
    whole = count - count % BLOCK
    found = [np.empty((count, function.numel_out(i))) for i in range(function.n_out())]
    asked: list[bool] = []
    with on_interrupt(
        lambda: asked.append(True)
    ):  # inside CasADi it would be a RuntimeError, or a failed iteration
        _fill(function, arguments, found, whole, asked)
    return found


def _fill(
    function: ca.Function, arguments: list[np.ndarray], found: list[np.ndarray], whole: int, asked: list[bool]
) -> None:
    """Results into `found`: the first rows in blocks, then the rest; until an end is asked for."""
    count = len(arguments[0])
    for size, firsts in ((BLOCK, range(0, whole, BLOCK)), (count - whole, range(whole, count, BLOCK))):
        if not firsts:
            continue
        mapped = function.map(size)
        buffer, run = mapped.buffer()
        inside = [np.empty((size, function.numel_in(i))) for i in range(function.n_in())]
        outside = [np.empty((size, function.numel_out(i))) for i in range(function.n_out())]
        for i, memory in enumerate(inside):
            buffer.set_arg(i, memory.data)
        for i, memory in enumerate(outside):
            buffer.set_res(i, memory.data)
        for first in firsts:
            for memory, argument in zip(inside, arguments, strict=True):
                memory[:] = argument[first : first + size]
            run()
            if asked:
                raise KeyboardInterrupt
            for memory, result in zip(outside, found, strict=True):
                result[first : first + size] = memory
