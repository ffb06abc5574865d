"""Studies on a Dask cluster of this machine: the same answers bit by bit, workers that are killed on the way."""

import os
import signal
import subprocess
import sys
import threading
import time
from typing import Any

import numpy as np
import pytest

from gantrytau import ModelError, study
from gantrytau.ensembles.workers import cluster
from gantrytau_models import Pendulum

distributed = pytest.importorskip("dask.distributed")


@pytest.fixture(scope="module")
def two_workers():
    """A cluster whose workers are processes with one thread each."""
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as local:
        yield local


def test_processes_and_cluster_agree_bit_by_bit(two_workers):
    asked: dict[str, Any] = dict(stop=1.0, over={"m": [1.0, 2.0], "x": [0.2, 0.5]})
    here = study(Pendulum(), **asked)
    there = study(Pendulum(), **asked, where=two_workers.scheduler_address)
    for a, b in zip(here.values, there.values, strict=True):
        assert all(np.array_equal(a[name], b[name]) for name in (*a.names, "time"))


def test_all_cases_come_though_a_worker_is_killed_on_the_way(two_workers):
    killed = []

    def slow(a):
        time.sleep(0.1)
        return os.getpid(), a**2

    def kill():
        time.sleep(0.7)
        killed.append(next(iter(two_workers.workers.values())).pid)
        os.kill(killed[0], signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    found = study(slow, over={"a": range(30)}, where=two_workers.scheduler_address)
    killer.join()
    assert not found.failures
    assert [square for _, square in found.values] == [a**2 for a in range(30)]
    assert len({process for process, _ in found.values} | set(killed)) > 2  # another worker took its place


def test_a_case_that_fails_or_ends_its_workers_is_a_row(two_workers):
    def deadly(a):
        if a == 1:
            os._exit(9)
        return 1 / a

    found = study(deadly, over={"a": [0, 1, 2, 4]}, where=two_workers.scheduler_address)
    assert found.values == (None, None, 0.5, 0.25)
    assert [f.kind for f in found.failures] == ["ZeroDivisionError", "WorkerDied"]


def test_a_study_within_a_case_is_computed_by_its_worker(two_workers):
    def outer(a):
        inner = study(lambda b: (os.getpid(), b), over={"b": [1, 2]}, where="dask")
        return os.getpid(), inner.values

    found = study(outer, over={"a": [1, 2, 3]}, where=two_workers.scheduler_address)
    assert not found.failures
    for process, values in found.values:
        assert values == ((process, 1), (process, 2))


def test_dask_starts_a_cluster_that_ends_with_the_study():
    found = study(lambda a: (os.getpid(), a), over={"a": [1, 2, 3]}, where="dask")
    assert [a for _, a in found.values] == [1, 2, 3]
    for process in {process for process, _ in found.values}:
        with pytest.raises(ProcessLookupError):
            os.kill(process, 0)


def test_nobody_and_nobody_to_work_are_told(monkeypatch):
    monkeypatch.setattr(cluster, "PATIENCE", 1.0)
    with pytest.raises(ModelError, match=r"nobody answers at tcp://127\.0\.0\.1:9"):
        study(lambda x: x, over={"x": [1, 2]}, where="tcp://127.0.0.1:9")
    with distributed.LocalCluster(n_workers=0, dashboard_address=":0") as empty:
        words = rf"the scheduler at {empty.scheduler_address} has no workers; start some by `dask worker"
        with pytest.raises(ModelError, match=words):
            study(lambda x: x, over={"x": [1, 2]}, where=empty.scheduler_address)


def test_a_script_that_its_workers_would_repeat_is_told_what_to_write(tmp_path):
    script = tmp_path / "unguarded.py"
    script.write_text("from gantrytau import study\nstudy(lambda a: a, over={'a': [1, 2]}, where='dask')\n")
    found = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=240)
    assert found.returncode != 0
    assert found.stderr.splitlines()[-1].startswith(
        "gantrytau.border.refusal.GantryTauError: study: where='dask': found workers"
    )
