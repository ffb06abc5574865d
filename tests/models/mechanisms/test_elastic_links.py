"""The six-link robot on elastic links: its modes against springs and a rigid body, written by hand."""

import numpy as np
import pytest
from scipy.linalg import eigh

from gantrytau import InitializationError, linearize, translate
from gantrytau_models import ElasticSixLinkGantryTau, prototypes

RECORD = prototypes.L1
PLACE = np.array([0.9, 2.7, -0.4])


def skew(a):
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def by_hand(start, stiffness: float) -> np.ndarray:
    """Frequencies of a plate on springs along the links, carts locked, (6,) in Hz."""
    K = np.zeros((6, 6))
    M = np.zeros((6, 6))
    M[:3, :3] = RECORD.plate_mass * np.eye(3)
    M[3:, 3:] = RECORD.plate_inertia
    for i, arm in enumerate(RECORD.arms):
        for link in arm.links:
            b = np.array(link.plate_offset)
            rod = PLACE + b - link.offset - start[f"carts[{i}].s"] * np.array(arm.direction)
            moved = np.hstack([np.eye(3), -skew(b)])  # of the joint on the plate, by a twist
            along = moved.T @ (rod / np.linalg.norm(rod))
            K += stiffness * np.outer(along, along)
    return np.sqrt(eigh(K, M, eigvals_only=True)) / (2 * np.pi)


@pytest.mark.parametrize(("joint", "tube"), [(115e6, 25e6), (115e6, 1e15), (3e6, 25e6)])
def test_modes_are_those_of_a_body_on_springs_in_series(joint, tube):
    links = [dict(links=[dict(mass=0.0, c_joint=joint, c_tube=tube)] * n) for n in (1, 2, 3)]
    robot = ElasticSixLinkGantryTau(RECORD, r=PLACE, friction=None, arms=links, world=dict(g=0.0))
    dae = translate(robot)
    linear = linearize(dae)
    rows = [k for k, name in enumerate(linear.states) if name.startswith("tool")]
    poles = np.linalg.eigvals(np.array(linear.A)[np.ix_(rows, rows)])
    assert poles.real == pytest.approx(np.zeros(12), abs=1e-6 * np.abs(poles).max())  # no damping
    found = np.sort(np.abs(poles.imag))[::2] / (2 * np.pi)
    assert found == pytest.approx(by_hand(dae.evaluate({}), 1 / (2 / joint + 1 / tube)), rel=1e-6)


@pytest.mark.parametrize(
    ("joint", "tube", "expected"),
    [  # two ball joints a link, stiff tubes; tubes of carbon as well; every arm 3 N/um in all
        (115e6, 1e15, [107, 268, 555]),
        (115e6, 25e6, [59, 148, 305]),
        (None, None, [22, 39, 90]),
    ],
)
def test_plate_that_does_not_turn_has_three_modes(joint, tube, expected):
    """Links and joints are 10 to 50 times too stiff for the 10.5 and 11.5 Hz that were measured.

    The figures are those of a point mass; a plate of large inertia is one, and its links, 2 and 3 on an arm, are parallel.
    """
    mass, heavy = 22.38, 1e9 * np.eye(3)
    # springs in series give c / n for each of n links
    stiffness = [
        dict(c_joint=joint, c_tube=tube) if joint else dict(c_joint=1e15, c_tube=3e6 / n) for n in (1, 2, 3)
    ]
    links = [dict(links=[dict(mass=0.0, **c)] * n) for n, c in enumerate(stiffness, start=1)]
    robot = ElasticSixLinkGantryTau(
        RECORD, r=PLACE, friction=None, arms=links, tool=dict(m=mass, J=heavy), world=dict(g=0.0)
    )
    linear = linearize(robot)
    rows = [k for k, name in enumerate(linear.states) if name.startswith("tool")]
    poles = np.linalg.eigvals(np.array(linear.A)[np.ix_(rows, rows)])
    assert np.sort(np.abs(poles))[-6::2] / (2 * np.pi) == pytest.approx(expected, rel=0.02)


def test_place_out_of_reach_is_refused():
    with pytest.raises(InitializationError, match=r"SixLinkGantryTau: no consistent start.*is a length out"):
        ElasticSixLinkGantryTau(RECORD, r=(0.9, 9.0, -0.4))
