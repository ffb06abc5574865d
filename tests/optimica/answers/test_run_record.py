"""The record of a run: what it holds, what a change of the problem changes in it, and what differs between two."""

import json
import math
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gantrytau import Fixed, Input, Model, ModelError, Parameter, Real, SolveError, Start, between, der
from gantrytau_optimica import Free, Optimization, Samples, final, optimize, prepare, sum_of_squares
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


class Tracked(Optimization):
    """Samples of a position are followed by a limited force."""

    mass = Mass(x=Fixed(0.5), v=Fixed(0.0))
    samples = Samples([0.0, 0.5, 1.0], [0.0, 0.1, 0.2])
    most, gain = 1.0, 2.0

    def objective(self):
        return self.gain * sum_of_squares(self.mass.x, self.samples)

    def constraints(self):
        yield between(-1.0, self.mass.u, self.most)


def changed(**attributes) -> type[Tracked]:
    return type("Tracked", (Tracked,), attributes)


TIMES, VALUES = [0.0, 0.5, 1.0], [0.0, 0.1, 0.2]
LEAST = 2.0**-52  # the last bit of a number


@pytest.mark.parametrize(
    "change",
    [
        dict(samples=Samples(TIMES, VALUES, deviation=0.1)),
        dict(samples=Samples(TIMES, VALUES, deviation=[[1.0], [1.0], [2.0]])),
        dict(samples=Samples(TIMES, VALUES, deviation=1.0)),  # told, not assumed
        dict(samples=Samples(TIMES, VALUES, kind="constant")),
        dict(samples=Samples(TIMES, VALUES, largest_gap=5.0)),
        dict(samples=Samples(TIMES, [0.0, 0.1, 0.2 * (1 + LEAST)])),
        dict(most=1.0 + LEAST),
        dict(gain=2.0 * (1 + LEAST)),
        dict(final_time=1.0 + LEAST),
        dict(integrand=lambda self: 1e-300 * self.mass.u**2),
        dict(mass=Mass(x=Fixed(0.5 * (1 + LEAST)), v=Fixed(0.0))),
        dict(mass=Mass(x=dict(start=0.5, fixed=True, nominal=2.0), v=Fixed(0.0))),
    ],
    ids=lambda change: next(iter(change)),
)
def test_all_that_changes_the_answer_changes_the_hash(change):
    base, other = hashes(solved(Tracked)), hashes(solved(changed(**change)))
    assert other["problem"] != base["problem"]
    assert other["equations"] == base["equations"]
    assert hashes(solved(changed())) == base


def test_numbers_in_equations_count_to_their_last_bit():
    class Pushed(Model):
        x = Real(start=0.0, fixed=True)
        u = Input(min=-1.0, max=1.0)
        gain = 1.0

        def equations(self):
            yield der(self.x) == self.gain * (self.u + 0.1 * self.x)

    def of(gain):
        kind = type("Pushed", (Pushed,), {"gain": gain})

        class Far(Optimization):
            model = kind()

            def objective(self):
                return -final(self.model.x)

        return hashes(solved(Far))["equations"]

    assert of(3.0) == of(3.0)
    assert of(3.0) != of(3.0 * (1 + LEAST))


def test_known_inputs_count_whatever_they_are():
    def of(**more):
        class Driven(Optimization):
            mass = Mass(x=Fixed(0.0), v=Start(Free(0.0)))
            inputs = {"mass.u": Samples(TIMES, VALUES, **more)}

            def objective(self):
                return (final(self.mass.x) - 1) ** 2

        return hashes(solved(Driven))["problem"]

    assert len({of(), of(kind="constant"), of(kind="constant", largest_gap=3.0)}) == 3


def test_held_parameters_count_as_they_are_for_the_solve():
    prepared = prepare(Shorter, elements=4, parameters=["half"])
    found = [hashes(prepared.solve({"half": x}))["problem"] for x in (0.5, 0.75, 0.5)]
    assert found[0] == found[2] != found[1]


def test_options_are_told_apart():
    optimum, finer = solved(), optimize(FastestMass, elements=7)

    def options(**given):
        return run_record(optimum, options=given)["options"]

    guesses = [
        {"mass.x": lambda t: 0.5 * t},
        {"mass.x": lambda t: 0.25 * t},
        {"mass.x": lambda t, gain=0.5: gain * t},
        {"mass.x": lambda t, gain=0.75: gain * t},
        optimum,
        finer,
        optimum.result,
        finer.result,
        np.zeros(100),
        np.ones(100),
    ]
    told = [json.dumps(options(guess=g)) for g in guesses]
    assert len(set(told)) == len(told)
    assert options(guess=guesses[0]) == options(guess={"mass.x": lambda t: 0.5 * t})


@pytest.mark.parametrize("record", [None, 3, "a.json", [], {}, {"problem": 1}, {"problem": {"name": 2}}])
def test_what_is_no_record_is_refused(record, tmp_path):
    whole = run_record(solved())
    for call in (
        lambda: compare_records(record, whole),
        lambda: compare_records(whole, record),
        lambda: write_record(record, tmp_path),
    ):
        with pytest.raises(ModelError, match="expected a record: what run_record returns"):
            call()
    assert list(tmp_path.iterdir()) == []
