"""The quadratic program of a linearised horizon, in the order of its stages, solved by PIQP.

    min  sum of 1/2 v' H v + g' v + penalty (e + e^2 / 2) over the stages  + 1/2 x_N' P x_N + p' x_N,     v = (x, u)
    x_next = A x + B u + b,   lower <= C x + D u <= upper, where soft lower - e <= ... <= upper + e,   e >= 0

Each soft limit has an e of its own in a stage: none gives way because another one does.

A soft limit has an exact penalty: it holds wherever it can, once the penalty is larger than its multiplier.

Measured on 40 stages of a cart with a pole: PIQP 0.6 ms by its own interface, which keeps its structure from call to call;
through CasADi PIQP 1.5 ms, OSQP 1.6, ProxQP 6, qrqp 8, DAQP 13, Fatrop 200, and HPIPM did not reach the tolerance.
The method of `controller.c`, compiled, takes 0.25 ms.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import piqp
from scipy import sparse

RIDGE = 1e-10  # of the largest curvature: a flat objective leaves no input undetermined
FAR = 1e30  # what PIQP takes for no limit
ACCURACY = 1e-12  # of the inputs this leaves 1e-9


@dataclass(frozen=True, eq=False)
class Stage:
    """N stages: H (N, v, v), g (N, v), A, B, b of the next state, rows C, D with their ends, and limits of inputs."""

    H: np.ndarray
    g: np.ndarray
    A: np.ndarray
    B: np.ndarray
    b: np.ndarray
    C: np.ndarray
    D: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    lower_u: np.ndarray
    upper_u: np.ndarray


@dataclass(frozen=True, eq=False)
class Found:
    """Changes of states (N + 1, nx) and inputs (N, nu), the largest slacks (N,), whether the program was solved or has
    no bound, and its objective.
    """

    x: np.ndarray
    u: np.ndarray
    slack: np.ndarray
    solved: bool
    unbounded: bool = False
    objective: float = 0.0


class HorizonProgram:
    """The program for one number of stages, solved again and again.

    soft (rows,): which slack a row of a stage has, -1 for none; finite (2, rows): whether they have a lower, an upper end;
    ridge: of the largest curvature, added to all; size: of costs, which the solver sees by it.
    """

    def __init__(
        self,
        stages: int,
        nx: int,
        nu: int,
        soft: np.ndarray,
        finite: np.ndarray,
        penalty: float,
        ridge: float = RIDGE,
        size: float = 1.0,
    ):
        self.stages, self.nx, self.nu, self.penalty, self.ridge = stages, nx, nu, penalty / size, ridge
        self._size = size
        self.slack = int(soft.max(initial=-1)) + 1
        self.each = nx + nu + self.slack
        # a soft row is one for each of its ends
        self.hard, below, above = (
            np.flatnonzero(one) for one in (soft < 0, (soft >= 0) & finite[0], (soft >= 0) & finite[1])
        )
        self.below, self.above, self.soft = below, above, soft
        self.rows = self.hard.size + below.size + above.size
        n, each = stages, self.each
        block = np.ones((each, each), bool)
        self._hessian = _Pattern([block] * n + [np.ones((nx, nx), bool)], each, each)
        beside = np.zeros((nx, each + nx), bool)
        beside[:, : nx + nu], beside[:, each:] = True, np.eye(nx, dtype=bool)
        self._dynamics = _Pattern([beside] * n, nx, each)
        self._limits = _Pattern([np.ones((self.rows, each), bool)] * n, self.rows, each, n * each + nx)
        self._solver: Any = None
        self._ends = np.zeros(0), np.zeros(0)  # lower and upper ones of all variables

    def load(self, stage: Stage, P: np.ndarray, p: np.ndarray) -> None:
        """Hand the solver all but the first state. P, p: of the last one."""
        n, nx, nu, each = self.stages, self.nx, self.nu, self.each
        P, p = P / self._size, p / self._size
        largest = max(float(np.abs(stage.H).max(initial=0.0)) / self._size, float(np.abs(P).max(initial=0.0)))
        ridge = self.ridge * max(largest, 1e-300)
        H = np.zeros((n, each, each))
        H[:, : nx + nu, : nx + nu] = stage.H / self._size
        H[:, range(each), range(each)] += ridge
        g = np.zeros((n, each))
        g[:, : nx + nu] = stage.g / self._size
        M = np.zeros((n, nx, each + nx))
        M[:, :, :nx], M[:, :, nx : nx + nu], M[:, :, each:] = stage.A, stage.B, -np.eye(nx)
        kept = np.concatenate([self.hard, self.below, self.above])
        last, first_above = self.hard.size, self.hard.size + self.below.size
        G = np.zeros((n, self.rows, each))
        G[:, :, : nx + nu] = np.concatenate([stage.C, stage.D], axis=2)[:, kept]
        low, high = -stage.lower[:, kept], stage.upper[:, kept]
        high[:, last:first_above], low[:, first_above:] = FAR, FAR
        lower, upper = np.full((2, n, each), FAR)
        lower[:, nx : nx + nu], upper[:, nx : nx + nu] = -stage.lower_u, stage.upper_u
        lower[0, :nx] = upper[0, :nx] = 0.0
        first_slack, ends = nx + nu, np.arange(self.rows)
        H[:, range(first_slack, each), range(first_slack, each)] = g[:, first_slack:] = self.penalty
        G[:, ends[last:first_above], first_slack + self.soft[self.below]] = 1.0
        G[:, ends[first_above:], first_slack + self.soft[self.above]] = -1.0
        lower[:, first_slack:] = 0.0
        free = np.full(nx, FAR)
        self._ends = -np.append(lower.ravel(), free), np.append(upper.ravel(), free)
        terms = (
            self._hessian.filled([H.ravel(), (P + ridge * np.eye(nx)).ravel()]), np.append(g.ravel(), p),
            self._dynamics.filled([M.ravel()]), -stage.b.ravel(),
            self._limits.filled([G.ravel()]), -np.minimum(low, FAR).ravel(), np.minimum(high, FAR).ravel(),
            *self._ends,
        )  # fmt: skip
        if self._solver is None:
            self._solver = piqp.SparseSolver()
            settings = self._solver.settings
            settings.kkt_solver = piqp.KKTSolver.sparse_multistage
            settings.eps_abs = settings.eps_rel = settings.eps_duality_gap_abs = (
                settings.eps_duality_gap_rel
            ) = ACCURACY
            self._solver.setup(*terms)
        else:
            self._solver.settings.preconditioner_reuse_on_update = False
            self._solver.update(*terms)

    def solve(self, first: np.ndarray) -> Found:
        """Changes that solve what is loaded. first (nx,): the change of the first state, which is known."""
        n, nx, nu, each = self.stages, self.nx, self.nu, self.each
        for end in self._ends:
            end[:nx] = first
        self._solver.settings.preconditioner_reuse_on_update = True  # its matrices are as they were
        self._solver.update(x_l=self._ends[0], x_u=self._ends[1])
        status = self._solver.solve()
        v = np.array(self._solver.result.x)
        if not np.isfinite(v).all():
            self._solver = None  # what it keeps from call to call is none any more
        parts = v[: n * each].reshape(n, each)
        x = np.vstack([parts[:, :nx], v[n * each :]])
        return Found(
            x,
            parts[:, nx : nx + nu],
            parts[:, nx + nu :].max(axis=1, initial=0.0),
            bool(status == piqp.Status.PIQP_SOLVED and np.isfinite(v).all()),
            status == piqp.Status.PIQP_DUAL_INFEASIBLE,
            self._solver.result.info.primal_obj,
        )


class _Pattern:
    """A sparse matrix of blocks, one below the other and each so many columns further right, whose numbers change."""

    def __init__(self, blocks: list[np.ndarray], down: int, right: int, width: int = 0):
        rows, columns, source, place = [], [], [], 0
        for k, block in enumerate(blocks):
            row, column = np.nonzero(block)
            rows.append(row + k * down)
            columns.append(column + k * right)
            source.append(place + np.flatnonzero(block.ravel()))
            place += block.size
        row, column, source = (np.concatenate([*part, np.zeros(0, int)]) for part in (rows, columns, source))
        shape = (
            down * (len(blocks) - 1) + len(blocks[-1]) if blocks else 0,
            width or int(column.max(initial=-1)) + 1,
        )
        numbered = sparse.csc_matrix((np.arange(1.0, source.size + 1), (row, column)), shape=shape)
        self._order = source[numbered.data.astype(int) - 1]
        self._matrix = numbered

    def filled(self, values: list[np.ndarray]) -> sparse.csc_matrix:
        """The matrix with the numbers of all blocks, row by row."""
        self._matrix.data[:] = np.concatenate(values)[self._order]
        return self._matrix
