"""What a predictive controller plans, and what its steps take."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import casadi as ca
import numpy as np

from gantrytau import Result
from gantrytau.describing.record import Record
from gantrytau.simulation.to_result import displays, labels
from gantrytau_optimica.answers.answer import Answer
from gantrytau_optimica.control.built import Built
from gantrytau_optimica.control.control_problem import Signal
from gantrytau_optimica.predictive.horizon_qp import Found
from gantrytau_optimica.predictive.stages import NODES, HorizonStages, Linear

Status = Literal["solved", "not converged", "late", "lost", "failed"]
APART = 1e3  # times a measured state at which a plan begins that an outlier has spoilt


@dataclass(frozen=True)
class StepTimes(Record):
    """What steps took, in s. preparation: before a measurement; step: from a measurement to its inputs; missed: how many
    steps were later than the deadline.
    """

    preparation: tuple[float, ...]
    step: tuple[float, ...]
    missed: int

    @property
    def median(self) -> float:
        """Of the steps, s."""
        return self.share(50)

    @property
    def worst(self) -> float:
        """Of the steps, s."""
        return max(self.step, default=math.nan)

    def share(self, percent: float) -> float:
        """The time in s that so many percent of the steps do not exceed; NaN before the first."""
        return float(np.percentile(self.step, percent)) if self.step else math.nan

    def __str__(self) -> str:
        named = {"median": self.median, "95 %": self.share(95), "99 %": self.share(99), "worst": self.worst}
        said = ", ".join(f"{word} {1e3 * t:.3g} ms" for word, t in named.items())
        return f"{len(self.step)} steps: {said}; {self.missed} missed the deadline"


@dataclass(frozen=True, eq=False)
class PlannedMotion:
    """A plan in scaled variables: nodes x (N + 1, nx), unknowns of stages w (N, nw), inputs u (N, nu), from time t in s."""

    x: np.ndarray
    w: np.ndarray
    u: np.ndarray
    t: float

    def changed(self, linear: Linear, found: Found, share: float = 1.0) -> "PlannedMotion":
        """The plan after a step of Gauss-Newton's method, or a share of it."""
        v = np.concatenate([np.ones((len(self.u), 1)), found.x[:-1], found.u], axis=1)
        w = self.w + share * np.einsum("nij,nj->ni", linear.w, v)
        return PlannedMotion(self.x + share * found.x, w, self.u + share * found.u, self.t)

    def without_stages(self) -> "PlannedMotion":
        """The plan with the unknowns of its last stage alone, to be kept."""
        return replace(self, w=self.w[-1:].copy())

    def near(self, missed: float, x: np.ndarray) -> bool:
        """Whether it can go on from a state (nx,): its unknowns miss their equations by little, beside what they are, and it
        begins not far beyond the state.
        """
        begin, given = (np.abs(one).max(initial=0.0) for one in (self.x[0], x))
        return bool(missed < 1.0 + np.abs(self.w).max(initial=0.0) and begin < APART * (1.0 + given))

    def shifted(self, t: float, period: float) -> "PlannedMotion":
        """The plan from time t on, whole periods later; its last stage is repeated."""
        n = len(self.u)
        by = min(max(round((t - self.t) / period), 0), n)
        rest = np.minimum(np.arange(n) + by, n - 1)
        nodes = np.minimum(np.arange(n + 1) + by, n)
        return PlannedMotion(self.x[nodes], self.w[rest], self.u[rest], t)


def first_plan(stages: HorizonStages, elements: int, x: np.ndarray, t: float) -> PlannedMotion:
    """The state at rest, inputs at zero or the limit next to it."""
    z = np.array([s.guess(np.zeros(1))[0] for s in stages.phase.algebraics]) / stages.sizes_z
    u = np.clip(np.zeros((elements, stages.nu)), stages.lower_u, stages.upper_u)
    return PlannedMotion(np.tile(x, (elements + 1, 1)), np.tile(np.append(x, z), (elements, 2)), u, t)


def guessed_plan(
    stages: HorizonStages, plan: PlannedMotion, guess: Mapping[str, Any] | Result | Answer
) -> PlannedMotion:
    """A plan with signals as a guess has them: an answer, or name -> number or function of time."""
    n, each = len(plan.u), stages.nx + stages.nz
    times = plan.t + stages.step * np.arange(n + 1)

    def row(signal: Signal, at: np.ndarray, default: np.ndarray) -> np.ndarray:
        if not isinstance(guess, Mapping):
            return np.interp(at, guess.time, guess[signal.name]) / signal.nominal
        if signal.name not in guess:
            return default
        value = guess[signal.name]
        found = value(at) if isinstance(value, Callable) else value
        return np.broadcast_to(np.asarray(found, dtype=float), at.shape) / signal.nominal

    phase, x, w, u = stages.phase, plan.x.copy(), plan.w.copy(), plan.u.copy()
    for k, signal in enumerate(phase.states):
        x[:, k] = row(signal, times, x[:, k])
    for k, signal in enumerate(phase.inputs):
        u[:, k] = row(signal, times[:-1] + stages.step / 2, u[:, k])
    for i, place in enumerate(NODES):
        for k, signal in enumerate((*phase.states, *phase.algebraics)):
            w[:, i * each + k] = row(signal, times[:-1] + place * stages.step, w[:, i * each + k])
    return replace(plan, x=x, w=w, u=np.clip(u, stages.lower_u, stages.upper_u))


def motion_result(
    built: Built,
    stages: HorizonStages,
    motion: PlannedMotion,
    period: float,
    title: str,
    ahead: float = 0.0,
    told: Mapping[str, np.ndarray] | None = None,
) -> Result:
    """All variables of a model at the samples of a motion, its inputs held; those of `ahead` s later than each sample.
    told: variables that are known from elsewhere.

    Algebraic variables are those at the end of the period before, with its inputs.
    """
    names, each = list(built.read.dae.variables), stages.nx + stages.nz
    last = motion.w[:, each:] * stages.size_w[:each]
    z = np.vstack([motion.w[:1, stages.nx : each] * stages.sizes_z, last[:, stages.nx :]])
    u = np.vstack([motion.u, motion.u[-1:]]) * stages.sizes_u
    signals = np.hstack([motion.x * stages.sizes_x, z, u])
    times = motion.t + period * np.arange(len(motion.x))
    phase = stages.phase
    symbols = [ca.vertcat(*(s.symbol for s in phase.signals)), stages.problem.time]
    symbols.append(ca.vertcat(ca.SX(0, 1), *(c.symbol for c in phase.courses)))
    named = ca.Function("variables", symbols, [ca.densify(built.expressed(names))])
    later = times + ahead
    values = np.asarray(named(signals.T, later[None, :], stages.course_values(later)))
    units, words = labels(built.read.dae)
    own: Any = dict(units=units, descriptions=words, title=title, shapes=built.read.dae.flat.shapes)
    own |= dict(held=[s.name for s in phase.inputs], displays=displays(built.read.dae))
    return Result(times, dict(zip(names, values, strict=True)) | dict(told or {}), **own)
