"""Programs of compiled functions: the numbers of CasADi's virtual machine, to the last bit."""

from typing import Any

import casadi as ca
import numpy as np
import pytest

from gantrytau import kernels
from gantrytau.commands.demo.motion_problems import FreePath
from gantrytau_optimica import optimize, prepare
from gantrytau_optimica.problem import kept_reading
from gantrytau_optimica.transcription import assemble
from gantrytau_optimica.transcription.program import first_guess
from tests.optimica.known_answers.closed_loops import carried
from tests.optimica.problems import BoundedOscillator

pytestmark = pytest.mark.skipif(kernels.c_compiler() is None, reason="no C compiler")


@pytest.fixture(autouse=True)
def at_once(tmp_path, monkeypatch):
    """Kernels in a folder of the test, of small functions too, that are waited for; how many there are in the end."""
    monkeypatch.setenv("GANTRYTAU_CACHE", str(tmp_path))
    monkeypatch.setattr(kernels, "WORTH", 0)
    monkeypatch.setattr(kernels, "LEAST", 0)
    monkeypatch.setattr(kept_reading, "_KEPT", {})
    monkeypatch.setattr(
        assemble, "kernel_for", lambda function, calls: kernels.kernel_for(function, calls, wait=True)
    )
    return lambda: len(list((tmp_path / "kernels").glob("*-*")))


def numbers(problem: Any, compile: bool, **options: Any) -> list[np.ndarray]:
    """All functions of a program beside its first guess."""
    program = prepare(problem, compile=compile, **options).program
    found, x = program.assembled, first_guess(program) / program.places.scale
    x = np.clip(x + 0.1 * np.sin(np.arange(x.size)), program.lbw, program.ubw)
    lagrangian = found.hess_lag(x, [], 0.7, np.cos(np.arange(found.rows)))
    results = [*found.nlp(x, []), found.grad_f(x, [])[1], found.jac_g(x, [])[1], lagrangian]
    return [np.array(ca.DM(one).nonzeros()) for one in results]


@pytest.mark.parametrize(
    ("problem", "options"),
    [
        (BoundedOscillator, dict(elements=5)),
        (BoundedOscillator, dict(elements=5, scheme="shooting", points=1)),
        (FreePath, dict(elements=4)),
        (carried("delta", 0), dict(elements=2)),
    ],
    ids=["oscillator", "shooting", "free path", "delta"],
)
def test_functions_of_a_program(problem, options, at_once):
    compiled, interpreted = (numbers(problem, way, **options) for way in (True, False))
    assert at_once() >= 2
    for one, other in zip(compiled, interpreted, strict=True):
        assert one.size
        np.testing.assert_array_equal(one, other)


def test_a_motion(at_once):
    compiled, interpreted = (optimize(FreePath, elements=8, compile=way) for way in (True, False))
    assert at_once() > 0
    assert compiled.objective == interpreted.objective
    assert compiled.iterations == interpreted.iterations
