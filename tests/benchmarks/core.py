"""The transcription core on records of GT-A, beside programs written by hand for this one robot."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gantrytau_optimica.solver import Solution, solve
from gantrytau_optimica.transcription import transcribe
from tests.benchmarks import gta, reference_collocation
from tests.benchmarks.gta_problem import control_problem
from tests.benchmarks.pose_pairs import core_solver, sweep
from tests.benchmarks.table import Row, at_most, in_turn, shown


def rows(full: bool = False) -> Iterator[Row]:
    """Durations of the four rows, time of the free row against its peers, with `full` the pose pairs."""
    for name, (task, duration, _) in gta.ROWS.items():
        found = _core(task).free["final_time"]
        # converged runs of the free row without weight scatter; it may also end on the faster branch
        scatters = task.weight == 0 and not task.line
        error = max(found - duration, 0.0) if scatters else abs(found - duration)
        yield at_most(f"core, {name}: |T - {duration:g} s|", error, 1.5e-4 if scatters else 2e-5, "s")
    yield from _against_peers()
    if full:
        verdicts = sweep(core_solver())
        failed = sum(not verdict.success for verdict in verdicts)
        seconds = float(np.median([verdict.seconds for verdict in verdicts]))
        yield at_most(f"core, {len(verdicts)} random pose pairs that do not converge", failed, 0)
        yield shown("core, median time of a pose pair", f"{seconds:.3f} s")


def _core(task: gta.Task) -> Solution:
    return solve(transcribe(control_problem(task), 50))


def _against_peers() -> Iterator[Row]:
    task = gta.Task()
    programs = {"core": lambda: _core(task), "hand": lambda: reference_collocation.solve(task)}
    try:
        from tests.benchmarks import rockit_reference
    except ImportError:
        yield shown("core, free row against rockit", "rockit is not installed")
    else:
        programs["rockit"] = lambda: rockit_reference.solve(task)
    times = in_turn(programs, 5)
    yield shown(
        "core, free row, seconds: " + " / ".join(times), " / ".join(f"{t:.3f}" for t in times.values())
    )
    yield at_most("core, free row, build and solve against by hand", times["core"] / times["hand"], 1.3, "x")
    if "rockit" in times:
        yield at_most(
            "core, free row, build and solve against rockit", times["core"] / times["rockit"], 0.25, "x"
        )
