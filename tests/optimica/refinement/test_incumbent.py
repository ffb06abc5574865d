"""Ctrl-C and the end of time, at any moment of `optimize`: what was found until then is kept, and nothing goes on."""

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import gantrytau_optimica.answers.playback.replay as replay_module
import gantrytau_optimica.refinement.refinement as refinement_module
from gantrytau import Parameter, SolveError
from gantrytau_optimica import final, optimize, pareto, prepare
from gantrytau_optimica.answers.playback.playback import play_back
from tests.optimica.known_answers.test_singular import CatalystMixing
from tests.optimica.problems import FastestMass, LinearQuadratic
from tests.optimica.refinement.test_starts import Around

ACCURACY = 1e-6
UNEVEN: Any = dict(elements=7, refine=ACCURACY)  # the switch lies inside of an element


def pressing(where: str, count: int = 1, press=lambda: signal.raise_signal(signal.SIGINT)):
    """A progress that presses Ctrl-C when `where` is at work for the `count`-th time, and what it saw afterwards."""
    left, after = [count], []

    def progress(iteration: int, objective: float, stage: str) -> None:
        if not left:
            after.append(stage)
        elif where in stage:
            left[0] -= 1
            if not left[0]:
                left.clear()
                press()

    return progress, after


def interrupted(problem: Any = FastestMass, **policy) -> SolveError:
    """The error of a call that was interrupted."""
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(SolveError) as caught:
        optimize(problem, **policy)
    assert caught.value.interrupted
    assert "interrupted" in str(caught.value)
    assert "What was reached so far is in .optimum." in str(caught.value)
    assert signal.getsignal(signal.SIGINT) is before
    return caught.value


@pytest.mark.parametrize(
    ("where", "rounds"),
    [
        ("round 1 of at most 13: playing back", 0),
        ("round 1 of at most 13: solving on the next mesh", 1),
        ("round 2 of at most 13: playing back", 1),
        ("round 2 of at most 13: solving on the next mesh", 2),
    ],
)
def test_an_interrupted_refinement_keeps_the_last_solved_mesh(where, rounds):
    progress, after = pressing(where)
    error = interrupted(progress=progress, **UNEVEN)
    optimum = error.optimum
    assert optimum.success
    assert optimum.final_time == pytest.approx(2.0, rel=2e-2)
    assert not optimum.refinement.reached
    assert len(optimum.refinement.rounds) == rounds
    assert f"interrupted at {where}" in str(error)
    assert "NOT refined to 1e-06" in str(error)
    assert "(interrupted)" in optimum.report()
    assert after == []


def test_an_interrupted_round_of_the_solver_keeps_the_round_before():
    progress, after = pressing("round 1 of at most 13: solving", count=4)  # the first is its announcement
    optimum = interrupted(progress=progress, **UNEVEN).optimum
    assert optimum.success
    assert optimum.breaks.size + 1 == 7
    assert len(optimum.refinement.rounds) == 1
    assert set(after) <= {"round 1 of at most 13: solving on the next mesh"}  # Ipopt ends its iteration


def test_a_hook_that_raises_is_a_ctrl_c():
    def press():
        raise KeyboardInterrupt

    progress, after = pressing("round 1 of at most 13: solving", count=4, press=press)
    assert interrupted(progress=progress, **UNEVEN).optimum.success
    assert len(after) <= 1


@pytest.mark.parametrize(
    ("module", "name"),
    [(refinement_module, "transcribed_again"), (refinement_module, "warm_start"), (replay_module, "_system")],
)
def test_wherever_it_comes_a_solution_is_kept(monkeypatch, module, name):
    def press(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(module, name, press)
    optimum = interrupted(**UNEVEN).optimum
    assert optimum.success
    assert optimum.breaks.size + 1 == 7


def test_before_anything_is_found_it_is_an_interruption_like_any_other(monkeypatch):
    module = sys.modules["gantrytau_optimica.optimize"]
    monkeypatch.setattr(module, "transcribe", lambda *a: signal.raise_signal(signal.SIGINT))
    with pytest.raises(KeyboardInterrupt):
        optimize(FastestMass)


def test_interrupted_first_guesses_keep_the_best_of_them():
    progress, after = pressing("first guess 3 of 5")
    error = interrupted(starts=5, elements=10, progress=progress)
    assert error.optimum.success
    assert error.optimum.final_time == pytest.approx(2.0, rel=1e-3)
    assert "interrupted at first guess 3 of 5" in str(error)
    assert after == []


def test_an_interrupted_first_guess_that_is_being_solved_does_not_go_on_to_the_next():
    progress, after = pressing("first guess 2 of 5", count=4)
    error = interrupted(starts=5, elements=10, progress=progress)
    assert error.optimum.success
    assert set(after) <= {"first guess 2 of 5"}


def test_interrupted_branches_keep_what_the_default_guess_led_to():
    progress, after = pressing("branch 1 of 1, on the whole mesh")
    error = interrupted(Around, starts=4, elements=40, progress=progress)
    assert error.optimum.success
    assert error.optimum.search.starts == 4
    assert len(error.optimum.search.branches) == 2
    assert error.optimum.search.stopped == "interrupted"
    assert error.optimum.breaks.size + 1 == 40
    assert after == []


def test_a_record_is_written_of_what_was_reached(tmp_path):
    progress, _ = pressing("round 2 of at most 13: playing back")
    interrupted(progress=progress, record=tmp_path / "run.json", **UNEVEN)
    record = json.loads((tmp_path / "run.json").read_text())
    assert record["success"]
    assert any("NOT refined to 1e-06 in 1 rounds (interrupted)" in line for line in record["report"])


def test_an_interrupted_record_does_not_cost_the_answer(tmp_path):
    progress, _ = pressing("writing the record")
    optimum = interrupted(progress=progress, record=tmp_path / "run.json", **UNEVEN).optimum
    assert optimum.refinement.reached
    assert optimum.final_time == pytest.approx(2.0, rel=2 * ACCURACY)
    assert list(tmp_path.iterdir()) == []


def test_a_prepared_problem_is_interrupted_alike():
    progress, _ = pressing("round 2 of at most 13: playing back")
    prepared = prepare(FastestMass, progress=progress, **UNEVEN)
    with pytest.raises(SolveError) as caught:
        prepared.solve()
    assert caught.value.interrupted
    assert caught.value.optimum.success
    assert prepared.solve().refinement.reached  # it can be solved again


def test_an_interrupted_study_keeps_what_it_has():
    solved = []

    def progress(iteration: int, objective: float) -> None:
        if iteration == 1:
            solved.append(objective)
        if len(solved) == 3:
            solved.clear()
            raise KeyboardInterrupt

    class Weighed(LinearQuadratic):
        """Its end, with a weight."""

        weight = Parameter(1.0, description="of the end")

        def objective(self):
            return self.weight * final(self.mass.x) ** 2 / self.one_m**2

        def constraints(self):
            yield final(self.mass.v) == -2

    found = pareto(Weighed, "weight", [0.1, 0.2, 0.3, 0.4], elements=5, progress=progress)
    assert found["weight"].tolist() == [0.1, 0.2]
    assert list(found.failures) == [0.3]


def test_ctrl_c_is_not_swallowed_by_the_integrator(capfd):
    """CasADi calls it "rhs failed" and goes on, unless it is kept from it."""
    optimum = optimize(CatalystMixing, elements=20)
    timer = threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT))
    begin = time.perf_counter()
    timer.start()

    def play():
        while time.perf_counter() - begin < 20:
            assert play_back(optimum).complete

    with pytest.raises(KeyboardInterrupt):
        play()
    timer.join()
    assert time.perf_counter() - begin < 5
    assert capfd.readouterr().err == ""


SCRIPT = """
from tests.optimica.refinement.test_incumbent import CatalystMixing
from gantrytau import SolveError
from gantrytau_optimica import optimize

def progress(iteration, objective, stage):
    print(stage, flush=True)

try:
    optimize(CatalystMixing, elements=20, refine=1e-9, progress=progress)
except SolveError as error:
    print("kept", error.interrupted, error.optimum.success, error.optimum.objective, flush=True)
"""


def test_a_real_signal_in_the_middle_of_a_refinement():
    root = Path(__file__).parents[3]
    child = subprocess.Popen(
        [sys.executable, "-c", SCRIPT], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=root
    )
    assert child.stdout is not None
    for line in child.stdout:
        if line.startswith("round 2"):
            break
    child.send_signal(signal.SIGINT)
    said, complaints = child.communicate(timeout=30)
    assert child.returncode == 0, complaints
    word, *flags, objective = said.splitlines()[-1].split()
    assert (word, flags) == ("kept", ["True", "True"])
    assert float(objective) == pytest.approx(-0.0480557, abs=1e-4)
    assert "rhs failed" not in complaints


def late(seconds: float, **policy):
    """An optimum for which there was not enough time, and the s that it took."""
    begin = time.perf_counter()
    optimum = optimize(CatalystMixing, max_time=seconds, **policy)
    return optimum, time.perf_counter() - begin


def test_max_time_is_the_budget_of_the_whole_call(monkeypatch):
    monkeypatch.setattr(refinement_module, "_holds", lambda rounds, accuracy: False)
    optimum, taken = late(1.5, elements=20, refine=1e-9)
    assert taken < 1.5 + 6.0  # what one playback and one mesh take on a busy machine
    refinement = optimum.refinement
    assert not refinement.reached
    assert refinement.stopped == "time limit reached"
    assert "NOT refined to 1e-09" in optimum.report()
    assert "(time limit reached)" in optimum.report()
    assert optimum.objective == pytest.approx(-0.0480557, abs=1e-4)


def test_no_time_for_all_first_guesses():
    begin = time.perf_counter()
    assert optimize(CatalystMixing, elements=20).success
    alone = time.perf_counter() - begin  # a single first guess, and all that is built for it
    optimum = optimize(CatalystMixing, elements=20, starts=3000, max_time=max(2.0, 4 * alone))
    assert optimum.success
    assert optimum.objective == pytest.approx(-0.0480557, abs=1e-4)
    assert 1 <= optimum.search.starts < 3000
    assert "(time limit reached):" in str(optimum.search)


@pytest.mark.parametrize(
    ("module", "name", "stage"),
    [
        ("gantrytau_optimica.optimize", "read_problem", "reading the problem"),
        ("gantrytau_optimica.optimize", "build", "building the program"),
        ("gantrytau_optimica.optimize", "transcribe", "building the program"),
    ],
)
def test_time_ends_while_there_is_nothing_yet(monkeypatch, module, name, stage):
    monkeypatch.setattr(sys.modules[module], name, lambda *a, **k: time.sleep(30))
    before, begin = signal.getsignal(signal.SIGINT), time.perf_counter()
    with pytest.raises(SolveError) as caught:
        optimize(FastestMass, max_time=0.5)
    assert time.perf_counter() - begin < 0.5 + 1.5 + 2.0  # what is given beyond the time, and a busy machine
    assert re.match(
        f"FastestMass: time limit reached at {stage} after [0-9.]+ s, before there was anything to keep; allow more",
        str(caught.value),
    )
    assert not caught.value.interrupted
    assert signal.getsignal(signal.SIGINT) is before
    time.sleep(0.2)  # no Ctrl-C of the clock comes after the call


def test_time_ends_while_a_refinement_plays_back(monkeypatch):
    """The second playback never ends: the round before is kept, and returned."""
    measured, made = refinement_module._round, []

    def stuck(optimum):
        made.append(optimum)
        if len(made) == 2:
            time.sleep(60)
        return measured(optimum)

    monkeypatch.setattr(refinement_module, "_round", stuck)
    optimum, taken = late(6.0, elements=20, refine=1e-9)
    assert taken < 6.0 + 1.5 + 2.0
    assert optimum.success
    assert len(optimum.refinement.rounds) == 1
    assert optimum.refinement.stopped == "time limit reached"
    assert optimum.objective == pytest.approx(-0.0480557, abs=1e-4)


def test_time_ends_while_it_is_asked_whether_there_is_a_minimum(monkeypatch):
    monkeypatch.setattr(
        sys.modules["gantrytau_optimica.refinement.strategy"], "places_aside", lambda *a, **k: time.sleep(60)
    )
    with pytest.raises(SolveError, match="time limit reached; found until then: a solution on 20") as caught:
        optimize(CatalystMixing, elements=20, max_time=6.0)
    assert caught.value.optimum.success
    assert not caught.value.interrupted


def test_time_does_not_end_a_call_that_is_over():
    optimum = optimize(FastestMass, elements=5, max_time=3.0)
    time.sleep(5.0)
    assert optimum.success


def test_the_best_round_is_kept_where_the_accuracy_is_not_reached(monkeypatch):
    """The third round is made worse than the second: its playback misses the end by a hundredth."""
    measured = refinement_module._round
    made = []

    def worse(optimum):
        made.append(measured(optimum))
        return replace(made[-1], defect=1e-2) if len(made) >= 3 else made[-1]

    monkeypatch.setattr(refinement_module, "_round", worse)
    monkeypatch.setattr(refinement_module, "MOST_ROUNDS", 3)
    optimum = optimize(CatalystMixing, elements=10, refine=1e-9)
    refinement = optimum.refinement
    assert not refinement.reached
    assert len(refinement.rounds) == 4
    assert refinement.kept == 1
    assert optimum.objective == refinement.rounds[1].objective
    assert "round 2 is kept, which passes limits by" in str(refinement)


def test_borders_that_moved_to_err_more_are_given_up(monkeypatch):
    """The third round, in which borders move, is said to miss the end: the fourth goes on from the second."""
    measured = refinement_module._round
    made = []

    def worse(optimum):
        made.append(optimum)
        found = measured(optimum)
        return replace(found, defect=1.0) if len(made) == 3 else found

    monkeypatch.setattr(refinement_module, "_round", worse)
    optimum = optimize(FastestMass, elements=7, refine=ACCURACY)
    rounds = optimum.refinement.rounds
    assert made[2].program.places.layouts[0].mesh.moving
    assert rounds[3].before == rounds[1].objective
    assert not any(o.program.places.layouts[0].mesh.moving for o in made[3:])
    assert optimum.refinement.reached
    assert optimum.final_time == pytest.approx(2.0, rel=2 * ACCURACY)


def test_a_mesh_that_no_longer_changes_ends_it(monkeypatch):
    monkeypatch.setattr(refinement_module, "_holds", lambda rounds, accuracy: False)
    monkeypatch.setattr(refinement_module, "_meshes", lambda o, *_: [p.mesh for p in o.phases.values()])
    refinement = optimize(FastestMass, elements=8, refine=ACCURACY).refinement
    assert not refinement.reached
    assert len(refinement.rounds) < 5


def test_progress_says_the_round():
    stages = []
    optimum = optimize(
        FastestMass, progress=lambda iteration, objective, stage: stages.append(stage), **UNEVEN
    )
    count = len(optimum.refinement.rounds)
    named = list(dict.fromkeys(stages))
    assert named[:3] == ["reading the problem", "building the program", ""]
    assert named[3:6] == [
        "round 1 of at most 13: playing back",
        "round 1 of at most 13: solving on the next mesh",
        "round 2 of at most 13: playing back",
    ]
    assert named[-1] == f"round {count} of at most 13: playing back"
