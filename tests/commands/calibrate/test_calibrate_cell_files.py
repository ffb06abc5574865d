"""Files of cells for `gantrytau calibrate cell.toml`: examples, and what cannot be read or planned."""

import pytest

from gantrytau_optimica.procedure import cell_example
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
    assert "for a cell to begin with give --example six" in fails(MISUSE, "calibrate", "six")


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (dict(tape='tap = "5 mm"'), "robot.tap: there is no such key; did you mean 'tape'?"),
        (dict(low="low = [2.0, 2.3, -1.6]"), "limits.obstacles[0]: Box: found low"),
        (dict(kind='kind = "bax"'), "limits.obstacles[0].kind: found \"bax\"; did you mean 'box'?"),
        (dict(facing="facing = [0, 0, 0]"), "device: found facing="),
        (dict(model='model = "GantryTau(X1)"'), "robot.model: --prototype X1: there is no prototype 'X1'"),
        (dict(name='name = "1Cal"'), "program: found name='1Cal', expected a name of RAPID"),
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
        ("[device]", "[[device]]", "device: found"),
        ('# "arms[0].length" = 2.061', '"arms[0].lenght" = 2.0', "values: arms[0].lenght: "),
        ('# "arms[0].length" = 2.061', "arms.length = 2.0", "write the name in quotes"),
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
        (dict(poses="poses = 4"), "goal.poses"),
        (dict(home="home = [0.5, 0.5]"), "plan.home"),
        (
            dict(low="low = [0.4, 2.3, -1.6]", high="high = [1.5, 3.5, 0.0]"),
            "mm too little clearance between",
        ),
    ],
)
def test_cells_that_cannot_be_planned(fails, tmp_path, lines, words):
    file = tmp_path / "cell.toml"
    file.write_text(with_lines(**lines))
    message = fails(FAULT, "calibrate", file)
    assert message.startswith(f"{file}: ")
    assert words in message
    assert all(path.is_file() or list(path.iterdir()) for path in tmp_path.iterdir())  # no empty folder
