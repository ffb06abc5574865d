"""How a mechanism is assembled: limits that keep positions found by iteration on the branch of the first guess.

Loops without closed form have several solutions at every pose, and the equations of one time say nothing of the next, so
a program may take one solution here and another one there. Near the course of the guess there is one.
"""

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from gantrytau_optimica.transcription.program import Program

BESIDE = 0.5  # of the largest value, and of the way that is gone: how far beside the guess positions may be
ANGLE = 1.0  # rad, or of a number without unit, the least of that
MOST_WIDER = 5  # times that limits which bind are laid around the solution anew
TOUCHES = 1e-5  # of their distance: how near to such a limit a solution rests on it


def assembled_near(program: Program, loops: Collection[str], w: np.ndarray) -> Program:
    """The program with such limits around the course that its unknowns w (unscaled) give to positions, by symbol."""
    lower, upper, scale = program.lbw.copy(), program.ubw.copy(), program.places.scale
    for mine in _positions(program, loops):
        low, high = float(np.min(w[mine])), float(np.max(w[mine]))
        beside = max(BESIDE * max(abs(low), abs(high)), BESIDE * (high - low), ANGLE)
        lower[mine] = np.maximum(lower[mine], (low - beside) / scale[mine])
        upper[mine] = np.minimum(upper[mine], (high + beside) / scale[mine])
    return replace(program, lbw=lower, ubw=upper)


def rests_on(narrow: Program, program: Program, w: np.ndarray) -> bool:
    """Whether unknowns w (unscaled) are at limits that a program has more than another one."""
    added = (narrow.lbw > program.lbw) | (narrow.ubw < program.ubw)
    x, low, high = (part[added] for part in (w / narrow.places.scale, narrow.lbw, narrow.ubw))
    near = TOUCHES * (high - low)
    return bool(np.any((x < low + near) | (x > high - near)))


def _positions(program: Program, loops: Collection[str]) -> list[np.ndarray]:
    """The unknowns of each of the positions."""
    return [
        layout.of(number)
        for layout in program.places.layouts
        for number, signal in enumerate(layout.phase.signals)
        if signal.symbol.name() in loops
    ]
