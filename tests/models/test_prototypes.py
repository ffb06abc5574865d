"""Prototypes: the published numbers, and that a record cannot hold nonsense."""

import dataclasses
import math
import subprocess
import sys
import tomllib

import numpy as np
import pytest

from gantrytau.errors import ModelError
from gantrytau_models import prototypes
from gantrytau_models.prototypes import Arm


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
    assert robot.assumed == ()


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
    assert robot.assumed == ("plate_mass", "cart_masses", "link_masses", "coulomb", "viscous")


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
    """All entries of a TOML table that give a quantity."""
    for key, value in table.items():
        if key == "arms":
            for arm in value:
                yield from _entries(arm)
        elif isinstance(value, dict):
            yield key, value


@pytest.mark.parametrize("path", sorted(prototypes._FOLDER.glob("*.toml")), ids=lambda path: path.stem)
def test_every_value_has_its_unit_and_its_source(path):
    entries = list(_entries(tomllib.loads(path.read_text())))
    assert len(entries) == 5 + 3 * 3
    for key, entry in entries:
        assert {"unit", "source"} <= entry.keys(), key
        assert ("value" in entry) != ("same_as" in entry), key


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
        ({"plate_mass": 0.0}, r"L1\.plate_mass: found 0\.0, expected a finite number above 0 in kg"),
        ({"plate_mass": "heavy"}, r"L1\.plate_mass: found 'heavy', expected a finite number"),
        ({"cart_masses": (1.0, math.nan, 1.0)}, r"L1\.cart_masses\[1\]: found nan"),
        ({"cart_masses": (1.0, 2.0)}, r"L1\.cart_masses: found \(1\.0, 2\.0\), expected three numbers in kg"),
        ({"cart_masses": 1.0}, r"L1\.cart_masses: found 1\.0, expected three numbers"),
        ({"link_masses": (0.0, 0.0, -1.0)}, r"link_masses\[2\]: found -1\.0, .* of at least 0 in kg"),
        ({"coulomb": (math.inf, 0.0, 0.0)}, r"coulomb\[0\]: found inf, expected a finite number"),
        ({"viscous": (0.0, -2.0, 0.0)}, r"viscous\[1\]: found -2\.0, .* in kg/s"),
        ({"arms": ()}, r"L1\.arms: found nothing; expected three Arm records; correct"),
    ],
)
def test_a_prototype_refuses_impossible_values(changes, message):
    with pytest.raises(ModelError, match=message):
        dataclasses.replace(prototypes.L1, **changes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"length": -2.0}, r"Arm\.length: found -2\.0, expected a finite number above 0 in m"),
        ({"offset": (0.0, 0.0)}, r"Arm\.offset: found \(0\.0, 0\.0\), expected three numbers in m"),
        ({"direction": "xyz"}, r"Arm\.direction: found 'xyz', expected three numbers in no unit"),
        ({"direction": (0, 0, 0)}, r"Arm\.direction: found \(0, 0, 0\), expected the axis of a guideway"),
    ],
)
def test_an_arm_refuses_impossible_values(changes, message):
    good = {"length": 2.0, "offset": (0.0, 0.0, 0.0), "direction": (1.0, 0.0, 0.0)}
    with pytest.raises(ModelError, match=message):
        Arm(**(good | changes))


def test_an_unknown_prototype_is_named_with_those_that_exist():
    message = r"there is no 'L11', expected one of D1, GT_A, L1; did you mean 'L1'\?"
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
