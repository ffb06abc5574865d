"""Calibration by Ipopt under equations and limits, against what they say and against multipliers by hand."""

import numpy as np
import pytest

from gantrytau import ModelError, SolveError
from gantrytau_models import F1GantryTau, GantryTau, SixLinkGantryTau, prototypes
from gantrytau_optimica import Measurements, calibrate
from tests.optimica.calibration import f1_data, synthetic_d1
from tests.optimica.calibration.synthetic import NOISE, grid, nominal

LENGTHS = [f"arms[{i}].length" for i in range(3)]


@pytest.fixture(scope="module")
def data():
    q, r = grid(prototypes.L1)
    return Measurements(q, r + NOISE * np.random.default_rng(0).standard_normal(r.shape))


def constrained(data, constraints, robot=None, **policy):
    return calibrate(robot or nominal(), data, method="ipopt", constraints=constraints, **policy)


def test_lengths_of_vectors_numbers_and_pairs_are_kept(data):
    wanted = {
        "|arms[0].direction|": 1.0,
        "arms[1].offset[0]": prototypes.L1.arms[1].offset[0],
        "arms[1].direction": "arms[2].direction",
    }
    found = constrained(data, wanted)
    assert np.linalg.norm(found.parameters["arms[0].direction"]) == pytest.approx(1.0, abs=1e-9)
    assert found.parameters["arms[1].offset[0]"] == pytest.approx(prototypes.L1.arms[1].offset[0], abs=1e-9)
    assert found.parameters["arms[1].direction"] == pytest.approx(
        found.parameters["arms[2].direction"], abs=1e-9
    )
    assert found.success


def test_a_limit_that_does_not_matter_changes_nothing(data):
    free = calibrate(nominal(), data)
    found = constrained(data, {"arms[0].length": (1.0, 3.0)})
    for name, value in free.parameters.items():
        assert found.parameters[name] == pytest.approx(value, abs=1e-9)
    assert found.covariance(LENGTHS) == pytest.approx(free.covariance(LENGTHS), rel=1e-6, abs=0)


def test_a_limit_holds_and_moves_the_others_as_their_covariance_says(data):
    free = calibrate(nominal(), data)
    names = ["arms[0].length", "arms[0].offset", "arms[0].direction"]
    C = free.covariance(names)
    least = free.parameters["arms[0].length"] + 3e-5
    found = constrained(data, {"arms[0].length": (least, 10.0)})
    assert found.parameters["arms[0].length"] == pytest.approx(least, abs=1e-9)
    moved = np.concatenate([np.atleast_1d(found.parameters[n] - free.parameters[n]) for n in names])
    # of one link the covariance is s^2 (J'J)^-1: the minimum with one number held is elsewhere by C e / C_11
    assert moved == pytest.approx(3e-5 * C[:, 0] / C[0, 0], abs=1e-7)
    # a ten-thousandth of what it was
    assert found.deviations["arms[0].length"] == pytest.approx(0.0, abs=1e-9)
    assert np.all(np.sqrt(np.diag(found.covariance(names))) <= 1.0001 * np.sqrt(np.diag(C)))


def test_pairs_of_equal_links_and_what_data_leave_open():
    q, r, R, _ = synthetic_d1.measure(0)
    pair = {"arms[1].links[0].length": "arms[1].links[1].length"}
    found = constrained(Measurements(q, r, R), pair, SixLinkGantryTau(prototypes.D1))
    lengths = [found.parameters[f"arms[1].links[{j}].length"] for j in (0, 1)]
    assert lengths[0] == pytest.approx(lengths[1], abs=1e-9)
    free = calibrate(SixLinkGantryTau(prototypes.D1), Measurements(q, r, R))
    assert found.error < 1.5 * free.error


def test_an_f1_with_constraints_a_prior_and_a_robust_loss():
    poses = f1_data.f1_poses(f1_data.f1_arms(), 120)
    measured = f1_data.measured(poses, seed=0)
    robot = F1GantryTau(prototypes.F1)
    pair = {"arms[1].links[0].length": "arms[1].links[1].length", "|arms[0].direction|": (0.9, 0.995)}
    found = constrained(Measurements(*measured), pair, robot)
    lengths = [found.parameters[f"arms[1].links[{j}].length"] for j in (0, 1)]
    assert lengths[0] == pytest.approx(lengths[1], abs=1e-9)
    assert np.linalg.norm(found.parameters["arms[0].direction"]) <= 0.995 + 1e-9
    prior = {"plate_offset": 1e-4}
    ours, other = (
        calibrate(robot, Measurements(*measured), prior=prior, method=m) for m in ("gauss-newton", "ipopt")
    )
    assert other.parameters["arms[0].links[0].length"] == pytest.approx(
        ours.parameters["arms[0].links[0].length"], abs=1e-6
    )
    r = measured.r.copy()
    r[[4, 40, 80]] += 0.02
    robust = calibrate(robot, Measurements(measured.q, r, measured.R), method="ipopt", loss="robust")
    assert {4, 40, 80} <= set(next(f for f in robust.findings if f.kind == "outliers").rows)
    assert np.median(robust.errors) < 25e-6
    between = {"arms[0].links[0].length": "arms[1].links[0].length"}
    same = constrained(Measurements(*measured), between, robot).parameters
    assert same["arms[0].links[0].length"] == pytest.approx(same["arms[1].links[0].length"], abs=1e-9)


@pytest.mark.parametrize(
    ("constraints", "name"),
    [
        ({"arms[0].lenght": 1.0}, "did you mean 'arms[0].length'"),
        ({"arms[0].length": (2.0, 1.0)}, "arms[0].length"),
        ({"arms[0].length": "arms[0].offset"}, "arms[0].offset"),
        ({"|arms[0].direction|": -1.0}, "|arms[0].direction|"),
        ([1.0], "a dict"),
    ],
)
def test_what_is_no_constraint(data, constraints, name):
    with pytest.raises(ModelError) as refusal:
        constrained(data, constraints)
    assert refusal.value.argument == "constraints"
    assert name in str(refusal.value)


def test_constraints_that_contradict_each_other_have_no_minimum(data):
    with pytest.raises(SolveError, match="contradict"):
        constrained(
            data, {"arms[0].length": 2.0, "arms[1].length": "arms[0].length", "|arms[1].length|": 1.0}
        )


def test_gauss_newton_keeps_no_constraints(data):
    with pytest.raises(ModelError) as refusal:
        calibrate(GantryTau(prototypes.L1), data, constraints={"|arms[0].direction|": 1.0})
    assert refusal.value.argument == "constraints"
