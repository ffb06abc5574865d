"""The client in C of the page, compiled and run beside one in Python that does the same."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from gantrytau_fmu.controller import Controller, Declaration, FunctionClient, RemoteClient
from tests.fmu.controller.conftest import DELTA, corrected, slide

SOURCE = Path(__file__).parents[4] / "fmu" / "examples" / "exchange_client.c"
STOP = 0.4


def test_a_client_in_sixty_lines_of_c_does_what_one_in_python_does(tmp_path):
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        pytest.skip("there is no C compiler on this machine")
    assert len(SOURCE.read_text().splitlines()) <= 60
    program = tmp_path / "client"
    subprocess.run([compiler, "-std=c11", "-Wall", "-D_DEFAULT_SOURCE", "-o", program, SOURCE], check=True)
    references = {"q_ref": 1.0}
    inside = FunctionClient("stream", [DELTA], lambda t, values: {"delta": -0.1 * values["q"]})
    expected = Controller(slide(), corrected, clients=[inside], references=references).run(STOP)
    controller = Controller(
        slide(), corrected, clients=[RemoteClient("stream", Declaration([DELTA]))], references=references
    )
    with controller.serve() as server:
        running = subprocess.Popen([program, str(server.port)], stdout=subprocess.PIPE, text=True)
        server.wait(timeout=10.0)
        found = controller.run(STOP)
        said, _ = running.communicate(timeout=10.0)
    assert said == f"{found.time.size} answers; the run has ended\n"
    assert np.array_equal(found["stream.delta"], expected["stream.delta"])
    assert np.array_equal(found["q"], expected["q"])
    assert found["stream.delta"][-1] < -0.05
