"""Files of cells from Python: read, planned, measured and judged without the command line."""

import re

import numpy as np
import pytest

from gantrytau import ModelError, translate
from gantrytau.kinematics import Kinematics
from gantrytau_models import GantryTau, prototypes
from gantrytau_optimica import LaserTracker, Measurements, cross_validate, read_cell
from gantrytau_optimica.procedure import cell_example, is_planned, load_planned_cell, measured_plan, plan_cell
from tests.optimica.refusals import refused

SMALL = {"poses = 40": "poses = 14", "robots = 20": "robots = 2\nspacing = 0.25"}


def small(text=None):
    text = text or cell_example()
    for old, new in SMALL.items():
        assert old in text
        text = text.replace(old, new)
    return text


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    folder = tmp_path_factory.mktemp("lab")
    (folder / "cell.toml").write_text(small())
    return plan_cell(read_cell(folder / "cell.toml"), folder / "cell-plan")


@pytest.mark.parametrize("kind", ["l1", "six", "f1"])
def test_examples_are_cells(tmp_path, kind):
    file = tmp_path / "cell.toml"
    file.write_text(cell_example(kind))
    cell = read_cell(file)
    assert cell.wanted == pytest.approx(0.2e-3)
    assert cell.limits.ball_joint in (pytest.approx(np.radians(50)), pytest.approx(np.radians(45)))
    assert cell.policy["tape"] == cell.tape
    assert f'"{cell.name}"' in cell_example(kind)


def test_a_grid_may_be_given_by_its_places(tmp_path):
    file = tmp_path / "cell.toml"
    file.write_text(small().replace("spacing = 0.25", "places = 300"))
    assert read_cell(file).policy["places"] == 300
    file.write_text(small().replace("spacing = 0.25", "places = 2.5"))
    with pytest.raises(ModelError, match="places"):
        read_cell(file)


def test_the_robot_may_be_given(tmp_path):
    file = tmp_path / "cell.toml"
    file.write_text(cell_example().replace('# "arms[0].length" = 2.061', '"arms[0].length" = "2061 mm"'))
    robot = GantryTau(prototypes.L1)
    assert type(read_cell(file, robot).robot) is GantryTau
    assert read_cell(file, lambda name: robot).values == {"arms[0].length": 2.061}
    own = re.sub(r'model = "[^"]*"', 'model = "robots.py:Mine"', file.read_text())
    (tmp_path / "robots.py").write_text(
        "from gantrytau_models import GantryTau, prototypes\nclass Mine(GantryTau):\n"
        "    def __init__(self):\n        super().__init__(prototypes.L1)\n"
    )
    file.write_text(own)
    cell = read_cell(file)
    assert type(cell.robot).__name__ == "Mine"
    (tmp_path / "masses.py").write_text("PLATE = 9.0\n")  # a neighbour, which the file imports
    with (tmp_path / "robots.py").open("a") as robots:
        robots.write("from masses import PLATE\nmine = GantryTau(prototypes.L1, plate_mass=PLATE)\n")
    for name in ("robots.py:mine", "GantryTau(L1, plate_mass=9)", "GantryTau(L1, plate_mass='9000 g')"):
        (tmp_path / "other.toml").write_text(own.replace("robots.py:Mine", name))
        assert translate(read_cell(tmp_path / "other.toml").robot).parameter_values["plate_mass"] == 9.0
    assert str(tmp_path) in cell.copied()  # found from any folder


@pytest.mark.parametrize(
    ("name", "part"), [("GantryTau(X9)", "X9"), ("Nobody", "Nobody"), ("math:pi", "math:pi"), ("a b", "a b")]
)
def test_robots_that_are_not_there(tmp_path, name, part):
    file = tmp_path / "cell.toml"
    file.write_text(re.sub(r'model = "[^"]*"', f'model = "{name}"', cell_example()))
    with pytest.raises(ModelError, match=r"robot\.model: ") as refusal:
        read_cell(file)
    assert part in str(refusal.value)


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ("[goal]", "[gaol]", "cell.toml: gaol: there is no such key; did you mean 'goal'"),
        ("[goal]", "[plan2]", "cell.toml: plan2"),
        ("[[limits.obstacles]]", "[limits.obstacles]", "limits.obstacles: found a table, expected a table"),
        ('kind = "laser tracker"', 'kind = "theodolite"', "device.kind"),
        ("robots = 20", "robots = 0", "plan.robots"),
        ('speed = "100 mm/s"', 'speed = "0 mm/s"', "program.speed"),
        ('name = "Calibration"', 'name = "1st"', "program: found name='1st'"),
        ('carts = "robax"', 'carts = "axes"', "program.carts"),
        ('# "arms[0].length" = 2.061', '"arms[0].lenth" = 2.061', "values: "),
        ('radius = "60 mm"', 'radios = "60 mm"', "limits.plate[0].radios"),
    ],
)
def test_a_wrong_cell_says_where(tmp_path, old, new, place):
    file = tmp_path / "cell.toml"
    assert old in cell_example()
    file.write_text(cell_example().replace(old, new))
    with pytest.raises(ModelError, match=re.escape(place)):
        read_cell(file)


def test_an_example_of_another_robot():
    with refused("kind"):
        cell_example("f2")
    with refused("robot"):
        cell_example(robot="Pendulum")


def test_a_planned_cell_is_found_again(planned):
    assert is_planned(planned.folder)
    again = load_planned_cell(planned.folder)
    np.testing.assert_array_equal(again.plan.q, planned.plan.q)
    assert again.cell.wanted == planned.cell.wanted
    assert {file.name for file in again.files} >= {"plan.html", "poses.csv", "plan.toml", "Calibration.mod"}


def test_measurements_are_laid_over_their_plan_and_judged(planned):
    plan = planned.plan
    q = plan.q[plan.measured]
    r, R = Kinematics(GantryTau(prototypes.L1)).fk(q)
    axes = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    tracker = LaserTracker((4.5, 2.9, -0.7), axes, target=(0.05, 0.0, 0.0), facing=(1.0, 0.0, 0.0))
    found = tracker.measure(r, R, seed=5, frame="device")
    kept = np.arange(len(q)) != 3
    measured = measured_plan(planned, Measurements(q[kept], found.r[kept]))
    assert measured.rows.tolist() == np.flatnonzero(kept).tolist()
    assert measured.missing == [int(plan.numbers[plan.measured][3])]
    assert measured.motion is not None
    np.testing.assert_allclose(measured.motion.rotation, axes, atol=0.01)
    checked = cross_validate(planned.cell.robot, measured.measurements, prior=measured.prior)
    calibrated, verdict = measured.judged(checked)
    assert verdict.wanted == planned.cell.wanted
    assert verdict.good == (max(verdict.validation_error, verdict.expected_error) <= verdict.wanted)
    assert np.isfinite(verdict.expected_error)
    assert calibrated.parameters.keys() == checked.calibration.parameters.keys()
    assert measured.write_rest().is_file()


def test_what_was_not_measured_is_refused(planned):
    plan = planned.plan
    q, r = plan.q[plan.measured], plan.r[plan.measured]
    with pytest.raises(ModelError, match="found x, y, z as the plan expects them"):
        measured_plan(planned, Measurements(q, r))
    with pytest.raises(ModelError, match="q in mm"):
        measured_plan(planned, Measurements(1e3 * q, r))
    with pytest.raises(ModelError, match="found 2 actuators, expected 3"):
        measured_plan(planned, Measurements(q[:, :2], r))
