"""The client in C of the page, compiled and run beside one in Python that does the same."""

import shutil
import socket
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest

from gantrytau_fmu.controller import Controller, Declaration, FunctionClient, RemoteClient
from tests.fmu.controller.conftest import DELTA, corrected, slide

SOURCE = Path(__file__).parents[4] / "fmu" / "examples" / "exchange_client.c"
STOP = 0.4


@pytest.fixture
def program(tmp_path):
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        pytest.skip("there is no C compiler on this machine")
    found = tmp_path / "client"
    subprocess.run([compiler, "-std=c11", "-Wall", "-D_DEFAULT_SOURCE", "-o", found, SOURCE], check=True)
    return found


def test_it_may_be_there_before_the_controller(program):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
    with subprocess.Popen([program, str(port)], stdout=subprocess.PIPE, text=True) as running:
        time.sleep(0.2)
        controller = Controller(slide(), corrected, clients=[RemoteClient("stream", Declaration([DELTA]))])
        with controller.serve(port) as server:
            server.wait(timeout=60.0)
            found = controller.run(STOP)
        assert running.communicate(timeout=60.0)[0] == f"{found.time.size} answers; the run has ended\n"


def test_a_client_in_sixty_lines_of_c_does_what_one_in_python_does(program):
    assert len(SOURCE.read_text().splitlines()) <= 60
    references = {"q_ref": 1.0}
    inside = FunctionClient("stream", [DELTA], lambda t, values: {"delta": -0.1 * values["q"]})
    expected = Controller(slide(), corrected, clients=[inside], references=references).run(STOP)
    controller = Controller(
        slide(), corrected, clients=[RemoteClient("stream", Declaration([DELTA]))], references=references
    )
    with controller.serve() as server:
        running = subprocess.Popen([program, str(server.port)], stdout=subprocess.PIPE, text=True)
        server.wait(timeout=60.0)
        found = controller.run(STOP)
        said, _ = running.communicate(timeout=60.0)
    assert said == f"{found.time.size} answers; the run has ended\n"
    assert np.array_equal(found["stream.delta"], expected["stream.delta"])
    assert np.array_equal(found["q"], expected["q"])
    assert found["stream.delta"][-1] < -0.05
