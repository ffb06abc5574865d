"""Solved signals as functions of time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from gantrytau_optimica.control_problem import ControlProblem
from gantrytau_optimica.layout import Layout

Array = NDArray[np.float64]
Side = Literal["left", "right"]


@dataclass(frozen=True, eq=False)
class Trajectory:
    """The polynomial pieces of all signals over physical time."""

    problem: ControlProblem
    layout: Layout
    variables: Array
    parameters: Array
    start: float  # s
    final: float  # s

    @property
    def time(self) -> Array:
        """Start, collocation points and borders of the elements, increasing, s."""
        return self._physical(np.unique(np.concatenate([self.layout.borders, self.layout.times.ravel()])))

    @property
    def borders(self) -> Array:
        """Borders of the elements, s."""
        return self._physical(self.layout.borders)

    @property
    def breaks(self) -> Array:
        """Inner borders, s, where algebraics and inputs may jump."""
        return self.borders[1:-1]

    @property
    def free(self) -> Array:
        """The free numbers, in the order of the problem."""
        return self.variables[: len(self.problem.free)]

    def _physical(self, moments: Array) -> Array:
        return self.start + moments * (self.final - self.start)

    def value(self, what: str | ca.SX, t: ArrayLike | None = None, *, side: Side = "left") -> Array:
        """A signal by name, or a scalar or column expression of signals, at times t (s; default `time`).

        Returns the shape of t, for a column of k the shape of t with k appended. `side` chooses the element
        at a border. Times outside the horizon are refused.
        """
        times = np.asarray(self.time if t is None else t, dtype=float)
        element, s = self._locate(times.ravel(), side)
        if isinstance(what, str):
            return self._signal(self._number(what), element, s).reshape(times.shape)
        problem = self.problem
        signals = [x for x in problem.signals if ca.depends_on(what, x.symbol)]
        columns = [self._signal(self._number(x.name), element, s) for x in signals]
        numbers = [*(x.symbol for x in problem.free), *(ca.vec(x.symbol) for x in problem.parameters)]
        symbols = [ca.vertcat(*(x.symbol for x in signals)), problem.time, ca.vertcat(ca.SX(0, 1), *numbers)]
        function = ca.Function("expression", symbols, [ca.vec(what)])
        fixed = np.concatenate([self.free, self.parameters])
        running = np.array(columns).reshape(len(columns), times.size)
        found = np.asarray(function(running, times.reshape(1, -1), np.tile(fixed[:, None], times.size)))
        shape = times.shape if what.is_scalar() else (*times.shape, what.numel())
        return found.T.reshape(shape)

    def _locate(self, times: Array, side: Side) -> tuple[NDArray[np.int64], Array]:
        moment = (times - self.start) / (self.final - self.start)
        if not ((moment > -1e-9) & (moment < 1 + 1e-9)).all():
            raise ValueError(
                f"time outside the motion, which lasts from {self.start:.6g} s to {self.final:.6g} s"
            )
        moment = np.clip(moment, 0.0, 1.0)
        # a border computed in physical time may miss the relative one by rounding
        nearest = self.layout.borders[np.abs(moment[:, None] - self.layout.borders).argmin(axis=1)]
        moment = np.where(np.abs(moment - nearest) < 1e-12, nearest, moment)
        element, s = self.layout.locate(moment)
        if side == "right":
            moves = (s >= 1.0) & (element < len(self.layout.widths) - 1)
            element, s = np.where(moves, element + 1, element), np.where(moves, 0.0, s)
        return element, s

    def _number(self, name: str) -> int:
        names = [signal.name for signal in self.problem.signals]
        if name not in names:
            raise ValueError(f"'{name}' is no signal of the problem; signals are {', '.join(names)}")
        return names.index(name)

    def _signal(self, number: int, element: NDArray[np.int64], s: Array) -> Array:
        return self.layout.values(self.layout.tracks[number], self.variables, element, s)
