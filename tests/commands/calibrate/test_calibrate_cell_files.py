"""Files of cells for `gantrytau calibrate cell.toml`: examples, and what cannot be read or planned."""

import pytest

from gantrytau_optimica import cell_example
from tests.commands.calibrate.cells import with_lines

FAULT, MISUSE = 1, 2


def test_the_example_is_printed(run, fails):
    found = run("calibrate", "--example")
    assert found.exit_code == 0
    assert found.stdout == cell_example() == run("calibrate", "--example", "l1").stdout
    six = run("calibrate", "--example", "--robot", "SixLinkGantryTau(L1)").stdout
    assert 'model = "SixLinkGantryTau(L1)"' in six
    assert six.startswith("# Limits, device and home below fit SixLinkGantryTau(D1): make them")
    assert "there is no such example" in fails(MISUSE, "calibrate", "--example", "f2")
    assert "or a kind beside it, as --example six" in fails(
        MISUSE, "calibrate", "--example", "--robot", "Pendulum"
    )
    assert "for a cell to begin with give --example six" in fails(MISUSE, "calibrate", "six")


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (dict(tape='tap = "5 mm"'), "robot.tap: there is no such key; did you mean 'tape'?"),
        (dict(tape=""), "robot.tape: found nothing, expected a length in m"),
        (
            dict(tape='tape = "5 deg"'),
            'robot.tape: found "5 deg", expected a length in m; units are m, mm, cm, um, in',
        ),
        (dict(tape="tape = true"), "robot.tape: found True, expected a length in m"),
        (dict(tape="tape = 0"), "robot.tape: found 0, expected a length in m above 0"),
        (dict(tape='tape = "1.2.3 mm"'), 'found "1.2.3 mm", expected a length in m; units are'),
        (dict(poses="poses = 4.5"), "goal.poses: found 4.5, expected a whole number"),
        (dict(poses="poses = 0"), "expected a whole number of at least 1"),
        (
            dict(strokes="strokes = [0, 1600]"),
            "limits.strokes[1]: found 1600, expected a length in m or an angle",
        ),
        (dict(strokes="strokes = [0, 1600]"), 'write "1600 mm" if it is in mm'),
        (
            dict(strokes="strokes = [0, 1, 2]"),
            "limits.strokes: found [0, 1, 2], expected [., .] or [[., .], [., .], ...]",
        ),
        (dict(strokes="stroke = [0, 1]"), "limits.stroke: there is no such key; did you mean 'strokes'?"),
        (
            dict(ball_joint="ball_joint = 50"),
            'limits.ball_joint: found 50, expected an angle in rad, up to 6.28; write "50 deg"',
        ),
        (
            dict(clearance="clearance = -0.1"),
            "limits.clearance: found -0.1, expected a length in m of at least 0",
        ),
        (dict(low="low = [2.0, 2.3, -1.6]"), "limits.obstacles[0]: Box: found low"),
        (dict(low="corner = [2.0, 2.3, -1.6]"), "limits.obstacles[0].corner: there is no such key"),
        (dict(kind='kind = "bax"'), "limits.obstacles[0].kind: found \"bax\"; did you mean 'box'?"),
        (
            dict(kind=""),
            "limits.obstacles[0].kind: found nothing, expected a text in quotes: box, cylinder, capsule",
        ),
        (dict(radius='radius = "60 deg"'), "limits.plate[0].radius"),
        (dict(facing="facing = [0, 0, 0]"), "device: LaserTracker: found facing"),
        (dict(facing="facing = [0, 1]"), "device.facing: found [0, 1], expected [., ., .], each a number"),
        (dict(model='model = "GantryTau(X1)"'), "robot.model: --prototype X1: there is no such robot"),
        (dict(model="model = 3"), "robot.model: found 3, expected a text in quotes"),
        (dict(carts='carts = "axes"'), 'program.carts: found "axes"; there is robax, extax.'),
        (dict(error='errors = "1 mm"'), "goal.errors: there is no such key; did you mean 'error'?"),
        (dict(home='limit = "x"'), "plan.limit: there is no such key"),
        (dict(name='name = "1Cal"'), "program: found name='1Cal', expected a name of RAPID"),
        (dict(trigger='trigger = "do measure"'), "program: found trigger='do measure', expected a name of"),
        (dict(tool='tool = "module"'), "program: found tool='module', expected a name of RAPID"),
    ],
)
def test_cells_that_cannot_be_read(fails, tmp_path, lines, words):
    file = tmp_path / "cell.toml"
    file.write_text(with_lines(**lines))
    message = fails(MISUSE, "calibrate", file)
    assert message.startswith(f"{file}: ")
    assert words in message
    assert [path.name for path in tmp_path.iterdir()] == ["cell.toml"]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("[goal]", "[goals]", "goals: there is no such key; did you mean 'goal'?"),
        ("[robot]", "[[robot]]", "robot: found"),
        ("[device]", "[[device]]", "device: found"),
        ("[[limits.plate]]", "[limits.plate]", "limits.plate: found"),
        ('# "arms[0].length" = 2.061', '"arms[0].lenght" = 2.0', "values: arms[0].lenght: "),
        ('# "arms[0].length" = 2.061', '"arms[0].length" = "2 s"', 'values.arms[0].length: found "2 s"'),
        ('# "arms[0].length" = 2.061', "arms[0].length = 2.0", 'names as "arms[0].length" stand in quotes'),
        ('# "arms[0].length" = 2.061', "arms.length = 2.0", "write the name in quotes"),
        ("[robot]", "robot", "cannot be read as TOML"),
    ],
)
def test_tables_that_cannot_be_read(fails, tmp_path, old, new, words):
    file = tmp_path / "cell.toml"
    assert old in cell_example()
    file.write_text(cell_example().replace(old, new))
    assert words in fails(MISUSE, "calibrate", file)


def test_a_table_that_is_missing(fails, tmp_path):
    file = tmp_path / "cell.toml"
    file.write_text('[robot]\nmodel = "GantryTau(L1)"\ntape = 0.005\n')
    assert "goal: found nothing, expected a table" in fails(MISUSE, "calibrate", file)
    assert "there is no such file" in fails(MISUSE, "calibrate", tmp_path / "nowhere.toml")


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (dict(tape="tape = 5"), "robot.tape: found 5.0, expected a length in m"),
        (dict(poses="poses = 4"), "goal.poses: found 4, expected a whole number from 8"),
        (dict(home="home = [0.5, 0.5]"), "plan.home: found [0.5, 0.5], expected 3 finite numbers"),
        (dict(strokes=""), "give limits.strokes"),
        (dict(strokes="strokes = [1.6, 0.0]"), "limits.strokes: found [1.6, 0.0], expected (3, 2)"),
        (
            dict(low="low = [0.4, 2.3, -1.6]", high="high = [1.5, 3.5, 0.0]"),
            "mm too little clearance between",
        ),
        (dict(low="low = [0.4, 2.3, -1.6]", high="high = [1.5, 3.5, 0.0]"), "and limits.obstacles[0] (Box)"),
        (dict(facing="facing = [-1, 0, 0]"), "turn the target (device.facing) towards it"),
    ],
)
def test_cells_that_cannot_be_planned(fails, tmp_path, lines, words):
    file = tmp_path / "cell.toml"
    file.write_text(with_lines(**lines))
    message = fails(FAULT, "calibrate", file)
    assert message.startswith(f"{file}: ")
    assert words in message
    assert "plan_calibration" not in message
    assert all(path.is_file() or list(path.iterdir()) for path in tmp_path.iterdir())  # no empty folder
