"""Devices: what they see, how large their errors are, and which of them do not average out."""

from dataclasses import replace
from functools import partial
from typing import Literal

import numpy as np
import pytest
from scipy.optimize import least_squares

from gantrytau import ModelError
from gantrytau.kinematics.rotations import turned
from gantrytau.kinematics.workspace.obstacles import Capsule
from gantrytau_optimica.calibration.devices.cameras import (
    Cameras,
    PlacedCamera,
    single_camera,
    stereo_cameras,
)
from gantrytau_optimica.calibration.devices.devices import LaserTracker, TMac
from gantrytau_optimica.calibration.devices.gauges import LengthGauge
from gantrytau_optimica.calibration.devices.sight import Bars

FRAMES: tuple[Literal["world", "device"], ...] = ("world", "device")
MANY = 4000  # standard deviations from so many readings are right within 1.1 %
UPRIGHT = np.eye(3)
TO_CAMERA = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])  # the z axis of the tool along -x


def ball(centre, radius: float) -> Capsule:
    return Capsule(centre, centre, radius)


def cube(count: int, half: float, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-half, half, (count, 3))


def turn(vector) -> np.ndarray:
    return turned(np.eye(3)[None], np.array([vector], dtype=float))[0]


def vectors(R: np.ndarray, nominal: np.ndarray) -> np.ndarray:
    """Rotation vectors of small turns from nominal to R, to first order."""
    D = R @ np.swapaxes(nominal, -1, -2)
    return np.stack([D[:, 2, 1] - D[:, 1, 2], D[:, 0, 2] - D[:, 2, 0], D[:, 1, 0] - D[:, 0, 1]], axis=1) / 2


def squared_distance(errors: np.ndarray, covariance: np.ndarray) -> float:
    """Mean of e.T C^-1 e, which is the number of columns if the covariance is right."""
    return float(
        np.mean(np.einsum("ni,ni->n", errors, np.linalg.solve(covariance, errors[..., None])[..., 0]))
    )


# laser tracker


@pytest.mark.parametrize("distance", [1.0, 5.0, 20.0])
def test_noise_of_a_tracker_along_and_across_the_beam(distance):
    tracker = LaserTracker(r=[1.0, 2.0, 0.5], R=turn([0.1, -0.2, 2.0]))
    beam = tracker.R @ [0.6, 0.64, 0.48]  # of length one
    r = np.tile(tracker.r + distance * beam, (MANY, 1))
    error = tracker.measure(r, seed=3).r - r
    along = error @ beam
    across = np.sqrt(np.sum((error - along[:, None] * beam) ** 2, axis=1).mean() / 2)
    assert along.std() == pytest.approx(5e-6 + 0.15e-6 * distance, rel=0.05)
    assert across == pytest.approx(7.5e-6 + 3e-6 * distance, rel=0.05)
    assert squared_distance(error, tracker.covariance(r)) == pytest.approx(3.0, rel=0.06)


def test_readings_of_a_tracker_are_range_azimuth_and_elevation():
    exact = LaserTracker(
        range_noise=0.0, range_noise_per_metre=0.0, transverse_noise=0.0, transverse_noise_per_metre=0.0
    )
    read = exact.measure([[1.0, 1.0, np.sqrt(2.0) * 0.5]])
    assert read.readings[0] == pytest.approx([np.sqrt(2.5), np.pi / 4, np.arctan(0.5)], abs=1e-12)
    assert read.r[0] == pytest.approx([1.0, 1.0, np.sqrt(0.5)], abs=1e-12)
    assert read.names[0] == "range [m]"


def test_the_frame_of_the_device_and_that_of_the_world():
    tracker = LaserTracker(r=[1.0, 2.0, 0.0], R=turn([0.0, 0.0, 0.3]))
    world, device = (tracker.measure(cube(5, 0.5), frame=f, seed=4).r for f in FRAMES)
    assert world == pytest.approx(device @ tracker.R.T + tracker.r, abs=1e-12)


def test_the_same_seed_gives_the_same_noise():
    tracker, r = LaserTracker(r=[3.0, 0.0, 0.0]), cube(5, 0.5)
    first, second, other = (tracker.measure(r, seed=s).r for s in (1, 1, 2))
    assert np.array_equal(first, second)
    assert not np.any(first == other)


def test_a_scale_does_not_average_out_and_noise_does():
    tracker, r = LaserTracker(r=[-4.0, 0.0, 0.0], scale=1e-5), np.zeros((MANY, 3))
    error = (tracker.measure(r).r - r).mean(axis=0)
    # five standard deviations of the mean
    assert error[0] == pytest.approx(4e-5, abs=5 * 5.6e-6 / np.sqrt(MANY))
    assert np.abs(error[1:]).max() < 5 * 19.5e-6 / np.sqrt(MANY)


def test_range_elevation_and_reflector_limit_what_a_tracker_sees():
    tracker = LaserTracker(facing=[-1.0, 0.0, 0.0])
    r = [[3.0, 0, 0], [0.2, 0, 0], [40.0, 0, 0], [3.0, 0, 3.2], [3.0, 2.0, 0]]
    assert tracker.sees(r, UPRIGHT).tolist() == [True, False, False, False, False]
    assert tracker.sees(r[4], turn([0.0, 0.0, np.arctan2(2.0, 3.0)]))
    lost = tracker.measure(r, UPRIGHT)
    assert np.isnan(lost.r).all(axis=1).tolist() == [False, True, True, True, True]
    assert np.array_equal(lost.seen, ~np.isnan(lost.readings[:, 0]))


def test_a_ball_hides_its_shadow():
    tracker = LaserTracker(obstacles=[ball([2.0, 0.0, 0.0], 0.2)])
    y = np.linspace(-1.0, 1.0, 401)
    r = np.column_stack([np.full(401, 4.0), y, np.zeros(401)])
    shadow = np.abs(np.arctan2(y, 4.0)) <= np.arcsin(0.1)
    edge = np.abs(np.abs(np.arctan2(y, 4.0)) - np.arcsin(0.1)) < 1e-3
    assert np.array_equal(~tracker.sees(r)[~edge], shadow[~edge])
    assert tracker.sees(r / 4 * 1.7).all()  # in front of it
    assert not tracker.sees([2.1, 0.0, 0.0])  # inside


def test_bars_hide_what_is_behind_them_and_not_what_they_carry():
    r = np.array([[4.0, 0.0, 0.0], [4.0, 0.0, 1.0]])
    across = Bars([[[2.0, -1.0, 0.0]], [[2.0, -1.0, 0.0]]], [[[2.0, 1.0, 0.0]], [[2.0, 1.0, 0.0]]], 0.03)
    assert LaserTracker().sees(r, bars=across).tolist() == [False, True]
    carried = Bars(r[:, None], r[:, None] + [1.0, 0.5, 0.0], 0.03)
    assert LaserTracker().sees(r, bars=carried).all()


# T-Mac


def test_errors_of_orientation_act_on_the_lever_arm():
    device = TMac(r=[-3.0, 0.0, 0.0], target=[0.0, 0.0, 0.3])
    r, R = np.zeros((MANY, 3)), np.broadcast_to(turn([0.3, 0.2, 0.1]), (MANY, 3, 3))
    read = device.measure(r, R)
    turns = vectors(read.R, R)
    assert turns.std(axis=0) == pytest.approx(np.full(3, np.radians(0.005)), rel=0.05)
    errors = np.hstack([read.r - r, turns])
    assert squared_distance(errors, device.covariance(r, R)) == pytest.approx(6.0, rel=0.05)
    whole = np.cov(errors.T) / np.sqrt(np.outer(*[np.diag(device.covariance(r[:1], R[:1])[0])] * 2))
    expected = device.covariance(r[:1], R[:1])[0]
    assert whole == pytest.approx(expected / np.sqrt(np.outer(*[np.diag(expected)] * 2)), abs=0.08)


def test_a_tmac_needs_more_distance_than_a_reflector():
    assert LaserTracker().sees([1.0, 0.0, 0.0])
    assert not TMac().sees([1.0, 0.0, 0.0])


# cameras


def test_a_pinhole_projects_by_similar_triangles():
    camera = PlacedCamera(np.zeros(3), UPRIGHT, focal=1000.0, size=(801, 601))
    assert camera.project([[0.1, 0.2, 2.0]])[0] == pytest.approx([450.0, 400.0])
    assert np.isnan(camera.project([[0.1, 0.2, -2.0]])).all()
    assert camera.inside(np.array([[0.0, 0.0], [801.0, 10.0]])).tolist() == [True, False]


def test_slopes_of_images_against_differences():
    lens = (-0.2, 0.1, 2e-3, -3e-3, 0.05)
    camera = PlacedCamera.looking([-2.0, 0.3, 0.4], [0.0, 0.0, 0.0], distortion=lens)
    points, step = cube(50, 0.4), 1e-6
    _, slopes = camera.slopes(points)
    for k in range(3):
        shift = step * np.eye(3)[k]
        difference = (camera.project(points + shift) - camera.project(points - shift)) / (2 * step)
        # pixel/m, of 900; rounding 1e-12 / 1e-6 * 1e3
        assert slopes[..., k] == pytest.approx(difference, abs=1e-4)


def test_a_camera_looks_where_it_is_told_with_up_in_the_image_up():
    camera = PlacedCamera.looking([-2.0, 0.0, 0.0], [0.0, 0.5, 0.3])
    middle, above = camera.project([[0.0, 0.5, 0.3], [0.0, 0.5, 0.4]])
    assert middle == pytest.approx(camera.centre)
    assert above[1] < middle[1]
    assert above[0] == pytest.approx(middle[0])


@pytest.mark.parametrize(
    "device", [single_camera([-2.5, 0, 0], [0, 0, 0]), stereo_cameras([-2.5, 0, 0], [0, 0, 0])]
)
def test_noise_of_poses_is_that_of_their_covariance(device):
    known = replace(device, believed=device.cameras, noise=0.02)
    r, R = cube(1000, 0.4), np.broadcast_to(TO_CAMERA @ turn([0.2, 0.1, 0.3]), (1000, 3, 3))
    read = known.measure(r, R)
    errors = np.hstack([read.r - r, vectors(read.R, R)])
    assert squared_distance(errors, known.covariance(r, R)) == pytest.approx(6.0, rel=0.08)


def test_two_cameras_know_the_depth_better_than_one():
    one, two = single_camera([-2.5, 0, 0], [0, 0, 0]), stereo_cameras([-2.5, 0, 0], [0, 0, 0])
    deep = [np.sqrt(d.covariance([[0.0, 0, 0]], TO_CAMERA)[0, 0, 0]) for d in (one, two)]
    assert deep[1] < deep[0] / 5


def test_cameras_may_look_straight_down():
    device = stereo_cameras([0, 0, 3.0], [0, 0, 0], up=[0, 1.0, 0], lens_error=0.0, noise=0.0)
    seen = device.measure(np.array([[0.1, 0.2, 0.0]]), np.eye(3)[None])
    np.testing.assert_allclose(seen.r, [[0.1, 0.2, 0.0]], atol=1e-9)
    np.testing.assert_allclose(device.cameras[1].r - device.cameras[0].r, [0.8, 0, 0], atol=1e-15)


def test_stereo_errs_as_much_as_in_the_thesis_and_measuring_again_does_not_help():
    """Section 5.5: 1.7 mm against a laser tracker."""
    device = stereo_cameras([-2.5, 0, 0], [0, 0, 0])
    r = cube(600, 0.5)
    rounds = np.array([device.measure(r, TO_CAMERA, seed=s).r - r for s in range(9)])
    once = np.nanmean(np.linalg.norm(rounds, axis=2))
    averaged = np.nanmean(np.linalg.norm(rounds.mean(axis=0), axis=1))
    assert once == pytest.approx(1.7e-3, rel=0.1)
    assert averaged > 0.95 * once
    noise = replace(device, believed=device.cameras)
    rounds = np.array([noise.measure(r, TO_CAMERA, seed=s).r - r for s in range(9)])
    ratio = np.nanmean(np.linalg.norm(rounds.mean(axis=0), axis=1)) / np.nanmean(
        np.linalg.norm(rounds, axis=2)
    )
    assert ratio == pytest.approx(1 / 3, rel=0.12)  # one over the root of nine; 600 poses leave 3 to 4 %


def test_a_camera_that_stands_elsewhere_shifts_all_poses():
    true = stereo_cameras([-2.5, 0, 0], [0, 0, 0], lens_error=0.0, noise=0.0).cameras
    moved = [replace(c, r=np.add(c.r, [0.0, 0.01, 0.0])) for c in true]
    read = Cameras(cameras=moved, believed=true, noise=0.0).measure(cube(20, 0.3), TO_CAMERA)
    assert read.r - cube(20, 0.3) == pytest.approx(np.tile([0.0, -0.01, 0.0], (20, 1)), abs=1e-9)
    assert read.R == pytest.approx(np.broadcast_to(TO_CAMERA, (20, 3, 3)), abs=1e-9)


def test_what_cameras_see():
    device = stereo_cameras([-2.5, 0, 0], [0, 0, 0])
    r = [[0.0, 0, 0], [0.0, 1.5, 0], [-4.0, 0, 0], [7.5, 0, 0]]  # beside, behind, too far
    assert device.sees(r, TO_CAMERA).tolist() == [True, False, False, False]
    assert not device.sees([0.0, 0, 0], TO_CAMERA @ turn([0, np.radians(70.0), 0]))
    hidden = replace(device, obstacles=[ball(np.add(device.cameras[1].r, [0.4, 0, 0]), 0.3)])
    assert not hidden.sees([0.0, 0, 0], TO_CAMERA)  # one of the two eyes is covered
    assert device.measure(r, TO_CAMERA).seen.tolist() == [True, False, False, False]


def test_a_lens_does_not_fold_the_world_back_into_its_image():
    """Beyond the largest radius of its polynomial, x - 0.3 x3 at x = 1.05, the image would come back to the middle."""
    camera = PlacedCamera(np.zeros(3), UPRIGHT, distortion=(-0.3, 0.0, 0.0, 0.0, 0.0))
    assert camera.border == pytest.approx(1 / 0.9)
    x = np.linspace(0.0, 3.0, 301)
    image = camera.project(np.column_stack([x, 0 * x, 0 * x + 1.0]))
    assert np.isnan(image[:, 0]).tolist() == (x > np.sqrt(1 / 0.9)).tolist()
    assert np.all(np.diff(image[: int(np.sum(x < 1.05)), 0]) > 0)
    assert PlacedCamera(np.zeros(3), UPRIGHT).border == np.inf
    device = replace(single_camera([-2.5, 0, 0], [0, 0, 0]), facing=None)
    beside = np.column_stack([np.full(400, -1.5), np.linspace(1.0, 10.0, 400), np.zeros(400)])
    assert not device.sees(beside, TO_CAMERA).any()  # 45 deg and more off the axis of a lens of 24


@pytest.mark.parametrize("noise", [0.1, 2.0])
@pytest.mark.parametrize("base", [0.0, 0.8])
def test_poses_are_those_that_fit_the_images_best(noise, base):
    """Against least squares with differences, of scipy, from the true pose."""
    device = replace(stereo_cameras([-2.5, 0, 0], [0, 0, 0], base=base), noise=noise)
    r, R = cube(12, 0.4), TO_CAMERA @ turn([0.2, 0.3, 0.3])
    read = device.measure(r, R, seed=1)
    for k in np.flatnonzero(read.seen):

        def missed(v, r=r[k], images=read.readings[k]):
            points = r + v[:3] + device.pattern @ (R @ turn(v[3:])).T
            return np.concatenate([c.project(points) for c in device.believed]).reshape(-1) - images

        best = least_squares(missed, np.zeros(6), x_scale=1e-3, xtol=1e-14, ftol=1e-14, gtol=1e-14)
        spread = np.sqrt(np.diag(device.covariance(r[k], R)[0])[:3].sum())
        assert np.linalg.norm(r[k] + best.x[:3] - read.r[k]) < 0.01 * spread  # of its noise


def test_no_poses_give_no_readings():
    for device in (LaserTracker(), TMac(), stereo_cameras([-2.5, 0, 0], [0, 0, 0])):
        read = device.measure(np.zeros((0, 3)))
        assert read.r.shape == (0, 3)
        assert len(read.readings) == 0


# gauges


def test_a_gauge_reads_how_far_a_face_is_pushed():
    gauge = LengthGauge(r=[0.0, 0.0, 0.0], noise=0.0, face=[1.0, 0.0, 0.0])
    assert gauge.measure([0.01, 0.0, 0.0]).readings[0, 0] == pytest.approx(0.01)
    tilted = turn([0.0, 0.0, 0.1])
    # the plane through (0.01, 0.005) with normal (cos, sin) meets the axis at 0.01 + 0.005 tan
    reading = gauge.measure([0.01, 0.005, 0.0], tilted).readings[0, 0]
    assert reading == pytest.approx(0.01 + 0.005 * np.tan(0.1), abs=1e-12)
    assert gauge.sees([[0.01, 0, 0], [-0.01, 0, 0], [0.04, 0, 0], [0.01, 0.03, 0]]).tolist() == [
        True,
        *[False] * 3,
    ]
    assert gauge.measure([0.01, 0.0, 0.0]).r is None


# arguments

ONE = {"cameras": [PlacedCamera(np.zeros(3), np.eye(3))]}


@pytest.mark.parametrize(
    ("make", "argument", "wrong"),
    [
        (LaserTracker, "r", [0.0, 1.0]),
        (LaserTracker, "R", 2 * np.eye(3)),
        (LaserTracker, "facing", [0, 0, 0]),
        (LaserTracker, "range_noise", -1e-6),
        (LaserTracker, "farthest", 0.1),
        (LaserTracker, "elevation", (1.0, 0.5)),
        (LaserTracker, "obstacles", ball([0, 0, 0], 1.0)),
        (LengthGauge, "face", [0, 0, 0]),
        (LengthGauge, "stroke", (0.1, 0.0)),
        (partial(PlacedCamera, np.zeros(3), np.eye(3)), "size", 3),
        (partial(PlacedCamera, np.zeros(3), np.eye(3)), "focal", -5.0),
        (partial(PlacedCamera, np.zeros(3), np.eye(3)), "distortion", [0.1]),
        (partial(PlacedCamera.looking, np.zeros(3), [1, 0, 0]), "up", [1, 0, 0]),
        (Cameras, "cameras", [1]),
        (partial(Cameras, **ONE), "pattern", np.eye(3)),
        (partial(Cameras, **ONE), "pattern", np.outer(range(4), [1, 0, 0])),
        (partial(Bars, np.zeros((2, 3)), np.ones((2, 3))), "radius", 0.0),
        (partial(LaserTracker().measure, np.zeros((2, 3))), "frame", "robot"),
        (partial(LaserTracker().sees, [0, 0, 1.0]), "bars", [1]),
    ],
)
def test_a_wrong_argument_is_refused_by_its_name(make, argument, wrong):
    with pytest.raises(ModelError) as refusal:
        make(**{argument: wrong})
    assert refusal.value.argument == argument


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: LaserTracker().measure([0.0, 1.0]),
        lambda: Bars(np.zeros((2, 3)), np.zeros((3, 3)), 0.1),
        lambda: Bars(np.zeros((2, 1, 3)), np.ones((2, 1, 3)), 0.1).hide(np.zeros(3), np.ones((3, 3))),
        lambda: Cameras(cameras=[]),
    ],
)
def test_arrays_that_do_not_belong_together_are_refused(wrong):
    with pytest.raises(ModelError, match="expected"):
        wrong()


def test_a_tracker_without_a_farthest_distance_sees_everything():
    assert LaserTracker([0, 0, 0], farthest=np.inf).measure([[0.0, 1e4, 0.0]]).seen.all()
