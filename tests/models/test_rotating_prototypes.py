"""The F1: its table, what the correction of it keeps, and its assembly modes found by a solver of the test."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gantrytau.border.refusal import ModelError
from gantrytau_models import prototypes
from gantrytau_models.prototypes import RotatingPrototype

DIGIT = 1e-9  # m, the last one in the table of F1


@pytest.fixture
def printed() -> RotatingPrototype:
    with pytest.warns(prototypes.DoubtfulPrototype):
        return prototypes.F1_printed


def with_sign_of_u2(robot: RotatingPrototype) -> RotatingPrototype:
    """The printed table with nothing but the sign of the 4th element of 1u_2 changed."""
    one, two, three = robot.arms
    w, x, y, z = two.turntables[0].orientation
    turntable = dataclasses.replace(two.turntables[0], orientation=(w, x, y, -z))
    return dataclasses.replace(robot, arms=(one, dataclasses.replace(two, turntables=(turntable,)), three))


def rotation(u):
    """R = I + 2 w [r]x + 2 [r]x^2 of a scalar-first quaternion that need not be unit."""
    cross = np.cross(np.eye(3), u[1:])
    return np.eye(3) + 2 * u[0] * cross + 2 * cross @ cross


def joints(robot, q=(0.0,) * 6):
    """Joints on the carts (6, 3) in m at the actuator coordinates q = (3 carts in m, 3 turntables in rad), (4.16)."""
    angles, found = iter(q[3:]), []
    for arm, s in zip(robot.arms, q[:3], strict=True):
        place, turned = np.add(arm.offset, s * np.array(arm.direction)), np.eye(3)
        for turntable in arm.turntables:
            place = place + turned @ turntable.offset
            spin = Rotation.from_rotvec(next(angles) * np.array(turntable.axis)).as_matrix()
            turned = turned @ rotation(turntable.orientation) @ spin
        found += [place + turned @ link.cart_offset for link in arm.links]
    return np.array(found)


def on_plate(robot):
    return np.array([link.plate_offset for arm in robot.arms for link in arm.links])


def spacings(points):
    """Distances 2a-2b, 3a-3b, 3a-3c, 3b-3c in m."""
    return [np.linalg.norm(points[i] - points[j]) for i, j in ((1, 2), (3, 4), (3, 5), (4, 5))]


def assembly_modes(robot, starts=600, seed=1):
    """Tool positions (k, 3) and plate rotations (k, 3, 3) found by Newton from random starts, sorted by z."""
    cart, plate = joints(robot), on_plate(robot)
    length = np.array([link.length for arm in robot.arms for link in arm.links])
    random = np.random.default_rng(seed)
    tool = cart.mean(axis=0) + random.uniform(-2.0, 2.0, (starts, 3))
    turn = Rotation.from_quat(random.normal(size=(starts, 4)))
    for _ in range(60):
        lever = np.einsum("nij,kj->nki", turn.as_matrix(), plate)
        rod = tool[:, None] + lever - cart
        error = (rod**2).sum(axis=2) - length**2
        jacobian = 2 * np.concatenate([rod, np.cross(lever, rod)], axis=2)
        step = np.linalg.solve(jacobian, -error[..., None])[..., 0]
        step /= np.maximum(1.0, np.linalg.norm(step, axis=1) / 0.7)[:, None]  # far from a solution: carefully
        tool, turn = tool + step[:, :3], Rotation.from_rotvec(step[:, 3:]) * turn
    rod = tool[:, None] + np.einsum("nij,kj->nki", turn.as_matrix(), plate) - cart
    solved = np.abs((rod**2).sum(axis=2) - length**2).max(axis=1) < 1e-12  # m2: a thousand times rounding
    modes = []
    for k in np.flatnonzero(solved):
        if not any(np.linalg.norm(tool[k] - tool[m]) < 1e-6 for m in modes):
            modes.append(k)
    modes.sort(key=lambda k: tool[k, 2])
    return tool[modes], turn.as_matrix()[modes]


def test_F1_printed_is_table_5_5(printed):
    one, two, three = printed.arms
    assert one.offset == (-0.23572, 3.29890, 1.21894)
    assert one.direction == (0.0, 0.0, 0.99)
    assert [len(arm.turntables) for arm in printed.arms] == [0, 1, 2]
    assert [len(arm.links) for arm in printed.arms] == [1, 2, 3]
    assert two.turntables[0].orientation == (0.6308, 0.0054, 0.0054, 0.7467)
    assert three.turntables[1].orientation == (0.0007, 0.0015, 0.7420, 0.6746)
    assert three.turntables[1].offset == (0.00018, 0.12190, -0.07000)
    assert two.links[1].cart_offset == (0.10092, 0.08252, -0.08632)
    assert three.links[2].plate_offset == (-0.18492, -0.08625, -0.19393)
    lengths = [link.length for arm in printed.arms for link in arm.links]
    assert lengths == [1.92258, 1.50186, 1.50427, 1.50199, 1.50119, 1.50524]
    norms = [math.hypot(*turntable.orientation) for arm in printed.arms for turntable in arm.turntables]
    np.testing.assert_allclose(norms, [0.97751, 0.97406, 1.00282], atol=5e-6, rtol=0)  # as the text prints


def test_F1_printed_warns_of_the_sign_each_time():
    for _ in range(2):
        with pytest.warns(prototypes.DoubtfulPrototype, match=r"F1_printed: the printed sign") as caught:
            _ = prototypes.F1_printed
        assert caught[0].filename == __file__


@pytest.mark.filterwarnings("error")
def test_F1_is_unit_norm_and_does_not_warn():
    for robot in (prototypes.F1, prototypes.F1_ideal):
        for arm in robot.arms:
            for turntable in arm.turntables:
                # the table has twelve digits
                assert math.hypot(*turntable.orientation) == pytest.approx(1.0, abs=1e-11)


def test_correction_keeps_each_joint_where_the_table_puts_it(printed):
    np.testing.assert_allclose(
        joints(prototypes.F1), joints(with_sign_of_u2(printed)), atol=2 * DIGIT, rtol=0
    )
    np.testing.assert_array_equal(on_plate(prototypes.F1), on_plate(printed))


def test_clusters_of_F1_are_nearly_parallelograms():
    robot = prototypes.F1
    cart = joints(robot)
    # half of the last printed digit of each, 0.1 mm, as computed from the table by hand
    np.testing.assert_allclose(spacings(cart)[:2], [0.1972, 0.1960], atol=5e-5, rtol=0)
    np.testing.assert_allclose(spacings(on_plate(robot))[:2], [0.1980, 0.1979], atol=5e-5, rtol=0)
    np.testing.assert_allclose(spacings(cart), spacings(on_plate(robot)), atol=3e-3, rtol=0)
    # a turntable is rigid, however it turns
    turned = joints(robot, np.array([0.1, -0.2, 0.3, 0.4, -0.5, 0.3]))
    np.testing.assert_allclose(spacings(turned), spacings(cart), atol=1e-12, rtol=0)


def test_axes_of_q4_and_q5_of_F1_are_opposite():
    _, two, three = prototypes.F1.arms
    axes = [rotation(arm.turntables[0].orientation) @ arm.turntables[0].axis for arm in (two, three)]
    assert math.degrees(math.acos(-axes[0] @ axes[1])) < 1.1


def test_F1_has_eight_assembly_modes_in_two_groups():
    tool, turn = assembly_modes(prototypes.F1)
    assert len(tool) == 8
    height = joints(prototypes.F1)[:, 2]
    assert (tool[:4, 2] < height.min()).all()  # four with the tool below all carts
    assert (tool[4:, 2] > height.max()).all()  # four above
    nominal = np.array(prototypes.F1.plate_rotation)
    angles = np.degrees([Rotation.from_matrix(found @ nominal.T).magnitude() for found in turn])
    # one of each group with its links uncrossed, near the nominal orientation; all others far from it
    assert max(angles[:4].min(), angles[4:].min()) < 5.0
    assert np.sort(angles)[2] > 30.0


def test_F1_as_printed_cannot_be_assembled(printed):
    tool, _ = assembly_modes(printed)
    assert len(tool) == 0


@pytest.mark.parametrize(
    ("angle", "tilt"), [(0.0, 0.0), (0.3, 0.0), (-0.5, 0.0), (0.0, 0.4), (0.3, -0.4)], ids=str
)
def test_plate_of_F1_ideal_turns_with_its_turntables(angle, tilt):
    # equal and opposite q4 and q5 turn all joints about x; q6 then turns those of arm 3 about their own line 3a-3b,
    # so that one rotation of the plate keeps all links of an arm parallel
    robot = prototypes.F1_ideal
    cart, plate = joints(robot, np.array([0.1, 0.2, -0.3, angle, -angle, tilt])), on_plate(robot)
    turn = (Rotation.from_rotvec([angle, 0.0, 0.0]) * Rotation.from_rotvec([0.0, -tilt, 0.0])).as_matrix()
    single = cart - plate @ turn.T  # (4.7)
    for first, others in ((1, [2]), (3, [4, 5])):
        np.testing.assert_allclose(single[others], single[[first] * len(others)], atol=1e-14, rtol=0)


def test_F1_ideal_is_regular_in_its_nominal_orientation():
    tool, turn = assembly_modes(prototypes.F1_ideal)
    upright = [k for k in range(len(tool)) if np.abs(turn[k] - np.eye(3)).max() < 1e-9]
    assert len(upright) == 2  # (4.26): three spheres meet in two points
    robot = prototypes.F1_ideal
    for place in tool[upright]:
        rod = place + on_plate(robot) - joints(robot)
        jacobian = np.hstack([rod, np.cross(on_plate(robot), rod)])
        assert np.linalg.cond(jacobian) < 200.0  # 55 to 87 in the modes of F1


@pytest.mark.parametrize(
    ("record", "changes", "message"),
    [
        ("robot", {"arms": ()}, r"F1\.arms: found nothing; expected 3 RotatingArm records"),
        ("robot", {"plate_inertia": np.zeros((3, 3))}, r"F1\.plate_inertia: .* expected all above 0"),
        ("arm", {"direction": (0, 0, 0)}, "RotatingArm: found direction=.* expected the axis of a guideway"),
        ("arm", {"turntables": 3}, r"RotatingArm\.turntables: found int; expected Turntable records"),
        ("link", {"length": 0.0}, r"RotatingLink: found length=0\.0"),
        ("turntable", {"orientation": (1, 0, 0)}, "Turntable: found orientation of 3"),
        ("turntable", {"axis": (0, 2, 0)}, r"Turntable\.axis: .* expected a unit vector"),
        ("turntable", {"inertia": np.diag([1, 1, 3])}, r"Turntable\.inertia: .* none above the sum"),
    ],
)
def test_records_of_F1_refuse_impossible_values(record, changes, message):
    arm = prototypes.F1.arms[1]
    records = {"robot": prototypes.F1, "arm": arm, "link": arm.links[0], "turntable": arm.turntables[0]}
    with pytest.raises(ModelError, match=message):
        dataclasses.replace(records[record], **changes)


def test_quaternions_that_are_not_unit_are_refused_unless_allowed(printed):
    with pytest.raises(ModelError, match=r"arms\[1\]\.turntables\[0\]\.orientation: found .* length"):
        dataclasses.replace(printed, unit_norm=True)
