"""What systems and servos are told beside their numbers: drifts, orders too low, steps that come twice."""

import numpy as np
import pytest

from gantrytau_optimica import StepResponse, identify_servo, identify_system

RINGING = 0.99 * np.array([[0.95, 0.2], [-0.2, 0.95]])


def outputs(seed, drift=0.0):
    """A ringing mode struck by white noise, with noise of 5 % and a drift."""
    u, x, y = np.random.default_rng(seed).normal(size=(2000, 1)), np.zeros(2), np.zeros((2000, 1))
    for k in range(len(u)):
        y[k], x = x[0], RINGING @ x + [0, u[k, 0]]
    noise = 0.05 * np.random.default_rng(seed + 100).normal(size=y.shape)
    return u, y + noise + np.linspace(0, drift, len(u))[:, None]


@pytest.mark.parametrize(
    ("drift", "order", "kinds"), [(0.0, 2, []), (30.0, 2, ["drift"]), (0.0, 1, ["order"])]
)
def test_drifts_and_orders_too_low_are_told(drift, order, kinds):
    for seed in range(3):
        found = identify_system(*outputs(seed, drift), order=order, period=0.01)
        assert [f.kind for f in found.findings if f.kind != "unstable"] == kinds  # a drift may grow


def test_an_integrator_does_not_drift():
    """A walk of sums of noise has slopes, which its inputs explain."""
    for seed in range(3):
        u = np.random.default_rng(seed).normal(size=(2000, 1))
        y = 0.98 * np.cumsum(np.vstack([[0.0], u[:-1]]), axis=0) + 0.1 * np.random.default_rng(9).normal(
            size=u.shape
        )
        assert [f.kind for f in identify_system(u, y, order=1, period=0.01).findings] in ([], ["unstable"])


def step(size, seed):
    """A step of a servo of a pole of 0.9 that comes 6 samples late."""
    t = 0.004 * np.arange(300)
    r, y = np.where(t > 0.1, size, 0.0), np.zeros(300)
    for k in range(1, 300):
        y[k] = 0.9 * y[k - 1] + 0.1 * r[max(k - 5, 0)]
    return StepResponse(t, r, y + np.random.default_rng(seed).normal(0, 1e-4, 300))


def test_a_step_that_comes_twice_and_strays_are_told():
    steps = [step(0.02, 0), step(0.04, 1)]
    assert identify_servo(steps).findings == ()
    twice = identify_servo([*steps, steps[0]])
    (found,) = twice.findings
    assert found.kind == "duplicates"
    assert "step 0 and step 2 hold the same values" in found.message
    spoilt = StepResponse(
        steps[0].t, steps[0].reference, steps[0].position + 0.005 * (np.arange(300) == 200)[:, None]
    )
    (found,) = identify_servo([spoilt, steps[1]]).findings
    assert (found.kind, found.rows.tolist()) == ("outliers", [200])
    assert "of step 0" in found.message
