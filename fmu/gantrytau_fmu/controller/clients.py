"""Who takes part in the exchange of samples: what a client has to do, whether in this process or at the end of a wire.

In sample k the controller gives everything it publishes to all clients, and then takes of each its newest answer that
is not newer than k - 1, so that what a client makes of sample k acts in sample k + 1, however quick or slow it is.
"""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from gantrytau.describing.record import Record
from gantrytau_fmu.controller.channels import Declaration, Values


@dataclass(frozen=True, eq=False)
class Sample(Record):
    """Values that belong together.

    k: number of the sample, from 0; of an answer that of the sample it answers. time: k periods, in ns.
    values: (n,) float64, as a `Declaration` says.
    """

    k: int
    time: int
    values: Values


@runtime_checkable
class Client(Protocol):
    """One that is given every sample and may answer with values for the controller. No call raises or blocks.

    One behind a wire may have `dropped` and `reason` besides: how many messages never became answers, and why the last one
    did not, if for its values.
    """

    @property
    def name(self) -> str:
        """Its name, under which its values and counters are told; no two clients of a controller share one."""
        ...

    @property
    def sends(self) -> Declaration:
        """What it gives the controller, empty if nothing."""
        ...

    def submit(self, sample: Sample, declaration: Declaration) -> None:
        """Take sample k of everything the controller publishes."""
        ...

    def answer(self, k: int) -> Sample | None:
        """Its newest answer, of a sample not newer than k - 1; None if it has none yet."""
        ...

    def settled(self, k: int) -> bool:
        """Whether it has done with sample k, so that a virtual clock may go on.

        One that answers nothing, or that has gone, always has.
        """
        ...

    def close(self) -> None:
        """The run has ended; it may be called more than once."""
        ...
