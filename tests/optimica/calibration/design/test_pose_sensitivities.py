"""Sensitivities pose by pose: differences of the forward kinematics, (5.6) and (5.7), and sums over poses."""

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gantrytau import ModelError
from gantrytau.kinematics import Kinematics
from gantrytau_models import F1GantryTau, GantryTau, Pendulum, SixLinkGantryTau, prototypes
from gantrytau_optimica import Measurements
from gantrytau_optimica.calibration import pose_sensitivities, sensitivity_table
from tests.optimica.calibration.linear_data import six_link_poses, three_link_poses
from tests.optimica.refusals import refused

STEP = 1e-5  # m, of central differences: their error is its square by metres, 1e-9 with rounding
CLOSE = 3e-9
LINKS = [
    "arms[0].links[0]",
    *(f"arms[1].links[{j}]" for j in range(2)),
    *(f"arms[2].links[{j}]" for j in range(3)),
]
ROBOTS = {
    "three links": GantryTau(prototypes.L1),
    "six links": SixLinkGantryTau(prototypes.D1),
    "turntables": F1GantryTau(prototypes.F1),
}


@pytest.fixture(scope="module", params=ROBOTS)
def known(request):
    """A robot, its kinematics, its q and sensitivities."""
    robot = ROBOTS[request.param]
    kinematics = Kinematics(robot)
    spread = np.array([0.1, 0.1, 0.1, 0.2, 0.2, 0.2])[: len(kinematics.joints)]
    q = kinematics.home.q + spread * np.random.default_rng(3).uniform(-1, 1, (4, len(spread)))
    return kinematics, q, pose_sensitivities(robot, (q, *kinematics.fk(q)))


def difference(kinematics: Kinematics, q: np.ndarray, name: str, column: int | None):
    """Central differences of the pose by a parameter, r (N, 3) and a rotation vector (N, 3)."""
    values = kinematics._values
    poses = []
    for step in (STEP, -STEP):
        if column is None:
            changed = values[name] + step
        elif ".rotation" in name:
            name_of = name.replace(".rotation", ".orientation")
            u = Rotation.from_quat([values[f"{name_of}[{k}]"] for k in range(4)], scalar_first=True)
            turn = u * Rotation.from_rotvec(step * np.eye(3)[column])
            changed = turn.as_quat(scalar_first=True).tolist()
        else:
            changed = [values[f"{name}[{k}]"] + step * (k == column) for k in range(3)]
        poses.append(kinematics.replaced({name.replace(".rotation", ".orientation"): changed}).fk(q))
    (r, R), (other_r, other_R) = poses
    turn = Rotation.from_matrix(R @ np.swapaxes(other_R, 1, 2)).as_rotvec()
    return (r - other_r) / (2 * STEP), turn / (2 * STEP)


def test_each_is_the_difference_of_forward_kinematics(known):
    kinematics, q, found = known
    np.testing.assert_allclose(found.r, kinematics.fk(q)[0], atol=1e-9)
    for k, element in enumerate(found.names):
        name, _, index = element.rpartition("[") if element.endswith("]") else (element, "", "")
        position, rotation = difference(kinematics, q, name, int(index[:-1]) if index else None)
        scale = 1 + np.abs(found.position[:, :, k]).max() + np.abs(found.rotation[:, :, k]).max()
        np.testing.assert_allclose(found.position[:, :, k], position, atol=CLOSE * scale**2, err_msg=element)
        np.testing.assert_allclose(found.rotation[:, :, k], rotation, atol=CLOSE * scale**2, err_msg=element)


def test_names_are_those_of_the_unknowns(known):
    _, q, found = known
    assert len(set(found.names)) == len(found.names)
    assert found.position.shape == found.rotation.shape == (len(q), 3, len(found.names))
    position, rotation = found.of("arms[0].direction")
    assert position.shape == rotation.shape == (len(q), 3, 3)
    k = found.names.index("arms[0].direction[1]")
    np.testing.assert_array_equal(position[:, :, 1], found.of("arms[0].direction[1]")[0])
    np.testing.assert_array_equal(position[:, :, 1], found.position[:, :, k])
    assert found.of(found.names[0])[0].shape == (len(q), 3)


def test_all_offsets_together_move_the_tool_as_they_do(known):
    # the same displacement of all carts is one of the whole robot
    _, _, found = known
    own = [name for name in (f"arms[{i}].offset" for i in range(3)) if f"{name}[0]" in found.names]
    together = sum(found.of(name)[0] for name in own or [f"{link}.offset" for link in LINKS])
    np.testing.assert_allclose(together, np.tile(np.eye(3), (len(found.r), 1, 1)), atol=1e-10)


def test_sums_are_those_of_the_table_to_first_order():
    d1 = SixLinkGantryTau(prototypes.D1), six_link_poses(61)
    table, found = sensitivity_table(*d1, step=1e-6), pose_sensitivities(*d1)
    assert found.names == table.names
    position, angle = found.summed(1e-6)
    np.testing.assert_allclose(position, table.position, rtol=2e-5)
    # link 1 alone turns the plate by rounding and second order
    np.testing.assert_allclose(angle, table.angle, rtol=1e-4, atol=1e-9)


def test_errors_of_measured_guideways_act_between_their_points():
    robot = GantryTau(prototypes.L1)
    kinematics, poses = Kinematics(robot), three_link_poses(4)
    places = [np.linspace(q.min() - 0.1, q.max() + 0.1, 4) for q in poses.q.T]
    found = pose_sensitivities(robot, poses, guideways=places)
    for i, along in list(enumerate(places))[1:2]:
        offset = np.array([kinematics._values[f"arms[{i}].offset[{x}]"] for x in range(3)])
        for k in range(len(along)):
            eps = np.zeros(len(along))
            eps[k] = STEP
            # (5.7): the cart goes straight from one displaced point to the next
            moved = np.interp(poses.q[:, i], along, eps)
            for x in range(3):
                expected = np.empty((4, 3))
                for row in range(4):
                    r = [
                        kinematics.replaced({f"arms[{i}].offset": offset + s * moved[row] * np.eye(3)[x]}).fk(
                            poses.q[row]
                        )[0]
                        for s in (1, -1)
                    ]
                    expected[row] = (r[0] - r[1]) / (2 * STEP)
                here = found.of(f"arms[{i}].guideway[{k}][{x}]")[0]
                np.testing.assert_allclose(here, expected, atol=1e-8)


def test_guideways_beyond_their_points_go_on_straight_and_errors_add_up():
    robot, poses = SixLinkGantryTau(prototypes.D1), six_link_poses(10)
    middle = poses.q.mean()
    # all points by the same error: the cart is off by it, wherever the points are
    found = pose_sensitivities(robot, poses, guideways=[middle + np.array([-0.1, 0.0, 0.3])] * 3)
    for i, count in enumerate((1, 2, 3)):
        points = found.of(f"arms[{i}].guideway")[0].reshape(10, 3, 3, 3).sum(axis=2)
        links = sum(found.of(f"arms[{i}].links[{j}].offset")[0] for j in range(count))
        np.testing.assert_allclose(points, links, atol=1e-9)


def test_guideways_of_measurements_are_known():
    robot, (q, r, R) = SixLinkGantryTau(prototypes.D1), six_link_poses(5)
    rail = np.column_stack([np.linspace(-0.65, 0.7, 28), np.zeros((28, 3))])
    rail[:, 1] = rail[:, 0]
    found = pose_sensitivities(robot, Measurements(q, r, R, rails=[rail] * 3))
    assert sum("guideway" in name for name in found.names) == 3 * 28 * 3
    assert not any("guideway" in name for name in pose_sensitivities(robot, (q, r, R)).names)


def test_deviations_add_as_squares():
    found = pose_sensitivities(ROBOTS["six links"], six_link_poses(7))
    one, two = "arms[0].links[0].length", "arms[2].links[1].plate_offset"
    position, angle = found.spread({one: 50e-6, two: 20e-6})
    parts = found.of(one)[0] * 50e-6, found.of(two)[0] * 20e-6
    expected = np.sqrt((parts[0] ** 2).sum(axis=1) + (parts[1] ** 2).sum(axis=(1, 2)))
    np.testing.assert_allclose(position, expected, rtol=1e-12)
    assert (angle > 0).all()
    np.testing.assert_allclose(
        found.spread(1e-5)[0], 1e-5 * np.sqrt((found.sizes**2).sum(axis=1)), rtol=1e-12
    )
    with refused(one):
        found.spread({one: -1e-6})
    with pytest.raises(ModelError, match=r"did you mean 'arms\[0\].links\[0\].length'"):
        found.spread({"arms[0].link[0].length": 1e-5})


def test_rows_that_were_not_seen_are_nan():
    robot, (q, r, _) = GantryTau(prototypes.L1), three_link_poses(6)
    r = np.where((np.arange(6) == 2)[:, None], np.nan, r)
    found = pose_sensitivities(robot, (q, r))
    assert np.isnan(found.position[2]).all()
    assert np.isfinite(found.position[[0, 1, 3, 4, 5]]).all()
    assert not found.rotation[0].any()
    assert np.isfinite(found.summed()[0]).all()
    assert "(5 poses)" in str(found)
    assert pose_sensitivities(robot, q[0]).position.shape == (1, 3, len(found.names))


def test_prints_a_line_for_each_parameter(known):
    _, q, found = known
    lines = str(found).splitlines()
    assert len(lines) == 1 + len(found.names)
    line = lines[1 + found.names.index("arms[1].direction[0]")].split()
    sizes = np.linalg.norm(found.of("arms[1].direction[0]")[0], axis=1)
    assert float(line[1]) == pytest.approx(sizes.mean(), rel=5e-3)
    assert float(line[2]) == pytest.approx(sizes.max(), rel=5e-3)
    assert int(line[3]) == sizes.argmax()
    assert f"({len(q)} poses)" in lines[0]


def test_pictures(known, tmp_path):
    _, q, found = known
    whole = found.plot(file=tmp_path / "all.png")
    assert [text.get_text() for text in whole.axes[0].get_yticklabels()] == list(found.names)
    some = found.plot("arms[0].direction", found.names[0])
    (vector, single) = some.axes[0].lines
    np.testing.assert_allclose(
        vector.get_ydata(), np.linalg.norm(found.of("arms[0].direction")[0], axis=(1, 2))
    )
    assert len(np.asarray(single.get_xdata())) == len(q)
    with pytest.raises(ModelError, match="found 9 names, expected at most 8"):
        found.plot(*found.names[:9])
    with pytest.raises(ModelError, match=r"all\.doc"):
        found.plot(file="all.doc")


def test_what_does_not_fit_is_refused():
    wrongly: Any = pose_sensitivities
    robot, poses = GantryTau(prototypes.L1), three_link_poses(3)
    found = pose_sensitivities(robot, poses)
    with pytest.raises(ModelError, match="found 'mass', expected the name of a parameter"):
        found.of("mass")
    with refused("step"):
        found.summed(0.0)
    with refused("guideways"):
        pose_sensitivities(robot, poses, guideways=[[0, 1]] * 2)
    for places in ([0.0], [1.0, 0.0], [0.0, np.nan], "ab", 3.0):
        with refused("guideways[0]"):
            wrongly(robot, poses, guideways=[places] * 3)
    with pytest.raises(ModelError, match="found no finite numbers in any of 0 rows, expected poses"):
        pose_sensitivities(robot, np.zeros((0, 3)))
    with pytest.raises(ModelError, match="found no finite numbers in any of 1 rows"):
        pose_sensitivities(robot, np.array([[0.0, 0.0, 9.0]]))  # out of reach
    with pytest.raises(ModelError, match="expected Measurements"):
        wrongly(robot, 3)
    with pytest.raises(ModelError, match=r"found q of"):
        pose_sensitivities(robot, np.zeros(2))
    with pytest.raises(ModelError):
        pose_sensitivities(Pendulum(), poses)
    with pytest.raises(ModelError):
        wrongly(GantryTau, poses)
