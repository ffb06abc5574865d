"""A process that is killed while it writes leaves what was there before, and nothing that looks like a result."""

import json
import os
import signal
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gantrytau import ModelError, Parameter, Result
from gantrytau_fmu import Build, export_fmu
from gantrytau_models import Pendulum
from gantrytau_optimica import load_optimum, optimize, pareto, save_optimum
from gantrytau_optimica.answers.archive.run_record import write_record
from tests.optimica.problems import FastestMass, LinearQuadratic

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
RESULT = Result([0.0, 1.0], {"x": np.array([1.0, 2.0])})


@cache
def solved() -> Any:
    return optimize(FastestMass, elements=4)


@cache
def study() -> Any:
    class Weighed(LinearQuadratic):
        """A weight on the force."""

        weight = Parameter(1.0, description="of the force")

        def integrand(self):
            return self.weight * super().integrand()

    return pareto(Weighed, "weight", [1.0, 2.0], elements=4)


WRITERS: dict[str, tuple[str, Callable[[Path], Any]]] = {
    "csv": ("a.csv", RESULT.save),
    "netcdf": ("a.nc", RESULT.save),
    "parquet": ("a.parquet", RESULT.save),
    "dymola": ("a.mat", RESULT.save),
    "figure": ("a.png", lambda path: RESULT.plot("x", file=path)),
    "optimum": ("a.optimum", lambda path: save_optimum(solved(), path)),
    "record": ("a.json", lambda path: write_record(solved(), path)),
    "study": ("a.csv", lambda path: study().save(path)),
    "fmu": ("a.fmu", lambda path: export_fmu(Pendulum(), path, build=Build(platforms=()))),
}


def killed(monkeypatch, at: str, write: Callable[[], Any]) -> None:
    """Run `write` in a process that is killed as it calls a function of `os`."""
    write_before = getattr(os, at)
    monkeypatch.setattr(os, at, lambda *arguments, **more: os.kill(os.getpid(), signal.SIGKILL))
    child = os.fork()
    if not child:
        try:
            write()
        finally:
            os._exit(1)
    monkeypatch.setattr(os, at, write_before)
    _, status = os.waitpid(child, 0)
    assert os.WIFSIGNALED(status)
    assert os.WTERMSIG(status) == signal.SIGKILL


def seen(folder: Path) -> list[str]:
    """Files that are not hidden."""
    return sorted(file.name for file in folder.iterdir() if not file.name.startswith("."))


@pytest.mark.parametrize("kind", WRITERS)
def test_what_is_killed_leaves_the_file_of_before(kind, tmp_path, monkeypatch):
    name, write = WRITERS[kind]
    file = tmp_path / name
    write(file)
    before = file.read_bytes()
    killed(monkeypatch, "replace", lambda: write(file))
    assert file.read_bytes() == before
    assert seen(tmp_path) == [name]
    write(file)
    assert seen(tmp_path) == [name]


def test_a_record_in_a_folder_is_whole_from_its_first_moment_on(tmp_path, monkeypatch):
    killed(monkeypatch, "link", lambda: write_record(solved(), tmp_path))
    assert seen(tmp_path) == []
    files = [write_record(solved(), tmp_path) for _ in range(2)]
    assert all(json.loads(file.read_text())["success"] for file in files)
    assert len(set(files)) == 2


def test_records_without_second_names_of_files(tmp_path, monkeypatch):
    def refused(*arguments):
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr(os, "link", refused)
    files = [write_record(solved(), tmp_path) for _ in range(3)]
    assert len(set(files)) == 3
    assert all(json.loads(file.read_text())["success"] for file in files)


def test_a_file_that_was_cut_is_told(tmp_path):
    file = save_optimum(solved(), tmp_path / "a.optimum")
    file.write_bytes(file.read_bytes()[:-200])
    with pytest.raises(ModelError, match="found no whole saved optimum"):
        load_optimum(file)
