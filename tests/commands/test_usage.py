"""Commands, arguments and options that do not exist, or are missing."""

import json
from importlib.metadata import version

import pytest

MISUSE = 2


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["fmu", "run"], "Missing argument"),
        (["fmu", "rum"], "rum"),
        (["fmu", "info", "a.fmu", "--every"], "--every"),
        (["simulate", "Pendulum", "--stop", "x"], "--stop"),
        (["simulat"], "simulat"),
        (["simulate", "Pendulum", "--singular", "stp"], "did you mean 'stop'?"),
    ],
)
def test_usage_errors_are_json_where_json_is_asked_for(run, arguments, words):
    printed, spoken = run(*arguments, "--json"), run(*arguments)
    assert (printed.exit_code, spoken.exit_code) == (MISUSE, MISUSE)
    said = json.loads(printed.stdout)
    assert list(said) == ["error"]
    assert words in said["error"]
    assert printed.stderr == ""
    assert spoken.stdout == ""
    assert words in spoken.stderr


def test_a_missing_file_is_begun_by_an_example(fails):
    assert "learn --example` prints one" in fails(MISUSE, "learn")


def test_a_misspelt_word_in_a_group_is_asked_for_once(fails):
    message = fails(MISUSE, "fmu", "export", "Pendulum", "--solver", "rodas")
    assert message.count("did you mean 'rodas4'?") == 1


def test_the_version_is_told(run):
    told = run("--version")
    assert (told.exit_code, told.stdout) == (0, f"gantrytau {version('gantrytau')}\n")
