"""The linear loop of a tool in contact: printed 68 Hz, and what a delay makes of it."""

import warnings

import numpy as np
import pytest

from gantrytau import ModelError, der, simulate
from gantrytau_models import Pendulum
from gantrytau_models.leadthrough.assumed import surfaces
from gantrytau_models.leadthrough.servo_and_sensors import LedArm
from gantrytau_models.leadthrough.surface.contact_loop import ContactLoop, CriticalGain, contact_loop
from gantrytau_models.leadthrough.surface.surface_tracking import SurfaceTracking


def test_the_loop_of_four_milliseconds_sounds_with_68_hertz():
    loop = ContactLoop(1.0)
    assert abs(loop.crossover - 68.0) < 0.2
    assert abs(loop.critical_gain - 690) < 5


@pytest.mark.parametrize("T_v", [0.5e-3, 2.303e-3, 20e-3])
def test_the_edge_is_that_of_the_triangle_of_jury(T_v):
    """Of z^2 + b z + c with an integrator behind a lag and a hold: unstable from c = 1 on, or 1 - b + c = 0."""
    T, a = 0.004, np.exp(-0.004 / T_v)
    # (b1 z + b0) / ((z - 1)(z - a)), as printed in books of sampled control
    b1, b0 = T - T_v * (1 - a), T_v * (1 - a) - T * a
    by_product, by_sum = (1 - a) / b0, 2 * (1 + a) / (b1 - b0) if b1 > b0 else np.inf
    assert np.isclose(ContactLoop(1.0, T_v=T_v).critical_gain, min(by_product, by_sum), rtol=1e-9)


@pytest.mark.parametrize(("delay", "hertz"), [(0.004, 30.7), (0.008, 20.44)])
def test_whole_samples_of_delay_make_it_low(delay, hertz):
    loop = ContactLoop(1.0, delay=delay)
    assert abs(loop.crossover - hertz) < 0.05
    # as the bare loop behind z^-k at that frequency
    bare = ContactLoop(loop.critical_gain).response(np.array([loop.crossover]))[0]
    shifted = bare * np.exp(-2j * np.pi * loop.crossover * delay)
    assert abs(shifted + 1) < 1e-6


def test_delays_go_over_into_each_other():
    gains = [
        ContactLoop(1.0, delay=d).critical_gain for d in (0.0, 1e-9, 2e-3, 4e-3 - 1e-9, 4e-3, 4e-3 + 1e-9)
    ]
    assert np.all(np.diff(gains) < 1e-3)
    assert np.isclose(gains[0], gains[1], rtol=1e-5)
    assert np.isclose(gains[3], gains[5], rtol=1e-5)


def test_a_stiff_structure_changes_nothing_and_a_soft_one_rules():
    assert np.isclose(ContactLoop(1.0, mode=5000.0, damping=0.7).critical_gain, 690.5, rtol=0.03)
    soft = ContactLoop(1.0, T_v=0.0, mode=70.0, damping=0.02)
    assert abs(soft.crossover - 68) < 1.0
    assert soft.critical_gain < 40


def test_numbers_are_those_of_the_model():
    loop = contact_loop(SurfaceTracking(surfaces.METAL, control=dict(tool=dict(K=[0.03, 0.03, 0.02]))))
    assert loop == ContactLoop(0.02 * surfaces.METAL.stiffness)


def test_a_gain_beyond_the_critical_one_is_told_before_the_run():
    with pytest.warns(CriticalGain, match=r"will hop on the surface.*127 % of the critical 690"):
        SurfaceTracking(surfaces.METAL, control=dict(tool=dict(K=[0.04] * 3)))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        SurfaceTracking(surfaces.METAL)
        SurfaceTracking(surfaces.METAL, tool_control=False, control=dict(tool=dict(K=[0.04] * 3)))


def test_the_curve_is_drawn(tmp_path):
    loop = ContactLoop(0.95 * 690)
    loop.plot_nyquist(tmp_path / "nyquist.png")
    assert (tmp_path / "nyquist.png").stat().st_size > 5000


def test_the_open_loop_is_that_of_the_transfer_function_at_each_frequency():
    T_v, T, a, hertz = 2.303e-3, 0.004, np.exp(-0.004 / 2.303e-3), np.array([2.0, 30.0, 68.0, 125.0])
    z = np.exp(2j * np.pi * hertz * T)
    expected = 500 * ((T - T_v * (1 - a)) * z + T_v * (1 - a) - T * a) / ((z - 1) * (z - a))
    assert np.allclose(ContactLoop(500.0, T_v=T_v).response(hertz), expected, rtol=1e-10)


def test_the_curve_passes_as_near_to_the_critical_point_as_the_margin_says():
    curve = ContactLoop(0.95 * 690.5).plot_nyquist().axes[0].lines[0]
    points = np.asarray(curve.get_xdata()) + 1j * np.asarray(curve.get_ydata())
    assert points.size > 100
    # it crosses the real axis at -0.95; the frequencies drawn lie within 1 % of one another
    crossing = points[np.argmin(np.abs(points.imag) + (points.real > -0.5))]
    assert abs(crossing + 0.95) < 0.02


# a mode so slow that its critical gain drowns in rounding, and numbers that are none
@pytest.mark.parametrize(
    "wrong", [dict(gain=-1.0), dict(mode=0.0), dict(T_v=-1.0), dict(period=0), dict(mode=1e-9)]
)
def test_wrong_loops_are_refused(wrong):
    with pytest.raises(ModelError, match=f"ContactLoop: found {next(iter(wrong))}="):
        ContactLoop(**(dict(gain=1.0) | wrong)).critical_gain  # noqa: B018


@pytest.mark.parametrize("mode", [1e-3, 1.0])
def test_a_slow_structure_bears_twice_its_damping_times_its_frequency(mode):
    # far below the sampling frequency the loop is s (s^2 + 2 d w s + w^2) + g w^2, and Routh says g < 2 d w
    assert ContactLoop(1.0, T_v=0.0, mode=mode, damping=0.02).critical_gain == pytest.approx(
        2 * 0.02 * 2 * np.pi * mode, rel=1e-2
    )


def test_no_gain_is_no_share_of_the_critical_one():
    assert ContactLoop(0.0).share == 0
    SurfaceTracking(surfaces.METAL, control=dict(tool=dict(K=[0.0] * 3)))


def test_other_servos_are_arguments_and_arms_without_a_lag_have_no_such_loop():
    with pytest.warns(CriticalGain, match="114 % of the critical 576"):
        SurfaceTracking(surfaces.METAL, arm=dict(T_v=5e-3))

    class Ideal(LedArm):
        def equations(self):
            yield self.v == self.v_ref
            yield der(self.r) == self.v

    led = SurfaceTracking(surfaces.CARDBOARD, arm=Ideal(r=dict(start=[0.0, 0.0, -0.03])))
    assert simulate(led, stop=4.0).final("f_n") == pytest.approx(2.0, abs=0.1)


def test_another_model_has_no_such_loop():
    with pytest.raises(ModelError, match=r"found Pendulum without control\.tool\.K"):
        contact_loop(Pendulum())
