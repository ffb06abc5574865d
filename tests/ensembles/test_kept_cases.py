"""Finished cases in a folder: kept through kill -9 and Ctrl-C, refused for another study, computed again when damaged."""

import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gantrytau import ModelError, SolveError, study
from gantrytau_models import Pendulum

LONG = """
    import os, sys, time
    from gantrytau import SolveError, study

    def counted(a):
        with open(sys.argv[2], "a") as file:
            file.write(f"{a}\\n")
        time.sleep(0.1)
        return a * a

    try:
        found = study(counted, over={"a": range(40)}, folder=sys.argv[1])
        print(found.values == tuple(a * a for a in range(40)))
    except SolveError as error:
        print(error, len(error.result.outcomes), error.interrupted)
"""


def started(tmp_path: Path) -> subprocess.Popen[str]:
    """A program with a study of 40 cases, in a group of processes of its own."""
    program = tmp_path / "long.py"
    program.write_text(textwrap.dedent(LONG))
    command = [sys.executable, str(program), str(tmp_path / "kept"), str(tmp_path / "called")]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True, start_new_session=True)


def until_some_are_kept(tmp_path: Path, number: int) -> None:
    end = time.monotonic() + 60.0
    while len(list((tmp_path / "kept" / "cases").glob("*.case"))) < number:
        assert time.monotonic() < end
        time.sleep(0.02)


def calls(tmp_path: Path) -> list[int]:
    return [int(line) for line in (tmp_path / "called").read_text().split()]


def has_ended(program: subprocess.Popen[str], within: float) -> bool:
    """Whether all processes that a program started end in time, s."""
    end = time.monotonic() + within
    while time.monotonic() < end:
        try:
            os.killpg(program.pid, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.1)
    return False


def test_what_is_finished_survives_a_kill_and_a_second_call_does_the_rest(tmp_path):
    first = started(tmp_path)
    until_some_are_kept(tmp_path, 5)
    first.kill()
    first.wait()
    kept = len(list((tmp_path / "kept" / "cases").glob("*.case")))
    assert 5 <= kept < 40
    before = len(calls(tmp_path))
    second = started(tmp_path)
    assert second.communicate(timeout=60)[0].strip() == "True"
    again = len(calls(tmp_path)) - before
    running = 2 * (os.cpu_count() or 1)  # workers of the first call finish what they had
    assert 40 - kept <= again <= 40 - kept + running
    assert set(calls(tmp_path)) == set(range(40))


def test_workers_of_a_program_that_was_killed_end(tmp_path):
    first = started(tmp_path)
    until_some_are_kept(tmp_path, 2)
    first.kill()
    first.wait()
    assert has_ended(first, within=30.0)


def test_ctrl_c_keeps_what_is_finished_and_says_so(tmp_path):
    first = started(tmp_path)
    until_some_are_kept(tmp_path, 5)
    os.killpg(first.pid, signal.SIGINT)  # as a terminal does: to all processes
    said = first.communicate(timeout=60)[0]
    kept = len(list((tmp_path / "kept" / "cases").glob("*.case")))
    words = f"counted: study interrupted, {kept} of 40 cases are finished, which .result holds; the same call goes on"
    assert said.startswith(words)
    assert said.split()[-2:] == [str(kept), "True"]


def test_results_that_were_kept_are_those_that_were_computed(tmp_path):
    asked: dict[str, Any] = dict(stop=1.0, over={"m": [1.0, -2.0], "x": [0.3, 0.9]}, folder=tmp_path / "kept")
    first, second = study(Pendulum(), **asked), study(Pendulum(), **asked)
    for a, b in zip(first.values, second.values, strict=True):
        assert (a is None) == (b is None)
        assert a is None or all(np.array_equal(a[n], b[n]) for n in a.names)
    assert [str(f) for f in first.failures] == [str(f) for f in second.failures]
    assert len(first.failures) == 2  # no mass is below zero


def test_a_damaged_file_is_computed_again(tmp_path):
    called = tmp_path / "called"

    def noted(a):
        called.touch()
        return a + 1

    for damage in (b"", b"\0" * 100, None):
        kept = tmp_path / f"kept{damage and len(damage)}"
        study(noted, over={"a": [1]}, folder=kept)
        (file,) = (kept / "cases").iterdir()
        file.write_bytes(file.read_bytes()[:-1] if damage is None else damage)
        called.unlink()
        assert study(noted, over={"a": [1]}, folder=kept).values == (2,)
        assert called.exists()


def test_a_folder_of_another_study_is_refused(tmp_path):
    asked: dict[str, Any] = dict(stop=1.0, over={"m": [1.0]}, folder=tmp_path)
    study(Pendulum(), **asked)
    others: list[tuple[dict[str, Any], str]] = [
        ({"stop": 2.0}, "stop"),
        ({"over": {"m": [1.0 + 1e-15]}}, "over"),
        ({"over": {"L": [1.0]}}, "over"),
        ({"tolerance": 1e-6}, "tolerance"),
        ({"outputs": ["x"]}, "outputs"),
    ]
    for other, part in others:
        words = rf"study: {tmp_path}: found the cases of another study, which differs in {part}, expected those of this one"
        with pytest.raises(ModelError, match=words):
            study(Pendulum(), **{**asked, **other})
    with pytest.raises(ModelError, match=r"differs in equations and values, expected"):
        study(Pendulum(m=3.0), **asked)


def test_a_function_is_known_by_its_source_and_what_it_closes_over(tmp_path):
    def scaled(factor):
        return lambda a: factor * a

    assert study(scaled(2.0), over={"a": [1]}, folder=tmp_path).values == (2.0,)
    assert study(scaled(2.0), over={"a": [1]}, folder=tmp_path).values == (2.0,)
    with pytest.raises(ModelError, match=r"differs in function, expected"):
        study(scaled(3.0), over={"a": [1]}, folder=tmp_path)
    with pytest.raises(ModelError, match=r"differs in function, expected"):
        study(lambda a: 2.0 * a + 1, over={"a": [1]}, folder=tmp_path)


def test_a_place_that_is_no_folder_of_a_study_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    no_path: Any = 3
    with pytest.raises(ModelError, match=r"file is a file, expected a folder"):
        study(lambda a: a, over={"a": [1]}, folder=tmp_path / "file")
    with pytest.raises(ModelError, match=r"found files but no study\.json"):
        study(lambda a: a, over={"a": [1]}, folder=tmp_path)
    with pytest.raises(ModelError, match=r"found folder=3, expected the path of a folder"):
        study(lambda a: a, over={"a": [1]}, folder=no_path)
    kept = tmp_path / "kept"
    study(lambda a: a, over={"a": [1]}, folder=kept)
    (kept / "study.json").write_text("{")
    with pytest.raises(ModelError, match=r"found a file that cannot be read, expected what a study wrote"):
        study(lambda a: a, over={"a": [1]}, folder=kept)


def test_a_case_whose_process_died_is_tried_again_by_the_next_call(tmp_path):
    flag = tmp_path / "flag"

    def deadly(a):
        if a == 1 and not flag.exists():
            os._exit(1)
        return a

    assert study(deadly, over={"a": [0, 1]}, folder=tmp_path / "kept").values == (0, None)
    flag.touch()
    assert study(deadly, over={"a": [0, 1]}, folder=tmp_path / "kept").values == (0, 1)


def test_a_study_that_is_interrupted_in_its_own_process_holds_what_is_finished():
    def pressed(a):
        if a == 2:
            raise KeyboardInterrupt
        return a

    from gantrytau.ensembles.workers import places

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(places, "processors", lambda: 1)
        with pytest.raises(SolveError, match=r"2 of 4 cases are finished.*with folder= they") as caught:
            study(pressed, over={"a": range(4)})
    assert caught.value.result.values == (0, 1, None, None)
