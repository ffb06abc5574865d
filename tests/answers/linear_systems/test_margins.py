"""Margins against python-control, and against the textbook."""

from typing import Any

import numpy as np
import pytest

from gantrytau import ModelError, StateSpace

control: Any = pytest.importorskip("control")


def of(numerator, denominator, period=None):
    """A system, and the same of python-control."""
    theirs = control.ss(control.tf(numerator, denominator))
    ours = StateSpace(theirs.A, theirs.B, theirs.C, theirs.D)
    if period is None:
        return ours, theirs
    ours = ours.discrete(period)
    return ours, control.ss(ours.A, ours.B, ours.C, ours.D, dt=period)


LOOPS: dict[str, Any] = {
    "servo": ([10.0], [1, 6, 11, 0]),
    "with a resonance": ([40.0, 4.0, 4000.0], np.polymul([1, 1, 0], [1, 0.4, 900.0])),
    "not minimum phase": ([-0.5, 1.0], [1, 2, 1]),
    "unstable plant": ([20.0, 40.0], np.polymul([1, -1, 0], [1, 10])),
    "direct": ([2.0, 1.0, 3.0], [1, 2, 4]),
}


@pytest.mark.parametrize("name", LOOPS)
@pytest.mark.parametrize("period", [None, 0.05])
def test_margins_are_those_of_python_control(name, period):
    numerator, denominator = LOOPS[name]
    ours, theirs = of(numerator, denominator, period)
    found = ours.margins()
    gm, pm, _, _, wp, _ = control.stability_margins(theirs)
    gains = control.stability_margins(theirs, returnall=True)[0]
    gains = gains[gains < 1e9]  # what is beyond is rounding
    own = [g for g in found.gain if 0 < g < np.inf]
    for g in gains:
        assert g > found.gain[1] * (1 - 1e-6) or g < found.gain[0] * (1 + 1e-6)
    assert len(gains) == 0 or np.min(np.abs(np.log(own))) <= abs(np.log(gm)) + 1e-6
    assert found.phase == (pytest.approx(pm, rel=1e-6, abs=1e-6) if np.isfinite(pm) else np.inf)
    if np.isfinite(pm):
        assert found.phase_frequency == pytest.approx(wp / (2 * np.pi), rel=1e-6)
    poles = control.feedback(theirs).poles()
    assert found.stable == bool(np.all(np.abs(poles) < 1 if period else poles.real < 0))
    hertz = np.geomspace(1e-5, 0.4999999 / period if period else 1e4, 4000)
    for of_loop, peak, at in (
        (control.feedback(1, theirs), found.M_s, found.M_s_frequency),
        (control.feedback(theirs, 1), found.M_t, found.M_t_frequency),
    ):
        s = 2j * np.pi * np.append(hertz, max(at, 1e-6))
        sizes = np.abs(of_loop(s if period is None else np.exp(s * period)))
        assert sizes[-1] == pytest.approx(peak, rel=1e-6)
        assert np.all(sizes <= peak * (1 + 1e-9))
    if period is None and found.stable and found.bandwidth < np.inf:
        assert 2 * np.pi * found.bandwidth == pytest.approx(
            control.bandwidth(control.feedback(theirs)), rel=2e-3
        )
    if found.stable:
        near = found.M_s_frequency * np.linspace(0.98, 1.02, 400)
        near = np.sort(np.append(hertz, near[near < hertz[-1]]))
        disk = control.disk_margins(theirs, 2 * np.pi * near, skew=0.0)[0]
        assert disk * (1 - 1e-3) <= found.disk <= disk * (1 + 1e-9)  # theirs is that of the grid


def test_margins_of_a_servo_are_those_of_the_textbook():
    found = StateSpace(
        [[0, 1, 0], [0, 0, 1], [0, -2, -3]], [0, 0, 1], [2, 0, 0]
    ).margins()  # 2 / s (s + 1) (s + 2)
    assert found.gain == (0.0, pytest.approx(3.0))
    assert found.gain_frequencies[1] == pytest.approx(np.sqrt(2) / (2 * np.pi))
    w = 2 * np.pi * found.phase_frequency
    assert found.phase == pytest.approx(90 - np.degrees(np.arctan(w) + np.arctan(w / 2)))
    assert found.delay == pytest.approx(np.radians(found.phase) / w)
    assert np.degrees(2 * np.arctan(found.disk / 2)) < found.phase


def test_a_sampled_loop_is_on_its_edge_at_half_of_the_sampling_frequency():
    found = StateSpace(1, 0.1, 1, period=0.1).margins()  # 0.1 k / (z - 1): stable for k below 20
    assert found.gain == (0.0, pytest.approx(20.0))
    assert found.gain_frequencies[1] == pytest.approx(5.0)
    assert StateSpace(1, 0.1, 30, period=0.1).margins().delay == 0  # unstable already


def test_one_loop_of_several_is_named_and_hidden_modes_do_not_count():
    system = StateSpace(np.diag([-1.0, 0.0]), np.eye(2), np.eye(2))
    assert system.margins(output="y[0]", input="u[0]").stable
    for wrong in (lambda: system.margins(), lambda: system.margins(output="y[0]", input="v")):
        with pytest.raises(ModelError) as refused:
            wrong()
        assert refused.value.argument == "input"
    with pytest.raises(ModelError, match=r"no way from u\[1\] to y\[0\]"):
        system.margins(output="y[0]", input="u[1]")
    with pytest.raises(ModelError, match=r"expected 1 . D not to be zero"):
        StateSpace(-1, 1, 1, -1).margins()
