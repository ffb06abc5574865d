"""`gantrytau learn`: from a file to histories, corrections and pictures; what is wrong with it, by its place."""

import json

import numpy as np
import pytest

from gantrytau_optimica import History, read_rig
from gantrytau_optimica.learning import RIG_EXAMPLE

PLANT = """\
from tests.optimica.learning.runs.linear_plant import LinearPlant

rig = LinearPlant(noise=1e-6)


def swinging():
    return LinearPlant(noise=1e-6, swing=(7.0, 0.02))


nothing = 3
"""
STOPPED = """
from gantrytau import SolveError


class Stopped(LinearPlant):
    calls = 0

    def run(self, *words, **more):
        self.calls += 1
        if self.calls == {call}:
            raise SolveError("interrupted") from KeyboardInterrupt()  # as of `simulate`
        return super().run(*words, **more)


stopped = Stopped(noise=1e-6)
"""
RIG = """\
[rig]
plant = "plant.py:rig"
[reference]
duration = "1.6 s"
begin = "0.2 s"
rounds = 1
move = "200 ms"
edge = "0.3 s"
[learning]
lead = "100 ms"
window = ["0.2 s", "1.6 s"]
iterations = 2
[[case]]
name = "one"
estimator = "actuators"
cut_off = 10.0
[[case]]
name = "two"
estimator = "measured"
open_to = 20.0
"""


@pytest.fixture
def rig(tmp_path):
    (tmp_path / "plant.py").write_text(PLANT)
    file = tmp_path / "rig.toml"
    file.write_text(RIG)
    return file


def test_ways_to_learn_are_compared_and_kept(run, rig, tmp_path):
    folder = tmp_path / "learnt"
    answer = run("learn", rig, "--output", folder)
    assert answer.exit_code == 0, answer.output
    assert "Case one. History: 3 runs of carts[0].s" in answer.output
    assert "case   sigma   tool x [%]   tool y [%]" in answer.output
    assert "case two: what corrections do ..." in answer.stderr
    names = {
        f"case-{case}{end}" for case in ("one", "two") for end in (".npz", "-corrections.csv", "-path.png")
    }
    assert names | {"cases.png"} <= {path.name for path in folder.iterdir()}
    first = History.load(folder / "case-one.npz")
    assert len(first) == 3
    longer = run("learn", rig, "--output", folder, "--case", "one", "--iterations", "3", "--json")
    told = json.loads(longer.stdout)
    assert [case["name"] for case in told["cases"]] == ["one"]
    assert np.array_equal(np.array(told["cases"][0]["relative"])[:3], first.relative)
    assert len(told["cases"][0]["relative"]) == 4
    assert told["cases"][0]["sigma"] < 1


def test_runs_on_file_are_not_gone_on_with_by_another_law_or_estimator(run, rig, tmp_path):
    """Their errors would stand beside the sigma of a law that did not make them."""
    folder = tmp_path / "learnt"
    assert run("learn", rig, "--case", "one", "--output", folder).exit_code == 0
    for old, new, word in (
        ("cut_off = 10.0", "cut_off = 10.0\ngain = 0.5", "gain, shift, law, Q or window"),
        ('"actuators"', '"kinematic"', "estimator"),
    ):
        rig.write_text(RIG.replace(old, new))
        answer = run("learn", rig, "--case", "one", "--output", folder)
        assert answer.exit_code != 0
        assert f"case-one.npz by another {word}, expected what learns now; take another folder" in " ".join(
            answer.output.split()
        )
    rig.write_text(RIG)
    assert run("learn", rig, "--case", "one", "--output", folder).exit_code == 0
    rig.write_text(RIG.replace("200 ms", "190 ms"))
    assert run("learn", rig, "--case", "one", "--output", folder).exit_code != 0


def test_an_interrupt_says_where_finished_runs_are(run, rig, tmp_path):
    """Whether it comes within a run of learning, or while what corrections do is measured."""
    folder = tmp_path / "learnt"
    for call in (1, 4):
        (tmp_path / "plant.py").write_text(PLANT + STOPPED.format(call=call))
        rig.write_text(RIG.replace("plant.py:rig", "plant.py:stopped"))
        answer = run("learn", rig, "--case", "one", "--output", folder)
        assert answer.exit_code == 130
        assert f"Interrupted; finished runs are kept in {folder}" in answer.output.replace("\n", "")
        assert (folder / "case-one.npz").exists() == (call > 1)
    answer = run("learn", rig, "--case", "one")
    assert "Interrupted; nothing was written; --output keeps runs" in " ".join(answer.output.split())


def test_what_diverges_is_refused_by_its_option(run, rig):
    rig.write_text(
        RIG.replace("plant.py:rig", "plant.py:swinging").replace("open_to = 20.0", "cut_off = 10.0")
    )
    answer = run("learn", rig, "--case", "two")
    assert answer.exit_code != 0
    assert "diverges: after 10 runs" in answer.output
    assert "rig.toml: case two: " in answer.output
    assert run("learn", rig, "--case", "two", "--force", "--iterations", "1").exit_code == 0


def test_the_example_is_a_file(run, tmp_path):
    file = tmp_path / "rig.toml"
    file.write_text(run("learn", "--example").stdout)
    assert file.read_text() == RIG_EXAMPLE
    found = read_rig(file)
    assert [case.name for case in found.cases] == ["1", "2A", "2B", "3"]
    assert found.plant().period == found.reference.period == 0.004
    assert (found.window.start, found.window.stop, found.window.lead) == (1.2, 4.5, 0.4)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [("rounds", "roundz", "reference.roundz: there is no such key; did you mean 'rounds'?")],
)
def test_what_is_wrong_with_a_file_is_told_by_its_place(run, rig, old, new, words):
    assert old in RIG
    rig.write_text(RIG.replace(old, new))
    answer = run("learn", rig)
    assert answer.exit_code != 0
    assert words in " ".join(answer.output.split())


def test_names_and_files_that_do_not_exist(run, rig, tmp_path):
    assert 'found no case "three"; there is one, two' in run("learn", rig, "--case", "three").output
    assert "there is no such file" in run("learn", tmp_path / "none.toml").output
