"""Step and impulse information against the textbook and python-control."""

from typing import Any

import numpy as np
import pytest

from gantrytau import ModelError, StateSpace

control: Any = pytest.importorskip("control")


@pytest.mark.parametrize("w", [1e-3, 5.0, 2e4])
def test_step_of_second_order_has_overshoot_and_peak_of_the_textbook(w):
    zeta = 0.3
    damped = w * np.sqrt(1 - zeta**2)
    found = StateSpace([[0, 1], [-(w**2), -2 * zeta * w]], [0, 3 * w**2], [1, 0]).step_information()
    assert found.final == pytest.approx(3.0, rel=1e-12)
    assert found.overshoot == pytest.approx(np.exp(-np.pi * zeta / np.sqrt(1 - zeta**2)), rel=1e-6)
    assert found.peak_time == pytest.approx(np.pi / damped, rel=1e-4)  # the top is flat
    assert found.undershoot == 0.0


@pytest.mark.parametrize("rate", [1e-9, 1e9])
def test_times_of_first_order_have_all_digits_however_fast_it_is(rate):
    system = StateSpace(-rate, rate, 5.0)
    assert system.step_information().settling == pytest.approx(np.log(50) / rate, rel=1e-9)
    assert system.margins().bandwidth == pytest.approx(6 * rate / (2 * np.pi), rel=1e-9)


def test_times_of_first_order_are_its_logarithms_beside_a_fast_mode():
    found = StateSpace(np.diag([-0.5, -1e5]), [1, 1e5], [0.5, 0.0]).step_information()
    assert found.rise == pytest.approx(np.log(9) / 0.5, rel=1e-9)
    assert found.settling == pytest.approx(np.log(50) / 0.5, rel=1e-9)
    beside = StateSpace(np.diag([-0.5, 0.0]), [1, 1], [1, 0])  # the output does not see the free body
    assert beside.step_information().final == pytest.approx(2.0)
    impulse = beside.impulse_information()
    assert (impulse.peak, impulse.final) == (pytest.approx(1.0), 0.0)
    assert impulse.settling == pytest.approx(np.log(50) / 0.5, rel=1e-9)


@pytest.mark.parametrize("period", [None, 0.1])
def test_information_is_that_of_python_control(period):
    A, B, C = [[0, 1, 0], [0, 0, 1], [-6, -11, -6]], [0, 0, 1], [6, -2, 0]
    ours = StateSpace(A, B, C) if period is None else StateSpace(A, B, C).discrete(period)
    theirs = control.ss(ours.A, ours.B, ours.C, ours.D, 0 if period is None else period)
    found = ours.step_information()
    expected = control.step_info(theirs, T=np.linspace(0, 20, 20_001) if period is None else None)
    for own, name in (("rise", "RiseTime"), ("settling", "SettlingTime"), ("peak", "Peak")):
        assert getattr(found, own) == pytest.approx(expected[name], rel=2e-3)  # of their grid
    assert found.undershoot == pytest.approx(expected["Undershoot"] / 100, rel=2e-3)
    assert found.undershoot > 0.03


def test_a_response_without_a_final_value_is_told_and_a_final_zero_has_no_shares():
    with pytest.raises(ModelError, match="pole at s = 0"):
        StateSpace(0, 1, 1).step_information()
    with pytest.raises(ModelError, match="direct gain of 2"):
        StateSpace(-1, 1, 1, 2).impulse_information()
    found = StateSpace(-1, 1, -1, 1).step_information()  # s / (s + 1)
    assert (found.final, found.peak, np.isnan(found.rise)) == (0.0, 1.0, True)
    assert found.settling == pytest.approx(np.log(50), rel=1e-9)
