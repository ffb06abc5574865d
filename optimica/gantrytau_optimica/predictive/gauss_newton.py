"""Gauss-Newton's method for the plan of a horizon: linearised, its quadratic program solved, the plan changed."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gantrytau_optimica.predictive.compiled_horizon import CompiledHorizon
from gantrytau_optimica.predictive.first_plan import FirstPlan
from gantrytau_optimica.predictive.horizon_qp import Found, HorizonProgram, Stage
from gantrytau_optimica.predictive.moves import Moves
from gantrytau_optimica.predictive.plan import PlannedMotion
from gantrytau_optimica.predictive.stages import HorizonStages, Linear
from gantrytau_optimica.predictive.terminal import SteadyState, Terminal

STANDS = 1e-6  # changes of scaled inputs and states where iterations end; flat parts of a program are not solved better
NEAR = 1e-2  # such changes, after which a first plan is good enough for a controller that goes on from it
AWAY = 10.0  # times the least change: there iterations lead away again


@dataclass(frozen=True, eq=False)
class Iterated:
    """A plan after some iterations, whether its programs were solved, or had no bound, the last change of inputs and states,
    and the largest slack of soft limits (N,).
    """

    plan: PlannedMotion
    solved: bool
    change: float
    slack: np.ndarray
    unbounded: bool = False

    @property
    def near(self) -> bool:
        """Whether it is one that steps of later samples improve."""
        return self.solved and self.change < NEAR

    @property
    def stands(self) -> bool:
        """Whether the last iteration changed nothing any more."""
        return self.solved and self.change < STANDS


@dataclass(frozen=True, eq=False)
class Loaded:
    """missed: how far the unknowns of a plan are from solving their equations; linear: None in machine code."""

    missed: float
    linear: Linear | None = None


def failed(plan: PlannedMotion, unbounded: bool = False) -> Iterated:
    """A plan from which no iteration leads on."""
    return Iterated(plan, False, math.inf, np.zeros(len(plan.u)), unbounded)


class GaussNewton:
    """Iterations for the plans of a horizon of so many stages; its program is the one that `load` has loaded last.

    soft (rows,): which slack a limit of a stage has, -1 for none; penalty: of slacks. applied (nu,): the inputs applied now,
    scaled; code: the same in machine code, which solves its programs by another method.
    """

    def __init__(
        self,
        stages: HorizonStages,
        elements: int,
        soft: np.ndarray,
        penalty: float,
        moves: Moves,
        steady: SteadyState | None,
    ):
        self.stages, self.elements, self.soft, self.penalty = stages, elements, soft, penalty
        self.moves, self.steady, self.terminal = moves, steady, Terminal(stages)
        self.period = stages.step
        self.code: CompiledHorizon | None = None
        self.reset()
        nx = stages.nx + (stages.nu if moves.wanted else 0)
        limits = np.isfinite([moves.lower, moves.upper])[:, moves.limited]
        finite = np.hstack([np.isfinite(stages.rows), limits])
        rows = np.append(soft, np.full(limits.shape[1], -1))
        self._program = HorizonProgram(elements, nx, stages.nu, rows, finite, penalty, size=stages.curvature)

    def reset(self) -> None:
        """No inputs are applied yet."""
        self.applied = np.clip(np.zeros(self.stages.nu), self.stages.lower_u, self.stages.upper_u)

    def load(self, plan: PlannedMotion) -> Loaded | None:
        """The horizon linearised at a plan, its program loaded; None where a number is not finite."""
        if self.code is not None and (missed := self.code.load(plan, self.applied)) >= 0.0:
            return Loaded(missed)
        linear = self._linear(plan)
        return None if linear is None else Loaded(float(np.abs(linear.w[:, :, 0]).max()), linear)

    def _linear(self, plan: PlannedMotion) -> Linear | None:
        """The horizon linearised at a plan, its program loaded; None where a number is not finite."""
        stages, times = self.stages, plan.t + self.period * np.arange(self.elements)
        linear = stages.finite(plan.x[:-1], plan.w, plan.u, times)
        if linear is None:
            return None
        (lower, upper), (H, g) = stages.rows, self.terminal.added(linear, plan)
        P, p = np.zeros((stages.nx, stages.nx)), np.zeros(stages.nx)
        if self.steady is not None:
            P, rest = self.steady.at(plan.t + self.elements * self.period, plan.x[-1])
            p = P @ (plan.x[-1] - rest)
        stage = Stage(
            H, g, linear.A, linear.B, linear.b - plan.x[1:], linear.C, linear.D, lower - linear.r, upper - linear.r,
            stages.lower_u - plan.u, stages.upper_u - plan.u,
        )  # fmt: skip
        if self.moves.wanted:
            stage = self.moves.added(stage, plan.u, self.applied)
            P, p = np.pad(P, (0, stages.nu)), np.append(p, np.zeros(stages.nu))
        self._program.load(stage, P, p)
        return linear

    def _solved(self, plan: PlannedMotion, x: np.ndarray) -> Found:
        """What the loaded program says from a state (nx,)."""
        first, added = x - plan.x[0], self.moves.wanted
        found = self._program.solve(np.append(first, np.zeros(self.stages.nu)) if added else first)
        return self.moves.removed(found, plan.u, self.applied) if added else found

    def improved(self, plan: PlannedMotion, loaded: Loaded | None, x: np.ndarray, most: int) -> Iterated:
        """A plan after at most so many full steps; loaded: at the plan, by the last call of `load`."""
        found = failed(plan)
        for k in range(most):
            found = self._changed(found.plan, self.load(found.plan) if k else loaded, x)
            if not found.solved or found.stands:
                break
        return found

    def _changed(self, plan: PlannedMotion, loaded: Loaded | None, x: np.ndarray) -> Iterated:
        """A plan after a full step."""
        linear = None if loaded is None else loaded.linear
        if loaded is not None and linear is None and self.code is not None:
            changed, change, slack = self.code.changed(plan, x)
            if change >= 0.0:
                return Iterated(changed, True, change, slack)
            linear = self._linear(plan)  # the other solver has the last word
        if linear is None:
            return failed(plan)
        found = self._solved(plan, x)
        if not found.solved:
            return failed(plan, found.unbounded)
        # inputs at their limits stand before states do
        change = float(max(np.abs(found.u).max(), np.abs(found.x).max()))
        return Iterated(plan.changed(linear, found), True, change, found.slack)

    def begun(self, plan: PlannedMotion, x: np.ndarray, most: int, ipopt: bool) -> Iterated:
        """A first plan: that of the full step, of at most so many, that changes least, or Ipopt's where all change much."""
        full = best = failed(plan)
        for _ in range(most):
            full = self._changed(full.plan, self.load(full.plan), x)
            best = full if full.change < best.change else best
            if not full.solved or best.stands or (best.near and full.change > AWAY * best.change):
                break
        if best.near or full.unbounded or not ipopt:
            return best if best.near else full
        found = self.globalised(plan, x)
        return found if found.solved else full

    def globalised(self, plan: PlannedMotion, x: np.ndarray) -> Iterated:
        """The plan by Ipopt, from a guess from which full steps may lead further off."""
        stages = self.stages
        P, rest = np.zeros((stages.nx, stages.nx)), np.zeros(stages.nx)
        if self.steady is not None:
            P, rest = self.steady.at(plan.t + self.elements * self.period, plan.x[-1])
        found, slack, solved = self._first.solved(plan, x, self.applied, P, rest)
        return Iterated(found, True, 0.0, slack) if solved else failed(found)

    @cached_property
    def _first(self) -> FirstPlan:
        return FirstPlan(self.stages, self.elements, self.soft, self.penalty, self.moves, self.terminal)
