"""The time that one call may take, and who is told how far it is."""

import inspect
import time
from collections.abc import Callable
from typing import Any

from gantrytau.progress import Progress as Line

# called with (iteration, objective), and `stage=` where it has a parameter of that name: what is at work, in words
Progress = Callable[..., Any]


class Clock:
    """Shared by all solves of one call: when it has to end, and its progress."""

    def __init__(self, max_time: float, progress: Progress | None = None):
        self.begun = time.perf_counter()
        self.end = self.begun + max_time
        self.progress, self.stage = progress, ""
        self.line = Line.shown() if progress is None else None  # on the screen
        self.last = (0, float("nan"))
        self._staged = progress is not None and "stage" in _parameters(progress)

    @property
    def left(self) -> float:
        """Time left in s, 0 when it is over."""
        return max(self.end - time.perf_counter(), 0.0)

    @property
    def passed(self) -> float:
        """Time since it began, s."""
        return time.perf_counter() - self.begun

    def enter(self, stage: str) -> None:
        """What comes next, as "round 2 of at most 13: solving"."""
        self.stage = stage
        if self.line is not None:
            self.line.stage = stage
        if self._staged and self.progress is not None:
            self.progress(*self.last, stage=stage)

    def tell(self, iteration: int, objective: float) -> None:
        """An iteration of the solver."""
        self.last = (iteration, objective)
        if self.line is not None:
            words = f"iteration {iteration}, objective {objective:.6g}"
            self.line.stage = f"{self.stage}, {words}" if self.stage else words
        if self._staged and self.progress is not None:
            self.progress(iteration, objective, stage=self.stage)
        elif self.progress is not None:
            self.progress(iteration, objective)


def _parameters(function: Callable[..., Any]) -> tuple[str, ...]:
    try:
        return tuple(inspect.signature(function).parameters)
    except ValueError:  # of what is built in
        return ()
