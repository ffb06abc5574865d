"""What is doubtful in a log alone: each finding on a log that has it, and none on one that has not."""

import numpy as np
import pytest

from gantrytau import ModelError, simulate
from gantrytau_models import GantryTau, prototypes
from gantrytau_optimica import MotionLog

T = np.arange(5000) / 250


def motion(t=T):
    return np.column_stack([0.3 * np.sin(w * t) + 0.1 * np.sin(3.1 * w * t + w) for w in (1.1, 1.7, 2.3)])


def log(lag=0, sign=1.0, noise=20.0, friction=150.0, q=motion):
    """Carts of 13, 14 and 38 kg with Coulomb friction and weight; force `lag` samples late."""
    h = 1e-4
    v, a = (q(T + h) - q(T - h)) / (2 * h), (q(T + h) - 2 * q(T) + q(T - h)) / h**2
    f = a * [13.0, 14.0, 38.0] + friction * np.tanh(v / 1e-3) + 80 * v + [0.0, 100.0, 0.0]
    f = sign * np.roll(f, lag, axis=0) + noise * np.random.default_rng(1).normal(size=f.shape)
    return MotionLog(T, q(T) + 1e-6 * np.random.default_rng(2).normal(size=f.shape), f)


def kinds(found):
    return [finding.kind for finding in found.findings]


def test_a_good_log_has_no_findings():
    assert kinds(log()) == []
    assert kinds(log(friction=0.0)) == []


@pytest.mark.parametrize("lag", [-4, 2, 3, 10])
def test_forces_that_are_late_are_told_with_their_lag(lag):
    (found,) = log(lag).findings
    assert found.kind == "delay"
    assert (
        f"forces are {abs(lag)} samples {'late' if lag > 0 else 'early'} ({abs(lag) * 4} ms)" in found.message
    )
    assert f"by {-lag:+d} rows" in found.message


def test_forces_of_the_opposite_sign_are_told():
    assert kinds(log(sign=-1.0)) == ["sign of force"]
    assert kinds(log(lag=3, sign=-1.0)) == ["delay", "sign of force"]


def test_constant_speed_tells_no_mass():
    (found,) = log(q=lambda t: np.outer(t, [0.05, -0.04, 0.06])).findings
    assert found.kind == "constant velocity"
    assert "identify_friction" in found.message


def test_motion_that_is_too_slow_is_told_by_actuator():
    found = log(q=lambda t: motion(t) * [1.0, 1e-3, 1.0]).findings
    assert [(f.kind, f.message[:2]) for f in found] == [("slow", "q2")]


def test_millimetres_are_told():
    good = log()
    assert kinds(MotionLog(good.t, good.q * 1e3, good.f)) == ["millimetres"] * 3


def test_a_force_that_stays_at_its_limit_is_told_with_rows():
    good = log()
    found = MotionLog(good.t, good.q, np.clip(good.f, -150, 1e9)).findings
    assert {f.kind for f in found} == {"saturated force"}
    assert np.array_equal(found[0].rows, np.flatnonzero(good.f[:, 0] <= -150))


def test_times_and_rows_without_numbers_are_told_with_rows():
    good = log()
    t, q = good.t.copy(), good.q.copy()
    t[3000:] += 0.5
    t[100] = t[99]
    q[[7, 9], 1] = np.nan
    found = {f.kind: f for f in MotionLog(t, q, good.f).findings}
    assert list(found) == ["nan", "time", "gaps"]
    assert found["nan"].rows.tolist() == [7, 9]
    assert found["time"].rows.tolist() == [100]
    assert 3000 in found["gaps"].rows


def test_short_and_empty_logs_have_findings_or_none_but_no_errors():
    empty = np.zeros((0, 3))
    assert kinds(MotionLog([], empty, empty)) == []
    assert kinds(log()[:3]) == []
    assert kinds(MotionLog([np.nan], [[1.0]], [[1.0]])) == ["nan"]


def test_a_simulated_motion_makes_a_log_with_the_noise_that_is_asked_for():
    robot = GantryTau(prototypes.L1)
    result = simulate(robot, stop=0.2)
    clean = MotionLog.of(result, robot)
    assert np.allclose(clean.t, np.arange(51) * 0.004, rtol=0, atol=1e-12)
    assert np.array_equal(clean.q[:, 1], result.at(clean.t, "carts[1].s"))
    noisy = MotionLog.of(result, robot, encoder=1e-6, force=20.0, seed=4)
    again = MotionLog.of(result, robot, encoder=1e-6, force=20.0, seed=4)
    assert np.array_equal(noisy.f, again.f)
    # 153 draws: the deviation is known to 6 %, four times that is 0.23
    assert np.std(noisy.f - clean.f) == pytest.approx(20.0, rel=0.23)
    assert np.std(noisy.q - clean.q) == pytest.approx(1e-6, rel=0.23)
    with pytest.raises(ModelError, match="found period=0"):
        MotionLog.of(result, robot, period=0)
