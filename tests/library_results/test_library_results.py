"""A small library of our own beside results that are written here."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.library_results.example import LEFT, NO_REFERENCE, NOT_RUN, PASSED, REFUSED, outcome_of
from tests.library_results.peer import SCRIPT, outcomes, sample
from tests.library_results.references import Reference, references
from tests.library_results.summary import write_peer, write_summary

TIME = np.linspace(0, 10, 501)
OWN = """package Own
  model Decay
    Real x(start = 1, fixed = true);
  equation
    der(x) = -x;
  end Decay;
  model Partly
    Missing m;
  end Partly;
  annotation(version = "4.1.0");
end Own;
"""


@pytest.fixture
def places(tmp_path):
    """A library in a file, and results of three examples: right, wrong, and without trajectories."""
    library, results = tmp_path / "libraries", tmp_path / "results"
    (library / "Own").mkdir(parents=True)
    (library / "Own" / "package.mo").write_text(OWN)
    for name in ("Decay", "Partly", "Gone", "Large"):
        folder = results / "Own" / name
        folder.mkdir(parents=True)
        (folder / "comparisonSignals.txt").write_text("time\nx\n")
        (folder / "creation.txt").write_text(
            "StartTime=0\nStopTime=10 // s\nInterval=0.02\nTolerance=1e-06\n"
        )
        rows = "".join(f"{t},{x}\n" for t, x in zip(TIME, np.exp(-TIME), strict=True))
        (folder / f"{name}.csv").write_text('"Time","x"\n' + rows)
    (results / "Own" / "Large" / "Large.csv").write_text("version https://git-lfs.github.com/spec/v1\n")
    return library, results


def test_examples_are_passed_refused_or_without_a_reference(places, tmp_path):
    library, results = places
    found = {one: outcome_of(one, library) for one in references(results)}
    words = {one.name: what.word for one, what in found.items()}
    assert words == {
        "Own.Decay": PASSED,
        "Own.Gone": REFUSED,
        "Own.Large": NO_REFERENCE,
        "Own.Partly": REFUSED,
    }
    assert "Missing" in next(what.detail for one, what in found.items() if one.name == "Own.Partly")
    write_summary(found, {"Own": "4.1.0"}, "digest", tmp_path / "kept.toml")
    write_peer("rumoca", "0", found.values(), tmp_path / "kept.toml")
    write_summary({}, {}, "", tmp_path / "kept.toml")
    assert (tmp_path / "kept.toml").read_text().count("word =") == 8


def test_a_wrong_trajectory_is_told_with_signal_and_time(places):
    library, results = places
    path = results / "Own" / "Decay" / "Decay.csv"
    rows = "".join(f"{t},{np.exp(-t) + 0.01 * (t > 3)}\n" for t in TIME)
    path.write_text('"time","x"\n' + rows)
    (one,) = references(results, "Own.Decay")
    found = outcome_of(one, library)
    assert found.word == LEFT
    assert found.detail == "x at 3.02 s (1 of 1 signals)"


def test_a_beginning_that_is_shorter_than_the_interval_is_run_again_alone(places):
    library, results = places
    fast = (
        OWN.replace("-x;", "-1e5 * x;")
        .replace("start = 1", "start = 0")
        .replace("1e5 * x", "1e5 * (x - exp(-1e4 * time))")
    )
    (library / "Own" / "package.mo").write_text(fast)
    time = np.sort(np.append(TIME, np.linspace(0, 1e-3, 50)))
    values = (np.exp(-1e4 * time) - np.exp(-1e5 * time)) * 1e5 / (1e5 - 1e4)
    rows = "".join(f"{t},{x}\n" for t, x in zip(time, values, strict=True))
    (results / "Own" / "Decay" / "Decay.csv").write_text("time,x\n" + rows)
    (one,) = references(results, "Own.Decay")
    assert outcome_of(one, library).word == PASSED


def test_a_missing_folder_is_told_by_the_name_of_its_variable(places):
    library, results = places
    both = {"MODELICAPATH": str(library), "REFERENCE_RESULTS": str(results)}
    for name in both:
        given = {**os.environ, **both, name: ""}
        done = subprocess.run(
            [sys.executable, "-m", "tests.library_results"],
            capture_output=True,
            text=True,
            env=given,
            cwd=Path(__file__).parents[2],
        )
        assert done.returncode == 1
        assert f"{name} is not set" in done.stderr


def test_an_example_in_a_process_of_its_own_prints_its_outcome(places):
    library, results = places
    command = [
        sys.executable,
        "-m",
        "tests.library_results.example",
        "Own.Decay",
        str(library),
        str(results),
        "60",
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=Path(__file__).parents[2])
    assert json.loads(done.stdout)["word"] == PASSED


RUMOCA = """import math, os
version = lambda: "0.1"
class RumocaError(Exception): ...
SimConfig = dict
class Result(dict):
    time = property(lambda self: self["time"])
class Session:
    def __init__(self, roots): ...
    def loads(self, text, model):
        if "Partly" in text: raise RumocaError("Missing")
        if "Gone" in text: os.abort()
        return self
    def simulate(self, span, dt, config):
        times = [dt * k for k in range(501)]
        return Result(time=times, x=[math.exp(-t) for t in times])
"""


def test_a_peer_is_compared_in_the_same_tubes_and_started_again_where_it_ends(places, tmp_path):
    library, results = places
    script = tmp_path / "peer" / SCRIPT.name
    script.parent.mkdir()
    script.write_text(SCRIPT.read_text())
    (script.parent / "rumoca.py").write_text(RUMOCA)
    asked = [one for one in references(results) if not one.missing]
    found = list(outcomes(asked, [sys.executable, str(script), str(library), "60"]))
    assert [(one.name, one.word) for _, one in found] == [
        ("Own.Decay", PASSED),
        ("Own.Gone", NOT_RUN),
        ("Own.Partly", NOT_RUN),
    ]
    assert found[2][1].detail == "Missing"
    assert {version for version, _ in found} == {"0.1"}


def test_a_sample_is_spread_over_the_names_of_a_package(tmp_path):
    for k in range(8):
        folder = tmp_path / "Modelica" / "Blocks" / "Examples" / f"E{k}"
        folder.mkdir(parents=True)
        (folder / f"E{k}.csv").touch()
    found = [Reference(tmp_path, f"Modelica.Blocks.Examples.E{k}") for k in range(8)]
    assert [one.name[-1] for one in sample(found)] == ["0", "2", "4", "6"]
