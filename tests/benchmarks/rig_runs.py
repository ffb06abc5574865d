"""Runs of the flexible robot under its servos, as learning control repeats them."""

import os
from collections.abc import Iterator

import numpy as np

from gantrytau_models.mechanisms.flexible import unstretched
from gantrytau_optimica import design_q
from gantrytau_optimica.learning import Scatter, uncertain
from tests.benchmarks.table import Row, at_most
from tests.optimica.learning.design.test_q_search import sampled
from tests.optimica.learning.flexible_runs import PERIOD, PLACE, RECORD, flexible_rig

ROWS, RUNS = 1200, 11


def spent() -> float:
    """Processor time in s, that of the C compiler as well."""
    return sum(os.times()[:4])


def rows() -> Iterator[Row]:
    """Translation and eleven runs of 4.8 s along eight edges of 10 mm, each with friction of its own."""
    t = PERIOD * np.arange(ROWS)
    rise = np.clip((t[:, None] - 1.2 - 0.412 * np.arange(8)) / 0.22, 0, 1)
    way = 0.01 * (rise - np.sin(2 * np.pi * rise) / (2 * np.pi)) @ (-1.0) ** np.arange(8)
    position = unstretched(RECORD, PLACE) + way[:, None] * [1.0, 1.0, 0.0]
    velocity = np.diff(position, axis=0, append=position[-1:]) / PERIOD
    begin = spent()
    rig = flexible_rig(noise=Scatter())
    runs = [rig.run(position, velocity, seed=k) for k in range(RUNS)]
    duration = spent() - begin
    assert all(np.abs(run["carts[0].s"] - position[:, 0]).max() < 2e-3 for run in runs)
    yield at_most("eleven runs of 4.8 s of a flexible robot under its servos", duration, 6.0, "s")
    family = uncertain(sampled([(7.4, 0.04), (11.5, 0.05)]))
    begin = spent()
    q = design_q(family)
    duration = spent() - begin
    assert q.magnitude([1.0], PERIOD).min() > 0.95
    yield at_most("Q of learning for two axes and six models", duration, 5.0, "s")
