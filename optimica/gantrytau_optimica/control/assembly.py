"""How a mechanism is assembled: limits that keep positions found by iteration on the branch of the guess.

Loops without closed form have several solutions at every pose, and the equations of one time say nothing of the next, so
a program may take one solution here and another one there. Near the course of the guess there is one.
"""

from dataclasses import replace

import numpy as np

from gantrytau_optimica.control.built import Built
from gantrytau_optimica.control.control_problem import ControlProblem, Signal

SHARES = np.linspace(0.0, 1.0, 21)  # of the horizon, at which guesses are looked at
BESIDE = 0.5  # of the largest value, and of the way that is gone: how far beside the course of the guess positions may be
ANGLE = 1.0  # rad, the least of that for what turns


def with_assembly(built: Built, problem: ControlProblem) -> ControlProblem:
    """The problem with such limits on the torn unknowns of nonlinear blocks."""
    torn = {
        y.name() for b in built.read.dae.blocks if b.kind == "nonlinear" and b.solution is None for y in b.tears
    }
    if not torn:
        return problem

    def near(_, signal: Signal) -> Signal:
        if signal.symbol.name() not in torn:
            return signal
        course = signal.guess(SHARES)
        low, high = float(np.min(course)), float(np.max(course))
        beside = max(BESIDE * max(abs(low), abs(high)), BESIDE * (high - low), ANGLE)
        return replace(signal, min=low - beside, max=high + beside)

    return problem.with_signals(near)
