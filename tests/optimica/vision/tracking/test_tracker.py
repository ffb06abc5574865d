"""A pattern that moves, followed at 250 Hz."""

from functools import cache
from typing import Any

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau_optimica.vision import Pattern, PatternTracker, Tracked, render
from tests.optimica.vision.camera_rig import LENS, MIDDLE, SIDE, pair, scene

PERIOD, COUNT = 0.004, 24
TIMES = PERIOD * np.arange(COUNT)
PLACES = MIDDLE + np.column_stack([0.5 * TIMES, 0.2 * np.sin(8 * TIMES), -0.1 * np.cos(8 * TIMES)])
TRUE = PLACES + scene().place
WRONGLY: Any = PatternTracker  # called with what types forbid


@cache
def frames():
    """Images of two cameras, (N, height, width) each."""
    return render(scene(), PLACES, pair(), seed=3).frames


def followed(cameras, hidden=()) -> list[Tracked]:
    """What a tracker says of each instant; images at hidden ones are grey."""
    tracker = PatternTracker(Pattern.quincunx(SIDE), [pair()[c] for c in cameras], period=PERIOD)
    found = []
    for k in range(COUNT):
        images = [frames()[c][k] for c in cameras]
        here = tracker.update([np.full_like(i, 90) for i in images] if k in hidden else images)
        assert here is not None
        found.append(here)
    return found


def tracked(images):
    """What a tracker of a pair says of its first images."""
    return PatternTracker(Pattern.quincunx(SIDE), pair()).update(list(images))


def test_a_pair_follows_within_a_tenth_of_a_millimetre():
    found = followed((0, 1))
    assert [each.searched for each in found] == [True, *[False] * (COUNT - 1)]
    assert all(each.seen for each in found)
    error = np.array([each.r for each in found]) - TRUE
    assert np.linalg.norm(error, axis=1).max() < 0.2e-3
    assert np.sqrt(np.mean(error[4:] ** 2)) < 0.08e-3
    true_v = np.gradient(TRUE, TIMES, axis=0)
    assert np.abs(found[-2].v - true_v[-2]).max() < 0.05
    assert found[-1].deviation < found[0].deviation
    axes = scene().R
    assert np.abs(found[-1].R - axes).max() < 0.01


def test_what_is_hidden_coasts_and_is_found_again():
    hidden = range(10, 14)
    found = followed((0, 1), hidden)
    assert [k for k, each in enumerate(found) if not each.seen] == list(hidden)
    error = np.linalg.norm([each.r - true for each, true in zip(found, TRUE, strict=True)], axis=1)
    assert error[list(hidden)].max() < 1.7e-3  # half of 13 m/s2 in 16 ms
    assert found[13].deviation > 2 * found[9].deviation
    assert not found[14].searched
    assert error[-1] < 0.2e-3


def test_one_camera_follows_with_less_depth():
    found = followed((0,))
    error = np.array([each.r for each in found[4:]]) - TRUE[4:]
    across = pair()[0].R[:, :2]
    assert np.abs(error @ across).max() < 0.15e-3
    assert np.linalg.norm(error, axis=1).max() < 6e-3


def test_nothing_is_told_before_it_was_seen():
    tracker = PatternTracker(Pattern.quincunx(SIDE), pair())
    assert tracker.update([np.full((768, 1024), 90, np.uint8)] * 2) is None
    assert tracker.update([frames()[0][0], frames()[1][0]]) is not None


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: PatternTracker(Pattern.charuco(5, 4, 0.05), pair()), "expected Pattern.quincunx"),
        (lambda: WRONGLY(Pattern.quincunx(SIDE), [LENS]), "expected those of a Reconstruction"),
        (lambda: tracked(frames()[0][:1]), "1 images, expected one of each of 2"),
        (lambda: tracked(np.zeros((2, 768, 1024))), "numbers of type float64"),
    ],
)
def test_what_does_not_fit_is_refused_by_name(call, words):
    with pytest.raises(ModelError, match=words):
        call()
