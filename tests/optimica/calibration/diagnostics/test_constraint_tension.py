"""Priors and constraints that hold numbers against the data: told with how many deviations, and only then."""

import re

import numpy as np
import pytest

from gantrytau_models import F1GantryTau, SixLinkGantryTau, prototypes
from gantrytau_optimica import Measurements, calibrate
from tests.optimica.calibration import f1_data, synthetic_d1
from tests.optimica.calibration.synthetic import NOISE, grid, nominal

TRUE = prototypes.L1.arms[0].length
LENGTH = "arms[0].length"


def measured(seed=0, noise=NOISE, count=60):
    q, r = grid(prototypes.L1)
    rng = np.random.default_rng(seed)
    rows = rng.choice(len(q), count, replace=False)
    return Measurements(q[rows], r[rows] + noise * rng.standard_normal((count, 3)))


def told(found, kind):
    """The finding of a kind, and how many deviations it names."""
    (finding,) = [f for f in found.findings if f.kind == kind]
    return finding.message, float(re.findall(r"([\d.e+]+) deviations", finding.message)[0])


def constrained(constraints, data=None):
    return calibrate(nominal(2e-3), data or measured(), method="ipopt", constraints=constraints)


def test_a_limit_that_is_reached_is_told_with_its_multiplier():
    free = calibrate(nominal(2e-3), measured())
    message, deviations = told(constrained({LENGTH: (TRUE + 1e-3, TRUE + 1.0)}), "limit")
    off = TRUE + 1e-3 - free.parameters[LENGTH]
    # numbers of one arm alone: noise of the other two is pooled in
    assert deviations == pytest.approx(off / free.deviations[LENGTH], rel=0.3)
    assert message.startswith(f"arms[0].length stands at its limit {TRUE + 1e-3:.7g}, data want 2.0607")
    assert message.endswith("widen the limit, or look whether measurements and units are right")
    # of data without noise too
    assert told(constrained({LENGTH: (TRUE + 1e-3, TRUE + 1.0)}, measured(noise=0.0)), "limit")[1] > 1e3
    assert not constrained({LENGTH: (TRUE - 1e-2, TRUE + 1.0)}).findings


@pytest.mark.parametrize(
    ("wrong", "right"),
    [
        ({LENGTH: TRUE - 2e-3}, {LENGTH: TRUE}),
        (
            {"|arms[0].direction|": 1.0},
            {"|arms[0].direction|": float(np.linalg.norm(prototypes.L1.arms[0].direction))},
        ),
        ({"arms[1].direction": "arms[2].direction"}, {"arms[1].offset[0]": prototypes.L1.arms[1].offset[0]}),
    ],
)
def test_equations_that_data_contradict(wrong, right):
    message, deviations = told(constrained(wrong), "equation")
    assert deviations > 10
    assert "a constraint holds it at" in message
    assert not constrained(right).findings


@pytest.mark.parametrize("loss", ["linear", "robust"])
def test_a_wrong_prior_is_told_however_tight(loss):
    for deviation in (1e-9, 1e-4):
        found = calibrate(nominal(2e-3), measured(), prior={LENGTH: (TRUE + 1e-3, deviation)}, loss=loss)
        message, deviations = told(found, "prior")
        # as L is known without it
        assert deviations == pytest.approx(1e-3 / np.hypot(90e-6, deviation), rel=0.3)
        assert message.startswith("data want arms[0].length at 2.060")
        assert f"the prior {TRUE + 1e-3:.7g} +- {deviation:g} holds it" in message
        assert message.endswith("look at its value, or give it a larger deviation")
    assert not calibrate(nominal(2e-3), measured(), prior={LENGTH: (TRUE + 1e-3, 1e-3)}, loss=loss).findings


def test_a_prior_of_several_numbers_names_three():
    found = calibrate(nominal(2e-2), measured(), prior={"length": 1e-6, "offset": 1e-6})
    message, _ = told(found, "prior")
    assert message.count("data want") == 3
    assert re.search(r"; and \d+ more; the other numbers are pulled along", message)


def test_plates_that_turn():
    q, r, R, _ = synthetic_d1.measure(1, 80)
    robot, data = SixLinkGantryTau(prototypes.D1), Measurements(q, r, R)
    assert "prior" not in {f.kind for f in calibrate(robot, data, prior={"plate_offset": 2e-3}).findings}
    name, value = "arms[0].links[0].length", prototypes.D1.arms[0].links[0].length
    found = calibrate(robot, data, prior={name: (value + 2e-2, 1e-9)})
    assert told(found, "prior")[1] > 5
    poses = f1_data.measured(f1_data.f1_poses(f1_data.f1_arms(), 60), seed=0)
    value = prototypes.F1.arms[0].links[0].length
    for off in (0.0, 2e-3):
        found = calibrate(F1GantryTau(prototypes.F1), Measurements(*poses), prior={name: (value + off, 1e-6)})
        assert ("prior" in {f.kind for f in found.findings}) == bool(off)


def test_true_priors_raise_no_alarm():
    for seed in range(20):
        off = 1e-4 * np.random.default_rng(seed).standard_normal(3)
        prior = {f"arms[{i}].length": (prototypes.L1.arms[i].length + off[i], 1e-4) for i in range(3)}
        assert not calibrate(nominal(2e-3, seed), measured(seed, count=30), prior=prior).findings
