"""One branch of the solutions of f(y, q) = 0 followed to many q at once, as `branch_follower` follows it to one.

The trials are the same, and so is what is accepted. Matrices are eliminated by pivots that are good at the start, as
expressions of which NumPy computes one instruction for all points; where the way ends so, it goes on with
pivots that are chosen by value for each point, so that no answer is lost where one of the others vanishes.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.answers import branch_follower as one
from gantrytau.answers.implicit_blocks import SOLVED
from gantrytau.answers.many_points.array_program import ArrayProgram, NotForArrays
from gantrytau.answers.many_points.elimination import eliminated, order_of_pivots, solved
from gantrytau.answers.many_points.one_angle import OneAngle, one_angle
from gantrytau.language.term_sizes import term_sizes

MOST = one.TRIALS[0] * one.TRIALS[1]
CORRECTIONS = 8
# of the unknowns in their sizes: a correction after which Newton's method has reached rounding
SETTLED = 1e-8
STARTS, STEPS = 200, 40  # of Newton's method for all solutions, and as many steps
SAME = 1e-6  # of one, by which unknowns of one solution may differ
ONWARD = 0.1  # of what is left of the way, the first trial after pivots are chosen anew


@dataclass(frozen=True, eq=False)
class FollowedBranch:
    """Unknowns y (n,) of a block; residual: (y, q) -> f (n,), an SX function; start: y where q is `begin`, both columns.

    anywhere: each point has a start of its own, and where it lies stands below `end`, (2 k, N).
    """

    residual: ca.Function
    start: np.ndarray
    begin: np.ndarray
    anywhere: bool = False

    def beside(self, end: np.ndarray, begin: np.ndarray, start: np.ndarray) -> np.ndarray:
        """Y (n, N) at `end` (k, N), each led from another point of the branch, start (n, N) at begin (k, N)."""
        if self.angle:
            return self._corrected(self.angle.near(end, start) / self.units[1][:, None], end)
        return self._anywhere(np.vstack([end, begin]), start)

    @cached_property
    def angle(self) -> OneAngle | None:
        """The equation in closed form, if it is one for an angle."""
        return None if self.anywhere else one_angle(self.residual, self.start, self.begin)

    @property
    def direct(self) -> bool:
        """Whether `beside` knows the branch without following it."""
        return self.angle is not None

    @cached_property
    def _anywhere(self) -> "FollowedBranch":
        return replace(self, anywhere=True)

    def __call__(self, end: np.ndarray, start: np.ndarray | None = None) -> np.ndarray:
        """Y (n, N) at `end` (k, N); NaN where the branch does not lead there."""
        rows, _ = self.units
        y = np.full((len(self.start), end.shape[1]), np.nan)
        start = np.repeat(self.start[:, None], end.shape[1], axis=1) if start is None else start
        z = start / self.units[1][:, None]
        way = np.ones((2, end.shape[1]))
        if self.angle:
            way[1, np.isnan(self.angle.near(end, start)[0])] = 0.0
        self._along(self._trial, way, z, end)
        late = np.flatnonzero(way[0] > 0)
        if late.size and len(rows) > 1:
            there, state, place = end[:, late], way[:, late], z[:, late]
            state[1] = np.maximum(state[1], ONWARD * state[0])
            self._along(self._trial_by_value, state, place, there)
            way[:, late], z[:, late] = state, place
        here = np.flatnonzero(way[0] == 0)
        y[:, here] = self._corrected(z[:, here], end[:, here])
        return y

    def jumped(self, end: np.ndarray, start: np.ndarray) -> np.ndarray:
        """Y (n, N) on any branch at `end` (k, N) by Newton's method from each start (n, N); NaN where it does not end."""
        z = start / self.units[1][:, None]
        for _ in range(STEPS):
            step = self._newton_by_value(z, end)
            z += np.nan_to_num(step / np.maximum(1.0, np.abs(step).max(axis=0)))
        return self._corrected(z, end)

    def solutions(self, end: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """All Y (n, m) at one `end` (k,) that many starts lead to, and signs (1, m) of det df/dy, 1 as at the start."""
        turns, begin = self._turning[:, None], self.start[:, None]
        wide = np.where(turns, np.pi, np.maximum(1.0, np.abs(begin)))
        ends = np.repeat(end[:, None], STARTS, axis=1)
        y = self.jumped(ends, begin + wide * np.random.default_rng(0).uniform(-1, 1, (len(begin), STARTS)))
        kept: list[int] = []
        for k in np.flatnonzero(np.isfinite(y[0])):
            gaps = y[:, k, None] - y[:, kept]
            if (np.abs(np.where(turns, 2 * np.sin(gaps / 2), gaps)).max(axis=0) > SAME).all():
                kept.append(int(k))
        there = self._residual_at(
            np.hstack([begin, y[:, kept]]), np.column_stack([self.begin, ends[:, kept]])
        )[1]
        signs = np.sign(np.linalg.det(there))
        return y[:, kept], signs[None, 1:] * signs[0]

    @cached_property
    def _turning(self) -> np.ndarray:
        """Whether each unknown is an angle, (n,): a whole turn does not change the residual."""
        n = len(self.start)
        beside = self.start + np.random.default_rng(0).uniform(-1, 1, n)
        y = beside[:, None] + 2 * np.pi * np.eye(n, n + 1)
        f, *_ = self._residual_at(y, np.repeat(self.begin[:, None], n + 1, axis=1))
        return np.abs(f[:, :n] - f[:, n:]).max(axis=0) <= SAME

    def _residual_at(self, y: np.ndarray, q: np.ndarray):
        return self._matrices(y / self.units[1][:, None], np.ones((1, y.shape[1])), q)

    def _along(self, trial, way: np.ndarray, z: np.ndarray, end: np.ndarray) -> None:
        """Trials until all have arrived or do not move; way: what is left of it and the next step, (2, N), z: (n, N)."""
        on = np.arange(end.shape[1])
        for _ in range(MOST):
            on = on[(way[0, on] > 0) & (way[1, on] > one.SMALLEST)]
            if not on.size:
                break
            left, h = way[:, on]
            both, sizes, pivots = trial(way[:, on], z[:, on], end[:, on])
            with np.errstate(all="ignore"):
                beside = sizes[0] / (sizes[1] * one.NEAR**2 + sizes[2] * one.ROUNDING**2 + one.NOTHING)
                # NaN, as a singular matrix makes it, is no step that is accepted
                bend = np.maximum(np.sqrt(beside), np.abs(np.log(pivots)).max(axis=0) / np.log(one.ALIKE))
                bend = np.where(np.isnan(bend), np.inf, bend)
                wider = h * np.clip(one.WANTED / bend, *one.CHANGES)
            good = bend <= 1
            z[:, on[good]] += both[:, good]
            left = np.where(good, left - h, left)
            way[:, on] = left, np.minimum(wider, left)

    def _corrected(self, z: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Y of points near the branch by Newton's method, to rounding; NaN where equations do not hold."""
        on = np.arange(end.shape[1])
        for _ in range(CORRECTIONS):
            if not on.size:
                break
            (step,) = self._newton(z[:, on], end[:, on])
            if len(z) > 1 and not np.isfinite(step).all():
                step = np.where(
                    np.isfinite(step).all(axis=0), step, self._newton_by_value(z[:, on], end[:, on])
                )
            z[:, on] += step
            on = on[~(np.abs(step).max(axis=0) <= SETTLED * np.abs(z[:, on]).max(axis=0))]
        y = z * self.units[1][:, None]
        (error,) = self._errors(y, end)
        with np.errstate(invalid="ignore"):
            y[:, ~(error[0] <= SOLVED**2)] = np.nan
        return y

    @cached_property
    def units(self) -> tuple[np.ndarray, np.ndarray]:
        """Scales of rows and unknowns."""
        sizes = one.sizes_at(self.residual, ca.DM(self.start), ca.DM(self.begin))
        rows, columns = (np.array(size).ravel() for size in sizes)
        return rows, columns

    @cached_property
    def _reach(self) -> ca.DM:
        return one.reach_along(self.residual, *map(ca.DM, (self.start, self.begin, self.units[1])))

    @cached_property
    def _here(self) -> ca.Function:
        """(z, s, b) -> residual, its Jacobians by z and s."""
        begin = None if self.anywhere else ca.DM(self.begin)
        return one.residual_along(self.residual, begin, *map(ca.DM, self.units))

    def _way(self, end: Any) -> Any:
        """From where the way begins to where it ends, as numbers (k, N) or symbols (k,)."""
        k = len(self.begin)
        begin = end[k:] if self.anywhere else self.begin[:, None]
        return end[:k] - begin

    @property
    def _end(self) -> ca.SX:
        return ca.SX.sym("end", len(self.begin) * (2 if self.anywhere else 1))

    @cached_property
    def order(self) -> list[tuple[int, int]]:
        """Pivots that are good at the start, as (row, column)."""
        there = np.tile(self.begin, 2) if self.anywhere else self.begin
        _, matrix, _ = self._here(ca.DM(self.start / self.units[1]), 0, ca.DM(there))
        order = order_of_pivots(np.array(matrix))
        if order is None:
            raise NotForArrays(f"{self.residual.name()} is singular at the start")
        return order

    @cached_property
    def _trial(self):
        """(way, z, end) -> step with correction; squares of correction, of a usual step and of z; pivots between Jacobians.

        Matrices are eliminated in the order that is good at the start.
        """
        n = len(self.start)
        way, z, end = ca.SX.sym("way", 2), ca.SX.sym("z", n), self._end
        left, h = way[0], way[1]
        f, before, slope = self._here(z, 1 - left, end)
        step = -eliminated(before, f + h * slope, self.order)
        f, after, _ = self._here(z + step, 1 - left + h, end)
        both = eliminated(after, ca.horzcat(f, before), self.order)
        pivots = one.pivots_of(both[:, 1:])
        usual = ca.sumsqr(step) + h**2 * ca.dot(self._reach, self._way(end) ** 2)
        sizes = ca.vertcat(ca.sumsqr(both[:, 0]), usual, ca.sumsqr(z))
        results = [step - both[:, 0], sizes, ca.vertcat(*pivots)]
        return ArrayProgram(ca.Function("trial", [way, z, end], results, {"cse": True}))

    def _trial_by_value(self, way: np.ndarray, z: np.ndarray, end: np.ndarray):
        f, before, slope = self._matrices(z, (1 - way[:1]), end)
        step = -solved(before, (f + way[1] * slope).T).T
        f, after, _ = self._matrices(z + step, 1 - way[:1] + way[1:], end)
        both = solved(after, np.concatenate([f.T[:, :, None], before], axis=2))
        correction, n = -both[:, :, 0].T, len(z)
        (pivots,) = self._pivots(both[:, :, 1:].transpose(2, 1, 0).reshape(n * n, -1))
        sizes = [np.sum(x * x, axis=0) for x in (correction, step, z)]
        sizes[1] += way[1] ** 2 * (np.array(self._reach).T @ self._way(end) ** 2)[0]
        return step + correction, sizes, pivots

    def _matrices(self, z: np.ndarray, s: np.ndarray, end: np.ndarray):
        """Residual (n, N), its Jacobian (N, n, n) by z and its slope (n, N) along the way."""
        f, matrix, slope = self._numbers(z, s, end)
        return f, matrix.reshape(len(z), len(z), -1).transpose(2, 1, 0), slope

    @cached_property
    def _numbers(self) -> ArrayProgram:
        return ArrayProgram(self._here)

    @cached_property
    def _pivots(self) -> ArrayProgram:
        matrix = ca.SX.sym("matrix", len(self.start), len(self.start))
        return ArrayProgram(ca.Function("pivots", [ca.vec(matrix)], [ca.vertcat(*one.pivots_of(matrix))]))

    @cached_property
    def _newton(self) -> ArrayProgram:
        z, end = ca.SX.sym("z", len(self.start)), self._end
        f, matrix, _ = self._here(z, 1, end)
        step = -eliminated(matrix, f, self.order)
        return ArrayProgram(ca.Function("newton", [z, end], [step], {"cse": True}))

    def _newton_by_value(self, z: np.ndarray, end: np.ndarray) -> np.ndarray:
        f, matrix, _ = self._matrices(z, np.ones((1, z.shape[1])), end)
        return -solved(matrix, f.T).T

    @cached_property
    def _errors(self) -> ArrayProgram:
        """(y, end) -> the square of the residual in the sizes of the terms of its equations."""
        y, end = self.residual.sx_in()[0], self._end
        f = self.residual(y, end[: len(self.begin)])
        terms = ca.vertcat(*(ca.if_else(t > 0, t, 1.0) for t in term_sizes(ca.densify(f).elements())))
        return ArrayProgram(ca.Function("errors", [y, end], [ca.sumsqr(f / terms)], {"cse": True}))
