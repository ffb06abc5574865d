"""When a sample begins: as soon as all clients have answered the one before, or when a period has passed on the wall.

The wall clock promises nothing. Sleeping is rounded to a millisecond and more by some systems, so it sleeps until 0.6 ms
before and then asks again and again, which halves the lateness (measured on a shared machine of two processors).
"""

import time
from collections.abc import Callable, Sequence

from gantrytau.border.refusal import SolveError
from gantrytau_fmu.controller.client_line import ClientLine

POLLED = 0.6e-3  # s before a sample in which the wall clock does not sleep
PAUSE = 50e-6  # s between questions whether clients have answered


class VirtualClock:
    """The next sample begins when all clients have done with this one; patience: s on the wall that they have."""

    name = "virtual"

    def __init__(self, period: float, patience: float):
        self.period, self.patience = period, patience

    def begin(self) -> None:
        """The run begins."""

    def until(self, k: int, lines: Sequence[ClientLine], interrupted: Callable[[], bool]) -> None:
        """Wait for all that have been given sample k - 1; nothing for the first."""
        waiting = [line for line in lines if not line.settled(k - 1)] if k else []
        end = time.monotonic() + self.patience
        while waiting and not interrupted():
            time.sleep(PAUSE)
            waiting = [line for line in waiting if not line.settled(k - 1)]
            if waiting and time.monotonic() > end:
                names = ", ".join(line.name for line in waiting)
                raise SolveError(
                    f"controller: {names} did not answer sample {k - 1} within {self.patience:g} s, expected an answer, for "
                    "which the virtual clock waits; look at this client, or take clock='wall', which goes on",
                    time=k * self.period,
                )

    @property
    def lateness(self) -> list[float]:
        """It is never late."""
        return []


class WallClock:
    """Samples begin at multiples of the period on the wall, or late; lateness: s, of each."""

    name = "wall"

    def __init__(self, period: float):
        self.period = period
        self.lateness: list[float] = []
        self._begin = 0.0

    def begin(self) -> None:
        """The first sample begins now."""
        self._begin, self.lateness = time.perf_counter(), []

    def until(self, k: int, lines: Sequence[ClientLine], interrupted: Callable[[], bool]) -> None:
        """Wait for the time of sample k; samples that were missed follow at once."""
        due = self._begin + k * self.period
        ahead = due - time.perf_counter() - POLLED
        if ahead > 0:
            time.sleep(ahead)
        while time.perf_counter() < due and not interrupted():
            pass
        self.lateness.append(max(0.0, time.perf_counter() - due))
