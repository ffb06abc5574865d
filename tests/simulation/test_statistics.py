"""What a run took, against what is known of it: events by condition, steps, the state that bends most."""

import numpy as np
import pytest

from gantrytau import Model, ModelError, Real, Result, der, if_else, simulate, sin, time
from tests.simulation.balls import Ball
from tests.simulation.sampled_models import Held


class Turning(Model):
    """What a sine switches, beside a slow and a quick state."""

    slow = Real(start=1.0, fixed=True)
    quick = Real(start=0.0, fixed=True)
    counted = Real(start=0.0, fixed=True)

    def equations(self):
        yield der(self.slow) == -0.1 * self.slow
        yield der(self.quick) == 40 * sin(40 * time)
        yield der(self.counted) == if_else(sin(2 * np.pi * time) > 0, 1.0, 0.0)


def test_events_are_counted_by_condition():
    assert list(simulate(Turning(), stop=2.25).statistics.events.values()) == [4]
    fall = simulate(Ball(), stop=2.0)
    (label, times), *rest = fall.statistics.events.items()
    assert (times, rest) == (fall.final("bounces"), [])
    assert "h<=0" in label.replace(" ", "")


def test_the_state_that_bends_most_limits_the_step():
    result = simulate(Turning(), stop=1.0)
    shares = result.statistics.limiting
    assert max(shares, key=lambda name: shares[name]) == "quick"
    assert sum(shares.values()) == pytest.approx(1)
    assert simulate(Turning(), stop=1.0, outputs=["slow"]).statistics.limiting == {}


def test_steps_of_both_methods_are_counted():
    for model, stop in ((Turning(), 1.0), (Held(), 0.1)):
        work = simulate(model, stop=stop).statistics
        assert work.evaluations > work.steps > 10
        assert sum(work.seconds.values()) > 0 <= min(work.seconds.values())
        assert f"{work.steps}, and {work.rejected} rejected" in str(work)
    finer = simulate(Turning(), stop=1.0, tolerance=1e-11).statistics
    assert finer.steps > 1.5 * simulate(Turning(), stop=1.0).statistics.steps


def test_samples_are_counted_by_their_period():
    for points in (11, 501):
        work = simulate(Held(), stop=0.1, points=points).statistics
        assert work.samples == {0.004: 26}  # at 0 and at 0.1 s, too
    assert "samples every 0.004 s" in str(work)
    assert simulate(Ball(), stop=0.1).statistics.samples == {}


def test_what_was_not_simulated_has_none():
    with pytest.raises(ModelError, match="result of simulate"):
        _ = Result([0.0], {"x": 1.0}).statistics
