"""Nyquist, Nichols and root locus show the numbers of the loop; Bode in dB and rad/s."""

import numpy as np
import pytest

from gantrytau import StateSpace

SERVO = StateSpace([[0, 1, 0], [0, 0, 1], [0, -2, -3]], [0, 0, 1], [2, 0, 0])  # 2 / s (s + 1) (s + 2)


def drawn(line) -> np.ndarray:
    return np.asarray(line.get_xdata()) + 1j * np.asarray(line.get_ydata())


def test_nyquist_and_nichols_pass_where_the_margins_say(tmp_path):
    margins = SERVO.margins()
    curve = next(
        drawn(line)
        for line in SERVO.plot_nyquist(file=tmp_path / "nyquist.png").axes[0].lines
        if line.get_label() == "StateSpace"
    )
    assert np.min(np.abs(curve + 1)) == pytest.approx(1 / margins.M_s, rel=1e-3)
    sampled = SERVO.discrete(0.1)
    axis = SERVO.plot_nyquist(chart="nichols", beside={"sampled": sampled}).axes[0]
    for line, found in zip(axis.lines[:2], (margins, sampled.margins()), strict=True):
        phase, level = np.real(drawn(line)), np.imag(drawn(line))
        assert np.interp(0.0, -level, phase) == pytest.approx(found.phase - 180, abs=0.01)  # of the grid
        assert np.interp(180.0, -phase, level) == pytest.approx(-20 * np.log10(found.gain[1]), abs=0.01)


@pytest.mark.parametrize("period", [None, 0.2])
def test_root_locus_begins_at_the_poles_and_reaches_the_edge_at_the_gain_margin(period):
    system = SERVO if period is None else SERVO.discrete(period)
    edge = system.margins().gain[1]
    lines = [drawn(line) for line in system.plot_root_locus().axes[0].lines if line.get_color() == "C0"]
    paths = [line for line in lines if len(line) > 3]
    assert np.sort([np.real(path[0]) for path in paths]) == pytest.approx(np.sort(np.real(system.poles)))
    ends = [
        drawn(line)[-1]
        for line in system.plot_root_locus([1.0, edge]).axes[0].lines
        if line.get_color() == "C0"
    ]
    outward = np.max(np.abs(ends[:3]) if period else np.real(np.array(ends[:3])))
    assert outward == pytest.approx(1.0 if period else 0.0, abs=1e-6)


def test_bode_has_decibels_and_radians_by_choice():
    gain, phase = SERVO.plot_bode([0.01, 1.0], dB=True, rad_per_s=True).axes
    x, y = gain.lines[0].get_data()
    assert np.asarray(x) == pytest.approx([0.02 * np.pi, 2 * np.pi])
    assert np.asarray(y) == pytest.approx(20 * np.log10(np.abs(SERVO.response([0.01, 1.0])[0, 0])))
    assert (gain.get_ylabel(), phase.get_xlabel()) == ("gain [dB]", "angular frequency [rad/s]")
