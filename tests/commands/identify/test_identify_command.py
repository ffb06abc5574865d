"""`gantrytau identify`: logs in, masses and friction out, and what is wrong with the logs."""

import json
import re

import numpy as np
import pytest

from gantrytau_models import GantryTau, prototypes
from gantrytau_optimica import MotionLog, identify
from tests.optimica.identification import gantry_logs

ROBOT = ("--robot", "GantryTau(L1)", "--fixed", "link_masses=0")


@pytest.fixture(scope="module")
def log():
    return gantry_logs.log(0)


@pytest.fixture(scope="module")
def file(log, tmp_path_factory):
    return log.save(tmp_path_factory.mktemp("logs") / "log.csv")


def test_the_command_says_what_the_function_finds(run, file, log, tmp_path):
    page = tmp_path / "page.html"
    answer = run("identify", file, *ROBOT, "--json", "--report", page)
    assert answer.exit_code == 0, answer.output
    record = json.loads(answer.stdout)
    found = identify(GantryTau(prototypes.L1), log, fixed=dict(link_masses=0))
    assert {n: v["value"] for n, v in record["parameters"].items()} == found.parameters
    assert record["set"]["carts[1].m"] == found.parameters["cart_masses[1]"]
    assert record["findings"] == []
    assert "cart_masses[1]" in page.read_text(encoding="utf-8")


def test_values_are_printed_as_options_that_other_commands_take(run, file):
    answer = run("identify", file, *ROBOT)
    assert answer.exit_code == 0, answer.output
    options = re.findall(r"--set '?([^' ]+)'?", answer.stdout.rpartition("As options:")[2])
    assert len(options) == 13  # what was fixed is a part of the robot that was found
    assert sum(option.endswith("=0") for option in options) == 3
    flags = [word for option in options for word in ("--set", option)]
    checked = run("check", "GantryTau(L1)", *flags)
    assert checked.exit_code == 0, checked.output


def test_what_is_wrong_with_a_log_is_told_with_its_file(run, log, tmp_path):
    late = MotionLog(log.t, log.q, np.roll(log.f, 5, axis=0) / 190).save(tmp_path / "late.csv")
    answer = run("identify", late, *ROBOT)
    assert answer.exit_code == 0, answer.output
    assert "late.csv: delay: forces are 5 samples late" in answer.stdout
    assert answer.stdout.count("delay:") == 1
    assert "late.csv: unit of force: forces are 1" in answer.stdout


@pytest.mark.parametrize(
    ("arguments", "words", "code"),
    [
        (("--friction", "dry"), "'dry' is not one of 'symmetric'", 2),
        (("--minimum-speed=-1",), "--minimum-speed -1.0: expected a number of at least 0", 2),
        (("--cutoff", "0"), "--cutoff 0.0: expected a number above 0", 2),
        (("--fixed", "link_masses"), "expected a number, as --fixed link_masses=0", 2),
        (("--fixed", "link_mass=0"), "link_mass", 1),
    ],
)
def test_wrong_options_are_refused(run, file, arguments, words, code):
    answer = run("identify", file, "--robot", "GantryTau(L1)", *arguments)
    assert (answer.exit_code, words in answer.output) == (code, True), answer.output
