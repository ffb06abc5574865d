"""What would have to give for a problem without solution: which conditions, by how much, and when."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from gantrytau.describing.record import Record
from gantrytau_optimica.control.built import Built
from gantrytau_optimica.control.control_problem import FreeNumber
from gantrytau_optimica.failures.constraint_labels import Meanings, intervals
from gantrytau_optimica.failures.elastic import Elastic, Soft, soft_conditions
from gantrytau_optimica.solving.ipopt import WORDS, Solution
from gantrytau_optimica.transcription.program import Program, first_guess
from gantrytau_optimica.transcription.trajectory import Trajectory
from gantrytau_optimica.transcription.transcribe import transcribed_again

SMALL = 1e-6  # of its size: what gives way by less holds
SINGLE = 4  # conditions that are tried alone
MODERATE = 20000  # unknowns up to which the answer is looked for without being asked for


@dataclass(frozen=True)
class Concession:
    """A condition that gives way by `amount`, in `unit`: name as written; when: words for the times at which it is used."""

    name: str
    amount: float
    unit: str
    when: str
    share: float  # of its typical size

    def __str__(self) -> str:
        when = f" {self.when}" if self.when else ""
        return f"`{self.name}` gave way by {self.amount:.3g}{' ' + self.unit if self.unit else ''}{when}"


@dataclass(frozen=True, eq=False)
class Relaxed(Record):
    """What would have to give: ways, each of conditions that yield together, fewest conditions first.

    found: whether there is an answer; ways is empty where all conditions can be met together. solution: the unknowns of
    the cheapest motion.
    """

    ways: tuple[tuple[Concession, ...], ...]
    found: bool
    solution: Solution

    def __str__(self) -> str:
        if not self.found:
            return "What would have to give was not found."
        if not self.ways:
            return (
                "All limits and conditions can be met together; solve again with guess=error.optimum.nearest."
            )
        ways = [" and ".join(map(str, way)) for way in self.ways]
        return "It could be solved if " + ";\n  or if ".join(ways) + "."


def worth_relaxing(program: Program, solution: Solution) -> bool:
    """Whether to look for what would have to give without being asked: nothing was found, and it takes seconds."""
    words = (WORDS["Infeasible_Problem_Detected"], WORDS["Restoration_Failed"])
    return solution.status in words and program.places.size <= MODERATE


def relax(built: Built, program: Program, solution: Solution, seconds: float = 5.0) -> Relaxed:
    """The least that would have to give, sought from where `solution` ended, and from the guess; seconds: of computing."""
    end = time.process_time() + seconds
    guess = first_guess(program)
    softs = soft_conditions(program, guess)
    elastic = Elastic(program, softs)
    starts = [w for w in (solution.w, guess) if np.all(np.isfinite(w)) and np.max(np.abs(w)) < 1e10]
    for start in starts:
        found = elastic.solve(start, range(len(softs)), end)
        if found is not None:
            break
    else:
        return Relaxed((), False, solution)
    w, yields, duals = found
    unsolved = replace(
        solution, w=w, constraints=np.array(program.assembled.nlp(w / program.places.scale, [])[1]).ravel()
    )
    first = [k for k in np.argsort(-yields) if yields[k] > SMALL]
    if not first:
        return Relaxed((), True, unsolved)
    ways = [(_Way(tuple(first), yields, w))]
    helpful = [k for k in np.argsort(-duals) if duals[k] > 1e-3 * softs[k].price and [k] != first]
    for k in helpful[:SINGLE]:
        single = elastic.solve(w, [k], end)
        if single is not None and SMALL < single[1][k] < 1e3:
            ways.append(_Way((k,), single[1], single[0]))

    def price(way: _Way) -> float:
        return sum(softs[k].price * way.yields[k] for k in way.which)

    alone = [way for way in ways if len(way.which) == 1]
    # one condition is easier to discuss than several, unless these are clearly cheaper
    ways = [way for way in ways if way in alone or not alone or price(way) < 0.9 * min(map(price, alone))]
    ways.sort(key=lambda way: (len(way.which), price(way)))
    conceded = [_concessions(built, program, softs, way) for way in ways]
    longer = _other_duration(program, w, end)
    return Relaxed((*conceded, *([(longer,)] if longer else [])), True, unsolved)


def _other_duration(program: Program, w: np.ndarray, end: float) -> Concession | None:
    """The nearest final time, where it is a fixed number, at which all other conditions hold; None if there is none."""
    problem = program.problem
    phase, *others = problem.phases
    fixed = phase.start_time.is_constant() and phase.final_time.is_constant()
    if (
        others
        or not fixed
        or phase.courses
        or phase.sums
        or any(not isinstance(p.time, str) for p in phase.points)
    ):
        return None
    start, stop = float(phase.start_time), float(phase.final_time)
    symbol, span = ca.SX.sym("final_time"), stop - start
    number = FreeNumber("final_time", symbol, start + 1e-3 * span, start + 1e3 * span, stop)
    changed = replace(problem, phases=(replace(phase, final_time=symbol),), free=(*problem.free, number))
    variant = transcribed_again(program, changed)
    place = len(problem.free)
    name = f"final_time = {stop:g}"
    scale, where, never = variant.places.scale[place], np.array([place]), np.array([np.nan])
    soft = Soft(name, False, where, stop, stop, span, scale, 1.0, never, -1)
    found = Elastic(variant, [soft]).solve(np.insert(w, place, stop), [0], end)
    if found is None or found[1][0] < SMALL:
        return None
    return Concession(name, float(found[1][0] * span), "s", f"to {found[0][place]:.4g} s", float(found[1][0]))


@dataclass(frozen=True, eq=False)
class _Way:
    which: tuple[int, ...]
    yields: np.ndarray
    w: np.ndarray


def _concessions(built: Built, program: Program, softs: Sequence[Soft], way: _Way) -> tuple[Concession, ...]:
    numbers = way.w[program.places.free]
    phases = [Trajectory(program.problem, layout, way.w, numbers) for layout in program.places.layouts]
    units = Meanings(built, program, phases).units
    rows = np.array(program.assembled.nlp(way.w / program.places.scale, [])[1]).ravel()
    found = []
    for k in way.which:
        soft, amount = softs[k], way.yields[k] * softs[k].size
        value = rows[soft.where] * soft.scale if soft.of_rows else way.w[soft.where]
        used = np.maximum(soft.lower - value, value - soft.upper) > 0.99 * amount
        timed = soft.phase >= 0 and not np.isnan(soft.moments).any()
        when = intervals(used, phases[soft.phase].times(soft.moments)) if timed else ""
        unit = units.get(soft.name, units.get(soft.name.split(" of ", 1)[-1], ""))
        found.append(Concession(soft.name, float(amount), unit, when, float(way.yields[k])))
    return tuple(found)
