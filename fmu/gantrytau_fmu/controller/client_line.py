"""What the controller keeps of a client: the values that count, and how often it held, refused or missed some."""

from collections.abc import Callable
from typing import Any

import numpy as np

from gantrytau.border.refusal import USERS_ERRORS, in_words
from gantrytau_fmu.controller.channels import Declaration, Values
from gantrytau_fmu.controller.clients import Client, Sample
from gantrytau_fmu.controller.timing import ClientCounts

OLDEST = 25  # samples: an answer to an earlier one is stale even if it is the newest


class ClientLine:
    """The way to a client. values: what it sent last and was taken; before that 0, or the limit next to 0.

    A client that raises is not asked any more, and its values stay: the robot goes on.
    """

    def __init__(self, client: Client):
        self.client, self.name = client, client.name
        self.sends: Declaration = client.sends
        self.values: Values = np.clip(np.zeros(self.sends.size), self.sends.minimum, self.sends.maximum)
        self.taken_k = -1
        self.taken = self.held = self.stale = self.refused = 0
        self.failure = self.reason = ""

    def submit(self, sample: Sample, declaration: Declaration) -> None:
        """Give it sample k; its own copy of the values."""
        self._ask(
            lambda: self.client.submit(Sample(sample.k, sample.time, sample.values.copy()), declaration)
        )

    def obtain(self, k: int) -> Values:
        """What it says in sample k: its answer to k - 1, or what it said before."""
        if not self.sends.size:
            return self.values
        found = self._ask(lambda: self.client.answer(k))
        whole = isinstance(found, Sample) and isinstance(found.k, (int, np.integer))
        if found is None or (whole and found.k == self.taken_k):
            self.held += 1
        elif words := self._refusal(found, k) if whole else _no_sample(found):
            self.refused, self.reason = self.refused + 1, words
        elif found.k < self.taken_k or found.k < k - 1 - OLDEST:
            self.stale += 1
        else:
            self.held += bool(found.k < k - 1)  # the answer to an earlier sample
            self.taken += bool(found.k == k - 1)
            self.taken_k, self.values = int(found.k), np.array(found.values, dtype=np.float64)
        return self.values

    def settled(self, k: int) -> bool:
        """Whether it has done with sample k."""
        found = self._ask(lambda: self.client.settled(k))
        return bool(found) or bool(self.failure)

    def close(self) -> None:
        """The run has ended."""
        self._ask(self.client.close)

    @property
    def counts(self) -> ClientCounts:
        """Until now."""
        dropped = getattr(self.client, "dropped", 0)  # of clients behind a wire
        reason = self.reason or str(getattr(self.client, "reason", ""))
        return ClientCounts(
            self.taken, self.held, self.stale, self.refused, int(dropped), self.failure, reason
        )

    def _refusal(self, found: Sample, k: int) -> str:
        """Why an answer cannot be taken in sample k, "" if it can."""
        if found.k > k - 1:
            return f"found an answer to sample {found.k} in sample {k}, expected one to a sample before it"
        return self.sends.refusal(found.values)

    def _ask(self, call: Callable[[], Any]) -> Any:
        if self.failure:
            return None
        try:
            return call()
        except USERS_ERRORS as error:  # of a client, which must not stop the robot
            self.failure = f"raised {type(error).__name__}: {in_words(error)}"
            return None


def _no_sample(found: object) -> str:
    if isinstance(found, Sample):
        return f"found a Sample whose k is {found.k!r}, expected a whole number"
    return f"found {type(found).__name__}, expected a Sample"
