"""Candidates for cameras and trackers: the law of depth, counted deviations, lenses, what is not seen."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau_optimica.calibration import Cameras, LaserTracker, PlacedCamera, place_device, stereo_cameras

LOOKS_ALONG_X = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])  # the pattern, in the xy plane of the tool
MIDDLE = np.array([0.5, 2.8, -0.6])


def pair(distance, *, base=0.8, lens_error=0.0):
    """Two cameras along x before the middle."""
    return stereo_cameras(MIDDLE + np.array([distance, 0, 0]), MIDDLE, base=base, lens_error=lens_error)


def test_depth_goes_with_the_square_of_the_distance_over_the_base():
    """Two cameras at a distance d tell depth to d^2 sqrt(2 / m) noise / (focal base) by m points, which is most of the
    error; the size of the pattern tells a little of it, too.
    """
    m, focal, noise = 20, 1800.0, 0.1
    for distance, base in ((4.0, 0.8), (6.0, 0.8), (6.0, 0.4)):
        told = place_device([pair(distance, base=base)], MIDDLE, LOOKS_ALONG_X).error[0]
        assert told == pytest.approx(distance**2 * np.sqrt(2 / m) * noise / (focal * base), rel=0.05)


def test_what_is_foretold_is_what_is_measured():
    """Counted over 2000 readings, a deviation is known to 1.6 %; lenses shift it besides."""
    for lens_error in (0.0, 0.03):
        device, r = pair(3.0, lens_error=lens_error), MIDDLE + np.array([0.1, 0.2, -0.3])
        told = place_device([device], r, LOOKS_ALONG_X).position[0, 0]
        read = device.measure(np.tile(r, (2000, 1)), LOOKS_ALONG_X).r - r
        assert told == pytest.approx(np.sqrt(np.mean(np.sum(read**2, axis=1))), rel=0.05)


def test_who_sees_more_comes_first_then_who_sees_better():
    r = MIDDLE + np.random.default_rng(0).uniform(-0.4, 0.4, (30, 3))
    near, wide, narrow, behind = pair(1.0), pair(4.0, base=1.0), pair(4.0, base=0.3), pair(-4.0)
    found = place_device([near, narrow, behind, wide], r, LOOKS_ALONG_X)
    assert found.best is wide
    assert found.order.tolist() == [3, 1, 0, 2]
    assert 0 < found.share[0] < 1 == found.share[1]
    assert found.share[2] == 0
    assert np.isnan(found.error[2])
    assert found.error[0] < found.error[3]  # of the poses that it sees
    assert np.isnan(found.position).tolist() == (~found.seen).tolist()


def test_a_tracker_is_placed_where_its_beam_is_short():
    far, near = (LaserTracker((d, 0.0, 0.0)) for d in (20.0, 5.0))
    found = place_device([far, near], np.zeros((1, 3)))
    assert found.best is near
    across = (
        7.5e-6 + 5 * 3e-6
    )  # of the manual, in each of two directions, and along the beam 5 um + 0.15 um/m
    assert found.error[1] == pytest.approx(np.hypot(np.sqrt(2) * across, 5e-6 + 5 * 0.15e-6), rel=1e-12)


def test_candidates_that_cannot_be_placed():
    place: Any = place_device
    edge = Cameras(
        cameras=[PlacedCamera.looking(MIDDLE + np.array([0, 4, 0]), MIDDLE)]
    )  # sees the pattern from its edge
    assert place([edge, pair(4.0)], MIDDLE, LOOKS_ALONG_X).order.tolist() == [1, 0]
    for wrong in ([], [3], pair(4.0), [edge]):
        with pytest.raises(ModelError) as refusal:
            place(wrong, MIDDLE, LOOKS_ALONG_X)
        assert refusal.value.argument == "candidates"
    with pytest.raises(ModelError, match="place_device"):
        place([replace(edge)], np.zeros((3, 2)))
