"""Devices that watch a motion: noise, bandwidth, range, friction of a tip, orientation."""

import numpy as np
import pytest

from gantrytau import ModelError, Result
from gantrytau.kinematics.rotations import turned
from gantrytau_optimica.calibration.devices.accelerometers import Accelerometer
from gantrytau_optimica.calibration.devices.devices import LaserTracker, TMac
from gantrytau_optimica.calibration.devices.gauges import LengthGauge
from gantrytau_optimica.calibration.devices.sampled_devices import SampledDevice


def motion(name: str, values, t) -> Result:
    return Result(t, {f"{name}[{k}]": np.broadcast_to(x, t.shape) for k, x in enumerate(values)})


def test_tracker_has_its_deviations_and_equal_seeds_give_equal_series():
    t = np.linspace(0.0, 4.0, 4001)
    path = motion("tool.r", [3.0 + 0.1 * t, 0.0, 0.0], t)
    tracker = LaserTracker()
    series = SampledDevice(tracker).measure(path, rate=1000.0, seed=3)
    assert len(series.time) == 4001
    assert series.unit("range") == "m"
    miss = series["r"] - path.at(series.time, "tool.r")
    expected = np.sqrt(np.diag(tracker.covariance([[3.2, 0.0, 0.0]])[0]))
    # 4001 readings: 1.1 %, four and a half times
    assert miss.std(axis=0) == pytest.approx(expected, rel=0.05)
    again = SampledDevice(tracker).measure(path, rate=1000.0, seed=3)
    other = SampledDevice(tracker).measure(path, rate=1000.0, seed=4)
    assert np.array_equal(series["r"], again["r"])
    assert not np.array_equal(series["r"], other["r"])


def test_rate_that_does_not_divide_and_times_that_repeat():
    t = np.array([0.0, 0.25, 0.5, 0.5, 0.75, 1.0])
    jump = motion("tool.r", [np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0]), 0.0, 0.0], t)
    exact = SampledDevice(LaserTracker(range_noise=0.0, range_noise_per_metre=0.0))
    series = exact.measure(jump, rate=2.0)
    assert series["range"] == pytest.approx([1.0, 2.0, 2.0])  # at the jump, what is behind it
    assert exact.measure(jump, rate=3.0).time == pytest.approx([0, 1 / 3, 2 / 3, 1])
    assert exact.measure(jump, rate=0.3).time == pytest.approx([0.0])
    assert exact.measure(jump, rate=1.5).time == pytest.approx([0.0, 2 / 3])
    with pytest.raises(ModelError) as refusal:
        exact.measure(jump, rate=0.0)
    assert refusal.value.argument == "rate"


def turning(t, angle) -> Result:
    """A tool that turns about an axis while it moves; `flange` is elsewhere and does not turn."""
    R = turned(np.broadcast_to(np.eye(3), (len(t), 3, 3)), angle[:, None] * np.array([0.0, 0.6, 0.8]))
    values = {f"tool.R[{i},{j}]": R[:, i, j] for i in range(3) for j in range(3)}
    values |= {f"tool.r[{k}]": x + 0.1 * t for k, x in enumerate((3.0, 0.2, -0.1))}
    return Result(t, values | {f"flange.r[{k}]": 1.0 + 0 * t for k in range(3)})


def test_devices_that_see_orientation_tell_it_over_time():
    t = np.linspace(0.0, 1.0, 251)
    path = turning(t, np.sin(2 * t))
    about = np.array([0.1, 0.0, 0.05])
    quiet = dict.fromkeys(
        ("range_noise", "range_noise_per_metre", "transverse_noise", "transverse_noise_per_metre"), 0.0
    )
    exact = TMac(rotation_noise=0.0, **quiet, target=about)
    series = SampledDevice(exact).measure(path, rate=200.0)
    assert series.findings == ()
    assert series["r"] == pytest.approx(path.at(series.time, "tool.r"), abs=1e-12)  # by lever and orientation
    R = series["R"]
    assert R @ R.transpose(0, 2, 1) == pytest.approx(np.broadcast_to(np.eye(3), R.shape), abs=1e-12)
    true = turning(series.time, np.sin(2 * series.time))["tool.R"]
    assert R == pytest.approx(true, abs=2 * 0.004**2 / 8 * 4)  # between outputs: h2 / 8 of second derivatives
    noisy = SampledDevice(TMac(rotation_noise=1e-4, target=about)).measure(path, rate=200.0, seed=2)
    turn = R.transpose(0, 2, 1) @ noisy["R"]
    assert np.std(turn[:, 2, 1]) == pytest.approx(1e-4, rel=0.2)  # 201 readings: 5 %
    # a tracker of the same target does without orientation, but its target goes round with the tool
    point = SampledDevice(LaserTracker(**quiet, target=about))
    reflector = path.at(series.time, "tool.r") + true @ about
    assert point.measure(path, rate=200.0)["r"] == pytest.approx(reflector, abs=1e-6)
    assert "R[0,0]" not in point.measure(path, rate=200.0)
    beside = SampledDevice(exact, position="flange.r", orientation="tool.R").measure(path, rate=200.0)
    assert beside["R"] == pytest.approx(R, abs=1e-12)


def test_wrong_orientations_are_told():
    t = np.linspace(0.0, 1.0, 101)
    path = turning(t, 0.0 * t)
    with pytest.raises(ModelError, match=r"has no variable 'plate\.R'"):
        SampledDevice(TMac(), orientation="plate.R").measure(path, rate=100.0)
    with pytest.raises(ModelError, match=r"found orientation='tool.r', of shape \(3,\), expected a matrix"):
        SampledDevice(TMac(), orientation="tool.r").measure(path, rate=100.0)
    with pytest.raises(ModelError, match=r"found tool\.R that is no rotation at all times, .* a few degrees"):
        SampledDevice(TMac()).measure(turning(t, 100.0 * t), rate=40.0 + 1 / 3)


def test_what_a_device_does_not_see_is_told():
    t = np.linspace(0.0, 1.0, 101)
    near, far = (motion("tool.r", [x + 10.0 * t, 0.0, 0.0], t) for x in (3.0, 300.0))
    unseen = SampledDevice(LaserTracker()).measure(far, rate=100.0)
    assert [(f.kind, len(f.rows)) for f in unseen.findings] == [("unseen", 101)]
    assert "the LaserTracker at [0, 0, 0] m sees none of 101 readings: tool.r is" in str(unseen.findings[0])
    assert np.all(np.isnan(unseen["r"]))
    partly = SampledDevice(LaserTracker(farthest=8.05)).measure(near, rate=100.0)
    (finding,) = partly.findings
    assert finding.kind == "lost"
    assert finding.rows == pytest.approx(np.flatnonzero(partly["seen"] == 0))
    assert "rows 51 to 100 of 101 are not seen by the LaserTracker" in finding.message
    assert SampledDevice(LaserTracker()).measure(near, rate=100.0).findings == ()


def test_outputs_farther_apart_than_readings_are_refused():
    t = np.linspace(0.0, 1.0, 101)
    path = motion("tool.r", [1.0 + 0.1 * np.sin(20 * t), 0.0, 0.0], t)
    assert len(SampledDevice(LaserTracker()).measure(path, rate=100.0).time) == 101
    with pytest.raises(ModelError, match=r"outputs 0\.01 s apart, expected 0\.004 s or less .* points=251"):
        SampledDevice(LaserTracker()).measure(path, rate=250.0)


def test_friction_at_the_tip_gives_a_loop_as_wide_as_twice_the_play():
    t = np.linspace(0.0, 2.0, 2001)
    path = motion("tool.r", [0.01 + 1e-3 * np.sin(np.pi * t), 0.0, 0.0], t)
    gauge = SampledDevice(LengthGauge(noise=0.0), play=2e-6)
    series = gauge.measure(path, rate=500.0)
    lag = series["length"] - path.at(series.time, "tool.r[0]")
    assert lag[50] == pytest.approx(-2e-6)  # on the way out
    assert lag[500] == pytest.approx(2e-6)  # on the way back
    with pytest.raises(ModelError) as refusal:
        SampledDevice(LaserTracker(), play=1e-6)  # nothing else touches what it measures
    assert refusal.value.argument == "play"


@pytest.mark.parametrize(("rate", "bandwidth"), [(1000.0, 50.0), (250.0, 100.0)])
def test_bandwidth_is_at_minus_3_dB(rate, bandwidth):
    t = np.linspace(0.0, 1.0, 40001)
    path = motion("accelerometer.a", [np.sin(2 * np.pi * bandwidth * t), 0.0, 0.0], t)
    device = Accelerometer(noise=0.0, bandwidth=bandwidth)
    series = device.measure(path, rate=rate)
    late = series.time > 0.5
    basis = np.exp(2j * np.pi * bandwidth * series.time[late])
    gain = 2 * abs(np.mean(series["a"][late, 0] * basis.conj()))
    assert gain == pytest.approx(1 / np.sqrt(2), rel=0.01)  # straight lines between 40 steps a period: 0.2 %


def test_at_rest_it_feels_gravity_with_its_noise_and_stays_in_its_range():
    t = np.linspace(0.0, 20.0, 5001)
    still = motion("accelerometer.a", [0.0, 0.0, 0.0], t)
    series = Accelerometer().measure(still, rate=250.0, seed=1)
    assert series["a"].mean(axis=0) == pytest.approx([0.0, 0.0, 9.81], abs=4 * 0.07 / np.sqrt(5001))
    assert series["a"].std(axis=0) == pytest.approx([0.07] * 3, rel=0.05)  # 5001 readings: 1 %
    spectrum = np.abs(np.fft.rfft(series["a"][1:, 0])) ** 2
    halves = spectrum[1:1250].mean(), spectrum[1250:].mean()
    assert halves[0] == pytest.approx(halves[1], rel=0.2)  # white: each mean is right within 3 %
    held = Accelerometer(noise=0.0, range=5.0).measure(still, rate=10.0)
    assert held["a"][:, 2] == pytest.approx(5.0)
    assert np.all(held["saturated"] == 1)


def test_orientation_is_found_to_its_predicted_deviation():
    t = np.linspace(0.0, 2.0, 4001)
    path = motion("accelerometer.a", [1.4 * np.sin(40 * t), 2.2 * np.sin(30 * t), 0.0], t)
    R = turned(np.eye(3)[None], np.array([[0.4, -2.0, 1.0]]))[0]
    device, unknown = Accelerometer(R=R), Accelerometer()
    scores = []
    for seed in range(20):
        found, covariance = unknown.orientation(device.measure(path, rate=250.0, seed=seed), path)
        D = found @ R.T
        turn = np.array([D[2, 1] - D[1, 2], D[0, 2] - D[2, 0], D[1, 0] - D[0, 1]]) / 2
        scores.append(turn @ np.linalg.solve(covariance, turn))
    # chi squared with three degrees of freedom: the mean of 20 is 3 with a deviation of 0.55
    assert np.mean(scores) == pytest.approx(3.0, abs=3 * 0.55)


def test_orientation_is_refused_where_it_is_not_told():
    t = np.linspace(0.0, 1.0, 101)
    upright = motion("accelerometer.a", [0.0, 0.0, np.sin(9 * t)], t)
    device = Accelerometer(noise=0.0)
    with pytest.raises(ModelError, match="a turn about that direction is not told"):
        device.orientation(device.measure(upright, rate=100.0), upright)
    small = Accelerometer(range=1.0)
    with pytest.raises(ModelError, match="found 0 readings within the range"):
        small.orientation(small.measure(upright, rate=100.0), upright)
