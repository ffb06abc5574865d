"""A slide that follows its reference, and clients of the exchange that answer, stall, die or send what is wrong."""

import numpy as np
import pytest

from gantrytau_fmu import PythonComponent
from gantrytau_fmu.controller import Channel, Declaration, Sample

DELTA, Q_REF = Channel("delta", "m", 1, -1.0, 1.0), Channel("q_ref", "m")
FOLLOWS = 0.3  # of the way to the reference in each sample


class InProcess:
    """A client that answers sample k with answers(k), or with nothing where that is None."""

    def __init__(self, name="stream", answers=lambda k: [0.0], sends=(DELTA,)):
        self.name, self.sends, self.answers = name, Declaration(sends), answers
        self.seen: list[Sample] = []
        self.given: list[Sample] = []
        self.closed = 0

    def submit(self, sample, declaration):
        self.seen.append(sample)
        values = self.answers(sample.k)
        if values is not None:
            self.given.append(Sample(sample.k, sample.time, np.array(values, dtype=float)))

    def answer(self, k):
        return next((sample for sample in reversed(self.given[-3:]) if sample.k <= k - 1), None)

    def settled(self, k) -> bool:
        return True

    def close(self):
        self.closed += 1


def slide(channel=Q_REF):
    """q(k+1) = q(k) + FOLLOWS (q_ref(k) - q(k)), from 0."""
    q = [np.zeros(channel.size)]

    def follow(t, values):
        q[0] = q[0] + FOLLOWS * (np.atleast_1d(values["q_ref"]) - q[0])
        return {"q": q[0]}

    measured = Channel("q", "m", channel.size)
    return PythonComponent(follow, inputs=[channel], outputs=[measured], sampled=False)


def corrected(t, values):
    """The reference with the correction of the client."""
    return {"q_ref": values["q_ref"] + values["stream.delta"]}


@pytest.fixture
def plant():
    return slide()
