"""Distances from obstacles, against dense samples and other closed forms."""

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau.kinematics.workspace import obstacles
from gantrytau.kinematics.workspace.obstacles import (
    Box,
    Capsule,
    Cylinder,
    between_segments,
    segment_distance,
)

TURN = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
TURN = TURN * np.sign(np.linalg.det(TURN))
BODIES = [
    Box([-0.5, -0.2, 0.1], [0.3, 0.6, 0.4]),
    Box([-0.5, -0.2, 0.1], [0.3, 0.6, 0.4], TURN),
    Cylinder([0.2, 0.0, -0.4], [-0.3, 0.3, 0.5], 0.25),
    Capsule([0.2, 0.0, -0.4], [-0.3, 0.3, 0.5], 0.25),
]


@pytest.mark.parametrize("body", BODIES, ids=lambda body: type(body).__name__)
def test_distances_are_those_from_the_surface(body):
    # a signed distance has slope one, and walking back along it ends on the surface
    points = np.random.default_rng(3).uniform(-1.5, 1.5, (4000, 3))
    distance = body.distance(points)
    assert (distance < 0).any()
    step = 1e-6
    slope = np.stack([(body.distance(points + step * e) - distance) / step for e in np.eye(3)], axis=-1)
    smooth = np.abs(np.linalg.norm(slope, axis=1) - 1) < 1e-4
    assert smooth.mean() > 0.99  # all but some near edges and axes
    outside = smooth & (distance > 0)
    foot = points[outside] - distance[outside, None] * slope[outside]
    assert np.abs(body.distance(foot)).max() < 1e-4


@pytest.mark.parametrize("body", BODIES, ids=lambda body: type(body).__name__)
def test_the_distance_of_a_segment_is_the_least_of_its_points(body):
    start, end = np.random.default_rng(4).uniform(-2, 2, (2, 60, 2, 3))
    way = np.linspace(0.0, 1.0, 4001)[:, None, None, None]
    sampled = body.distance(start + way * (end - start)).min(axis=0)
    found = segment_distance(body, start, end)
    assert (found <= sampled + 0.5e-6 * np.linalg.norm(end - start, axis=-1)).all()
    assert found == pytest.approx(sampled, abs=1e-3)  # steps between the samples are up to 1.7 mm


class Hidden:
    """A body of which nothing is known but its distance."""

    def __init__(self, body):
        self.distance = body.distance


@pytest.mark.parametrize("body", BODIES, ids=lambda body: type(body).__name__)
@pytest.mark.parametrize("size", [0.3, 2.0])
def test_closed_forms_are_the_search(body, size):
    # segments within the body, through it and beside it, some along its axes, some of no length
    start, end = np.random.default_rng(6).uniform(-size, size, (2, 4000, 3))
    end[::7], end[1::7, 0], end[2::7, :2] = start[::7], start[1::7, 0], start[2::7, :2]
    searched = segment_distance(Hidden(body), start, end)
    found = segment_distance(body, start, end)
    assert (found <= searched + obstacles._TOUCH).all()
    assert (searched - found <= 1e-6 * np.linalg.norm(end - start, axis=1) + 1e-12).all()
    if size == 0.3:
        assert 0.2 < (found < 0).mean() < 0.9


@pytest.mark.parametrize("body", BODIES, ids=lambda body: type(body).__name__)
def test_segments_of_any_shape(body):
    start, end = np.random.default_rng(7).normal(size=(2, 3, 2, 3))
    every = segment_distance(body, start, end)
    assert every.shape == (3, 2)
    assert segment_distance(body, start[1, 1], end[1, 1]) == pytest.approx(every[1, 1], abs=1e-12)
    assert segment_distance(body, start[0, 0], end).shape == (3, 2)  # from one point to many
    assert segment_distance(body, start[:0], end[:0]).shape == (0, 2)
    end[0, 1] = np.nan
    np.testing.assert_array_equal(np.isnan(segment_distance(body, start, end)), np.isnan(end[..., 0]))


def test_segments_among_each_other_are_capsules_as_obstacles():
    a, b, c, d = np.random.default_rng(5).normal(size=(4, 300, 3))
    found = between_segments(a, b, c, d)
    for k in range(300):
        other = segment_distance(Capsule(c[k], d[k], 0.1), a[k], b[k]) + 0.1
        assert found[k] == pytest.approx(other, abs=1e-5)  # what golden section leaves of a segment


def test_parallel_and_vanishing_segments():
    zero, x, y = np.zeros(3), np.array([1.0, 0, 0]), np.array([0, 0.3, 0])
    assert between_segments(zero, x, y, y + x) == pytest.approx(0.3)
    assert between_segments(zero, x, y + 3 * x, y + 2 * x) == pytest.approx(np.hypot(1.0, 0.3))
    assert between_segments(zero, zero, y, y) == pytest.approx(0.3)
    assert between_segments(zero, x, 2 * x, 2 * x) == pytest.approx(1.0)
    assert np.isnan(segment_distance(BODIES[0], np.full(3, np.nan), x))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Box([0, 0, 0], [1, 1, 0]), "Box: found low .* expected low < high"),
        (lambda: Box([0, 0], [1, 1, 1]), "Box: found low of 2"),
        (lambda: Box([0, 0, 0], [1, 1, 1], 2 * np.eye(3)), "Box: found no rotation in row 0 of R"),
        (lambda: Cylinder([0, 0, 0], [0, 0, 0], 1.0), "Cylinder: found start and end"),
        (lambda: Capsule([0, 0, np.nan], [0, 0, 1], 0.1), "Capsule: found start"),
    ],
)
def test_bodies_that_are_none_are_refused(call, message):
    with pytest.raises(ModelError, match=message):
        call()
