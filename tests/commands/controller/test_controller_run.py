"""`gantrytau controller run`: from a file to samples, lines of JSON and counters; what is wrong, by its place."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from typer.testing import CliRunner

from gantrytau.commands.app import app
from gantrytau.kinematics import Kinematics
from gantrytau_models import GantryTau, prototypes

CELL = """\
from gantrytau_fmu import Channel
from gantrytau_fmu.controller import ExternalKinematics
from tests.fmu.controller.conftest import InProcess, slide

plant = slide()
three = 3


def law(t, values):
    return {"q_ref": values["gain"] * values["q_ref"] + values["stream.delta"]}


def posed(t, values):
    return {"height": values["height"] + values["stream.delta"]}


kinematics = ExternalKinematics(lambda pose: 2 * pose, [Channel("height", "m")], ["q_ref"])


def late(t, values):
    return {"q_ref": 1.0 if t < 0.1 else 1 / 0}


def probe():
    return InProcess(answers=lambda k: [0.001 * k])
"""
FILE = """\
plant = "cell.py:plant"
law = "cell.py:law"
clients = ["cell.py:probe"]
[references]
q_ref = 0.1
[limits.q_ref]
maximum = 0.2
[parameters.gain]
value = 1.0
maximum = 4.0
[[event]]
at = 0.1
set = "gain"
value = 3.0
[[event]]
at = 0.16
state = "idle"
"""


@pytest.fixture
def cell(tmp_path):
    (tmp_path / "cell.py").write_text(CELL)
    (tmp_path / "cell.toml").write_text(FILE)
    return tmp_path / "cell.toml"


def run(*arguments):
    return CliRunner().invoke(app, ["controller", "run", *map(str, arguments)])


def test_a_file_becomes_samples_and_their_log(cell, tmp_path):
    found = run(cell, "--stop", "0.2", "--output", tmp_path / "log.jsonl", "--json")
    assert found.exit_code == 0
    told = json.loads(found.stdout)
    assert told["time"] == {"stop": 0.2, "samples": 51}
    assert told["timing"]["clients"]["stream"]["taken"] == 39  # of samples 1 to 39; from 40 on it is idle
    lines = [json.loads(line) for line in (tmp_path / "log.jsonl").read_text().splitlines()]
    channels = [channel["name"] for channel in lines[0]["channels"]]
    rows = np.array([line["values"] for line in lines if line["type"] == "sample"])
    applied, k = rows[:, channels.index("applied.q_ref")], np.arange(51)
    assert np.allclose(applied[:25], (0.1 + 0.001 * np.maximum(k - 1, 0))[:25], rtol=1e-15)
    assert set(applied[25:40]) == {0.2}  # the limit
    assert set(applied[40:]) == {0.1}
    kinds = [(line["type"], line["k"]) for line in lines if line["type"] in ("set", "state")]
    assert kinds == [("set", 25), ("state", 40)]


def test_a_table_is_written_and_counters_are_told(cell, tmp_path):
    found = run(cell, "--stop", "0.2", "--output", tmp_path / "run.csv")
    assert found.exit_code == 0
    assert "51 samples of 0.004 s" in found.stdout
    assert "stream: 39 taken, 0 held, 0 stale, 0 refused, 0 dropped" in found.stdout
    assert (tmp_path / "run.csv").read_text().count("\n") == 52


def test_the_example_runs_and_brings_the_tool_where_it_is_asked_for(tmp_path):
    (tmp_path / "cell.toml").write_text(run("--example").stdout)
    found = run(tmp_path / "cell.toml", "--stop", "2", "--json")
    final = json.loads(found.stdout)["final"]
    r, _ = Kinematics(GantryTau(prototypes.L1)).fk([final[f"q[{k}]"] for k in range(3)])
    assert np.allclose(r, [1.0, 3.05, -0.35], atol=1e-3)  # a PD controller beside friction


def test_an_interrupt_leaves_a_whole_log(cell, tmp_path):
    log = tmp_path / "log.jsonl"
    command = [
        sys.executable,
        "-m",
        "gantrytau.cli",
        "controller",
        "run",
        str(cell),
        "--stop",
        "60",
        "--clock",
        "wall",
    ]
    process = subprocess.Popen([*command, "--output", str(log)], stdout=subprocess.PIPE, env=os.environ)
    end = time.monotonic() + 60
    while (not log.exists() or log.stat().st_size == 0) and process.poll() is None and time.monotonic() < end:
        time.sleep(0.05)
    time.sleep(0.2)
    process.send_signal(signal.SIGINT)
    said, _ = process.communicate(timeout=60)
    assert process.returncode == 130
    assert b"interrupted" in said
    lines = [json.loads(line) for line in log.read_text().splitlines()]
    assert lines[-1]["ended"] == "interrupted"
    assert lines[-1]["samples"] == sum(line["type"] == "sample" for line in lines) > 0


WRONG = [
    ('plant = "cell.py:plant"', "", "cell.toml: plant: found nothing, expected a text in quotes"),
    ("cell.py:plant", "cell.py:plan", "cell.toml: cell.py has no 'plan'; did you mean 'plant'?"),
    (
        '["cell.py:probe"]',
        '["cell.py:law"]',
        "cell.toml: clients: found cell.py:law, which cannot be called without arguments",
    ),
    ('set = "gain"', 'set = "gian"', "there is no parameter 'gian'; did you mean 'gain'?"),
    ("value = 3.0", "", "cell.toml: event[0]: found {'at': 0.1, 'set': 'gain'}, expected at with state"),
    ("cell.py:law", "cell.py:late", "the function late raised ZeroDivisionError"),
]


@pytest.mark.parametrize(("old", "new", "said"), WRONG, ids=lambda text: text[:24])
def test_what_is_wrong_in_a_file_is_told_with_its_place(old, new, said, cell):
    assert old in FILE
    cell.write_text(FILE.replace(old, new, 1))
    found = run(cell, "--stop", "0.2")
    assert found.exit_code in (1, 2)
    assert said in found.stderr
    assert found.exception is None or isinstance(found.exception, SystemExit)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("cell.toml", "--stop", "0"), "--stop"),
        (("none.toml", "--stop", "1"), "none.toml: there is no such file"),
        (("cell.toml", "--stop", "1", "--output", "none/log.jsonl"), "none/log.jsonl"),
    ],
)
def test_what_is_asked_for_wrongly_is_told(arguments, said, cell, monkeypatch):
    monkeypatch.chdir(cell.parent)
    found = run(*arguments)
    assert found.exit_code == 2
    assert said in found.stderr
