"""A client that computes its answers in a thread, every few samples, so that the controller need not wait."""

from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import numpy as np

from gantrytau_fmu.controller.channels import Channel, Declaration
from gantrytau_fmu.controller.clients import Sample
from gantrytau_fmu.controller.laws.periodic_law import PeriodicFunction


class PeriodicClient:
    """`function(t, {known: value}) -> {name: value}` of sample k acts in sample k + every, or later where it is late.

    It is called in a thread, and while it is busy not again; dropped: how often that was. gives: name -> unit.
    """

    def __init__(
        self,
        name: str,
        function: PeriodicFunction,
        every: int,
        known: Sequence[str],
        gives: Mapping[str, str],
    ):
        self.name, self.sends = name, Declaration([Channel(*one) for one in gives.items()])
        self.dropped = 0
        self._function, self._every, self._known = function, every, known
        self._pool = ThreadPoolExecutor(max_workers=1)
        self._jobs: list[tuple[int, Future[Mapping[str, float]]]] = []  # the last two, with their samples

    def submit(self, sample: Sample, declaration: Declaration) -> None:
        """Take sample k, and begin the answer to it where one is due."""
        if sample.k % self._every:
            return
        if self._jobs and not self._jobs[-1][1].done():
            self.dropped += 1
            return
        places = [declaration.elements.index(name) for name in self._known]
        values = dict(zip(self._known, sample.values[places].tolist(), strict=True))
        job = self._pool.submit(self._function, 1e-9 * sample.time, values)
        self._jobs = [*self._jobs[-1:], (sample.k, job)]

    def answer(self, k: int) -> Sample | None:
        """The answer to apply in sample k; None before the first answer, and while an answer is late."""
        due = [job for begun, job in self._jobs if begun + self._every <= k]
        if not due or not due[-1].done():
            return None
        values: Any = {name: due[-1].result()[name] for name in self.sends.names}
        return Sample(k - 1, 0, self.sends.vector(values).astype(np.float64))

    def settled(self, k: int) -> bool:
        """Whether what acts in sample k + 1 is there."""
        return all(job.done() for begun, job in self._jobs if begun + self._every <= k + 1)

    def close(self) -> None:
        """Wait for what is being computed."""
        self._pool.shutdown()
