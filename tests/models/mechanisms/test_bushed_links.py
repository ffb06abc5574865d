"""Links as bodies on bushings: stiffness in series, spin of a tube, and the modes of the plate by another route."""

import numpy as np
import pytest

from gantrytau import InitializationError, Model, linearize
from gantrytau.mechanics.multibody import Body, World
from gantrytau_models import BushedSixLinkGantryTau, ElasticSixLinkGantryTau, prototypes
from gantrytau_models.mechanisms.bushed_links import BushedRod
from tests.mechanisms.rows import in_a_row

RECORD = prototypes.L1
PLACE = np.array([0.9, 2.7, -0.4])
MASS = 22.38  # kg, with a wrist
FLOATING = dict(g=0.0)


# A load at the end of a rod.
Hung = in_a_row(
    "Hung",
    world=World(g=0.0),
    rod=BushedRod(L=2.0, m=0.5, radius=0.03, axis=[0.6, 0.0, 0.8], c_phi=50.0),
    load=Body(m=22.0, J=np.eye(3)),
)


def test_a_rod_gives_way_along_itself_by_both_joints_and_its_tube():
    linear = linearize(Hung(rod=dict(c_phi=0.0)))
    found = linear.eigenfrequencies
    series = np.sqrt(1 / (2 / 115e6 + 1 / 25e6) / 22.0) / (2 * np.pi)
    nearest = found[np.argmin(np.abs(found - series))]
    assert nearest == pytest.approx(series, rel=2 * 0.5 / 22.0)  # the rod has mass as well
    assert nearest < series


def test_joints_that_resist_rotation_let_a_rod_spin_as_its_inertia_says():
    linear = linearize(Hung(load=dict(J=1e6 * np.eye(3), m=1e6)))
    spin = np.sqrt(2 * 50.0 / (0.5 * 0.03**2)) / (2 * np.pi)  # between two walls, thin tube
    assert np.min(np.abs(linear.eigenfrequencies - spin)) < 1e-3 * spin  # the walls have 1e6 kg.m2


def modes(robot: Model, bodies: str) -> np.ndarray:
    """Frequencies in Hz with the carts locked, rising, each once."""
    linear = linearize(robot)
    rows = [k for k, name in enumerate(linear.states) if "carts" not in name and "rail" not in name]
    rows = [k for k in rows if bodies in linear.states[k]]
    poles = np.linalg.eigvals(np.array(linear.A)[np.ix_(rows, rows)])
    return np.sort(np.abs(poles))[::2] / (2 * np.pi)


def lifted(robot: type, **tool) -> Model:
    links = [dict(links=[dict(mass=0.1)] * n) for n in (1, 2, 3)]
    return robot(RECORD, r=PLACE, friction=None, world=FLOATING, tool=dict(m=MASS, **tool), arms=links)


def test_the_plate_has_the_modes_of_springs_along_its_links():
    bodies = modes(lifted(BushedSixLinkGantryTau), "")
    springs = modes(lifted(ElasticSixLinkGantryTau), "tool")
    assert bodies[:6] == pytest.approx(np.zeros(6), abs=0.5)  # each of six links may spin
    # 0.6 kg of links are nearer to the plate or farther
    assert bodies[6:12] == pytest.approx(springs, rel=0.005)
    assert bodies[12] > 10 * springs[-1]  # links on their joints


def test_a_plate_that_does_not_turn_has_the_modes_of_the_literature():
    """Two joints of 115 N/um and a tube of 25 N/um on each link, 1, 2 and 3 links, a mass point of 22.38 kg."""
    found = modes(lifted(BushedSixLinkGantryTau, J=1e6 * np.eye(3)), "")
    # the plate's turns are slow, links spin
    assert found[9:12] == pytest.approx([59.0, 148.0, 305.0], rel=0.02)


def test_place_out_of_reach_is_refused_before_any_link_is_stretched():
    with pytest.raises(InitializationError, match=r"no consistent start.*is a length out of reach"):
        BushedSixLinkGantryTau(RECORD, r=(0.9, 9.0, -0.4))
