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
        (dict(model='model = "GantryTau(X1)"'), "robot.model: --prototype X1: there is no prototype 'X1'"),
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
    ("lines", "words"),
    [
        (dict(poses="poses = 4"), "goal.poses"),
        (dict(home="home = [0.5, 0.5]"), "plan.home"),
        (dict(low="low = [0.4, 2.3, -1.6]", high="high = [1.5, 3.5, 0.0]"), "mm too little clearance"),
    ],
)
def test_cells_that_cannot_be_planned(fails, tmp_path, lines, words):
    file = tmp_path / "cell.toml"
    file.write_text(with_lines(**lines))
    message = fails(FAULT, "calibrate", file)
    assert message.startswith(f"{file}: ")
    assert words in message
    assert all(path.is_file() or list(path.iterdir()) for path in tmp_path.iterdir())  # no empty folder
