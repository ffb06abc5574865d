"""What a shell is offered behind Tab: commands, options, models, prototypes, parameters, files and their classes."""

import os
import shutil
import subprocess
import sys
from typing import Literal, get_args, get_origin

import pytest
from typer._completion_shared import get_completion_script
from typer.main import get_command
from typer.testing import CliRunner

from gantrytau.commands.app import app


def offered(*arguments):
    """What completion says behind the last, unfinished argument."""
    words = ["gantrytau", *arguments]
    environment = {
        "_GANTRYTAU_COMPLETE": "complete_bash",
        "COMP_WORDS": "\n".join(word.replace("(", "\\(") for word in words),
        "COMP_CWORD": str(len(words) - 1),
    }
    found = CliRunner().invoke(app, [], env=environment, prog_name="gantrytau")
    assert found.exit_code == 0, found.output
    return found.stdout.split()


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish", "pwsh"])
def test_a_script_is_shown_for_each_shell(shell, monkeypatch):
    monkeypatch.setattr("typer.completion._get_shell_name", lambda: shell)
    found = CliRunner().invoke(app, ["--show-completion"], prog_name="gantrytau")
    assert "_GANTRYTAU_COMPLETE" in found.stdout


def test_commands_and_options_are_offered(run):
    assert "--install-completion" in run("--help").stdout
    assert {"simulate", "study", "pareto", "fmu"} <= set(offered(""))
    assert offered("linea") == ["linearize"]
    assert set(offered("fmu", "")) == {"export", "check", "info", "run"}
    assert {"--stop", "--start"} <= set(offered("simulate", "Pendulum", "--st"))


def test_models_of_the_library_are_offered_with_their_prototypes():
    assert offered("check", "Pend") == ["Pendulum"]
    found = offered("simulate", "G")
    assert "GantryTau" in found
    assert "GantryTau(L1)" in offered("check", "GantryTau(L")
    assert "D1" in offered("check", "GantryTau", "--prototype", "")
    six = offered("check", "SixLinkGantryTau", "--prototype", "")
    assert six
    assert set(six) <= set(offered("check", "--prototype", ""))


def test_parameters_are_offered_behind_set(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.toml").write_text("")
    assert set(offered("check", "Pendulum", "--set", "")) == {"L=", "m=", "g=", "damping=", "own.toml"}
    assert "crank." in offered("check", "FourBar", "--set", "cr")


def test_files_and_their_classes_are_offered_without_running_them(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "robot.py").write_text(
        "raise SystemExit\nclass Arm: ...\nclass Leg: ...\nclass _Hidden: ...\n"
    )
    (tmp_path / "broken.py").write_text("class (\n")
    (tmp_path / "notes.txt").write_text("")
    (tmp_path / "more").mkdir()
    (tmp_path / "more" / "other.py").write_text("class Other: ...")
    (tmp_path / "empty").mkdir()
    assert offered("check", "ro") == ["robot.py"]
    assert offered("optimize", "") == ["broken.py", "more/", "robot.py"]
    assert offered("optimize", "more/") == ["more/other.py"]
    assert offered("optimize", "robot.py:") == ["robot.py:Arm", "robot.py:Leg"]
    assert offered("pareto", "robot.py:L") == ["robot.py:Leg"]
    assert offered("optimize", "broken.py:") == []
    assert offered("optimize", "missing.py:") == []


def options(command, path=()):
    """All options of all commands, with the commands that lead to them."""
    for name in getattr(command, "places", ()):
        yield from options(command.get_command(None, name), (*path, name))
    for parameter in command.params:
        yield path, parameter


def words(option):
    """The words that an option takes, if it takes words."""
    kind = getattr(option.type_descriptor, "annotation", None)
    return get_args(kind) if get_origin(kind) is Literal else ()


WORDS = [(path, option) for path, option in options(get_command(app)) if words(option)]


@pytest.mark.parametrize(
    ("path", "option"), WORDS, ids=[f"{' '.join(path)} {option.opts[0]}" for path, option in WORDS]
)
def test_words_of_options_are_offered(path, option):
    assert set(words(option)) <= set(offered(*path, option.opts[0], ""))
    assert len(WORDS) > 10


BASH = """
eval "$(cat {script})"
COMP_WORDS=(gantrytau {words}); COMP_CWORD={place}
_gantrytau_completion gantrytau
printf '%s\\n' "${{COMPREPLY[@]}}"
complete -p gantrytau
"""


@pytest.mark.skipif(shutil.which("bash") is None, reason="there is no bash")
def test_bash_completes_by_the_script_that_is_shown(tmp_path):
    program = tmp_path / "gantrytau"
    program.write_text(
        f"#!{sys.executable}\nfrom gantrytau.commands.app import app\napp(prog_name='gantrytau')\n"
    )
    program.chmod(0o755)
    script = tmp_path / "script"
    script.write_text(
        get_completion_script(prog_name="gantrytau", complete_var="_GANTRYTAU_COMPLETE", shell="bash")
    )
    environment = {**os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}"}

    def completed(*words):
        text = BASH.format(script=script, words=" ".join(words), place=len(words))
        found = subprocess.run(
            ["bash", "--norc", "-c", text], env=environment, capture_output=True, text=True, check=True
        )
        return found.stdout.splitlines()

    assert completed("linea")[0] == "linearize"
    assert "Pendulum" in completed("check", "Pen")
    # of a file nothing is offered, and bash completes names of files by itself
    nothing, *_, rule = completed("study", "sw")
    assert (nothing, "-o default" in rule) == ("", True)
