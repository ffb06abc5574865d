"""Prototypes: the published numbers, and that a record cannot hold nonsense."""

import dataclasses
import math
import subprocess
import sys
import tomllib

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gantrytau.border.refusal import ModelError
from gantrytau_models import prototypes


def test_L1_is_table_5_1_modified_and_table_6_3_model_2():
    robot = prototypes.L1
    assert [arm.length for arm in robot.arms] == [2.0608, 2.0633, 2.0611]
    assert robot.arms[0].offset == (-1.8089, 3.5093, 0.0039)
    assert robot.arms[1].direction == (0.9990, -0.0264, -0.0045)
    assert robot.arms[2].offset == (-1.8086, 3.2774, -1.4434)
    assert robot.plate_mass == 9.13
    assert robot.cart_masses == (13.58, 13.64, 38.23)
    assert robot.link_masses == (0.0, 0.0, 0.0)
    assert robot.coulomb == (128.62, 145.13, 194.57)
    assert robot.viscous == (102.43, 355.25, 388.77)
    assert "Table 5.1" in robot.source
    assert robot.assumed == ("plate_inertia", "plate_centre", "plate_rotation", "arms.links")


@pytest.mark.parametrize(
    ("name", "norms", "digits"),
    # the lengths of the printed directions, as computed from the tables by hand
    [("L1", [0.99983, 0.99936, 1.00014], 5), ("D1", [1.000007, 0.999715, 0.999886], 6)],
)
def test_directions_are_as_printed_and_not_normalised(name, norms, digits):
    arms = getattr(prototypes, name).arms
    np.testing.assert_allclose([math.hypot(*arm.direction) for arm in arms], norms, atol=10**-digits, rtol=0)


def test_D1_is_table_5_8_model_1_with_the_masses_assumed():
    robot = prototypes.D1
    assert [arm.length for arm in robot.arms] == [2.04423, 2.04292, 2.04350]
    assert robot.arms[1].offset == (-3.07865, -3.47376, 0.66795)
    assert robot.arms[2].direction == (0.99769, -0.06603, -0.00509)
    assert robot.cart_masses == prototypes.L1.cart_masses
    assert "assumed" in robot.source
    assert {"plate_mass", "cart_masses", "link_masses", "coulomb", "viscous"} <= set(robot.assumed)


def test_links_of_L1_continue_its_arms():
    robot = prototypes.L1
    on_plate = [[link.plate_offset for link in arm.links] for arm in robot.arms]
    assert on_plate == [
        [(0.0, 0.0, 0.0)],
        [(0.0, 0.12, 0.05), (0.0, -0.12, 0.05)],
        [(0.10, 0.05, -0.10), (-0.10, 0.10, -0.10), (0.0, -0.12, -0.15)],
    ]
    for arm in robot.arms:
        for link in arm.links:
            # (4.7) with R = I, up to the rounding of a sum of numbers of a few metres
            np.testing.assert_allclose(
                np.subtract(link.offset, link.plate_offset), arm.offset, atol=1e-15, rtol=0
            )
            assert (link.length, link.mass, link.direction) == (arm.length, 0.5, None)
    assert np.array_equal(robot.plate_inertia, np.diag([0.20, 0.25, 0.30]))
    assert np.array_equal(robot.plate_rotation, np.eye(3))
    assert robot.plate_centre == (0.0, 0.0, 0.0)
    assert "assumed" in robot.source


def test_links_of_D1_are_table_5_9_model_3():
    links = [link for arm in prototypes.D1.arms for link in arm.links]
    assert [link.length for link in links] == [2.04422, 2.04291, 2.04294, 2.04351, 2.04352, 2.04352]
    assert links[0].plate_offset == (-0.04871, -0.05363, -0.10361)
    assert links[1].offset == (-3.13100, -3.52723, 0.79856)
    assert links[3].direction == (0.99766, -0.06600, -0.00515)
    assert links[5].plate_offset == (-0.05438, 0.11726, 0.07666)


def test_the_lost_offset_of_D1_follows_from_the_other_models():
    # a joint is displaced from that of its arm equally in models 3 and 1 as in models 4 and 2; the frame
    # offsets of models 4 and 2 (Tables 5.9 and 5.8) are printed also for link 2b
    arm, (link_2a, link_2b) = prototypes.D1.arms[1], prototypes.D1.arms[1].links
    model_2 = np.array([1.41419, -3.86450, 0.08531])
    model_4a, model_4b = np.array([1.36183, -3.91799, 0.21592]), np.array([1.36706, -3.72450, 0.05766])
    np.testing.assert_allclose(arm.offset + model_4a - model_2, link_2a.offset, atol=5e-5, rtol=0)
    np.testing.assert_allclose(arm.offset + model_4b - model_2, link_2b.offset, atol=1e-9, rtol=0)
    assert {"arms[1].links[1].offset", "arms[1].links[1].direction"} <= set(prototypes.D1.assumed)
    assert "2b are lost and reconstructed" in prototypes.D1.source


def test_arms_and_links_of_D1_fit_each_other():
    robot = prototypes.D1
    for arm in robot.arms:
        for link in arm.links:
            single = np.subtract(link.offset, np.array(robot.plate_rotation) @ link.plate_offset)  # (4.7)
            assert np.linalg.norm(single - arm.offset) < 0.9e-3  # m: the arms do not know the joints
            assert link.direction is not None
            assert np.linalg.norm(np.subtract(link.direction, arm.direction)) < 2e-4


def test_GT_A_is_L1_with_parallel_guideways():
    parallel = tuple(dataclasses.replace(arm, direction=(1.0, 0.0, 0.0)) for arm in prototypes.L1.arms)
    expected = dataclasses.replace(
        prototypes.L1,
        name="GT_A",
        arms=parallel,  # pyright: ignore[reportArgumentType]
        source=prototypes.GT_A.source,
    )
    assert expected == prototypes.GT_A


def _entries(table):
    """All entries of a TOML table that give a quantity, those of its arms, turntables and links included."""
    for key, value in table.items():
        if isinstance(value, list) and value and isinstance(value[0], dict):
            for record in value:
                yield from _entries(record)
        elif isinstance(value, dict):
            yield key, value


@pytest.mark.parametrize("path", sorted(prototypes._FOLDER.glob("*.toml")), ids=lambda path: path.stem)
def test_every_value_has_its_unit_and_its_source(path):
    for key, entry in _entries(tomllib.loads(path.read_text())):
        expected = {"source"} if key == "links" else {"unit", "source"}
        assert expected <= entry.keys(), key
        assert ("value" in entry) != ("same_as" in entry), key


@pytest.mark.parametrize("name", ["L1", "GT_A", "D1", "F1", "F1_ideal"])
def test_what_is_assumed_is_there(name):
    robot = getattr(prototypes, name)
    for path in robot.assumed:
        values = [robot]
        for step in path.replace("]", "").split("."):
            field, *index = step.split("[")
            values = [getattr(value, field) for value in values]
            if index:
                values = [value[int(index[0])] for value in values]
            elif field in ("arms", "links", "turntables"):
                values = [item for value in values for item in value]
        assert values, path


def test_a_record_cannot_be_changed_but_varied():
    robot = prototypes.L1
    with pytest.raises(dataclasses.FrozenInstanceError):
        robot.plate_mass = 1.0  # pyright: ignore[reportAttributeAccessIssue]
    heavy = dataclasses.replace(robot, plate_mass=12, cart_masses=np.array([1.0, 2.0, 3.0]))
    assert (heavy.plate_mass, heavy.cart_masses) == (12.0, (1.0, 2.0, 3.0))
    assert isinstance(heavy.plate_mass, float)
    assert prototypes.L1.plate_mass == 9.13
    assert {robot: "hashable"}[prototypes.L1] == "hashable"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"plate_mass": 0.0}, r"L1: found plate_mass=0\.0, expected a number above 0 in kg"),
        ({"cart_masses": (1.0, math.nan, 1.0)}, r"L1: found cart_masses\[1\] = nan"),
        ({"cart_masses": (1.0, 2.0)}, "L1: found cart_masses of 2"),
        ({"link_masses": (0.0, 0.0, -1.0)}, r"found link_masses\[2\] = -1\.0, .* of at least 0 in kg"),
        ({"plate_inertia": [[1, 0.5, 0], [0, 1, 0], [0, 0, 1]]}, r"plate_inertia: .* expected a symmetric"),
        ({"plate_inertia": np.diag([1.0, 1.0, 0.0])}, r"moments 0, 1, 1 kg\.m2, expected all above 0"),
        ({"plate_inertia": np.diag([1.0, 1.0, 2.1])}, r"2\.1 kg\.m2, expected none above the sum"),
        ({"plate_rotation": np.diag([1.0, 1.0, -1.0])}, r"L1\.plate_rotation: .* expected a rotation matrix"),
        ({"plate_rotation": 1.1 * np.eye(3)}, r"L1\.plate_rotation: .* expected a rotation matrix"),
        ({"arms": ()}, r"L1\.arms: found nothing; expected 3 Arm records; correct"),
    ],
)
def test_a_prototype_refuses_impossible_values(changes, message):
    with pytest.raises(ModelError, match=message):
        dataclasses.replace(prototypes.L1, **changes)


@pytest.mark.parametrize(
    "wrong",
    [
        ("arm", {"length": -2.0}),
        ("arm", {"offset": (0.0, 0.0)}),
        ("arm", {"links": (1.0,)}),
        ("arm", {"links": None}),
        ("arm", {"direction": (0, 0, 0)}),
        ("link", {"mass": -0.5}),
        ("link", {"offset": (0.0, math.inf, 0.0)}),
        ("link", {"direction": (0, 0, 0)}),
    ],
    ids=str,
)
def test_arms_and_links_refuse_impossible_values(wrong):
    kind, changes = wrong
    record = prototypes.L1.arms[0] if kind == "arm" else prototypes.L1.arms[0].links[0]
    with pytest.raises(ModelError, match=f"found {next(iter(changes))}|links: found"):
        dataclasses.replace(record, **changes)


def test_one_link_may_be_longer():
    robot = prototypes.L1
    arms = list(robot.arms)
    links = list(arms[1].links)
    links[0] = dataclasses.replace(links[0], length=links[0].length + 1e-4)
    arms[1] = dataclasses.replace(arms[1], links=links)  # pyright: ignore[reportArgumentType]
    longer = dataclasses.replace(robot, arms=arms)  # pyright: ignore[reportArgumentType]
    assert [link.length for link in longer.arms[1].links] == [2.0633 + 1e-4, 2.0633]
    assert {longer, robot} == {robot, longer}  # tuples, whatever was given: hashable
    assert longer != robot
    assert (longer.arms[0], longer.arms[2]) == (robot.arms[0], robot.arms[2])


def test_names_lists_what_there_is():
    assert prototypes.names() == [
        "D1",
        "F1",
        "F1_ideal",
        "F1_printed",
        "GT_A",
        "L1",
        "L1_asymmetric",
        "L1_flexible",
    ]
    # what type checkers and editors are told
    assert set(prototypes.names()) <= set(prototypes.__annotations__)


def test_an_unknown_prototype_is_named_with_those_that_exist():
    message = rf"there is no 'L11', expected one of {', '.join(prototypes.names())}; did you mean 'L1'\?"
    with pytest.raises(ModelError, match=message):
        _ = prototypes.L11
    assert not hasattr(prototypes, "NOPE")
    assert {"D1", "GT_A", "L1"} <= set(dir(prototypes))


def test_a_unit_that_is_not_expected_raises(tmp_path, monkeypatch):
    text = (
        (prototypes._FOLDER / "L1.toml")
        .read_text()
        .replace('value = 2.0633, unit = "m"', 'value = 2063.3, unit = "mm"')
    )
    (tmp_path / "MM.toml").write_text(text)
    monkeypatch.setattr(prototypes, "_FOLDER", tmp_path)
    with pytest.raises(ModelError, match=r"MM\.arms\.1\.length: found the unit 'mm', expected 'm'"):
        _ = prototypes.MM


def test_files_are_read_when_a_prototype_is_named():
    code = (
        "from gantrytau_models import prototypes as p; assert p._read.cache_info().currsize == 0;"
        "p.L1; assert p._read.cache_info().currsize == 1"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize(("name", "degrees"), [("L1", 1e-9), ("GT_A", 1e-9), ("D1", 0.5)])
def test_six_links_assemble_near_the_nominal_orientation(name, degrees):
    # the orientation of D1 is known from offsets that fit within 0.9 mm, on a plate with joints 0.2 m apart
    robot = getattr(prototypes, name)
    links = [link for arm in robot.arms for link in arm.links]
    cart, plate = (np.array([getattr(link, key) for link in links]) for key in ("offset", "plate_offset"))
    length = np.array([link.length for link in links])
    forward = np.mean([arm.direction for arm in robot.arms], axis=0)
    tool = np.mean([arm.offset for arm in robot.arms], axis=0) + 0.85 * length.mean() * forward
    turn = Rotation.from_matrix(robot.plate_rotation)
    nominal = turn
    for _ in range(20):
        lever = turn.apply(plate)
        rod = tool + lever - cart
        jacobian = 2 * np.hstack([rod, np.cross(lever, rod)])
        step = np.linalg.solve(jacobian, length**2 - (rod**2).sum(axis=1))
        tool, turn = tool + step[:3], Rotation.from_rotvec(step[3:]) * turn
    np.testing.assert_allclose(np.linalg.norm(tool + turn.apply(plate) - cart, axis=1), length, rtol=1e-13)
    assert (forward @ (tool - cart).T > 0).all()  # the tool ahead of the carts
    assert np.degrees((turn * nominal.inv()).magnitude()) < degrees
