"""Published problems of index one and three, from components or equations (test set for IVP solvers, Bari)."""

import numpy as np
import pytest

from gantrytau import simulate
from tests.classics.circuits import Amplifier
from tests.classics.constrained import CarAxis, Squeezer
from tests.classics.printed_ends import AXIS, SQUEEZER, VOLTAGES


def check_ends(found, ends, tolerance):
    """Global errors are at most ten tolerances, relative to the largest element on the way."""
    for name, exact in ends.items():
        largest = np.max(np.abs(found[name]))
        np.testing.assert_allclose(found.final(name), exact, rtol=0, atol=10 * tolerance * largest)


@pytest.mark.parametrize("tolerance", [1e-6, 1e-8, 1e-10])
@pytest.mark.parametrize(
    ("model", "stop", "ends"),
    [(CarAxis, 3.0, {name: AXIS[name] for name in "pv"}), (Amplifier, 0.2, {"y": VOLTAGES})],
    ids=["axis", "amplifier"],
)
def test_global_errors_are_at_most_ten_tolerances(model, stop, ends, tolerance):
    check_ends(simulate(model(), stop=stop, tolerance=tolerance), ends, tolerance)


@pytest.mark.nightly
@pytest.mark.parametrize("tolerance", [1e-6, 1e-8, 1e-10])
def test_squeezer(tolerance):
    """Seconds, to translate three loops."""
    ends = {
        f"{n}.{k}": end for n, both in SQUEEZER.items() for k, end in zip(("phi", "w"), both, strict=True)
    }
    check_ends(simulate(Squeezer(), stop=0.03, tolerance=tolerance), ends, tolerance)


def test_torques_that_rounding_disturbs_cost_the_angles_no_digits():
    """Newton's iteration fails at a tolerance of a step of 1e-13, as torques are as exact as they can be."""
    found = simulate(Squeezer(), stop=0.003, tolerance=1e-12, points=2)
    coarse = simulate(Squeezer(), stop=0.003, tolerance=1e-8, points=2)
    assert found.final("beta.phi") == pytest.approx(coarse.final("beta.phi"), rel=1e-7)
