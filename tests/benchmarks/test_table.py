"""Targets that are missed are told, whatever kind of number the figure is."""

import numpy as np
import pytest

from tests.benchmarks.table import at_least, at_most


@pytest.mark.parametrize("number", [float, np.float64, np.float32])
def test_missed_targets_are_missed(number):
    assert at_most("time", number(2.0), 1.0).met is False
    assert at_most("time", number(1.0), 1.0).met is True
    assert at_least("speed", number(0.5), 1.0).met is False
    assert at_least("speed", number(np.nan), 1.0).met is False
