"""From carts to the tool the robot is linear, whatever friction does to its carts: a run against the equations."""

import numpy as np
import pytest

from gantrytau import Result, linearize
from gantrytau_models import FlexibleGantryTau
from gantrytau_models.mechanisms.flexible import unstretched
from gantrytau_optimica import identify_system
from gantrytau_optimica.learning import Scatter
from tests.optimica.learning.flexible_runs import (
    PERIOD,
    PLACE,
    RECORD,
    WRIST,
    excited,
    flexible_rig,
    kinematic_motion,
)

LENGTH = 5 * (2**10 - 1)  # samples of a period of the sequences


@pytest.fixture(scope="module")
def run() -> Result:
    return excited(flexible_rig(noise=Scatter()))


def from_carts_to_gauge(hertz: np.ndarray) -> np.ndarray:
    """Response of the gauge to positions of the carts, (3, 3, F), of the robot without friction."""
    robot = FlexibleGantryTau(RECORD, friction=None, plate_mass=WRIST)
    carts = [f"carts[{k}].s" for k in range(3)]
    at = dict(zip(carts, unstretched(RECORD, PLACE), strict=True))
    H = linearize(robot, at=at, steady=True, outputs=[*carts, "gauge.r"]).response(hertz)
    # forces cancel between the two, and so does any friction that acts between cart and guideway
    return np.stack([H[3:, :, k] @ np.linalg.inv(H[:3, :, k]) for k in range(len(hertz))], axis=-1)


def test_gauge_follows_the_carts_as_the_linear_equations_say(run):
    carts = run["measured.q"]
    assert np.std(carts - run["q_ref"], axis=0).min() > 2e-4  # m: friction and servos let them follow badly
    # the last period repeats the one before, so that its spectra have lines only
    lines = np.arange(1, int(30.0 * LENGTH * PERIOD))
    Q, Y = (np.fft.rfft(x[-LENGTH:], axis=0)[lines] for x in (carts, run["measured.r"]))
    predicted = np.einsum("ijk,kj->ki", from_carts_to_gauge(lines / (LENGTH * PERIOD)), Q)
    left = np.linalg.norm(Y - predicted, axis=0) / np.linalg.norm(Y, axis=0)
    assert left == pytest.approx(np.zeros(3), abs=0.03)  # where it begins has not died out, 1 mm is not small
    held = np.linalg.norm(Y - kinematic_lines(run, lines), axis=0) / np.linalg.norm(Y, axis=0)
    # and stiff arms do not explain it, least along x where they are stiffest
    assert np.all(held > [0.15, 0.5, 0.5])


def kinematic_lines(run, lines) -> np.ndarray:
    return np.fft.rfft(kinematic_motion(run)[-LENGTH:], axis=0)[lines]


def test_identified_resonances_are_the_printed_ones(run):
    """Table 6.4 and (6.13): 7.4, 10.5 and 11.5 Hz from a black box of order 10, and what it says of other data."""
    z, y = kinematic_motion(run), run["measured.r"]
    first, second = slice(0, 3000), slice(3000, None)
    found = identify_system(z[first], y[first], order=10, period=PERIOD)
    for printed in (7.4, 10.5, 11.5):
        assert np.abs(found.eigenfrequencies - printed).min() < 0.3
    assert np.all(found.fit(z[second], y[second]) > 95)
    assert found.singular_values[7] > 1.5 * found.singular_values[8]  # four modes, and what is between
    # without the third input a part of the motion has no cause
    blind = identify_system(z[first, :2], y[first, :2], order=10, period=PERIOD)
    assert np.all(blind.fit(z[second, :2], y[second, :2]) < found.fit(z[second], y[second])[:2])


def test_servos_hide_the_pair_of_modes(run):
    """(6.12), order 7, x and y: from references poles of the servos come first, and one pair near 10 Hz is left."""
    r, y = run["q_ref"], run["measured.r"][:, :2]
    found = identify_system(r[:3000], y[:3000], order=7, period=PERIOD)
    swings = found.poles[np.imag(found.poles) > 0]
    hertz = np.abs(np.log(swings)) / (2 * np.pi * PERIOD)
    assert np.sum((hertz > 9.0) & (hertz < 11.5)) == 1
    assert not np.any(np.abs(hertz - 7.4) < 0.5)
    real = np.real(found.poles[np.imag(found.poles) == 0])
    assert np.any((real > 0.94) & (real < 0.99))
