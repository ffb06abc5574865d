"""Linear systems of index 3 in which derivatives cancel between equations move as their closed forms say."""

import numpy as np
import pytest

from gantrytau import simulate, translate
from tests.families import first_of
from tests.independent_routes.mixed_equations import random_mixed

TOLERANCE = 1e-9
CLOSE = 1e3 * TOLERANCE  # of the largest value


@pytest.mark.parametrize("seed", first_of(range(40), 3))
def test_mixed_systems_move_as_their_closed_form(seed):
    mixed = random_mixed(seed)
    dae = translate(mixed.model())
    found = simulate(dae, stop=1.0, points=3, tolerance=TOLERANCE).final("w")
    expected = mixed.motion(1.0)
    assert np.abs(found - expected).max() <= CLOSE * np.abs(expected).max()
