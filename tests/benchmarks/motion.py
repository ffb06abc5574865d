"""Known answers: the minimum-time motion GT-A from components, and small problems."""

from collections.abc import Iterator
from typing import Any

from gantrytau.commands.demo.motion_problems import FreePath, OnLine
from gantrytau_optimica import optimize
from tests.benchmarks.table import Row, at_most
from tests.optimica import problems

KNOWN = {  # T + w * energy at 50 elements of 3 Radau points
    ("free path", 0.0): 0.913510,
    ("free path", 0.001): None,
    ("free path", 0.01): None,
    ("straight line", 0.0): 0.974057,
}
TIMES = {("free path", 0.001): 0.92103, ("free path", 0.01): 0.97598}


def rows() -> Iterator[Row]:
    """Values of the four rows, and of small problems."""
    free, line = FreePath, OnLine
    for (title, weight), value in KNOWN.items():
        problem: Any = (line if title == "straight line" else free)(weight=weight)
        found = optimize(problem).final_time
        expected = value or TIMES[title, weight]
        allowed = 1.5e-4 if (title, weight) == ("free path", 0.0) else 2e-5
        # the free row may also end on the faster branch
        error = max(found - expected, 0.0) if allowed > 1e-4 else abs(found - expected)
        yield at_most(f"GT-A {title}, w = {weight:g}: |T - {expected:g} s|", error, allowed, "s")
    yield from _small_problems()


def _small_problems() -> Iterator[Row]:
    found = {
        "1, Van der Pol with a bound": optimize(problems.BoundedOscillator).objective - 3.17619576,
        "2, Van der Pol in minimum time": optimize(problems.FastestOscillator).final_time - 2.28115871,
        "3, double integrator": optimize(problems.FastestMass).final_time - 2.0,
        "5, linear-quadratic": optimize(problems.LinearQuadratic).objective - 50.9836626,
    }
    for name, error in found.items():
        yield at_most(f"small problem {name}, error", abs(error), 1e-6)
