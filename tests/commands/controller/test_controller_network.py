"""`gantrytau controller run --port`, `stream` and `panel`: three programs beside each other."""

import json
import re
import signal
import subprocess
import sys
import time
from typing import Any

import pytest
from typer.testing import CliRunner

from gantrytau.commands.app import app

CELL = """\
from tests.fmu.controller.conftest import slide

plant = slide()


def law(t, values):
    return {"q_ref": values["stream.delta"]}
"""
FILE = """\
plant = "cell.py:plant"
law = "cell.py:law"
clock = "wall"
[places.stream]
delta = { unit = "m", minimum = -1.0, maximum = 1.0 }
"""
GANTRYTAU = [sys.executable, "-m", "gantrytau.cli"]


@pytest.fixture
def cell(tmp_path):
    (tmp_path / "cell.py").write_text(CELL)
    (tmp_path / "cell.toml").write_text(FILE)
    (tmp_path / "u.csv").write_text(
        "time [s],delta [m]\n" + "".join(f"{0.004 * k},{0.01 * (k + 1)}\n" for k in range(5))
    )
    return tmp_path


def asked(*arguments):
    return CliRunner().invoke(app, ["controller", *map(str, arguments)])


def started(*arguments):
    """A program beside this one, its input and outputs as pipes of text."""
    pipes: Any = dict(stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    return subprocess.Popen([*GANTRYTAU, "controller", *map(str, arguments)], **pipes)


def test_a_file_streams_to_a_running_controller_and_a_panel_activates_it(cell):
    run = started("run", cell / "cell.toml", "--stop", 8, "--port", 0, "--json", "--output", cell / "log.csv")
    programs = [run]
    try:
        assert run.stderr is not None
        serving = re.match(
            r"Serving at 127\.0\.0\.1:(\d+); to set something: --token (\S+)", run.stderr.readline()
        )
        assert serving is not None
        port, token = serving.groups()
        stream = started("stream", cell / "u.csv", "--port", port, "--json")
        panel = started("panel", "--port", port, "--token", token)
        programs += [stream, panel]
        assert panel.stdin is not None
        panel.stdin.write("set f_activate 1\n")
        panel.stdin.flush()
        told, _ = run.communicate(timeout=60)
        streamed = json.loads(stream.communicate(timeout=10)[0])
        shown, _ = panel.communicate(timeout=10)
    finally:
        for program in programs:
            program.kill()
    assert run.returncode == 0
    final = json.loads(told)["final"]
    assert final["f_activate"] == 1.0
    assert final["stream.delta"] == 0.05
    assert streamed["state"] == "at the end of 5 rows: holds the last"
    assert streamed["ended"] == "the run has ended"
    assert "The controller ended: the run has ended" in shown


def test_what_is_wrong_is_told_in_options(cell):
    (cell / "none.csv").write_text("delta [furlong]\n1\n")
    for arguments, words in (
        (
            ["stream", cell / "u.csv", "--port", 9, "--at-end", "dance"],
            "'dance' is not one of 'hold', 'stop'",
        ),
        (["stream", cell / "missing.csv", "--port", 9], "found no file to read"),
        (["stream", cell / "none.csv", "--port", 9], "furlong"),
        (["stream", cell / "u.csv", "--port", 9, "--tcp"], "found nobody there"),
        (
            ["stream", cell / "u.csv", "--port", 9, "--token", "two\tparts"],
            "expected a text that can be printed",
        ),
        (["run", cell / "cell.toml", "--stop", 1, "--port", 0, "--wait", 0.1], "did not come within 0.1 s"),
    ):
        answer = asked(*arguments)
        assert answer.exit_code != 0
        assert words in " ".join(answer.output.split()), answer.output


def test_at_an_interrupt_stream_and_panel_leave_and_say_so(cell):
    run = started("run", cell / "cell.toml", "--stop", 60, "--port", 0)
    programs = [run]
    try:
        assert run.stderr is not None
        serving = re.search(r":(\d+);", run.stderr.readline())
        assert serving is not None
        stream = started("stream", cell / "u.csv", "--port", serving[1])
        page = started("panel", "--port", serving[1], "--web", 0)
        programs += [stream, page]
        assert page.stdout is not None
        assert page.stdout.readline().startswith("The panel is at")
        time.sleep(1.0)
        for program, code in ((stream, 130), (page, 0)):
            program.send_signal(signal.SIGINT)
            told, error = program.communicate(timeout=20)
            assert program.returncode == code
            assert not error
            assert program is not stream or re.match(r"\d+ answers to \d+ samples; interrupted; waits", told)
    finally:
        for program in programs:
            program.kill()


def test_without_waiting_it_runs_at_once(cell):
    answer = asked("run", cell / "cell.toml", "--stop", 0.1, "--port", 0, "--wait", 0)
    assert answer.exit_code == 0, answer.output
    assert "26 samples of 0.004 s" in answer.output
