"""An optimum with more parameters held as unknowns of its program, carried over instead of being solved again."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from gantrytau import SolveError
from gantrytau_optimica.answers.optimum import Optimum
from gantrytau_optimica.control.build import build
from gantrytau_optimica.control.built import Built
from gantrytau_optimica.control.control_problem import Limit
from gantrytau_optimica.solving.ipopt import Solution, Solver, SolverSettings, objective_size
from gantrytau_optimica.studies.kkt import stationarity
from gantrytau_optimica.transcription.program import Program, first_guess
from gantrytau_optimica.transcription.transcribe import transcribed_again

SAME = 1e-6  # relative: within it two objectives are those of one solution
STATIONARY = 1e-6  # gradient of the Lagrangian relative to its terms, a hundred times Ipopt's tolerance


def holding(optimum: Optimum, missing: Sequence[str]) -> Optimum:
    """The same optimum with more parameters held, at the values they have."""
    old, program = optimum.built, optimum.program
    values = optimum.numbers
    held = [n.name for n in program.problem.free if n.held]
    pieces = {s.name: s.pieces for phase in program.problem.phases for s in phase.inputs}
    built = _same_sizes(build(old.read, {}, [*held, *missing], pieces, old.causality), old, values)
    located = np.array([n.guess for n in built.problem.free])
    borders = [layout.placed(optimum.solution.w).borders for layout in program.places.layouts]
    new = transcribed_again(program, built.problem, located=(located, borders))
    w = _unknowns(program, new, optimum.solution.w)
    solution = _carried(program, new, optimum.solution, w)
    if solution is None:  # limits with the parameters are rows of their own now, or constants are none
        solution = Solver(new, SolverSettings()).solve(new, w)
    found = replace(optimum, built=built, program=new, solution=solution)
    size = max(abs(optimum.objective), objective_size(new))
    if not found.success or abs(found.objective - optimum.objective) > SAME * size:
        raise SolveError(
            f"{optimum.name}: with {', '.join(missing)} held it {found.status}, objective {found.objective:.8g} instead of "
            f"{optimum.objective:.8g}; name them in prepare(parameters=[...]) and solve there",
            optimum=found,
        )
    return found


def _same_sizes(built: Built, old: Built, values: Mapping[str, float]) -> Built:
    """The control problem with values of its numbers, and guesses and typical sizes, as another one has them."""
    known = {s.name: s for s in old.problem.signals}
    sized = built.problem.with_signals(
        lambda _, s: replace(s, nominal=known.get(s.name, s).nominal, guess=known.get(s.name, s).guess)
    )
    sizes = {n.name: n.size for n in old.problem.free}
    numbers = []
    for number in built.problem.free:
        value = float(values.get(number.name, number.guess))
        ends = {"min": value, "max": value} if number.held else {}
        size = sizes.get(number.name, number.size)
        numbers.append(replace(number, guess=value, nominal=size, **ends))
    phases = tuple(
        replace(
            phase,
            residual_sizes=before.residual_sizes
            if before.residual_names == phase.residual_names
            else phase.residual_sizes,
            path_limits=_sized(phase.path_limits, before.path_limits),
        )
        for phase, before in zip(sized.phases, old.problem.phases, strict=True)
    )
    boundary = _sized(sized.boundary, old.problem.boundary)
    return replace(built, problem=replace(sized, phases=phases, boundary=boundary, free=tuple(numbers)))


def _sized(limits: Sequence[Limit], old: Sequence[Limit]) -> tuple[Limit, ...]:
    """Limits with the sizes that they had, if they are the same."""
    if [limit.name for limit in limits] != [limit.name for limit in old]:
        return tuple(limits)
    return tuple(replace(limit, size=before.size) for limit, before in zip(limits, old, strict=True))


def _unknowns(old: Program, new: Program, w: np.ndarray) -> np.ndarray:
    """Unscaled unknowns of the new program: values of the old one by name, first guesses for unknowns it has not."""
    found = first_guess(new)
    for before, layout in zip(old.places.layouts, new.places.layouts, strict=True):
        found[layout.knots] = w[before.knots]
        known = {s.name: before.of(k) for k, s in enumerate(before.phase.signals)}
        for k, signal in enumerate(layout.phase.signals):
            mine = layout.of(k)
            if mine.size == known.get(signal.name, mine[:0]).size:
                found[mine] = w[known[signal.name]]
    return found


def _carried(old: Program, new: Program, solution: Solution, w: np.ndarray) -> Solution | None:
    """A solution carried over to a program with more numbers, if its rows are the same."""
    count = len(old.problem.free)
    same = [(g.kind, g.name, g.phase) for g in old.groups] == [(g.kind, g.name, g.phase) for g in new.groups]
    if not same or old.assembled.rows != new.assembled.rows or w.size != new.places.size:
        return None
    place = {n.name: k for k, n in enumerate(old.problem.free)}
    numbers = [
        solution.bound_multipliers[place[n.name]] if n.name in place else 0.0 for n in new.problem.free
    ]
    objective, constraints = new.assembled.nlp(w / new.places.scale, [])
    found = replace(
        solution,
        w=w,
        bound_multipliers=np.concatenate([numbers, solution.bound_multipliers[count:]]),
        constraints=np.array(constraints).ravel(),
        objective=float(objective),
    )
    return found if stationarity(new, found) < STATIONARY else None
