"""A controller under fire for some seconds; `fuzz.py` does it for hours."""

import pytest

from tests.fmu.controller.exchange.fuzz import fuzzed


@pytest.mark.parametrize("seed", [1, 2])
def test_random_messages_change_nothing_but_counters(seed):
    counts = fuzzed(1.0, seed)
    assert counts["dropped"] > 0
