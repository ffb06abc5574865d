"""What is called in loops by kernels: the numbers of CasADi's virtual machine, to the last bit."""

from functools import partialmethod

import numpy as np
import pytest

from gantrytau import kernels, simulate, translate
from gantrytau.simulation.sampling import buffers
from gantrytau_models import FourBar, Pendulum
from tests.simulation.sampled_models import Held

pytestmark = pytest.mark.skipif(kernels.c_compiler() is None, reason="no C compiler")


@pytest.fixture
def at_once(tmp_path, monkeypatch):
    """Kernels of small functions too, that are waited for; how many there are in the end."""
    monkeypatch.setenv("GANTRYTAU_CACHE", str(tmp_path))
    for name in ("WORTH", "LEAST", "LOOK"):
        monkeypatch.setattr(kernels, name, 0)
    monkeypatch.setattr(buffers, "WORTH", 0)
    waiting = partialmethod(kernels.Kernel.called, wait=True)
    monkeypatch.setattr(kernels.Kernel, "called", waiting)
    return lambda: len(list((tmp_path / "kernels").glob("*-*")))


@pytest.mark.parametrize("model", [Pendulum, Held], ids=["with multipliers", "sampled"])
def test_a_simulation(model, at_once, monkeypatch):
    found = simulate(model(), stop=0.5, points=26)
    assert at_once() >= 3
    monkeypatch.setenv("GANTRYTAU_CACHE", "off")
    expected = simulate(model(), stop=0.5, points=26)
    for name in expected.names:
        np.testing.assert_array_equal(found[name], expected[name])


def test_points_on_branches(at_once, monkeypatch):
    dae = translate(FourBar())
    given, find = ["crank.phi"], ["rocker.phi"]
    angles = dae.start[given[0]] + np.linspace(-9, 9, 40)
    found = dae.array_function(given, find)(angles)
    assert at_once() == 1
    monkeypatch.setenv("GANTRYTAU_CACHE", "off")
    for one, other in zip(found, dae.array_function(given, find)(angles), strict=True):
        np.testing.assert_array_equal(one, other)
