"""The hand-written references against Pinocchio."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.benchmarks import pinocchio_reference
from tests.references import chain, six_link

ROBOTS = {
    "nominal": six_link.parameters_L1(),
    "symmetric": six_link.parameters_symmetric(),
    "longer": six_link.parameters_longer(),
    "disturbed": six_link.parameters_disturbed(),
}
FORCE = np.array([10.0, -5.0, 5.0])  # N


@pytest.mark.parametrize("name", ROBOTS)
def test_six_links_move_alike(name):
    robot = ROBOTS[name]
    for state in six_link.consistent_states(robot, 20, seed=5):
        expected = six_link.accelerations(robot, *state, FORCE)
        found = pinocchio_reference.accelerations(robot, state, FORCE)
        for mine, theirs in zip(expected[:3], found, strict=True):
            assert np.allclose(mine, theirs, rtol=1e-8, atol=1e-8)  # rounding times a condition of up to 1e5


@pytest.mark.parametrize("count", [1, 6, 12])
def test_chains_move_alike(count):
    arm = chain.random_chain(count)
    rng = np.random.default_rng(count)
    phi, w, tau = rng.uniform(-3, 3, (3, count))
    expected = chain.forward_dynamics(arm, phi, w, tau)
    found = pinocchio_reference.chain_forward_dynamics(arm, phi, w, tau)()
    assert np.allclose(expected, found, rtol=1e-9, atol=1e-9)  # rounding


def test_massless_links_are_refused():
    robot = replace(ROBOTS["nominal"], link_masses=np.zeros(6))
    with pytest.raises(ValueError, match="expected above zero"):
        pinocchio_reference.six_link_mechanism(robot)
