"""A law that is called every few samples, and whose references are held until it is called again."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from gantrytau_fmu.controller.board import Board
from gantrytau_fmu.controller.channels import Declaration, Values

PeriodicFunction = Callable[[float, Mapping[str, float]], Mapping[str, float]]


class PeriodicLaw:
    """`function(t, {known: value}) -> {reference: value}` at every so many samples, by names of scalars that there are."""

    tunables, tuned = Declaration(), np.zeros(0)

    def __init__(self, function: PeriodicFunction, every: int, known: Sequence[str], gives: Sequence[str]):
        self._function, self._every, self._known, self._gives = function, every, known, gives
        self._held = np.zeros(len(gives))

    def fit(self, board: Board, references: Declaration) -> None:
        """See `Law.fit`."""
        self._board = board
        self._taken = [board.declaration.elements.index(name) for name in self._known]
        self._given = [references.elements.index(name) for name in self._gives]

    def begin(self, stop: float) -> None:
        """Nothing to prepare."""

    def set(self, name: str, values: Values) -> None:
        """It has no parameters of its own."""

    def references(self, k: int, time: float, period: float, nominal: Values) -> Values:
        """See `Law.references`."""
        if k % self._every == 0:
            values = dict(zip(self._known, self._board.values[self._taken].tolist(), strict=True))
            found = self._function(time, values)
            self._held = np.array([found[name] for name in self._gives])
        wanted = nominal.copy()
        wanted[self._given] = self._held
        return wanted

    def close(self) -> None:
        """Nothing is held open."""
