"""An output that takes no more, and one that nobody reads."""

import subprocess
import sys
from pathlib import Path

import pytest

FULL = Path("/dev/full")  # every write to it fails as on a full disk
MISUSE = 2


def program(*arguments, unbuffered, **streams):
    """The command line as a process of its own."""
    command = [sys.executable, *(["-u"] if unbuffered else []), "-m", "gantrytau.cli", *arguments]
    return subprocess.run(command, stderr=subprocess.PIPE, text=True, check=False, **streams)


@pytest.mark.skipif(not FULL.exists(), reason="only some systems have a device that is always full")
@pytest.mark.parametrize("unbuffered", [False, True])
@pytest.mark.parametrize("arguments", [("check", "Pendulum"), ("library", "--json"), ("optimize", "--help")])
def test_a_full_disk_is_told(arguments, unbuffered):
    with FULL.open("w") as full:
        found = program(*arguments, unbuffered=unbuffered, stdout=full)
    assert found.returncode == MISUSE
    words = "Cannot write: No space left on device; make room, or send the output to another place\n"
    assert found.stderr == words


def test_a_closed_output_is_no_fault():
    command = f"'{sys.executable}' -m gantrytau.cli library >&-"
    found = subprocess.run(["sh", "-c", command], stderr=subprocess.PIPE, text=True, check=False)
    assert (found.returncode, found.stderr) == (0, "")


def test_other_faults_of_files_are_not_hidden(run, monkeypatch):
    def broken(model):
        raise FileNotFoundError(2, "No such file or directory", "inside")

    monkeypatch.setattr("gantrytau.check", broken)
    assert isinstance(run("check", "Pendulum").exception, FileNotFoundError)
