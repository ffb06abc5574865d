"""The record of a run: what it holds, what a change of the problem changes in it, and what differs between two."""

import json
import math
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gantrytau import Fixed, ModelError, Parameter, SolveError
from gantrytau_optimica import optimize, prepare
from gantrytau_optimica.answers.archive.run_record import compare_records, hashes, run_record, write_record
from tests.optimica.problems import FastestMass, LaunchedMass, LinearQuadratic, Mass

NOON = datetime(2012, 5, 4, 14, 30, tzinfo=timezone(timedelta(hours=2)))


def solved(problem: Any = FastestMass, **policy):
    return optimize(problem, elements=6, **policy)


def test_a_record_holds_what_was_asked_and_what_came_out():
    options = {
        "elements": 6,
        "guess": {"mass.x": np.sin},
        "controls": {"mass.u": "constant"},
        "tolerance": 1e-8,
    }
    optimum = solved(controls={"mass.u": "constant"})
    record = run_record(optimum, problem=FastestMass, options=options, started=NOON, read_time=0.25)
    assert record["problem"]["class"] == "tests.optimica.problems.FastestMass"
    assert record["problem"]["file"] == "problems.py"
    assert record["options"]["guess"] == {"mass.x": "function sin"}
    assert list(record["options"]) == sorted(options)
    assert record["transcription"][0]["controls"]["mass.u"]["kind"] == "constant"
    assert (record["transcription"][0]["elements"], record["transcription"][0]["borders"]) == (6, "equal")
    assert record["started"] == "2012-05-04T12:30:00+00:00"
    assert record["durations"] == {"read": 0.25, "build": optimum.build_time, "solve": optimum.solve_time}
    assert record["free"] == {"final_time": optimum.final_time}
    assert record["objective"] == optimum.objective
    assert record["verdict"] == {"solved": True, "failed": [], "between_points": optimum.playback.violation}
    assert record["report"] == optimum.report().splitlines()
    assert {"gantrytau", "casadi", "numpy", "python"} <= record["versions"].keys()


def test_the_file_hash_is_that_of_the_source():
    import hashlib

    here = hashlib.sha256(Path(test_the_file_hash_is_that_of_the_source.__code__.co_filename).read_bytes())

    class Mine(FastestMass):
        pass

    assert run_record(solved(Mine), problem=Mine())["problem"]["file_hash"] == here.hexdigest()[:16]


def test_a_class_typed_into_a_session_has_no_file():
    typed: dict[str, Any] = {"FastestMass": FastestMass, "__name__": "typed"}
    exec("class Typed(FastestMass): pass", typed)
    record = run_record(solved(typed["Typed"]), problem=typed["Typed"])
    assert record["problem"] == {"name": "Typed", "class": "typed.Typed", "file": None, "file_hash": None}
    assert run_record(solved())["problem"]["class"] is None


def test_two_runs_of_one_problem_have_the_same_record():
    first, second = (run_record(solved(), problem=FastestMass, started=datetime.now(UTC)) for _ in range(2))
    assert compare_records(first, second) == ""
    assert json.dumps(list(first)) == json.dumps(list(second))


class Shorter(FastestMass):
    """Half the way."""

    half = Parameter(0.5, unit="m", description="way")

    def constraints(self):
        from gantrytau_optimica import final

        yield from super().constraints()
        yield final(self.mass.x) <= 2 * self.half


def test_hashes_tell_equations_from_the_rest_of_the_problem():
    base = hashes(solved())
    weaker = hashes(solved(FastestMass(mass=dict(u=dict(min=-0.5)))))
    assert weaker["equations"] == base["equations"]
    assert weaker["problem"] != base["problem"]
    one, other = hashes(solved(Shorter)), hashes(solved(Shorter(half=0.6)))
    assert one["equations"] == other["equations"]
    assert len({base["problem"], one["problem"], other["problem"]}) == 3
    assert hashes(solved(LaunchedMass))["equations"] != base["equations"]
    assert hashes(solved(guess={"mass.x": 0.3}, scheme="gauss")) == base
    starts = [hashes(solved(LinearQuadratic(mass=Mass(x=Fixed(x), v=Fixed(2.0))))) for x in (1.0, 1.5)]
    assert starts[0]["equations"] == starts[1]["equations"]
    assert starts[0]["problem"] != starts[1]["problem"]


def test_what_differs_is_named():
    a, b = (run_record(optimize(FastestMass, elements=5, scheme=scheme)) for scheme in ("radau", "gauss"))
    lines = compare_records(a, b).splitlines()
    assert "transcription[0].scheme: radau -> gauss" in lines
    assert any(line.startswith("objective: 2.0") for line in lines)
    assert not any("durations" in line or "hashes" in line for line in lines)
    c = {**a, "objective": a["objective"] * (1 + 1e-12), "free": {}}
    assert compare_records(a, c) == f"free.final_time: {a['objective']:.10g} -> nothing"


def test_held_parameters_are_those_of_the_solve():
    prepared = prepare(Shorter, elements=4, parameters=["half"])
    values = [run_record(prepared.solve({"half": x}))["parameters"]["half"] for x in (0.5, 0.75)]
    assert values == [0.5, 0.75]


def test_a_failure_is_recorded_with_what_is_not_met(tmp_path):
    with pytest.raises(SolveError) as caught:
        solved(max_iterations=2)
    record = json.loads(write_record(caught.value.optimum, tmp_path, problem=FastestMass).read_text())
    assert record["verdict"]["solved"] is False
    assert any("is off by" in line for line in record["verdict"]["failed"])
    assert record["status"] == "iteration limit reached"


def test_numbers_that_json_lacks_are_words(tmp_path):
    record = run_record(
        solved(), options={"max_time": math.inf, "guess": {"mass.x": np.array([math.nan, 1.0])}}
    )
    assert record["options"] == {"guess": {"mass.x": ["nan", 1.0]}, "max_time": "inf"}
    long = run_record(solved(), options={"guess": np.zeros(100)})["options"]["guess"]
    assert long.startswith("array of shape (100,), hash ")
    file = write_record(record, tmp_path / "a.json")
    assert json.loads(file.read_text(), parse_constant=pytest.fail) == record


def test_records_in_a_folder_never_replace_each_other(tmp_path):
    optimum = solved()
    files = [write_record(optimum, tmp_path, started=NOON) for _ in range(3)]
    assert [f.name for f in files] == [f"FastestMass-2012-05-04T123000{k}.json" for k in ("", "-1", "-2")]
    assert all(json.loads(f.read_text())["success"] for f in files)


def test_other_names_are_refused(tmp_path):
    for path, words in (
        (tmp_path / "a.txt", "neither a folder nor"),
        (tmp_path / "b" / "a.json", "does not exist"),
    ):
        with pytest.raises(ModelError, match=words):
            write_record(solved(), path)


def test_what_a_playback_finds_is_in_the_verdict():
    class Played:
        violation = 0.25
        complete = True

    optimum = solved()
    object.__setattr__(optimum, "__dict__", {**optimum.__dict__, "playback": Played})
    assert run_record(optimum)["verdict"]["between_points"] == 0.25
