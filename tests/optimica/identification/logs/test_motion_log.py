"""Logs of motion: shapes, slices, stretches."""

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau_optimica import MotionLog
from gantrytau_optimica.identification.logs.motion_log import join

T = np.arange(100) / 250


def log(t=T):
    return MotionLog(t, np.outer(t, [1.0, 2.0, 3.0]), np.outer(np.cos(t), [1.0, 0.0, -1.0]))


@pytest.mark.parametrize(
    ("arguments", "wrong"),
    [
        ((T, np.zeros((99, 3)), np.zeros((100, 3))), "q"),
        ((T, np.zeros((100, 3)), np.zeros((100, 2))), "f"),
        ((T[:, None], np.zeros((100, 3)), np.zeros((100, 3))), "t"),
        ((T, np.zeros((100, 3)), np.zeros((100, 3)), None, np.zeros((100, 2))), "r"),
    ],
)
def test_shapes_that_do_not_fit_are_refused(arguments, wrong):
    with pytest.raises(ModelError) as refusal:
        MotionLog(*arguments)
    assert refusal.value.argument == wrong


def test_a_log_is_sliced_and_cannot_be_written_to():
    whole = log()
    assert len(whole[10:20]) == 10
    assert whole[-1].t[0] == T[-1]
    assert np.array_equal(whole.between(T[3], T[5]).q, whole.q[3:6])
    assert whole.period == pytest.approx(0.004)
    with pytest.raises(ValueError, match="read-only"):
        whole.q[0, 0] = 1.0


def test_stretches_end_at_gaps_and_rows_without_numbers():
    q = np.outer(T, [1.0, 2.0, 3.0])
    q[40] = np.nan
    t = np.where(T > T[70], T + 1.0, T)
    parts = MotionLog(t, q, q * 0 + 1).parts()
    assert [len(part) for part in parts] == [40, 30, 29]
    whole = join([log(), log()[:50]])
    assert [len(part) for part in whole.parts()] == [100, 50]
    with pytest.raises(ModelError, match=r"logs of \[3, 1\] actuators"):
        join([log(), MotionLog(T, T, T)])
