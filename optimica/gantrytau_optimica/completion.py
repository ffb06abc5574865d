"""Algebraic unknowns that have no closed form, completed along the guess of the other signals by Newton's method.

A closed mechanism is led from its start values to the pose in which the guess begins, and then along the guess, each
time from the solution before: in small steps it stays on its branch.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

STEPS = 32  # along the guess
LEADING = 16  # from the start values to its begin
ITERATIONS = 15
NOTHING = 1e-5
ENOUGH = 1e-9  # of the size of the residuals' terms

Guess = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class Completion:
    """Algebraics z along known signals k: 0 = residuals(time, k, z).

    known: guesses of the signals k as functions of shares; begin (k,), start (nz,): values that belong together;
    roots: numbers of algebraics that must not be negative.
    """

    residuals: ca.Function
    known: Sequence[Guess]
    begin: np.ndarray
    start: np.ndarray
    roots: np.ndarray
    span: tuple[float, float]

    @cached_property
    def shares(self) -> np.ndarray:
        """Shares of the horizon at which the equations are solved."""
        return np.linspace(0.0, 1.0, STEPS + 1)

    @cached_property
    def table(self) -> np.ndarray:
        """Algebraics at these shares, (33, nz); where there is no solution those before are kept."""
        signals = np.array([np.broadcast_to(guess(self.shares), self.shares.shape) for guess in self.known])
        z, found = self.start, []
        for part in np.linspace(0.0, 1.0, LEADING + 1)[1:]:
            z = self._solved(self.span[0], self.begin + part * (signals[:, 0] - self.begin), z)
        for share, column in zip(self.shares, signals.T, strict=True):
            z = self._solved(self.span[0] + share * (self.span[1] - self.span[0]), column, z)
            found.append(z)
        return np.array(found)

    def guess(self, number: int) -> Guess:
        """The course of one algebraic as a function of shares."""
        column = self.table[:, number]
        if np.max(np.abs(column)) < NOTHING:  # what the solver of equations leaves of a zero is no size
            column = np.zeros(column.size)
        return lambda share: np.interp(np.atleast_1d(share), self.shares, column)

    def _solved(self, time: float, signals: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Damped Newton from z; z itself where it does not come closer."""
        first, jacobian = self._at(time, signals, z)
        best, size = z, np.linalg.norm(first)
        for _ in range(ITERATIONS):
            if not np.isfinite(size) or not np.all(np.isfinite(jacobian)):
                return z
            if size <= ENOUGH * max(1.0, float(np.max(np.abs(jacobian) @ np.abs(best)))):
                return best
            step = np.linalg.lstsq(jacobian, -first, rcond=1e-12)[0]
            for damping in (1.0, 0.5, 0.25, 0.1, 0.02):
                trial = best + damping * step
                trial[self.roots] = np.abs(trial[self.roots])
                value, slope = self._at(time, signals, trial)
                if np.linalg.norm(value) < size:
                    best, first, jacobian, size = trial, value, slope, np.linalg.norm(value)
                    break
            else:
                return best
        return best

    def _at(self, time: float, signals: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values, slopes = self.residuals(time, signals, z)
        return np.array(values).ravel(), np.array(slopes)
