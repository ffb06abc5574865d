"""Answers that rest on the margins of their square roots (see control/root_margins): what there is nearer to zero."""

from collections.abc import Callable
from dataclasses import replace

from gantrytau_optimica.answers.optimum import Optimum
from gantrytau_optimica.control.built import Built
from gantrytau_optimica.control.root_margins import scaled_margins
from gantrytau_optimica.transcription.program import Program, on_margins

CLOSER = 0.1  # of their margins: how near to zero square roots may come at a second look

Solve = Callable[[Built, Program, bool], Optimum]


def off_margins(found: Optimum, solve: Solve) -> Optimum:
    """Where square roots rest on their margins: the optimum nearby that does not, or the one at hand if none is found, of
    which the report says so. What is no solution is looked for once more, without margins.

    solve: by a built problem and its program, from the optimum at hand (True) or from the first guess (False).
    """
    if not on_margins(found.program, found.solution.w):
        return found
    problem = scaled_margins(found.program.problem, CLOSER if found.success else 0.0)
    program = found.program.with_numbers(problem)
    other = solve(replace(found.built, problem=problem), program, found.success)
    if not found.success:
        return _counted(other, found)
    lost = not other.success or on_margins(program, other.solution.w)
    return _counted(found, other) if lost else _counted(other, found)


def _counted(kept: Optimum, other: Optimum) -> Optimum:
    """An optimum with the iterations and the time of another solve that it took as well."""
    one, two = kept.solution, other.solution
    iterations, spent = one.iterations + two.iterations, one.solve_time + two.solve_time
    return replace(kept, solution=replace(one, iterations=iterations, solve_time=spent))
