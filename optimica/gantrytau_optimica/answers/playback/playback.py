"""An optimum played back: its inputs drive the model anew, and limits and ends are looked at between the nodes."""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from gantrytau import ModelError, Result
from gantrytau.simulation.to_result import labels
from gantrytau_optimica.answers.playback.replay import Replayed, replay
from gantrytau_optimica.answers.program_answer import ProgramAnswer
from gantrytau_optimica.control.control_problem import ControlProblem, Limit, Phase


@dataclass(frozen=True)
class Violation:
    """By how much a limit is passed at worst, in its unit, when in s, and its range (upper - lower, or its size)."""

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


@dataclass(frozen=True, eq=False)
class Playback:
    """What happens if the inputs of an optimum drive the model.

    phases: states and algebraics integrated anew, by name; violations: all limits along the motion, the worst first;
    defects: all conditions at single times; objective: of the motion as played; multipliers: of the conditions.
    """

    optimum: ProgramAnswer
    phases: dict[str, Replayed]
    violations: tuple[Violation, ...]
    defects: tuple[Defect, ...]
    objective: float
    objective_error: float

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
        return Result(played.times[keep], table, units=units, descriptions=words, title=title)

    def __getitem__(self, name: str) -> np.ndarray:
        """A variable along the motion as played, over `result.time`."""
        return self.result[name]

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
        worst = sorted(self.defects, key=lambda d: -abs(d.amount))
        lines += [f"`{d.name}` is missed by {abs(d.amount):.3g}" for d in worst[:4] if abs(d.amount) > 1e-12]
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


def play_back(optimum: ProgramAnswer) -> Playback:
    """Integrate the model with the inputs of an optimum, and look at all limits and conditions."""
    problem = optimum.built.problem
    phases = {name: replay(optimum.built, t) for name, t in optimum.phases.items()}
    violations = [v for played in phases.values() for v in _violations(problem, played)]
    objective, defects, error = _at_points(optimum, list(phases.values()))
    ranked = tuple(sorted(violations, key=lambda v: -v.relative))
    return Playback(optimum, phases, ranked, tuple(defects), objective, error)


def limits_of(phase: Phase) -> list[Limit]:
    """All limits along a phase: those of the user and of the model, and those of algebraics by themselves."""
    own = [
        Limit(s.symbol, s.min, s.max, s.words or s.name)
        for s in phase.algebraics
        if np.isfinite(s.min) or np.isfinite(s.max)
    ]
    return [*phase.path_limits, *own]


def range_of(limit: Limit, values: np.ndarray) -> float:
    """The range of a limit: between its two sides, else the size of what it limits."""
    if np.isfinite(limit.lower) and np.isfinite(limit.upper) and limit.upper > limit.lower:
        return limit.upper - limit.lower
    bound = limit.lower if np.isfinite(limit.lower) else limit.upper
    sizes = [abs(bound), float(np.max(np.abs(values), initial=0.0))]
    return max(*sizes, 1e-12) if np.all(np.isfinite(sizes)) else max(abs(bound), 1.0)


def _violations(problem: ControlProblem, played: Replayed) -> list[Violation]:
    phase, found = played.trajectory.phase, []
    limits = limits_of(phase)
    if not limits:
        return []
    rows = played.values(ca.vertcat(*(limit.expression for limit in limits)))
    for limit, row in zip(limits, rows, strict=True):
        amount = np.maximum(limit.lower - row, row - limit.upper)
        amount = np.where(np.isfinite(amount), amount, -np.inf)
        worst = int(np.argmax(amount))
        size = max(float(amount[worst]), 0.0)
        found.append(
            Violation(limit.name, phase.name, size, float(played.times[worst]), range_of(limit, row))
        )
    return found


def _at_points(optimum: ProgramAnswer, phases: list[Replayed]) -> tuple[float, list[Defect], float]:
    """Objective as played, defects of the conditions, and the error of the objective that follows from both."""
    problem, program, solution = optimum.built.problem, optimum.program, optimum.solution
    symbols, values = [problem.numbers], [ca.DM(phases[0].trajectory.numbers)]
    running = 0.0
    for phase, played in zip(problem.phases, phases, strict=True):
        for point in phase.points:
            symbols.append(point.symbol)
            when = np.array([played.trajectory.moment(point.time)])
            values.append(ca.DM(played.at(point.expression, when)[:, 0]))
        sums: dict[int, float] = {}
        for one in phase.sums:
            error = (played.at(one.expression, one.times, after=True)[0] - one.values) / one.deviations
            key = one.symbol.element_hash()
            sums[key] = sums.get(key, 0.0) + float(error @ error)
        for key, one in {s.symbol.element_hash(): s for s in phase.sums}.items():
            symbols.append(one.symbol)
            values.append(ca.DM(sums[key]))
        running += _running(played)
    rows = ca.vertcat(problem.objective, *(limit.expression for limit in problem.boundary))
    found = np.array(ca.Function("points", symbols, [ca.densify(rows)])(*values)).ravel()
    defects = []
    error = found[0] + running - solution.objective
    count = len(problem.boundary)
    multipliers = solution.multipliers[program.assembled.rows - count :]
    for limit, value, multiplier in zip(problem.boundary, found[1:], multipliers, strict=True):
        amount = value - limit.upper if value > limit.upper else min(value - limit.lower, 0.0)
        defects.append(Defect(limit.name, float(amount), _size(problem, limit)))
        error += multiplier * amount
    return float(found[0] + running), defects, float(error)


def _size(problem: ControlProblem, limit: Limit) -> float:
    """The typical size of what a condition compares: of the signals in it, or its bounds."""
    leaves = {leaf.element_hash() for leaf in ca.symvar(limit.expression)}
    inside = [
        p.expression for p in problem.points if any(e.element_hash() in leaves for e in p.symbol.elements())
    ]
    names = {leaf.element_hash() for e in inside for leaf in ca.symvar(e)}
    sizes = [s.nominal for s in problem.signals if s.symbol.element_hash() in names]
    sizes += [abs(b) for b in (limit.lower, limit.upper) if np.isfinite(b) and b != 0.0]
    return max(sizes, default=1.0)


def _running(played: Replayed) -> float:
    """The integral of the integrand and the penalties on steps, as played."""
    layout, w = played.trajectory.layout, played.trajectory.w
    cost = 0.0
    if not layout.phase.integrand.is_zero():
        cost = float(played.integral(layout.phase.integrand)[0])
    for signal, chain in layout.chains.items():
        penalty = layout.phase.signals[signal].pieces.step_penalty
        cost += penalty * float(np.sum(np.diff(w[chain]) ** 2))
    return cost
