"""`gantrytau view`: pages of poses and of motions."""

import pytest

FAULT, MISUSE = 1, 2


def test_a_pose_is_written_as_a_page(run, answer, tmp_path):
    page = tmp_path / "robot.html"
    said = run("view", "GantryTau(L1)", "--pose", "tool.r=[0.5, 3, -0.6]", "-o", page)
    assert (said.exit_code, said.stdout) == (0, f"Written: {page}\n")
    assert "<title>GantryTau</title>" in page.read_text(encoding="utf-8")
    told = answer("view", "GantryTau(L1)", "-o", page)
    size = page.stat().st_size
    assert told == {
        "model": "GantryTau",
        "prototype": "L1",
        "file": str(page),
        "bytes": size,
        "files": [str(page)],
    }


def test_the_page_is_called_as_the_model(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run("view", "Pendulum").stdout == "Written: Pendulum.html\n"
    assert (tmp_path / "Pendulum.html").is_file()


def test_a_saved_motion_is_shown(run, tmp_path):
    motion, page, still = tmp_path / "motion.csv", tmp_path / "motion.html", tmp_path / "still.html"
    assert run("simulate", "Pendulum", "--stop", 0.1, "--points", 11, "--output", motion).exit_code == 0
    said = run("view", "Pendulum", "--result", motion, "-o", page)
    assert said.exit_code == 0, said.output
    assert run("view", "Pendulum", "-o", still).exit_code == 0
    assert page.stat().st_size > still.stat().st_size  # pictures in a row
    both = run("view", "Pendulum", "--result", motion, "--result", motion, "--speed", 0.1, "-o", still)
    assert both.exit_code == 0, both.output
    assert still.stat().st_size > page.stat().st_size


@pytest.mark.parametrize(
    ("code", "arguments", "words"),
    [
        (MISUSE, ["--pose", "tool.r"], "--pose tool.r: expected NAME=VALUE"),
        (MISUSE, ["--pose", "tool.r=near"], "--pose tool.r=near: expected a number"),
        (FAULT, ["--pose", "tool.r=[50, 3, -0.6]"], "GantryTau"),
        (MISUSE, ["--pose", "tol.r=[0.5, 3, -0.6]"], "did you mean"),
        (MISUSE, ["--result", "none.csv"], "--result none.csv: there is no such file"),
        (MISUSE, ["--result", "motion.txt"], "--result motion.txt: found the suffix '.txt'"),
        (MISUSE, ["--result", "a.csv", "--pose", "tool.r=[0.5, 3, -0.6]"], "found --pose and --result"),
    ],
)
def test_mistakes_are_told(fails, tmp_path, code, arguments, words):
    assert words in fails(code, "view", "GantryTau(L1)", *arguments, "-o", tmp_path / "robot.html")
    assert list(tmp_path.iterdir()) == []
