"""Paths: their geometry against closed forms, their smoothing against the truth."""

from typing import Any

import casadi as ca
import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau_optimica.paths.path import Deviation, Path
from gantrytau_optimica.paths.way import Way

START, END = np.array([0.0, 2.51, -1.03]), np.array([1.711, 3.46, -0.24])
ARC = (START, [0.3, 2.5, -0.85], [0.9, 2.75, -0.5], [1.4, 3.1, -0.35], END)


def circle(u):
    """A quarter of a helix with a radius of 0.5 m."""
    return 0.5 * np.cos(u), 0.5 * np.sin(u), 0.2 * u


def test_a_helix_has_its_length_its_curvature_and_unit_speed():
    path = Path.of(lambda u: (0.5 * ca.cos(u), 0.5 * ca.sin(u), 0.2 * u), 0.0, 5.0)
    rate = np.hypot(0.5, 0.2)
    assert path.length == pytest.approx(5.0 * rate, abs=1e-12)
    s = np.linspace(0.0, path.length, 999)
    np.testing.assert_allclose(
        path.at(s), np.transpose(circle(s / rate)), atol=1e-7
    )  # the accuracy of pieces
    np.testing.assert_allclose(np.linalg.norm(path.derivative(s), axis=1), 1.0, atol=1e-5)
    np.testing.assert_allclose(path.curvature(s), 0.5 / rate**2, atol=1e-4)
    np.testing.assert_allclose(path.tangent(s)[:, 2], 0.2 / rate, atol=1e-6)


@pytest.mark.parametrize("order", [0, 1, 2])
def test_place_tangent_and_curvature_are_continuous(order):
    path = Path.polyline([[0, 0, 0], [1, 0, 0], [1, 1, 0.5]], blend=0.02)
    knots = path.pieces.knots[1:-1]
    jump = path.derivative(knots + 1e-10, order) - path.derivative(knots - 1e-10, order)
    # the third derivative of a rounding of this size is about its curvature over its length, 4e3
    assert np.abs(jump).max() < 1e-6


def test_a_spline_goes_through_its_points_with_order_four():
    errors = []
    for count in (9, 17, 33):
        u = np.linspace(0.0, 2.0, count)
        ends: Any = dict(
            start_direction=[0, 0.5, 0.2], end_direction=[-0.5 * np.sin(2), 0.5 * np.cos(2), 0.2]
        )
        path = Path.through(np.transpose(circle(u)), **ends)
        s = np.linspace(0.0, path.length, 2001)
        # a helix is met at the height that its place has
        found = path.at(s)
        errors.append(np.abs(found - np.transpose(circle(found[:, 2] / 0.2))).max())
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    np.testing.assert_allclose(orders, 4.0, atol=0.2)


def test_a_spline_meets_its_points_and_directions():
    path = Path.through(ARC, start_direction=[0, 0, 3.0])
    s = np.linspace(0.0, path.length, 20001)
    for point in ARC:
        assert np.linalg.norm(path.at(s) - point, axis=1).min() < 1e-4  # half the distance of the samples
    np.testing.assert_allclose(path.tangent([0.0])[0], [0, 0, 1], atol=1e-12)
    assert path.curvature([path.length])[0] == pytest.approx(0.0, abs=1e-9)  # a natural end


def test_a_closed_spline_of_a_circle_is_round_everywhere():
    u = np.linspace(0.0, 2 * np.pi, 25)
    points = np.column_stack([np.cos(u), np.sin(u)])
    points[-1] = points[0]
    path, again = Path.through(points, closed=True), Path.through(points[:-1], closed=True)
    assert path.dimension == 2
    assert path.length == pytest.approx(2 * np.pi, abs=1e-4)
    assert again.length == path.length
    np.testing.assert_allclose(path.curvature(np.linspace(0, path.length, 99)), 1.0, atol=0.02)
    np.testing.assert_allclose(path.derivative([0.0], 1), path.derivative([path.length], 1), atol=1e-9)


@pytest.mark.parametrize(
    "make", [Path.through, Path.polyline, lambda p: Path.of(lambda u: p[0] + u * (p[-1] - p[0]))]
)
def test_what_is_straight_is_a_straight_line(make):
    path = make(START + np.linspace(0, 1, 5)[:, None] * (END - START))
    line = Path.line(START, END)
    assert path.length == pytest.approx(line.length, abs=1e-12)
    s = np.linspace(0, line.length, 50)
    np.testing.assert_allclose(path.at(s), line.at(s), atol=1e-12)
    np.testing.assert_allclose(path.curvature(s), 0.0, atol=1e-9)


def test_a_mirrored_path_is_the_mirror_image():
    mirror = np.array([1.0, -1.0, 1.0])
    path, image = Path.through(ARC), Path.through(np.array(ARC) * mirror)
    s = np.linspace(0, path.length, 100)
    np.testing.assert_allclose(image.at(s), path.at(s) * mirror, atol=1e-13)


def test_called_with_a_number_an_array_and_a_symbol():
    path = Path.through(ARC)
    s = ca.SX.sym("s")
    first = ca.jacobian(path(s), s)
    exact = ca.Function("path", [s], [path(s), first, ca.jacobian(first, s)])
    places = np.linspace(0.0, path.length, 200)
    assert path(0.3).shape == (3,)
    assert path(places).shape == path.at(places).shape == (200, 3)
    for order, found in enumerate(exact.map(200)(places[None, :])):
        np.testing.assert_allclose(np.array(found).T, path.derivative(places, order), atol=1e-10)


@pytest.mark.parametrize("path", [Path.through(ARC), Path.line(START, END)])
def test_beyond_its_ends_a_symbolic_path_goes_on_straight(path):
    s = ca.SX.sym("s")
    evaluate = ca.Function("path", [s], [path(s), ca.jacobian(path(s), s)])
    for end, sign in ((0.0, -1), (path.length, 1)):
        near, slope = (np.array(found).ravel() for found in evaluate(end + sign * 0.05 * path.length))
        far, same = (np.array(found).ravel() for found in evaluate(end + sign * 5.05 * path.length))
        np.testing.assert_allclose(far, near + sign * 5.0 * path.length * slope, atol=1e-10)
        np.testing.assert_allclose(slope, same, atol=1e-12)
        assert np.linalg.norm(near - path(end)) == pytest.approx(0.05 * path.length, rel=0.02)


def test_a_corner_is_rounded_to_the_distance_asked_for():
    path = Path.polyline([[0, 0, 0], [1, 0, 0], [1.5, 0, 0], [1.5, 1, 0], [1.5, 1, 2]], blend=0.01)
    assert [corner.row for corner in path.corners] == [2, 3]  # points[1] is on the way
    s = np.linspace(0, path.length, 40001)
    for corner in path.corners:
        assert corner.angle == pytest.approx(np.pi / 2)
        gaps = np.linalg.norm(path.at(s) - corner.point, axis=1)
        assert gaps.min() == pytest.approx(0.01, abs=1e-6)  # samples are 0.1 mm apart
        assert corner.distance == pytest.approx(0.01, abs=1e-9)
        assert s[gaps.argmin()] == pytest.approx(corner.s, abs=2e-4)
    assert "2 corners rounded" in repr(path)


def test_short_lines_are_rounded_closer():
    path = Path.polyline([[0, 0], [1, 0], [1, 0.02], [2, 0.02]], blend=0.05)
    assert 0.0 < max(corner.distance for corner in path.corners) < 0.01
    assert path.pieces.knots[-1] < 2.02


def test_arcs_that_meet_in_a_corner_are_rounded_too():
    u = np.linspace(0, 1, 12)
    arcs = np.vstack([np.transpose(circle(u)), np.transpose(circle(u[::-1]))[1:] + u[1:, None] * [0, 0, 0.5]])
    path = Path.through(arcs, blend=0.005)
    assert [corner.row for corner in path.corners] == [11]
    assert path.corners[0].distance == pytest.approx(0.005, abs=1e-9)
    assert np.linalg.norm(
        path.at(np.linspace(0, path.length, 9999)) - arcs[11], axis=1
    ).min() == pytest.approx(0.005, abs=1e-6)


NOISE = 3e-4  # m


def recording(seed=3, count=3000):
    """A way led by hand: the truth (n, 3) with a pause in it and at both ends, and what was recorded."""
    t = np.linspace(-0.1, 1.3, count)
    u = np.clip(np.where(t < 0.4, t, np.where(t < 0.6, 0.4, t - 0.2)), 0.0, 1.0)
    truth = np.column_stack([1.5 * u, 0.3 * np.sin(4 * u), 0.2 * np.cos(3 * u)])
    return truth, truth + np.random.default_rng(seed).normal(0.0, NOISE, truth.shape)


def deviation(path) -> Deviation:
    """Of a recording from its path."""
    assert path.deviation is not None
    return path.deviation


def furthest(path, truth):
    """Largest distance in m of true places from a path."""
    samples = path.at(np.linspace(0, path.length, 20001))
    return max(np.linalg.norm(samples - place, axis=1).min() for place in truth[::20])


def test_a_noisy_recording_with_pauses_is_smoothed_to_the_truth():
    truth, recorded = recording()
    path = Path.recorded(recorded)
    # across the path two of three coordinates of the noise are left
    assert deviation(path).rms == pytest.approx(NOISE * np.sqrt(2), rel=0.05)
    assert deviation(path).noise == pytest.approx(NOISE, rel=0.1)
    assert deviation(path).largest < 6 * NOISE  # of 3000 points
    inner = (truth[:, 0] > 0.02) & (truth[:, 0] < 1.48)
    assert furthest(path, truth[inner]) < NOISE
    length = np.sum(np.linalg.norm(np.diff(truth, axis=0), axis=1))
    assert path.length == pytest.approx(length, abs=10 * NOISE)  # the noise added up is 1.3 m


def test_a_tolerance_is_kept_with_fewer_pieces():
    _, recorded = recording()
    fine, coarse = (Path.recorded(recorded, tolerance=tolerance) for tolerance in (0.002, 0.01))
    assert deviation(fine).largest <= 0.002
    assert deviation(coarse).largest <= 0.01
    assert len(coarse.pieces.coefficients) < len(fine.pieces.coefficients) <= 40
    away = np.linalg.norm(
        recorded[deviation(coarse).row] - coarse.at(np.linspace(0, coarse.length, 20001)), axis=1
    )
    assert away.min() == pytest.approx(deviation(coarse).largest, abs=1e-6)
    assert "m from its recording" in repr(coarse)


def test_a_recording_that_repeats_its_points_and_has_no_noise():
    truth, _ = recording(count=600)
    path = Path.recorded(np.repeat(truth, 3, axis=0))
    assert deviation(path).largest < 1e-5
    assert path.corners == ()


def test_a_point_that_is_far_off_is_not_followed():
    _, recorded = recording()
    stray = recorded.copy()
    stray[1200] += [0.0, 0.2, 0.0]
    path = Path.recorded(stray)
    assert deviation(path).left_out == (1200,)
    assert path.length == pytest.approx(Path.recorded(recorded).length, abs=NOISE)
    assert deviation(path).largest < 6 * NOISE


def test_a_long_recording_and_one_that_starts_slowly_are_not_drawn_with_their_noise():
    u = np.linspace(0.0, 1.0, 12000)[:, None] ** 4
    way = np.hstack([np.cos(2 * u), np.sin(2 * u), 0.3 * u])
    path = Path.recorded(way + np.random.default_rng(8).normal(0.0, NOISE, way.shape))
    assert path.length == pytest.approx(np.hypot(2.0, 0.3), abs=10 * NOISE)
    # 4 / (4 + 0.09): a spline that follows the noise bends a thousand times as much
    assert np.abs(path.curvature(np.linspace(0.0, path.length, 2000)) - 0.978).max() < 0.3


def test_a_corner_in_a_recording_is_listed():
    u = np.linspace(0, 1, 1500)
    way = np.vstack([np.column_stack([u, 0 * u, 0 * u]), np.column_stack([0 * u + 1, u, 0 * u])])
    path = Path.recorded(way + np.random.default_rng(5).normal(0.0, NOISE, way.shape))
    (corner,) = path.corners
    np.testing.assert_allclose(corner.point, [1, 0, 0], atol=0.02)
    assert corner.angle == pytest.approx(np.pi / 2, abs=0.3)
    assert corner.distance < 0.005


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Path.through([[0, 0, 0], [1, np.nan, 0]]), "Path.through: found points[1, 1] = nan"),
        (lambda: Path.through([[0, 0, 0]]), "found 1 points, expected at least 2"),
        (lambda: Path.line([1, 2, 3], [1, 2, 3]), "Path.line: points[1] repeats points[0] = (1, 2, 3) m"),
        (lambda: Path.through(np.ones((3, 7))), "found points of 3 x 7, expected n x 3 numbers or n x 2"),
        (lambda: Path.through("here"), "points"),
        (lambda: Path.through([[0, 0], [1, 0], [1, 0], [2, 0]]), "points[2] repeats points[1] = (1, 0) m"),
        (lambda: Path.recorded(np.random.default_rng(0).normal(size=(5, 3))), "found 5 points, expected at"),
        (lambda: Path.recorded(np.ones((50, 3))), "all 50 points are the same, expected a way"),
        (lambda: Path.recorded(recording()[1], tolerance=-1.0), "found tolerance=-1.0"),
        (lambda: Path.recorded(recording()[1], tolerance=1e-4), "tolerance=0.0001 m is too small for this"),
        (lambda: Path.polyline([[0, 0, 0], [1, 0, 0], [1, 1, 0], [2, 2, 0]]), "Path.polyline: at points[1]"),
        (lambda: Path.through([[0, 0], [1, 0], [2, 0], [2, 1], [2, 2]]), "Path.through: at points[2] = (2"),
        (lambda: Path.through([[0, 0], [1, 0], [1, 1]], blend=0.0), "found blend=0.0"),
        (lambda: Path.polyline([[0, 0], [1, 0], [0, 0]], blend=0.01), "points[1] = (1, 0) m turns back by"),
        (lambda: Path.through([[0, 0], [1, 0], [0, 0]], closed=True), "found 2 different points of a"),
        (lambda: Path.through([[0, 0], [1, 0], [0, 1]], closed=True), "round its corners with blend=0.01"),
        (lambda: Path.through([[0, 0], [1, 0], [0, 1]], closed=True, blend=0.1), "found blend=0.1"),
        (lambda: Path.through([[0, 0], [1, 0]], end_direction=[0, 0]), "found end_direction=[0, 0]"),
        (lambda: Path.through([[0, 0], [1, 0]], end_direction="up"), "found end_direction='up'"),
        (lambda: Path.of(lambda u: (u, u, u, u)), "found 4 coordinates, expected two or three"),
        (lambda: Path.of(lambda u: (ca.fabs(u), u), -0.5, 1.0), "found a corner, a jump or a cusp"),
        (lambda: Path.of(lambda u: (ca.log(u), u)), "the place or a derivative is not finite, or the curve"),
        (lambda: Path.of(lambda u: (u, 1.0), 1.0, 0.0), "found stop=0.0, expected a number above 1"),
        (lambda: Path.of(lambda u: "circle"), "expected a function of one symbol that returns coordinates"),
        (lambda: Path.line(START, END).at(2.2), "found s = 2.2 m, expected 0 to 2.11048 m, the length of"),
        (lambda: Path.line(START, END)(np.array([0.1, np.nan])), "found s = nan m, expected 0 to"),
        (lambda: Path.line(START, END).at([[0.1]]), "found s of 1 x 1"),
        (lambda: Path.line(START, END)(ca.SX.sym("s", 2)), "found a symbol of shape (2, 1), expected one"),
        (lambda: Path.line(START, END)(ca.MX.sym("s")), "found MX, expected a number, an array (k,) or a"),
        (lambda: Way(Path.line([0, 0], [1, 0])), "expected a Path in space"),
    ],
)
def test_what_is_no_path_is_refused(make, words):
    with pytest.raises(ModelError) as caught:
        make()
    assert words in str(caught.value)


def test_a_figure_of_a_path(tmp_path):
    Path.polyline([[0, 0, 0], [1, 0, 0], [1, 1, 0]], blend=0.05).plot(file=tmp_path / "space.png")
    Path.polyline([[0, 0], [1, 0], [1, 1]], blend=0.05).plot(file=tmp_path / "plane.png")
    assert min((tmp_path / f"{name}.png").stat().st_size for name in ("space", "plane")) > 5000
