"""Ranks and redundant parameters: Table 5.4, invariances of rigid bodies, and data that hold too little."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import qr
from scipy.spatial.transform import Rotation

from gantrytau import ModelError, StructureError
from gantrytau_models import F1GantryTau, GantryTau, SixLinkGantryTau, prototypes
from gantrytau_optimica.calibration.design.identifiability import PoseArrays, identifiability
from gantrytau_optimica.calibration.fitting.fit_arm import fit_arm
from gantrytau_optimica.calibration.links.arm_closure import read_arms
from tests.optimica.calibration.f1_data import ANGLE, DEVICE, f1_arms, f1_poses, measured
from tests.optimica.calibration.linear_data import carts
from tests.optimica.refusals import refused

# Table 5.4, Dressler (2012); 1u2 is turntables[0].orientation, 1u3 and 2u3 those of [1] and [2], r3 turntables[2].offset
TABLE_5_4 = {
    "arms[1].links[1].offset[1]": {"arms[1].offset[0]", "arms[1].offset[1]", "arms[1].links[0].offset[1]"},
    "arms[1].links[1].offset[2]": {
        "arms[1].links[0].offset[0]",
        "arms[1].links[0].offset[2]",
        "arms[1].links[1].offset[0]",
        "turntables[0].orientation[1]",
        "turntables[0].orientation[2]",
    },
    "turntables[2].offset[1]": {"arms[2].offset[0]", "arms[2].offset[1]"},
    "turntables[2].orientation[1]": {
        "turntables[2].offset[0]",
        "turntables[1].orientation[1]",
        "turntables[1].orientation[2]",
        "turntables[2].orientation[0]",
    },
    "arms[2].links[2].offset[0]": {
        "turntables[2].offset[0]",
        "arms[2].links[0].offset[0]",
        "arms[2].links[1].offset[0]",
    },
    "arms[2].links[2].offset[2]": {
        "arms[2].links[0].offset[2]",
        "arms[2].links[1].offset[2]",
        "arms[2].links[2].offset[1]",
        "turntables[2].orientation[2]",
        "turntables[2].orientation[3]",
    },
}


@pytest.fixture(scope="module")
def robot():
    return F1GantryTau(prototypes.F1)


@pytest.fixture(scope="module")
def poses():
    return f1_poses(f1_arms(), 185)


def linear_poses(count: int, *, turn: float, seed: int = 0) -> PoseArrays:
    """Anywhere near a D1, whether its links close there or not, which ranks do not ask for."""
    rng = np.random.default_rng(seed)
    r = np.array([-0.4, -4.5, 0.1]) + rng.uniform(-0.6, 0.6, (count, 3))
    R = Rotation.from_rotvec(turn * rng.standard_normal((count, 3))).as_matrix()
    return PoseArrays(r[:, :1] + 1.0 + rng.uniform(-0.4, 0.4, (count, 3)), r, R)


@pytest.mark.parametrize(
    ("orientation", "deficiency"), [("local", [0, 2, 4]), ("free", [0, 2, 4]), ("unit", [0, 3, 6])]
)
def test_rank_deficiency_of_the_f1(robot, poses, orientation, deficiency):
    found = identifiability(robot, poses, orientation)
    assert [arm.deficiency for arm in found.arms] == deficiency
    assert [len(arm.redundant) for arm in found.arms] == deficiency
    assert all(arm.count - arm.rank == arm.deficiency for arm in found.arms)


@pytest.mark.parametrize("noisy", [False, True], ids=["exact", "measured"])
@pytest.mark.parametrize("count", [40, 185])
def test_table_5_4(robot, poses, noisy, count):
    data = measured(poses, seed=2) if noisy else poses
    found = identifiability(robot, [each[:count] for each in data], "free")
    redundant = {name: set(others) for arm in found.arms for name, others in arm.redundant.items()}
    assert redundant == TABLE_5_4


def test_redundant_parameters_may_be_fixed(robot, poses):
    # moved away from the truth one after another, they are taken up by those that depend on them
    data = measured(poses, seed=3)
    for arm, said in zip(f1_arms("free"), identifiability(robot, poses, "free").arms, strict=True):
        best = fit_arm(arm, *data).deviation
        for name in said.redundant:
            step = np.where(np.array(arm.names) == name, 3e-3, 0.0)
            fit = fit_arm(arm.moved(step), *data, prior={name: 1e-9})
            # a direction that is held loosely, and so left where it starts, may start elsewhere
            assert fit.deviation == pytest.approx(best, rel=2e-2)


def test_an_orientation_that_does_not_change_leaves_joints_on_cart_and_plate_in_one():
    robot = SixLinkGantryTau(prototypes.D1)
    still = identifiability(robot, linear_poses(100, turn=0.0))
    assert [arm.deficiency for arm in still.arms] == [3, 6, 9]
    for arm in still.arms:
        for name, others in arm.redundant.items():
            assert name.endswith(tuple(f".offset[{k}]" for k in range(3)))
            assert others == [name.replace(".offset", ".plate_offset")]
    assert [arm.deficiency for arm in identifiability(robot, linear_poses(100, turn=0.1)).arms] == [0, 0, 0]


def test_an_orientation_that_hardly_changes_is_told_as_collinear():
    robot = SixLinkGantryTau(prototypes.D1)
    found = identifiability(robot, linear_poses(100, turn=1e-4))
    for links, arm in enumerate(found.arms, start=1):
        assert arm.deficiency == 0
        assert len(arm.collinear) == 3 * links
        name = f"{arm.name}.links[0].plate_offset"
        with pytest.raises(StructureError, match=r"cannot be told apart by these data; fix .*prior"):
            arm.covariance([name])
        assert np.isfinite(arm.covariance([f"{arm.name}.links[0].length"])).all()
        assert f"{arm.name}.links[0].offset[0] is known worse than by a tape measure, with" in str(found)
    silent = replace(found.arms[0], redundant={"arms[0].length": []})
    assert "nothing that was measured depends on arms[0].length: arms[0].length may be fixed" in str(silent)
    alone = replace(found.arms[0], collinear={"arms[0].length": []})
    assert str(alone).endswith("arms[0].length is known worse than by a tape measure")


def test_a_line_of_poses_holds_less_than_a_volume():
    poses = linear_poses(100, turn=0.0)
    r = poses.r[0] + np.linspace(0, 1, 100)[:, None] * [0.3, 0.4, 0.1]
    robot = GantryTau(prototypes.L1)
    assert [arm.deficiency for arm in identifiability(robot, (poses.q, poses.r)).arms] == [0, 0, 0]
    assert min(arm.deficiency for arm in identifiability(robot, (poses.q * 0 + r[:, :1], r)).arms) > 0


@pytest.mark.parametrize(
    ("where", "rank"),
    [
        ([[0.8, 0, 0], [0, 0.4, 0], [0, 0, 0.3]], 7),
        ([[0.8, 0, 0], [0, 0.4, 0]], 6),  # in a plane along the guideways: the joint may be mirrored in it
        ([[0.8, 0, 0]], 2),  # links do not turn: a constant and q
        ([[0, 0.4, 0], [0, 0, 0.3]], 7),  # across them: carts still move
        ([[0, 0, 0]], 1),
    ],
)
def test_rank_of_three_links_in_a_box_a_plane_a_line_and_a_point(where, rank):
    """With guideways along x exactly; of the columns L, d and q d with d = r - A - q v, by another decomposition."""
    arms = [replace(arm, direction=(1.0, 0.0, 0.0)) for arm in prototypes.L1.arms]
    robot = GantryTau(replace(prototypes.L1, arms=arms))
    drawn = np.random.default_rng(1).uniform(-1, 1, (60, len(where)))
    r = np.array([0.5, 2.8, -0.8]) + drawn @ np.array(where)
    q = carts(read_arms(robot), r, np.tile(np.eye(3), (60, 1, 1)))
    for i, arm in enumerate(identifiability(robot, (q, r)).arms):
        d = r - np.array(arms[i].offset) - np.outer(q[:, i], arms[i].direction)
        columns = np.column_stack([np.ones(60), d, q[:, i, None] * d])
        pivots = np.abs(np.diag(qr(columns, mode="r", pivoting=True)[0]))
        assert arm.rank == np.count_nonzero(pivots > 1e-10 * pivots[0]) == rank


def test_rows_that_were_not_seen_count_for_nothing(robot, poses):
    lost = np.arange(185) % 4 == 0
    q, r, R = poses
    seen = identifiability(robot, (q[~lost], r[~lost], R[~lost]))
    whole = identifiability(robot, (q, np.where(lost[:, None], np.nan, r), R))
    for a, b in zip(seen.arms, whole.arms, strict=True):
        np.testing.assert_array_equal(a.singular_values, b.singular_values)
    with pytest.raises(ModelError, match="measurements: found no finite numbers in any of 185 rows"):
        identifiability(robot, (q, np.nan * r, R))
    with refused("r"):
        identifiability(robot, (q, r[0], R))
    with refused("r"):
        identifiability(robot, (q, "r", R))


def test_few_poses_leave_what_they_cannot_count():
    found = identifiability(GantryTau(prototypes.L1), linear_poses(5, turn=0.0))
    assert [arm.deficiency for arm in found.arms] == [2, 2, 2]  # seven unknowns, five equations


def test_covariance_is_that_of_fits(poses):
    robot, arm = F1GantryTau(prototypes.F1), f1_arms()[1]
    said = identifiability(robot, poses, noise=DEVICE, angle=ANGLE).arms[1]
    names = ["arms[1].direction", "arms[1].links[0].length"]
    rows = [k for k, name in enumerate(arm.names) if name.rpartition("[")[0] == names[0] or name == names[1]]
    rows = [*rows[1:], rows[0]]
    fits = [fit_arm(arm, *measured(poses, seed=seed)) for seed in range(5)]
    expected = np.mean([np.diag(fit.covariance)[rows] for fit in fits], axis=0)
    # each fit estimates the covariance of its errors from 185 poses, to a tenth
    np.testing.assert_allclose(np.diag(said.covariance(names)), expected, rtol=0.15)


def test_what_is_not_held_is_not_inverted(robot, poses):
    arm = identifiability(robot, poses, "free").arms[1]
    with pytest.raises(StructureError, match=r"fix arms\[1\]\.links\[1\]\.offset\[1\], or give a prior"):
        arm.covariance(["arms[1].offset"])
    with pytest.raises(StructureError, match=r"turntables\[0\]\.orientation\[0\]: these poses do not"):
        arm.covariance(["turntables[0].orientation[0]"])
    with pytest.raises(ModelError, match=r"arms\[1\]: there is no unknown 'radius', expected one of"):
        arm.covariance(["radius"])
    with pytest.raises(ModelError, match=r"measurements: found float, expected Measurements, or \(q, r, R\)"):
        identifiability(robot, 3.0)
