"""Images of another pose, and cameras that look at different moments: told by name, counted, and no harm to other poses."""

from dataclasses import replace

import numpy as np
import pytest

from gantrytau.kinematics.rotations import motion
from gantrytau_optimica.vision import Detections, Reconstruction, reconstruct
from gantrytau_optimica.vision.detection.quincunx import quarter_turned
from tests.families import first_of
from tests.optimica.vision.camera_rig import LENS, pair, places, seen

POSES, SHIFTED = 60, 5
BOTH = [LENS, LENS]


@pytest.fixture(scope="module")
def images() -> Detections:
    return seen(places(POSES, 0), pair())


def off(found: Reconstruction, true: np.ndarray) -> float:
    """How far places are off after the best motion, rms in m."""
    r, expected = found.r[found.found], true[found.found]
    turn, shift = motion(expected, r)
    return float(np.sqrt(np.mean(np.sum((r - shift - expected @ turn.T) ** 2, axis=1))))


def wrong(images: Detections, pixels: float) -> Detections:
    """One image of one pose shifted by pixels, or with corners a quarter of a turn on."""
    corners = images.corners.copy()
    if pixels:
        corners[0, SHIFTED] += pixels
    else:
        corners[0, SHIFTED] = corners[0, SHIFTED, quarter_turned()]
    return replace(images, corners=corners)


@pytest.mark.parametrize("corners", first_of(["plate", "free"]))
@pytest.mark.parametrize("pixels", first_of([20.0, 0.0, 1.0, 3.0, 50.0], 2))
def test_one_wrong_image_is_told_and_costs_the_others_nothing(images, pixels, corners):
    found = reconstruct(wrong(images, pixels), BOTH, corners=corners)
    assert [finding.kind for finding in found.findings] == ["stray image"]
    assert found.findings[0].rows.tolist() == [SHIFTED]
    # a slight shift is a motion
    camera = "camera 1 does" if pixels in (0.0, 20.0, 50.0) else "camera 1 or 2 does"
    assert f"row 5: the image of {camera} not belong to this pose" in str(found)
    assert not found.found[SHIFTED]
    others = np.delete(np.arange(POSES), SHIFTED)
    steps = np.where(np.arange(POSES) == SHIFTED, "corners", images.steps)
    alone = reconstruct(replace(images, steps=steps), BOTH, corners=corners)
    assert found.r[others] == pytest.approx(alone.r[others], abs=1e-7)


def test_a_third_camera_keeps_the_pose():
    cameras = [*pair(), pair(base=0.0)[0]]
    true = places(POSES, 0)
    found = reconstruct(wrong(seen(true, cameras), 5.0), [LENS] * 3)
    assert found.found.all()
    assert "row 5: the image of camera 1 does not belong" in str(found)
    assert off(found, true) < 3 * found.expected


@pytest.mark.parametrize("skew", first_of([2e-3, 3e-4]))
def test_cameras_that_look_at_different_moments_are_told_and_counted(skew):
    true = places(POSES, 0)
    late = true + skew * np.random.default_rng(8).standard_normal(true.shape)
    both = np.stack([seen(r, pair(), seed=k).corners[k] for k, r in enumerate((true, late))])
    found = reconstruct(replace(seen(true, pair()), corners=both), BOTH)
    assert [finding.kind for finding in found.findings] == ["moments"]
    assert "cameras look at different moments while the plate moves" in str(found)
    # foretold and true over the seven numbers of a base and the depth that all poses share
    assert 0.5 < off(found, true) / found.expected < 2.0


def test_sound_images_have_no_finding(images):
    found = reconstruct(images, BOTH)
    assert found.findings == ()
    assert found.found.all()
