"""Closure equations of arms with turntables, and their fits, against the reference by hand, differences and Ipopt."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gantrytau import Array, Model, ModelError, Parameter, SolveError
from gantrytau.kinematics.rotations import of_vectors
from gantrytau_models import F1GantryTau, FourBar, GantryTau, SixLinkGantryTau, prototypes
from gantrytau_optimica.calibration.fitting.fit_arm import fit_arm
from gantrytau_optimica.calibration.fitting.ipopt_fit import solve
from gantrytau_optimica.calibration.fitting.rod_fit import fit_group
from gantrytau_optimica.calibration.links.arm_closure import read_arms, rotation
from gantrytau_optimica.calibration.links.arm_factors import scales
from gantrytau_optimica.calibration.links.arm_poses import pose_rows, poses_of
from gantrytau_optimica.calibration.links.error_models import grouped, links_of_arm
from tests.optimica.calibration.f1_data import DEVICE, f1_arms, f1_poses, measured
from tests.references import f1

ORIENTATIONS = ("local", "unit", "free")
COUNTS = {"local": (10, 23, 36), "unit": (10, 24, 38), "free": (10, 24, 38)}


@pytest.fixture(scope="module")
def truth():
    return f1_arms()


@pytest.fixture(scope="module")
def poses(truth):
    return f1_poses(truth, 185)


@pytest.fixture(scope="module")
def data(poses):
    return measured(poses, seed=1)


def disturbed(arm, *, seed: int, size: float = 2e-3):
    """Its unknowns wrong by about 2 mm at the joints, quaternions still of unit length."""
    start = arm.moved(size * scales(arm) * np.random.default_rng(seed).standard_normal(arm.count))
    values = dict(start.values)
    for turntable in start.turntables:
        u = values[f"{turntable.name}.orientation"]
        values[f"{turntable.name}.orientation"] = u / np.linalg.norm(u)
    return dataclasses.replace(start, values=values)


@pytest.mark.parametrize("orientation", ORIENTATIONS)
def test_the_thesis_counts_10_24_and_38_parameters(orientation):
    arms = f1_arms(orientation)
    # a local rotation has one less than a quaternion
    assert tuple(arm.count for arm in arms) == COUNTS[orientation]
    assert all(len(set(arm.names)) == arm.count == len(arm.vector) for arm in arms)


def test_linear_arms_have_7_and_10_17_24_parameters():
    assert [arm.count for arm in read_arms(GantryTau(prototypes.L1))] == [7, 7, 7]
    # lengths, joints on cart and plate, and one direction for all links of a cart
    assert [arm.count for arm in read_arms(SixLinkGantryTau(prototypes.D1))] == [10, 17, 24]


@pytest.mark.parametrize("orientation", ORIENTATIONS)
@pytest.mark.parametrize("robot", ["L1", "D1", "F1"])
def test_jacobian_is_that_of_differences(orientation, robot):
    models = {"L1": GantryTau, "D1": SixLinkGantryTau, "F1": F1GantryTau}
    rng = np.random.default_rng(3)
    R = None if robot == "L1" else Rotation.random(5, rng=np.random.default_rng(2)).as_matrix()
    q, r = rng.standard_normal((5, 6)), rng.standard_normal((5, 3))  # closure need not hold for this
    for nominal in read_arms(models[robot](getattr(prototypes, robot)), orientation, gains=True):
        arm = nominal.moved(0.02 * rng.standard_normal(nominal.count))
        J = arm.closure(q, r, R)[1]
        steps = 1e-6 * np.eye(arm.count)
        ends = [[arm.moved(h * step).closure(q, r, R)[0] for h in (1.0, -1.0)] for step in steps]
        differences = np.stack([(after - before) / 2e-6 for after, before in ends], axis=-1)
        # 1e-6 squared, and 1e-16 / 1e-6 by size 10
        np.testing.assert_allclose(J, differences, atol=1e-8, rtol=0)


@pytest.mark.parametrize("robot", ["D1", "F1"])
def test_slopes_by_the_pose_are_those_of_differences(robot):
    arms = f1_arms() if robot == "F1" else read_arms(SixLinkGantryTau(prototypes.D1))
    rng = np.random.default_rng(4)
    q, r, R = (
        rng.standard_normal((5, 6)),
        rng.standard_normal((5, 3)),
        Rotation.random(5, rng=np.random.default_rng(2)).as_matrix(),
    )

    def errors(x):
        turned = of_vectors(np.tile(x[3:], (5, 1))) @ R
        return np.concatenate([arm.closure(q, r + x[:3], turned)[0] for arm in arms], axis=1)

    differences = np.stack([(errors(x) - errors(-x)) / 2e-6 for x in 1e-6 * np.eye(6)], axis=-1)
    np.testing.assert_allclose(pose_rows(arms, q, r, R), differences, atol=1e-8, rtol=0)


def test_closure_holds_where_lagranges_equations_put_the_robot(truth):
    for state in f1.consistent_states(prototypes.F1, 3, seed=4):
        for arm in truth:
            errors = arm.closure(state.q[None], state.T[None], state.R[None])[0]
            assert np.abs(errors).max() < 1e-13  # rounding, after the steps of Newton there


def test_a_quaternion_of_any_length_is_a_matrix_as_the_thesis_has_it():
    u = np.array([0.6308, 0.0054, 0.0054, -0.7467])  # Table 5.5, sign corrected
    np.testing.assert_allclose(rotation(u), f1.rotation(u), atol=1e-15)
    unit = u / np.linalg.norm(u)
    np.testing.assert_allclose(
        rotation(unit), Rotation.from_quat(unit, scalar_first=True).as_matrix(), atol=1e-15
    )


@pytest.mark.parametrize("orientation", ORIENTATIONS)
def test_fit_explains_measurements_to_their_noise(orientation, data, poses):
    for arm in f1_arms(orientation):
        fit = fit_arm(disturbed(arm, seed=5), *data)
        assert fit.success
        assert fit.iterations <= 12
        # errors of 10 um and 20 urad at 0.35 m; their deviation is known to a twentieth
        assert fit.deviation == pytest.approx(1.07e-5, rel=0.15)
        # other poses than those measured, without noise: what is left is the error of the identified parameters
        assert np.abs(fit.arm.closure(*poses)[0]).mean() < 0.5 * DEVICE


def test_fit_without_noise_finds_the_true_links(truth, poses):
    for arm in truth:
        fit = fit_arm(disturbed(arm, seed=6), *poses, noise=1e-9)
        assert np.abs(fit.residuals).max() < 1e-12  # rounding of metres
        lengths = [name for name in arm.names if name.endswith(".length") or ".direction" in name]
        found, true = (dict(zip(a.names, a.vector, strict=True)) for a in (fit.arm, arm))
        assert max(abs(found[name] - true[name]) for name in lengths) < 1e-8  # rounding by the condition, 1e4


def test_covariance_of_a_fit_is_that_of_repeated_measurements(truth, poses):
    arm = truth[1]
    fits = [fit_arm(arm, *measured(poses, seed=seed)) for seed in range(60)]
    columns = [k for k, name in enumerate(arm.names) if ".length" in name or ".direction" in name]
    spread = np.std([fit.arm.vector[columns] for fit in fits], axis=0, ddof=1)
    said = np.sqrt(np.mean([np.diag(fit.covariance)[columns] for fit in fits], axis=0))
    np.testing.assert_allclose(spread, said, rtol=0.4)  # four standard deviations of a spread of 60


def fitted(arm, data):
    (group,) = grouped(links_of_arm(arm, *data))
    return fit_group(group)


@pytest.mark.parametrize("orientation", ORIENTATIONS)
def test_ipopt_finds_the_same_arm(orientation, data):
    found = fitted(disturbed(f1_arms(orientation)[1], seed=7), data)
    (other,) = solve([found])
    assert np.abs(found.group.errors(found.x) - found.group.errors(other.x)).max() < 1e-10  # m
    assert other.x == pytest.approx(found.x, abs=1e-7)


def test_ipopt_keeps_what_is_fixed_or_limited(truth, data):
    arm = truth[0]
    name = "arms[0].links[0].length"
    low, high = float(arm.values[name]) + 1e-4, float(arm.values[name]) + 2e-4
    (fit,) = solve([fitted(arm, data)], {"arms[0].direction[2]": 0.99, name: (low, high)})
    assert fit.values["arms[0].direction[2]"] == pytest.approx(0.99, abs=1e-12)
    assert low - 1e-9 < fit.values[name] < high + 1e-9


def test_gains_of_turntables_are_found(truth, poses):
    wrong = 1.002
    arm = f1_arms(gains=True)[1]
    q = poses.q.copy()
    q[:, 3] /= wrong
    fit = fit_arm(arm, q, poses.r, poses.R)
    gain = arm.names.index("turntables[0].gain")
    assert fit.arm.vector[gain] == pytest.approx(wrong, abs=1e-9)  # no noise: rounding by the condition
    assert fit_arm(truth[1], q, poses.r, poses.R).deviation > 1e-6  # without it errors stay


def test_robust_loss_sets_outliers_aside(truth, data):
    arm, r = truth[0], data.r.copy()
    r[::20] += [0.02, 0.0, 0.0]
    good = fit_arm(arm, *data).arm.values["arms[0].links[0].length"]
    plain, robust = (fit_arm(arm, data.q, r, data.R, loss=loss) for loss in ("linear", "robust"))
    assert abs(plain.arm.values["arms[0].links[0].length"] - good) > 1e-3
    assert abs(robust.arm.values["arms[0].links[0].length"] - good) < 1e-4


def test_prior_holds_a_parameter(truth, data):
    arm = disturbed(truth[0], seed=8)
    fit = fit_arm(arm, *data, prior={"arms[0].offset": 1e-9})
    np.testing.assert_allclose(fit.arm.values["arms[0].offset"], arm.values["arms[0].offset"], atol=1e-8)


def test_poses_out_of_reach_are_told(truth, poses):
    q = poses.q[:3].copy()
    q[1, 0] += 4.0
    with pytest.raises(SolveError, match=r"the links of 1 poses, the first in row 1, cannot be closed"):
        poses_of(truth, q, poses.r[:3], poses.R[:3])
    r, _ = poses_of(truth, q, poses.r[:3], poses.R[:3], all_of_them=False)
    assert np.isnan(r).all(axis=1).tolist() == [False, True, False]


def test_what_cannot_be_an_arm_is_refused():
    with pytest.raises(ModelError, match="FourBar that does not say what its rods are"):
        read_arms(FourBar())
    stretched = F1GantryTau(prototypes.F1, turntables=[dict(orientation=[1.0, 0.1, 0.0, 0.0]), {}, {}])
    with pytest.raises(ModelError, match=r"turntables\[0\]\.orientation: found a quaternion of length"):
        read_arms(stretched)
    assert read_arms(stretched, "free")[1].count == 24


@pytest.mark.parametrize(
    ("change", "argument", "names"),
    [
        (dict(prior={"arms[2].lenght": 1e-3}), "prior", "did you mean 'arms[2]."),
        (dict(prior={"arms[2].offset": 0.0}), "prior", "arms[2].offset"),
        (dict(prior=[1.0]), "prior", "a dict"),
        (dict(q=np.zeros((185, 4))), "q", "185 x 4"),
        (dict(r=np.zeros((4, 3))), "r", "4 x 3"),
        (dict(r=np.full((185, 3), np.nan)), "r", "finite"),
        (dict(R=None), "R", "the plate turns"),
    ],
    ids=["name", "deviation", "mapping", "joints", "rows", "finite", "orientations"],
)
def test_what_does_not_fit_an_arm_is_refused(change, argument, names, truth, data):
    with pytest.raises(ModelError) as refusal:
        fit_arm(truth[2], **{**data._asdict(), **change})
    assert refusal.value.argument == argument
    assert names in str(refusal.value)


class Guideway(Model):
    """What calibration reads of an arm with one link."""

    length = Parameter(unit="m", description="length of the link")
    offset = Parameter([0.0, 1.0, 0.0], unit="m", description="cart at s = 0")
    direction = Parameter([1.0, 0.0, 0.0], unit="1", description="axis")


class AlikeRobot(Model):
    """Three arms of one length, which is a parameter of the robot."""

    size = Parameter(2.1, unit="m", description="length of all links")
    arms = Array(Guideway, 3, length=2 * size)

    rods = GantryTau.rods


def test_parameters_that_follow_from_others_are_read():
    arms = read_arms(AlikeRobot())
    assert [float(arm.values[f"{arm.name}.length"]) for arm in arms] == [4.2, 4.2, 4.2]
    assert [arm.count for arm in arms] == [7, 7, 7]
