"""`gantrytau optimize`: problems in files of a user, answers, and what is kept of those that have none."""

import csv
import inspect
import json
import signal
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest

import gantrytau_optimica
from tests.families import first_of

FAULT, MISUSE, INTERRUPTED = 1, 2, 130


def columns(file):
    """Header -> values of a CSV file."""
    with file.open() as opened:
        rows = list(csv.reader(opened))
    return dict(zip(rows[0], np.array(rows[1:], dtype=float).T, strict=True))


def fastest(distance=1.0, mass=1.0):
    """Full force forth and back: half the way in half the time, with 1 N."""
    return 2 * np.sqrt(distance * mass / 1.0)


def test_the_fastest_motion_takes_two_seconds(run, answer, move):
    found = answer("optimize", move)
    assert found["problem"] == "Fastest"
    assert found["success"] is True
    assert found["status"] == "solved"
    assert found["objective"] == found["final_time"] == found["free"]["final_time"]
    assert found["final_time"] == pytest.approx(
        fastest(), abs=1e-5
    )  # solved to 1e-8, limits relaxed by as much
    assert found["iterations"] > 0
    assert found["seconds"].keys() == {"build", "solve"}
    assert found["versions"].keys() == {"gantrytau", "casadi", "python"}
    assert found["report"][0].startswith("Fastest: solved after ")
    assert found["files"] == []
    spoken = run("optimize", move)
    assert spoken.exit_code == 0
    assert "Fastest: solved after " in spoken.stdout
    line = next(line for line in spoken.stdout.splitlines() if line.startswith("  final_time = "))
    assert float(line.split()[2]) == pytest.approx(fastest(), abs=1e-5)
    assert line.endswith(" s (duration)")


@pytest.mark.parametrize(
    ("name", "options", "distance", "mass"),
    [
        (":Fastest", ("--set", "cart.m=4"), 1.0, 4.0),
        (":Fastest", ("--set", "distance=4", "--set", "cart.m=4"), 4.0, 4.0),
        (":Fastest(distance=4)", (), 4.0, 1.0),
        (":Fastest( distance = 4 )", ("--set", "final_time=3"), 4.0, 1.0),  # of a Free number: its guess
        (":far", ("--set", "cart.m=2.25"), 4.0, 2.25),
        (":Needy(way=9)", (), 9.0, 1.0),
    ],
)
def test_parameters_are_set(answer, moves, name, options, distance, mass):
    found = answer("optimize", f"{moves}{name}", *options)
    assert found["final_time"] == pytest.approx(fastest(distance, mass), rel=1e-5)  # as above


def test_a_problem_of_a_module_in_this_folder(answer, move, monkeypatch):
    (move.parent / "moves_of_a_user.py").write_text(move.read_text())
    monkeypatch.chdir(move.parent)
    for name in ("moves_of_a_user:Fastest", "moves_of_a_user.Fastest"):
        assert answer("optimize", name)["final_time"] == pytest.approx(fastest(), abs=1e-5)  # as above
    assert str(move.parent) not in sys.path


def test_the_mesh_and_the_solver_are_chosen(answer, move, monkeypatch):
    asked = {}

    def recorded(problem, **policy):
        asked.update(policy)
        return solve(problem, **{key: value for key, value in policy.items() if key in known})

    solve = gantrytau_optimica.optimize
    known = [name for name in inspect.signature(solve).parameters if name not in ("refine", "starts")]
    monkeypatch.setattr(gantrytau_optimica, "optimize", recorded)
    policy = dict(elements=10, points=2, scheme="gauss", tolerance=1e-6, max_iterations=99, max_time=9.0)
    options = [text for name, value in policy.items() for text in (f"--{name.replace('_', '-')}", value)]
    found = answer("optimize", move, *options)
    assert asked.items() >= policy.items()
    assert found["final_time"] == pytest.approx(fastest(), abs=1e-4)  # a hundred times the tolerance
    answer("optimize", move, "--refine", "1e-4", "--starts", "3")
    assert (asked["refine"], asked["starts"]) == (1e-4, 3)


def test_the_motion_is_saved_and_drawn(run, move, tmp_path):
    table, picture = tmp_path / "move.csv", tmp_path / "force.png"
    found = run(
        "optimize", move, "--save", table, "--plot", "cart.f,der(cart.v),final_time,time", "--to", picture
    )
    assert found.exit_code == 0, found.output
    assert f"Written: {table}\nWritten: {picture}" in found.stdout
    values = columns(table)
    assert values["time [s]"][-1] == pytest.approx(fastest(), abs=1e-5)  # as above
    assert values["cart.x [m]"][-1] == pytest.approx(1.0, abs=1e-6)  # a hundred times the tolerance
    assert len(np.unique(plt.imread(picture).reshape(-1, 4), axis=0)) > 20  # paper, axes, the lines' colours


@pytest.mark.parametrize("suffix", first_of([".csv", ".nc"]))
def test_phases_are_saved_drawn_and_gone_on_from(run, answer, moves, tmp_path, suffix, monkeypatch):
    table, picture = tmp_path / f"moves{suffix}", tmp_path / "moves.png"
    problem, drawn = f"{moves}:ThereAndBack", "out.cart.x,back.cart.x,der(back.cart.v[0]),back.final_time"
    arguments = ("optimize", problem, "--elements", "10", "--save", table, "--plot", drawn, "--to", picture)
    found = run(*arguments)
    assert found.exit_code == 0, found.output
    assert f"Written: {table}\nWritten: {picture}" in found.stdout
    assert len(np.unique(plt.imread(picture).reshape(-1, 4), axis=0)) > 20  # as above
    printed = json.loads(run(*arguments, "--json").stdout)
    assert printed["final_time"] == pytest.approx(2 * fastest(), abs=1e-4)
    if suffix == ".csv":
        values = columns(table)
        time, out, back = (values[n] for n in ("time [s]", "out.cart.x [m]", "back.cart.x [m]"))
        middle = np.argmin(np.abs(time - fastest()))
        assert (time[0], time[-1]) == pytest.approx((0.0, 2 * fastest()), abs=1e-4)
        assert np.all(np.isfinite(out) | np.isfinite(back))
        assert np.all(np.isnan(out[middle + 2 :]))
        assert np.all(np.isnan(back[: middle - 1]))
        assert np.nanmax(out) == pytest.approx(1.0, abs=1e-6)
    given = {}
    solve = gantrytau_optimica.optimize
    monkeypatch.setattr(gantrytau_optimica, "optimize", lambda p, **k: solve(p, **(given.update(k) or k)))
    again = answer("optimize", problem, "--elements", "10", "--guess", table)
    assert "guess" in given
    assert again["final_time"] == pytest.approx(2 * fastest(), abs=1e-4)


def test_what_cannot_be_drawn_does_not_cost_the_answer(run, fails, move, tmp_path):
    table, picture = tmp_path / "move.csv", tmp_path / "rate.png"
    arguments = ("optimize", move, "--save", table, "--plot", "der(cart.f)", "--to", picture)
    message = fails(MISUSE, *arguments)
    assert message == "--plot der(cart.f): the equations do not determine this derivative; draw 'cart.f'"
    found = json.loads(run(*arguments, "--json").stdout)
    assert found["success"] is True
    assert found["files"] == [str(table)]
    assert not picture.exists()
    assert "Fastest: solved after " in run(*arguments).stdout


def test_a_full_disk_does_not_cost_the_answer(fails, run, move, tmp_path, monkeypatch):
    def full(result, path, display=None):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("gantrytau.commands.printing.result_output.rehearse", lambda file: None)
    monkeypatch.setattr("gantrytau.results.result.Result.save", full)
    arguments = ("optimize", move, "--save", tmp_path / "move.csv")
    assert "Cannot write" in fails(MISUSE, *arguments)
    assert json.loads(run(*arguments, "--json").stdout)["final_time"] == pytest.approx(fastest(), abs=1e-5)


@pytest.mark.parametrize("suffix", first_of([".csv", ".nc"]))
def test_a_saved_motion_is_where_the_next_search_starts(answer, move, tmp_path, suffix, monkeypatch):
    file = tmp_path / f"move{suffix}"
    answer("optimize", move, "--save", file)
    given = {}
    solve = gantrytau_optimica.optimize

    def recorded(problem, **policy):
        given.update(policy)
        return solve(problem, **policy)

    monkeypatch.setattr(gantrytau_optimica, "optimize", recorded)
    found = answer("optimize", move, "--guess", file, "--elements", "20")
    assert found["final_time"] == pytest.approx(fastest(), abs=1e-5)  # as above
    assert given["guess"]["cart.v"].shape == (151, 2)  # the start and three points in each of 50 elements
    assert given["guess"]["cart.x"][-1] == pytest.approx(1.0, abs=1e-6)  # a hundred times the tolerance


def test_a_problem_without_a_solution_is_told(unsolved, moves, tmp_path):
    file = tmp_path / "move.csv"
    file.write_text("a solution of before\n")
    report = unsolved(FAULT, f"{moves}:Impossible", "--save", file)
    assert report["status"].startswith("no solution")
    assert "` is off by" in report["error"]
    assert "It could be solved if `final(cart.x) == distance` gave way by 0.43" in report["error"]
    kept = tmp_path / "move.unfinished.csv"
    assert f"What was reached until then is in {kept}" in report["error"]
    assert report["files"] == [str(kept)]
    assert columns(kept)["time [s]"][-1] <= 1.5 + 1e-6  # s, the limit, relaxed by the solver
    assert file.read_text() == "a solution of before\n"


def test_of_a_problem_out_of_time_before_the_first_step_nothing_is_kept(unsolved, move, tmp_path):
    report = unsolved(FAULT, move, "--max-time", "1e-9", "--save", tmp_path / "move.csv")
    assert report["iterations"] == 0
    assert [path.name for path in tmp_path.iterdir() if path.suffix == ".csv"] == []


def test_too_few_iterations_can_be_gone_on_from(unsolved, answer, move, tmp_path):
    file = tmp_path / "move.csv"
    report = unsolved(FAULT, move, "--max-iterations", "2", "--save", file)
    assert report["iterations"] == 2
    kept = tmp_path / "move.unfinished.csv"
    assert f"; --guess {kept} goes on from there" in report["error"]
    assert answer("optimize", move, "--guess", kept)["final_time"] == pytest.approx(fastest(), abs=1e-5)


def press_ctrl_c(monkeypatch):
    """Let Ctrl-C be pressed after the third iteration of the solver."""
    solve = gantrytau_optimica.optimize

    def pressed(problem, **policy):
        def press(iteration, objective):
            if iteration == 3:
                signal.raise_signal(signal.SIGINT)

        return solve(problem, **{**policy, "progress": press})

    monkeypatch.setattr(gantrytau_optimica, "optimize", pressed)


def test_ctrl_c_keeps_what_was_found(unsolved, move, tmp_path, monkeypatch):
    press_ctrl_c(monkeypatch)
    report = unsolved(INTERRUPTED, move, "--save", tmp_path / "move.csv")
    kept = tmp_path / "move.unfinished.csv"
    assert report["status"] == "interrupted"
    assert f"What was reached until then is in {kept}; --guess {kept} goes on from there" in report["error"]
    assert columns(kept)["cart.x [m]"].size > 1
    assert "With --save what was reached would have been kept" in unsolved(INTERRUPTED, move)["error"]


def test_ctrl_c_in_the_report_does_not_cost_the_files(run, move, tmp_path, monkeypatch):
    def pressed(*arguments):
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr("gantrytau.commands.printing.optimum_summary.show", pressed)
    table = tmp_path / "move.csv"
    found = run("optimize", move, "--save", table)
    assert (found.exit_code, found.stderr.splitlines()[-1]) == (INTERRUPTED, f"Interrupted; written: {table}")
    assert columns(table)["cart.x [m]"][-1] == pytest.approx(1.0, abs=1e-6)


def test_an_accuracy_that_is_not_reached_is_told_to_programs(run, move, tmp_path, monkeypatch):
    monkeypatch.setattr("gantrytau_optimica.refinement.refinement.MOST_ROUNDS", 1)
    table = tmp_path / "move.csv"
    arguments = ("optimize", move, "--elements", "7", "--refine", "1e-9", "--save", table)
    spoken, printed = run(*arguments), run(*arguments, "--json")
    assert (spoken.exit_code, printed.exit_code) == (FAULT, FAULT)
    record = json.loads(printed.stdout)
    assert record["refinement"]["accuracy"] == 1e-9
    assert record["refinement"]["reached"] is False
    assert len(record["refinement"]["rounds"]) == 2
    assert record["error"].startswith("NOT refined to 1e-09 in 2 rounds")
    assert record["error"] in spoken.stderr
    assert record["files"] == [str(table)]  # it is a solution, of which the error is known
    assert columns(table)["time [s]"][-1] == pytest.approx(fastest(), rel=1e-2)


def test_what_cannot_be_saved_does_not_hide_why_it_stopped(unsolved, move, tmp_path):
    (tmp_path / "move.unfinished.csv").mkdir()
    report = unsolved(FAULT, move, "--max-iterations", "2", "--save", tmp_path / "move.csv")
    assert "iteration limit reached" in report["error"]
    assert "What was reached cannot be saved: " in report["error"]
    assert "is a folder" in report["error"]


def test_nothing_but_the_user_speaks_on_stderr_without_a_terminal(run, move):
    found = run("optimize", move, "--json")
    assert found.stderr == "loading\n"
    assert json.loads(found.stdout)["success"] is True


def test_a_problem_of_optimica_text_is_named_by_its_file(run, answer):
    file = Path(__file__).parents[2] / "optimica" / "text" / "problems.mop"
    found = answer("optimize", f"{file}:Problems.Fastest", "--refine", "1e-6", "--set", "finalTime=3")
    assert found["problem"] == "Fastest"
    assert found["free"]["finalTime"] == pytest.approx(
        2.2811848, rel=1e-6
    )  # of van der Pol's equation, converged
    several = run("optimize", file)
    assert several.exit_code == MISUSE
    assert "several problems (Problems.Box, " in " ".join(several.stderr.split())
