"""What changes at the beginning of samples: as soon as may be, or at a time that was named before."""

from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np

from gantrytau.border.checks import number
from gantrytau_fmu.controller.sample_log import SampleLog

Change = Callable[[SampleLog], None]
ROUNDING = 1e-9  # of a period


class PlannedChanges:
    """Changes in the order in which they come: those of an earlier time first, then those that were asked for since.

    They may be asked for from another thread while samples run.
    """

    def __init__(self, period: float):
        self._period = period
        self._queue = deque[Change]()
        self._planned = list[tuple[int, Change]]()

    def add(self, change: Change, at: Any) -> None:
        """For the next sample, or the first that is not before `at`, s; ModelError for a time that is none."""
        if at is None:
            self._queue.append(change)
            return
        time = number("controller", "at", at, least=0.0, unit="s")
        sample = int(np.ceil(time / self._period - ROUNDING))
        self._planned = sorted([*self._planned, (sample, change)], key=lambda planned: planned[0])

    def act(self, k: int, log: SampleLog) -> None:
        """All that is due in sample k."""
        while self._planned and self._planned[0][0] <= k:
            change = self._planned.pop(0)[1]
            change(log)
        for _ in range(len(self._queue)):
            self._queue.popleft()(log)
