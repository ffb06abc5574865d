"""An optimum played back: its inputs drive the model anew, and limits and ends are looked at between the nodes."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from gantrytau import ModelError, Result, heeding_interrupts
from gantrytau.describing.record import Record
from gantrytau.simulation.to_result import displays, labels
from gantrytau_optimica.answers.playback.ranges import FLAT, condition_sizes, magnitude, measured
from gantrytau_optimica.answers.playback.replay import Replayed, replay
from gantrytau_optimica.answers.program_answer import ProgramAnswer
from gantrytau_optimica.control.control_problem import ControlProblem, PointValue


@dataclass(frozen=True)
class Violation:
    """By how much a limit is passed at worst, in its unit, when in s, and its range (upper - lower, or what it compares)."""

    name: str
    phase: str
    amount: float
    time: float
    range: float

    @property
    def relative(self) -> float:
        """The amount over the range."""
        return self.amount / self.range


@dataclass(frozen=True)
class Defect:
    """By how much a condition on values at single times is missed, in its unit, and the size of what it is about."""

    name: str
    amount: float
    size: float

    @property
    def relative(self) -> float:
        """The amount, signs aside, over the size."""
        return abs(self.amount) / self.size


@dataclass(frozen=True, eq=False)
class Playback(Record):
    """What happens if the inputs of an optimum drive the model.

    phases: states and algebraics integrated anew, by name; violations: all limits along the motion, the worst first;
    defects: all conditions at single times; objective: of the motion as played; objective_size: what is small for it.
    """

    optimum: ProgramAnswer
    phases: dict[str, Replayed]
    violations: tuple[Violation, ...]
    defects: tuple[Defect, ...]
    objective: float
    objective_error: float
    objective_size: float

    @property
    def complete(self) -> bool:
        """Whether the integration came to the end of every phase."""
        return all(phase.complete for phase in self.phases.values())

    @property
    def violation(self) -> float:
        """The largest violation of a limit relative to its range."""
        return max((v.relative for v in self.violations), default=0.0)

    @property
    def defect(self) -> float:
        """The largest defect of a condition, in the unit of its own."""
        return max((abs(d.amount) for d in self.defects), default=0.0)

    @cached_property
    def result(self) -> Result:
        """All variables of the model along the motion as played; only where there is one phase."""
        if len(self.phases) > 1:
            names = ", ".join(f"'{name}'" for name in self.phases)
            raise ModelError(
                f"{self.optimum.name} has phases with times of their own; ask one of .phases[...]: {names}"
            )
        dae, (played,) = self.optimum.dae, self.phases.values()
        names = list(dae.variables)
        rows = played.values(self.optimum.built.expressed(names))
        keep = np.concatenate([np.diff(played.times) > 0, [True]])
        units, words = labels(dae)
        table = dict(zip(names, rows[:, keep], strict=True))
        title = f"{self.optimum.name}, played back"
        own: dict[str, Any] = dict(title=title, shapes=dae.flat.shapes, displays=displays(dae))
        return Result(played.times[keep], table, units=units, descriptions=words, **own)

    def __getitem__(self, name: str) -> np.ndarray:
        """A variable along the motion as played, over `result.time`."""
        return self.result[name]

    def _ipython_key_completions_(self) -> list[str]:
        return self.result._ipython_key_completions_()

    def lines(self) -> list[str]:
        """The verdict in sentences."""
        if not self.complete:
            lost = next(phase for phase in self.phases.values() if not phase.complete)
            when = lost.times[np.flatnonzero(~np.isfinite(lost.x[..., 0].ravel()))[0]] if lost.x.size else 0.0
            return [f"it cannot be integrated beyond t = {when:.4g} s"]
        lines = []
        for violation in [v for v in self.violations if v.relative > 1e-9][:4]:
            lines.append(
                f"`{violation.name}` is passed by {violation.amount:.3g} ({violation.relative:.2g} of its range) at t = "
                f"{violation.time:.4g} s"
            )
        if not lines:
            lines.append("all limits hold between the nodes as well")
        worst = sorted(self.defects, key=lambda d: -d.relative)
        lines += [f"`{d.name}` is missed by {abs(d.amount):.3g}" for d in worst[:4] if d.relative > 1e-12]
        lines.append(
            f"the objective becomes {self.objective:.8g}; its estimated error is {self.objective_error:.2g}"
        )
        return lines

    def __repr__(self) -> str:
        return (
            f"<Playback of {self.optimum.name}: limits passed by {self.violation:.2g} of their range, conditions missed by "
            f"{self.defect:.2g}>"
        )

    def __str__(self) -> str:
        return "\n".join(["Played back:", *(f"  {line}" for line in self.lines())])


@heeding_interrupts()
def play_back(optimum: ProgramAnswer) -> Playback:
    """Integrate the model with the inputs of an optimum, and look at all limits and conditions."""
    phases = {name: replay(optimum.built, t) for name, t in optimum.phases.items()}
    violations = [v for played in phases.values() for v in _violations(played)]
    objective, summed, defects, error = _at_points(optimum, list(phases.values()))
    ranked = tuple(sorted(violations, key=lambda v: -v.relative))
    size = max(abs(objective), FLAT * summed)
    return Playback(optimum, phases, ranked, tuple(defects), objective, error, size)


def _violations(played: Replayed) -> list[Violation]:
    phase, found = played.trajectory.phase, []
    for limit, row, size in measured(played.trajectory, played.values):
        amount = np.maximum(limit.lower - row, row - limit.upper)
        amount = np.where(np.isfinite(amount), amount, -np.inf)
        worst = int(np.argmax(amount))
        passed = max(float(amount[worst]), 0.0)
        found.append(Violation(limit.name, phase.name, passed, float(played.times[worst]), size))
    return found


def _at_points(optimum: ProgramAnswer, phases: list[Replayed]) -> tuple[float, float, list[Defect], float]:
    """Objective as played, that with all its terms positive, defects of the conditions, and the error of the objective
    that follows from both.
    """
    problem, program, solution = optimum.built.problem, optimum.program, optimum.solution
    symbols, values, sizes = [problem.numbers], [ca.DM(phases[0].trajectory.numbers)], []
    sizes.append(ca.fabs(values[0]))
    running = np.zeros(2)
    for phase, played in zip(problem.phases, phases, strict=True):
        for point in phase.points:
            when = np.array([played.trajectory.moment(point.time)])
            both = [point.expression, *(magnitude(e) for e in point.expression.elements())]
            found = played.at(ca.vertcat(*both), when)[:, 0]
            symbols.append(point.symbol)
            values.append(ca.DM(found[: point.symbol.numel()]))
            sizes.append(ca.DM(found[point.symbol.numel() :]))
        for symbol, total in _sums(played):
            symbols.append(symbol)
            values.append(ca.DM(total[0]))
            sizes.append(ca.DM(total[1]))
        running += _running(played)
    rows = ca.vertcat(problem.objective, *(limit.expression for limit in problem.boundary))
    found = np.array(ca.Function("points", symbols, [ca.densify(rows)])(*values)).ravel()
    summed = float(ca.Function("sizes", symbols, [magnitude(problem.objective)])(*sizes)) + running[1]
    defects = []
    error = found[0] + running[0] - solution.objective
    count = len(problem.boundary)
    multipliers = solution.multipliers[program.assembled.rows - count :]
    small = _condition_sizes(problem, phases)
    for limit, value, multiplier, size in zip(problem.boundary, found[1:], multipliers, small, strict=True):
        amount = value - limit.upper if value > limit.upper else min(value - limit.lower, 0.0)
        defects.append(Defect(limit.name, float(amount), float(size)))
        error += multiplier * amount / limit.size
    return float(found[0] + running[0]), float(summed), defects, float(error)


def _sums(played: Replayed) -> list[tuple[ca.SX, np.ndarray]]:
    """Sums of squares over samples as played, and what they would be if nothing in them cancelled, by their symbols."""
    totals: dict[int, tuple[ca.SX, np.ndarray]] = {}
    for one in played.trajectory.phase.sums:
        found = played.at(ca.vertcat(one.expression, magnitude(one.expression)), one.times, after=True)
        rows = np.array([found[0] - one.values, found[1] + np.abs(one.values)]) / one.deviations
        symbol, total = totals.get(one.symbol.element_hash(), (one.symbol, np.zeros(2)))
        totals[one.symbol.element_hash()] = (symbol, total + np.sum(rows**2, axis=1))
    return list(totals.values())


def _condition_sizes(problem: ControlProblem, phases: list[Replayed]) -> np.ndarray:
    """What is small for the conditions at single times, (k,), by the solution."""

    def values(number: int, point: PointValue, expressions: ca.SX) -> np.ndarray:
        trajectory = phases[number].trajectory
        return trajectory.values(expressions, np.array([trajectory.moment(point.time)]))[:, 0]

    return condition_sizes(problem, phases[0].trajectory.numbers, values)


def _running(played: Replayed) -> np.ndarray:
    """The integral of the integrand and the penalties on steps, as played; and with all their terms positive, (2,)."""
    layout, w = played.trajectory.layout, played.trajectory.w
    integrand, cost = layout.phase.integrand, np.zeros(2)
    if not integrand.is_zero():
        cost += played.integral(ca.vertcat(integrand, magnitude(integrand)))
    for signal, chain in layout.chains.items():
        penalty = layout.phase.signals[signal].pieces.step_penalty
        cost += penalty * float(np.sum(np.diff(w[chain]) ** 2))
    return cost
