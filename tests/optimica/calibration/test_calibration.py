"""Three links calibrated from 779 poses with the noise of a laser tracker, as in section 5.2."""

import json
from typing import Any, cast

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau_models import GantryTau, prototypes
from gantrytau_optimica import Measurements, calibrate
from tests.optimica.calibration.synthetic import NOISE, grid, inverse, nominal, three_links
from tests.optimica.refusals import refused

LENGTHS = [f"arms[{i}].length" for i in range(3)]
TRUTH = prototypes.L1


@pytest.fixture(scope="module")
def poses():
    return grid(TRUTH)


def measured(poses, seed=0, noise=NOISE):
    q, r = poses
    return Measurements(q, r + noise * np.random.default_rng(seed).standard_normal(r.shape))


@pytest.fixture(scope="module")
def found(poses):
    return calibrate(nominal(), measured(poses))


def slopes(i, q, r):
    """Derivatives of the closure equation of link i by (L, A, v), by hand."""
    L, A, v = (x[i] for x in three_links(TRUTH))
    d = A + q[:, i, None] * v - r
    return np.column_stack([np.full(len(q), -2 * L), 2 * d, 2 * q[:, i, None] * d])


def bound(i, q, r):
    """Cramer-Rao bound of the parameters of link i: noise of r moves the closure error by 2 L times as much."""
    J = slopes(i, q, r)
    return (2 * TRUTH.arms[i].length * NOISE) ** 2 * np.linalg.inv(J.T @ J)


def names(i):
    return [f"arms[{i}].length", f"arms[{i}].offset", f"arms[{i}].direction"]


def values(found, i):
    return np.concatenate([np.atleast_1d(found.parameters[name]) for name in names(i)])


def true_values(i):
    L, A, v = three_links(TRUTH)
    return np.concatenate([[L[i]], A[i], v[i]])


def test_poses_that_were_held_out_are_met_up_to_noise(found):
    assert found.success
    assert found.iterations <= 6
    # three coordinates with 10 um each are 16 um long in the mean
    assert 14e-6 < found.error < 18e-6
    assert found.errors.shape == (389,)
    assert found.noise == pytest.approx(NOISE, rel=0.06)  # twice the deviation of an estimate from 390 poses


def test_the_true_robot_is_met_better_than_noise(found, poses):
    q, r = poses
    position, _ = found.kinematics.fk(q, near=r)
    assert np.linalg.norm(position - r, axis=1).mean() < 4e-6


@pytest.mark.parametrize("seed", range(4))
def test_parameters_are_within_four_deviations_of_the_bound(poses, seed):
    q, r = poses
    found = calibrate(nominal(), measured(poses, seed))
    for i in range(3):
        limit = np.sqrt(np.diag(bound(i, q[::2], r[::2])))
        assert np.all(np.abs(values(found, i) - true_values(i)) < 4 * limit)
        assert np.sqrt(np.diag(found.covariance(names(i)))) == pytest.approx(limit, rel=0.1)
        assert 15e-6 < limit[0] < 19e-6  # on this grid


def test_covariance_agrees_with_repeated_measurements(poses):
    # arms vary together, as they share the noise of a position; 100 repetitions leave 7 % of a deviation
    runs = [calibrate(GantryTau(TRUTH), measured(poses, seed)) for seed in range(100)]
    sample = np.cov([[run.parameters[n] for n in LENGTHS] for run in runs], rowvar=False)
    told = runs[0].covariance(LENGTHS)
    assert np.sqrt(np.diag(told)) == pytest.approx(np.sqrt(np.diag(sample)), rel=0.2)
    correlation = [C / np.sqrt(np.outer(np.diag(C), np.diag(C))) for C in (told, sample)]
    assert correlation[0] == pytest.approx(correlation[1], abs=0.25)
    assert np.abs(correlation[0] - np.eye(3)).max() > 0.05


def test_gauss_newton_and_ipopt_agree(found, poses):
    other = calibrate(nominal(), measured(poses), method="ipopt")
    for name, value in found.parameters.items():
        assert other.parameters[name] == pytest.approx(value, abs=1e-9)
    assert other.error == pytest.approx(found.error, rel=1e-6)
    assert other.covariance(LENGTHS) == pytest.approx(found.covariance(LENGTHS), rel=1e-6)


def test_a_linear_start_needs_no_nominal_values(found, poses):
    other = calibrate(GantryTau(prototypes.D1), measured(poses), start="linear")
    for name, value in found.parameters.items():
        assert other.parameters[name] == pytest.approx(value, abs=1e-9)
    assert other.iterations <= 5


def test_parallel_guideways_are_not_enough(poses):
    parallel = calibrate(GantryTau(TRUTH), measured(poses), model="parallel")
    free = calibrate(GantryTau(TRUTH), measured(poses), model="parallel", start="linear")
    # directions of L1 are 0.05 to 0.25 degrees apart, about twice the 0.1 degrees that the thesis speaks of
    assert 0.5e-3 < parallel.error < 1.0e-3
    assert 0.3e-3 < free.error < parallel.error
    assert len(parallel.names) == 12
    assert len(free.names) == 15
    assert np.ptp([parallel.parameters[f"arms[{i}].direction"] for i in range(3)], axis=0).max() == 0


def test_measurements_in_another_frame_are_identified_there(poses):
    q, r = poses
    c, s = np.cos(0.4), np.sin(0.4)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    moved = measured((q, r @ turn.T + [1.0, 2.0, 3.0]))
    found = calibrate(nominal(), moved)
    assert [f.kind for f in found.findings] == ["frame"]
    assert 14e-6 < found.error < 18e-6
    for i in range(3):
        assert found.parameters[f"arms[{i}].direction"] == pytest.approx(
            turn @ TRUTH.arms[i].direction, abs=1e-4
        )


def test_a_robust_loss_is_not_moved_by_outliers(found, poses):
    data = measured(poses)
    r = data.r.copy()
    rng = np.random.default_rng(5)
    rows = np.arange(0, 779, 20)
    r[rows] += rng.normal(0, 0.01, (len(rows), 3))
    dirty = Measurements(data.q, r)
    robust = calibrate(nominal(), dirty, loss="robust")
    linear = calibrate(nominal(), dirty)
    deviation = np.sqrt(np.diag(found.covariance(LENGTHS)))
    shift = [robust.parameters[n] - found.parameters[n] for n in LENGTHS]
    assert np.all(np.abs(shift) < deviation)
    assert np.max(np.abs([linear.parameters[n] - found.parameters[n] for n in LENGTHS]) / deviation) > 4
    (outliers,) = [f for f in robust.findings if f.kind == "outliers"]
    assert set(outliers.rows) == set(rows)


def test_a_prior_holds_what_few_poses_do_not(poses):
    q, r = poses
    few = Measurements(q[::40], r[::40] + NOISE * np.random.default_rng(2).standard_normal(r[::40].shape))
    start = nominal(0.001)
    held = calibrate(start, few, prior={"length": 1e-6, "arms[1].direction": (TRUTH.arms[1].direction, 1e-7)})
    free = calibrate(start, few)
    before = calibrate(start, measured(poses), holdout=None).nominal_rods.values
    for name in LENGTHS:
        assert held.parameters[name] == pytest.approx(before[name], abs=4e-6)
        assert held.deviations[name] < 1.1e-6 < free.deviations[name]
    assert held.parameters["arms[1].direction"] == pytest.approx(TRUTH.arms[1].direction, abs=4e-7)


def test_poses_to_hold_out_can_be_chosen(poses):
    data = measured(poses)
    assert len(calibrate(nominal(), data, holdout=None).rows) == 779
    chosen = calibrate(nominal(), data, holdout=[3, 4, 5])
    assert chosen.held_out.tolist() == [3, 4, 5]
    assert chosen.errors.shape == (3,)


def test_names_of_vectors_and_of_elements_are_accepted(found):
    assert found.parameters["arms[1].offset[2]"] == found.parameters["arms[1].offset"][2]
    whole = found.covariance(["arms[1].offset"])
    assert whole.shape == (3, 3)
    assert found.covariance(["arms[1].offset[2]"])[0, 0] == whole[2, 2]
    assert found.covariance().shape == (21, 21)


def test_the_calibrated_robot_is_a_model(found, poses):
    _, r = poses
    again = calibrate(found.robot, measured(poses))
    assert again.iterations <= 2
    assert found.kinematics.ik(r[:5]) == pytest.approx(inverse(TRUTH, r[:5]), abs=1e-4)


def test_the_report_holds_the_numbers(found, tmp_path):
    page = found.report(tmp_path / "calibration.html")
    text = page.read_text(encoding="utf-8")
    assert "<svg" in text
    assert "arms[0].offset[2]" in text
    numbers = json.loads((tmp_path / "calibration.json").read_text(encoding="utf-8"))
    assert numbers["error_m"]["mean"] == pytest.approx(found.error)
    assert len(numbers["covariance"]["names"]) == 21
    assert sum(numbers["histogram"]["counts"]) == 389
    assert sum(numbers["principal_axes"]["shares"]) == pytest.approx(1.0)
    # what is left is white: no test of it is that unlikely by chance
    assert min(test["probability"] for test in numbers["residual_tests"]) > 1e-3


def test_residual_tests_see_a_bent_guideway(poses, tmp_path):
    q, r = poses
    bent = q.copy()
    bent[:, 1] += 30e-6 * np.sin(2 * np.pi * q[:, 1] / 0.7)
    found = calibrate(nominal(), measured((bent, r)))
    found.report(tmp_path / "bent.html")
    numbers = json.loads((tmp_path / "bent.json").read_text(encoding="utf-8"))
    along = {
        t["link"]: t["probability"] for t in numbers["residual_tests"] if t["test"] == "along the guideway"
    }
    assert along["arms[1]"] < 1e-6 < along["arms[0]"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (dict(model=3), "all six links"),
        (dict(model=2), "no rails"),
        (dict(constraints={"arms[0].length": 2.0}), "constraints="),
        (dict(holdout="third"), "holdout='third'"),
        (dict(holdout=[1000]), "rows from 0 to 778"),
        (dict(prior={"arms[0].lenght": 1e-3}), "did you mean"),
        (dict(prior={"length": 0.0}), "above 0"),
        (dict(prior=[1.0]), "deviations in m by name"),
    ],
)
def test_arguments_that_do_not_fit(poses, arguments, words):
    with pytest.raises(ModelError, match=words.replace("[", r"\[")):
        calibrate(nominal(), measured(poses), **arguments)


def test_robots_and_names_that_are_none(found, poses):
    from gantrytau_models import Pendulum

    with pytest.raises(ModelError, match="expected a model instance"):
        calibrate(cast(Any, "L1"), measured(poses))
    with pytest.raises(ModelError, match="found Pendulum that does not say what its rods are"):
        calibrate(Pendulum(), measured(poses))
    with refused("measurements"):
        calibrate(nominal(), poses)
    with pytest.raises(ModelError, match="did you mean"):
        found.covariance(["arms[0].lengh"])
    with pytest.raises(ModelError, match="expected a list"):
        found.covariance("arms[0].length")
    with pytest.raises(ModelError, match="there is no"):
        found.parameters["arms[3].length"]
    parallel = calibrate(nominal(), measured(poses), model="parallel")
    with pytest.raises(ModelError, match="held at its value"):
        parallel.covariance(["arms[0].direction"])


def test_a_robot_of_ones_own_is_calibrated_under_its_own_names(poses):
    from tests.kinematics.test_rods import Tripod

    robot = Tripod(low=dict(length=TRUTH.arms[0].length + 0.002))
    found, other = calibrate(robot, measured(poses)), calibrate(nominal(), measured(poses))
    for name, known in (("low", "arms[0]"), ("high", "arms[1]"), ("far", "arms[2]")):
        for part in ("length", "offset", "direction"):
            assert found.parameters[f"{name}.{part}"] == pytest.approx(
                other.parameters[f"{known}.{part}"], abs=1e-9
            )
    q, r = poses
    assert found.kinematics.joints == ("low_cart.s", "high_cart.s", "far_cart.s")
    assert found.kinematics.ik(r[:5]) == pytest.approx(q[:5], abs=2e-4)
