"""`gantrytau view`: pages of poses and of motions."""

import pytest

FAULT, MISUSE = 1, 2


def test_a_pose_is_written_as_a_page(run, answer, tmp_path):
    page = tmp_path / "robot.html"
    said = run("view", "GantryTau(L1)", "--pose", "tool.r=[0.5, 3, -0.6]", "-o", page)
    assert (said.exit_code, said.stdout) == (0, f"Written: {page}\n")
    assert "<title>GantryTau</title>" in page.read_text(encoding="utf-8")
    told = answer("view", "GantryTau(L1)", "-o", page)
    assert told == {"model": "GantryTau", "prototype": "L1", "file": str(page), "bytes": page.stat().st_size}


def test_the_page_is_called_as_the_model(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run("view", "Pendulum").stdout == "Written: Pendulum.html\n"
    assert (tmp_path / "Pendulum.html").is_file()


@pytest.mark.parametrize("suffix", ["csv", "nc"])
def test_a_saved_motion_is_shown(run, tmp_path, suffix):
    motion, page, still = tmp_path / f"motion.{suffix}", tmp_path / "motion.html", tmp_path / "still.html"
    assert run("simulate", "GantryTau(L1)", "--stop", 0.1, "--points", 11, "--output", motion).exit_code == 0
    said = run("view", "GantryTau(L1)", "--result", motion, "-o", page)
    assert said.exit_code == 0, said.output
    assert run("view", "GantryTau(L1)", "-o", still).exit_code == 0
    assert page.stat().st_size > still.stat().st_size  # pictures in a row
    both = run("view", "GantryTau(L1)", "--result", motion, "--result", motion, "--speed", 0.1, "-o", still)
    assert both.exit_code == 0, both.output
    assert still.stat().st_size > page.stat().st_size


PROBLEM = """
from gantrytau import between
from gantrytau_models import GantryTau, prototypes
from gantrytau_optimica import Free, Optimization, final, initial

class Fastest(Optimization):
    robot = GantryTau(prototypes.L1)
    final_time = Free(1.0, unit="s", min=0.1, max=5.0)
    def objective(self):
        return self.final_time
    def constraints(self):
        for cart in self.robot.carts:
            yield between(-1200.0, cart.f, 1200.0)
        yield initial(self.robot.tool.r) == [0.0, 2.51, -1.03]
        yield final(self.robot.tool.r) == [1.2, 3.2, -0.4]
        for end in (initial, final):
            yield end(self.robot.tool.v) == 0
"""


def test_the_motion_of_an_optimum_is_that_of_its_robot(run, tmp_path):
    problem, motion, page = tmp_path / "move.py", tmp_path / "motion.csv", tmp_path / "motion.html"
    problem.write_text(PROBLEM)
    solved = run("optimize", problem, "--elements", 8, "--save", motion, "--quiet")
    assert solved.exit_code == 0, solved.output
    said = run("view", "GantryTau(L1)", "--result", motion, "-o", page)
    assert said.exit_code == 0, said.output
    assert page.is_file()


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


def test_places_that_cannot_be_written_are_told(fails, tmp_path):
    assert "is a folder" in fails(MISUSE, "view", "Pendulum", "-o", tmp_path)
    assert "none" in fails(MISUSE, "view", "Pendulum", "-o", tmp_path / "none" / "page.html")


def test_models_without_anything_to_be_seen_are_told(fails, robots, tmp_path):
    message = fails(FAULT, "view", f"{robots}:Cart", "--set", "m=1", "-o", tmp_path / "page.html")
    assert "Cart: found nothing that could be shown, expected components of mechanics.multibody" in message
    assert "animate" not in message


def test_speeds_are_told_as_the_option(fails, run, tmp_path):
    motion = tmp_path / "motion.csv"
    assert run("simulate", "Pendulum", "--stop", 1, "--points", 5, "--output", motion).exit_code == 0
    message = fails(
        MISUSE, "view", "Pendulum", "--result", motion, "--speed", -1, "-o", tmp_path / "page.html"
    )
    assert message.startswith("--speed")


def test_a_motion_of_another_model_is_told(fails, run, tmp_path):
    motion = tmp_path / "motion.csv"
    assert run("simulate", "Pendulum", "--stop", 1, "--points", 5, "--output", motion).exit_code == 0
    message = fails(FAULT, "view", "GantryTau(L1)", "--result", motion, "-o", tmp_path / "page.html")
    assert "motion.csv: found no" in message
