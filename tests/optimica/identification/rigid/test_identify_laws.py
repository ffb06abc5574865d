"""Laws of friction: what a plant has is found, and what a law does not know is kept out by speed."""

import numpy as np
import pytest

from gantrytau_optimica import identify
from tests.optimica.identification import gantry_logs as logs

LINKS = dict(link_masses=logs.IDEAL.link_masses)  # weak, and not asked here
STRIBECK = 40.0  # N


def off(found, truth) -> np.ndarray:
    """Errors of families of parameters by name, in predicted deviations."""
    expected = {f"{word}[{i}]": x for word, row in truth.items() for i, x in enumerate(row)}
    return np.array([(found.parameters[n] - x) / found.deviations[n] for n, x in expected.items()])


@pytest.mark.parametrize("seed", range(3))
def test_friction_of_either_direction_is_found(seed):
    found = identify(
        logs.robot(), logs.log(seed, logs.Extras(asymmetry=0.12)), friction="asymmetric", fixed=LINKS
    )
    truth = {f"coulomb[{i}]": (1.12 * f, 0.88 * f) for i, f in enumerate(logs.COULOMB)}
    truth |= {f"viscous[{i}]": (f, f) for i, f in enumerate(logs.VISCOUS)}
    assert np.max(np.abs(off(found, truth))) < 3
    masses = dict(plate_mass=[logs.IDEAL.plate_mass], cart_masses=logs.IDEAL.cart_masses)
    assert abs(found.parameters["plate_mass"] - masses["plate_mass"][0]) < 3 * found.deviations["plate_mass"]
    assert np.max(np.abs(off(found, dict(cart_masses=masses["cart_masses"])))) < 3


@pytest.mark.parametrize("fall", [0.03, 0.1, 0.3])
def test_stribecks_friction_is_found_with_its_speed(fall):
    """Forces are not linear in the speed: it is looked for between 0.01 and 1 m/s, everything else is linear at each."""
    truth = dict(coulomb=logs.COULOMB, viscous=logs.VISCOUS, static=logs.COULOMB + STRIBECK)
    found = identify(
        logs.robot(), logs.log(0, logs.Extras(stribeck=STRIBECK, fall=fall)), friction="stribeck", fixed=LINKS
    )
    assert found.stribeck_speed == pytest.approx(fall, rel=0.05)  # 8 seeds scatter by 2 %
    assert np.max(np.abs(off(found, truth))) < 3


def test_without_stribecks_friction_its_law_says_the_same_as_the_plain_one():
    found = identify(logs.robot(), logs.log(0), friction="stribeck", fixed=LINKS)
    assert np.max(np.abs(off(found, dict(coulomb=logs.COULOMB)))) < 3
    for i in range(3):
        assert abs(found.parameters[f"static[{i}]"] - logs.COULOMB[i]) < 3 * found.deviations[f"static[{i}]"]


def test_a_minimum_speed_of_twice_stribecks_keeps_it_out_of_the_plain_law():
    """At 2 v_s there is exp(-4) of it left, less than 1 N. Below, it is taken for Coulomb friction."""

    def error(fall: float, minimum_speed: float) -> np.ndarray:
        log = logs.log(0, logs.Extras(stribeck=STRIBECK, fall=fall))
        found = identify(logs.robot(), log, minimum_speed=minimum_speed, fixed=LINKS)
        return np.array([found.parameters[f"coulomb[{i}]"] for i in range(3)]) - logs.COULOMB

    assert np.all(error(0.03, 0.005) > 5.0)
    assert np.all(np.abs(error(0.03, 0.06)) < 1.5)
    assert np.all(error(0.1, 0.06) > 15.0)  # 0.06 m/s is not enough for a speed of 0.1 m/s
    assert np.all(np.abs(error(0.1, 0.2)) < 3.0)
