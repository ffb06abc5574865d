"""Poses from corners in images, against the truth: thesis section 5.5, and what one camera tells."""

import numpy as np
import pytest

from gantrytau.kinematics.rotations import about
from gantrytau_models import SixLinkGantryTau, prototypes
from gantrytau_optimica import calibrate
from gantrytau_optimica.vision import Camera, Pattern, compare, detect, reconstruct
from gantrytau_optimica.vision.scenes.scene import AHEAD
from tests.optimica.vision.camera_rig import LENS, SIDE, TYPICAL, lines, pair, scene, seen, views

BOTH = [LENS, LENS]


def lens(factor=1.0, k1=0.0):
    return Camera([[1290 * factor, 0, 511.5], [0, 1290 * factor, 383.5], [0, 0, 1]], [k1, 0, 0, 0, 0])


def missed(found, r):
    return compare(found.r, r)


def test_without_noise_places_cameras_and_lenses_are_the_true_ones():
    r, q = lines(1, count=6)
    rig = pair(TYPICAL)
    found = reconstruct(seen(r, rig, noise=0.0), BOTH, spacing=q, intrinsics="estimate")
    assert missed(found, r).distances.max() < 2e-5  # what is given of the lenses pulls a little
    assert found.rms < 1e-3
    assert found.cameras[0].focal == pytest.approx([1296, 1296], rel=1e-4)
    assert found.cameras[1].centre == pytest.approx([518, 377], abs=0.1)
    assert np.linalg.norm(found.cameras[1].r) == pytest.approx(1.2, abs=1e-4)
    turn = rig[0].R.T @ rig[1].R
    assert found.cameras[1].R == pytest.approx(turn, abs=1e-4)


@pytest.mark.parametrize("seed", [0, 1])
def test_a_rig_that_is_known_gives_tenths_of_a_millimetre_and_says_so(seed):
    r, q = lines(seed)
    found = reconstruct(seen(r, pair(), seed=seed), BOTH, spacing=q)
    error = missed(found, r)
    assert error.mean < 0.15e-3
    rms = np.sqrt(np.mean(error.distances**2))
    assert found.expected / 1.5 < rms < 1.5 * found.expected
    # errors have the covariance that is told: as many as degrees of freedom, in sum
    turned = compare(found.r, r).R
    squares = [
        e @ np.linalg.solve(turned @ C @ turned.T, e)
        for e, C in zip(error.error, found.covariance, strict=True)
    ]
    assert 0.6 < np.mean(squares) / 3 < 1.5


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_typical_lens_is_found_with_plate_and_spacing_and_as_well_as_from_the_truth(seed):
    r, q = lines(seed)
    images = seen(r, pair(TYPICAL), seed=seed)
    found = reconstruct(images, BOTH, spacing=q, intrinsics="estimate")
    best = reconstruct(images, [TYPICAL, TYPICAL], spacing=q, intrinsics="estimate")
    error = missed(found, r)
    assert error.mean < 0.25e-3
    assert error.mean < 1.3 * missed(best, r).mean
    assert 1 / 1.5 < np.sqrt(np.mean(error.distances**2)) / found.expected < 1.5


def test_an_unknown_distortion_gives_the_error_of_the_thesis():
    """Table 5.6: 1.7 mm, smallest in depth, larger at the border; a scale from the laser gains little."""
    means, gains, depth, border = [], [], [], []
    for seed in range(5):
        r, q = lines(seed)
        found = reconstruct(seen(r, pair(lens(k1=-0.017)), seed=seed), BOTH, spacing=q, corners="free")
        error, scaled = missed(found, r), compare(found.r, r, scale=True)
        means.append(error.mean)
        gains.append(1 - scaled.mean / error.mean)
        depth.append(error.axes[0] / np.mean(error.axes[1:]))
        border.append(error.border_ratio)
    assert 1.5e-3 < np.median(means) < 1.9e-3
    assert 0.9e-3 < min(means) < max(means) < 2.2e-3
    assert 0.1 < np.median(gains) < 0.25
    assert np.median(depth) < 0.6
    assert np.median(border) < 1


def test_focal_errors_of_opposite_signs_show_in_depth_and_of_one_sign_beside():
    alike, opposite = [], []
    for seed in range(3):
        r, q = lines(seed, width=1.6, height=1.2)
        rigs = (pair(lens(1.0034)), [pair(lens(1.005))[0], pair(lens(0.995))[1]])
        for rig, kept in zip(rigs, (alike, opposite), strict=True):
            found = reconstruct(seen(r, rig, seed=seed), BOTH, spacing=q, corners="free")
            error = missed(found, r)
            kept.append([error.mean, *error.axes])
    mean, x, y, z = np.median(alike, axis=0)
    assert 1.4e-3 < mean < 1.9e-3
    assert x < 0.6 * (y + z) / 2
    _, x, y, z = np.median(opposite, axis=0)
    assert x > 2 * (y + z) / 2


def test_a_plate_of_another_size_is_told_by_spacing():
    r, q = lines(2)
    images = seen(r, pair())
    wrong = Pattern.quincunx(SIDE * 0.98)
    images = type(images)(
        wrong, *(getattr(images, n) for n in ("corners", "sigma", "steps", "size", "numbers"))
    )
    found = reconstruct(images, BOTH, spacing=q, scale="spacing")
    assert found.scale == pytest.approx(1 / 0.98, rel=1e-3)
    assert missed(found, r).mean < 0.25e-3
    assert [finding.kind for finding in found.findings] == ["size"]
    assert "larger than its side says" in str(found)


def test_one_camera_sees_depth_worse_and_says_so():
    r, q = lines(0)
    images = seen(r, pair()[:1])
    each = reconstruct(images, [LENS], orientation="free")
    shared = reconstruct(images, [LENS])
    both = reconstruct(images, [LENS], spacing=q)
    means = [missed(found, r).mean for found in (each, shared, both)]
    assert 2e-3 < means[0] < 3.5e-3  # 2.3 mm in the thesis
    assert means[1] < means[0]
    assert means[2] < 0.8e-3
    for found in (each, shared, both):
        rms = np.sqrt(np.mean(missed(found, r).distances ** 2))
        assert found.expected / 1.5 < rms < 1.5 * found.expected


def test_robots_are_calibrated_from_cameras():
    """Held-out places by forward kinematics of the calibrated robot, after the best motion."""
    robot = SixLinkGantryTau(prototypes.GT_A)
    r, q = lines(0)
    other, carts = lines(99)
    for rig, lenses, spacing, most in (
        (pair(), BOTH, q, 0.1e-3),
        (pair(TYPICAL), BOTH, q, 0.5e-3),
        (pair()[:1], [LENS], None, 1.3e-3),
        (pair()[:1], [LENS], q, 0.3e-3),
    ):
        fixed = "estimate" if rig[0].distortion[0] else "fixed"
        found = reconstruct(seen(r, rig), lenses, spacing=spacing, intrinsics=fixed)
        measured = found.measurements(q)
        assert measured.covariance is not None
        fitted = calibrate(robot, measured, model=1)
        reached, _ = fitted.kinematics.fk(carts)
        assert compare(reached, other).mean < most


def test_plates_that_turn_are_measured_where_that_is_said_and_told_where_not():
    r, _ = lines(3, count=8)
    R = about(np.array([0.0, 0.0, 1.0]), np.radians(np.linspace(-8, 8, len(r))))
    images = seen(r, pair(), R=R)
    found = reconstruct(images, BOTH, orientation="free")
    middle = r + R @ scene().place
    assert compare(found.r, middle).mean < 0.6e-3
    plates = found.measurements(np.zeros((len(r), 3)), place=scene().place)
    assert compare(plates.r, r).mean < 1.2e-3  # tilt of the plate by 0.15 m of lever comes on top
    axes = compare(found.r, middle).R @ found.R
    assert np.abs(axes - R @ AHEAD).max() < 0.02
    fixed = reconstruct(images, BOTH)
    assert any("orientation='free'" in finding.message for finding in fixed.findings)


def test_images_end_in_places():
    """From rendered images, of which one camera misses some, to places."""
    images = views(24, 5)
    detections = detect(images, Pattern.quincunx(SIDE))
    found = reconstruct(detections, BOTH)
    assert found.found.sum() >= 23
    assert missed(found, images.r).mean < 0.3e-3
    assert found.rms < 0.2


def test_corners_that_lie_pull_nothing():
    r, q = lines(4, count=8)
    images = seen(r, pair())
    clean = missed(reconstruct(images, BOTH, spacing=q), r).mean
    images.corners[0, ::7, 3] += 5.0  # pixels
    assert missed(reconstruct(images, BOTH, spacing=q), r).mean < 2 * clean


def test_poses_that_one_camera_misses_are_left_out():
    r, q = lines(5, count=6)
    images = seen(r, pair())
    images.corners[1, 4] = np.nan
    images.steps[1, 4] = "edges"
    found = reconstruct(images, BOTH, spacing=q)
    assert np.flatnonzero(~found.found).tolist() == [4]
    assert np.isnan(found.covariance[4]).all()
    measured = found.measurements(q)
    assert len(measured) == len(r) - 1
    assert measured.numbers is not None
    assert 4 not in measured.numbers.tolist()


@pytest.mark.parametrize(("corners", "most"), [("plate", 0.2e-3), ("free", 4e-3)])
def test_corners_that_are_hidden_are_left_out(corners, most):
    r, q = lines(1, count=5, each=6)
    images = seen(r, pair())
    images.corners[np.random.default_rng(0).random(images.corners.shape[:3]) < 0.2] = np.nan
    found = reconstruct(images, BOTH, spacing=q, corners=corners)
    error = missed(found, r)
    assert error.mean < most
    assert 1 / 2.5 < np.sqrt(np.mean(error.distances**2)) / found.expected < 2.5


@pytest.mark.parametrize("base", [0.0, 0.005])
def test_cameras_that_stand_together_see_like_one(base):
    r, q = lines(1, count=5, each=6)
    first = pair()[0]
    second = LENS.looking(np.add(first.r, [0, base, 0]), [1.3, 3.0, -0.6])
    found = reconstruct(seen(r, [first, second]), BOTH, spacing=q)
    error = missed(found, r)
    assert error.mean < 0.8e-3
    assert np.linalg.norm(found.cameras[1].r) == pytest.approx(base, abs=2e-3)
    assert found.expected / 2 < np.sqrt(np.mean(error.distances**2)) < 2 * found.expected


def test_three_cameras_see_better_than_two_also_where_one_misses_much():
    r, q = lines(1, count=5, each=6)
    third = LENS.looking([4.8, 3.0, 0.2], [1.3, 3.0, -0.6])
    images = seen(r, [*pair(), third])
    images.corners[2, ::2], images.steps[2, ::2] = np.nan, "edges"
    images.corners[0, ::3], images.steps[0, ::3] = np.nan, "edges"
    found = reconstruct(images, [*BOTH, LENS], spacing=q)
    assert np.array_equal(found.found, images.found.sum(axis=0) > 1)
    assert compare(found.r, r).mean < 0.2e-3


def test_noisy_corners_are_no_mistake():
    r, q = lines(1, count=5, each=6)
    found = reconstruct(seen(r, pair(), noise=2.0), BOTH, spacing=q)
    assert missed(found, r).mean < 3e-3
    assert found.findings == ()
