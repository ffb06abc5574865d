"""What reconstruct refuses, and what it notices."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau_optimica.vision import Camera, Detections, Pattern, VisionError, reconstruct
from tests.optimica.vision.camera_rig import LENS, TYPICAL, lines, pair, seen

BOTH = [LENS, LENS]
WRONGLY: Any = reconstruct  # called with what types forbid
R, Q = lines(7, count=5)
IMAGES = seen(R, pair())


def of(**changes) -> Detections:
    return replace(IMAGES, **changes)


def lost(rows):
    corners, steps = IMAGES.corners.copy(), np.where(IMAGES.found, "", "corners").astype("U16")
    corners[0, rows], steps[0, rows] = np.nan, "dark"
    return of(corners=corners, steps=steps)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (
            lambda: reconstruct(lost(np.arange(55)), BOTH),
            "found 5 poses of 60 with the pattern in 2 images, expected at least 10; lost were 55 images at 'dark', "
            "rows 0 to 54: it is black",
        ),
        (lambda: reconstruct(IMAGES, BOTH, spacing=0.1 * Q), "times as large as its side says, expected about 1"),
        (
            lambda: reconstruct(IMAGES, BOTH, spacing=np.roll(Q, 1, axis=0)),
            "images and carts are shifted by",
        ),
        (
            lambda: reconstruct(IMAGES, BOTH, spacing=Q[np.random.default_rng(1).permutation(len(Q))]),
            "miss the spacing along the guideways by .* check that rows of spacing are those of the images",
        ),
        (
            lambda: reconstruct(of(corners=np.stack([IMAGES.corners[0], np.roll(IMAGES.corners[1], 1, axis=0)])), BOTH),
            "images of camera 2 are one pose late",
        ),
    ],
)  # fmt: skip
def test_images_that_do_not_belong_together_are_refused(call, words):
    with pytest.raises(VisionError, match=words):
        call()


@pytest.mark.parametrize(
    ("call", "argument"),
    [
        (lambda: reconstruct(IMAGES, BOTH, scale="both"), "scale"),
        (lambda: reconstruct(IMAGES, BOTH, scale="pattern", spacing=Q), "scale"),
        (lambda: reconstruct(IMAGES, BOTH, corners="free", scale="both", spacing=Q), "scale"),
        (lambda: reconstruct(IMAGES, BOTH, corners="free", intrinsics="estimate"), "intrinsics"),
        (lambda: reconstruct(of(size=IMAGES.size[:1]), [LENS], corners="free"), "cameras"),
        (lambda: reconstruct(IMAGES, [LENS]), "cameras"),
        (lambda: WRONGLY(IMAGES, pair()), "cameras"),
        (lambda: WRONGLY(R, BOTH), "detections"),
        (lambda: reconstruct(IMAGES, [LENS, Camera.guess((512, 384), 645.0)]), "cameras"),
        (lambda: reconstruct(IMAGES, BOTH, spacing=Q[:5]), "spacing"),
        (lambda: reconstruct(IMAGES, BOTH, spacing=1000 * Q), "spacing"),
        (lambda: reconstruct(IMAGES, BOTH, spacing=0 * Q), "spacing"),
        (lambda: reconstruct(IMAGES, BOTH, spacing=np.random.default_rng(1).random(Q.shape)), "spacing"),
        (lambda: reconstruct(IMAGES, BOTH).measurements(Q[:4]), "q"),
    ],
)
def test_what_does_not_fit_is_refused_by_name(call, argument):
    with pytest.raises(ModelError) as refusal:
        call()
    assert refusal.value.argument == argument


def test_swapped_lenses_are_noticed():
    wide = Camera([[1500.0, 0, 520], [0, 1500.0, 390], [0, 0, 1]])
    images = seen(R, [pair(wide)[0], pair()[1]])
    with pytest.raises(VisionError, match="lenses are swapped"):
        reconstruct(images, [LENS, wide])


def test_one_line_of_poses_does_not_tell_a_lens():
    r, q = lines(7, count=1, each=14)
    found = reconstruct(seen(r, pair(TYPICAL)), BOTH, spacing=q, intrinsics="estimate")
    assert {finding.kind for finding in found.findings} == {"lens"}
    assert "the centre across, the centre down hardly better" in str(found)


def test_a_size_that_spacing_contradicts_is_told():
    images = of(pattern=Pattern.quincunx(0.063))
    found = reconstruct(images, BOTH, spacing=Q, scale="spacing")
    assert [finding.kind for finding in found.findings] == ["size"]


def test_a_side_that_spacing_contradicts_is_named_first():
    found = reconstruct(of(pattern=Pattern.quincunx(0.05)), BOTH, spacing=Q)
    assert [finding.kind for finding in found.findings] == ["size"]
    assert "+20 % larger than its side says; measure both; lengths are those of spacing" in str(found)
    assert found.scale == pytest.approx(1.2, rel=1e-3)


@pytest.mark.parametrize("cameras", [[0], [0, 1]])
def test_mirrored_images_are_told(cameras):
    corners = IMAGES.corners.copy()
    corners[cameras, ..., 0] = 1023 - corners[cameras, ..., 0]
    with pytest.raises(VisionError, match=r"camera 1 sees the pattern from behind in .* its images are"):
        reconstruct(of(corners=corners), BOTH)
