"""The tube around closed-form trajectories."""

import numpy as np
import pytest

from gantrytau.results.tube import leaves

TIME = np.linspace(0, 10, 501)


def _edge(at):
    """A unit step as an integrator gives it: both sides at one time."""
    time = np.sort(np.append(TIME, [at, at]))
    values = (time > at).astype(float)
    values[np.searchsorted(time, at) + 1] = 1.0
    return time, values


@pytest.mark.parametrize(("share", "inside"), [(0.0019, True), (0.0021, False)])
def test_the_tube_is_as_high_as_a_share_of_the_range(share, inside):
    hat = 1 - np.abs(TIME - 5) / 5  # at its top the width of the tube adds nothing
    assert (not leaves(TIME, hat, TIME, hat + share)[0].size) is inside


@pytest.mark.parametrize(("shift", "inside"), [(0.019, True), (0.021, False)])
def test_the_tube_is_as_wide_as_a_share_of_the_time(shift, inside):
    when, _ = leaves(*_edge(4.0), *_edge(4.0 + shift))
    assert (not when.size) is inside
    assert np.all((when > 4.0) & (when < 4.03))


def test_a_pulse_without_width_may_be_outside_and_one_with_it_not():
    for wide, inside in ((1e-7, True), (0.05, False)):
        time = np.sort(np.append(TIME, [4.001, 4.001, 4.001 + wide, 4.001 + wide]))
        pulse = ((time >= 4.001) & (time <= 4.001 + wide)).astype(float)
        pulse[[np.flatnonzero(pulse)[0], np.flatnonzero(pulse)[-1]]] = 0.0
        assert (not leaves(TIME, 0 * TIME, time, pulse)[0].size) is inside


def test_constants_may_differ_by_noise_alone():
    assert not leaves(TIME, 0 * TIME, TIME, 0 * TIME + 1e-9)[0].size
    when, by = leaves(TIME, 0 * TIME + 5, TIME, 0 * TIME + 5.001)
    assert when[0] == 0.0
    assert by == pytest.approx(0.001)


def test_a_run_that_ends_early_leaves_where_it_ends():
    when, by = leaves(TIME[:251], TIME[:251], TIME, TIME)
    assert when[0] == pytest.approx(5.0 + 0.02, abs=0.041)
    assert by[-1] == np.inf


def test_what_is_not_a_number_is_outside():
    when, by = leaves(TIME, np.where(TIME > 3, np.nan, TIME), TIME, TIME, wide=0.0)
    assert when[0] == pytest.approx(3.01, abs=0.011)
    assert np.all(np.isinf(by))
