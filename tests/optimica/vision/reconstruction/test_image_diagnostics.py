"""What images leave: a camera that moves slowly, images that come twice, noise other than told; and sound ones nothing."""

from dataclasses import replace

import numpy as np
import pytest

from gantrytau_optimica.vision import Detections, reconstruct
from tests.families import first_of
from tests.optimica.vision.camera_rig import LENS, lines, pair, places, seen

BOTH = [LENS, LENS]


def images(seed: int = 0) -> Detections:
    return seen(places(60, seed), pair(), seed=seed)


def sinking(found: Detections, pixels: float) -> Detections:
    """Camera 2 turns slowly while poses are taken: its images move by so much in all."""
    corners = found.corners.copy()
    corners[1, ..., 1] += np.linspace(0, pixels, corners.shape[1])[:, None]
    return replace(found, corners=corners)


def twice(found: Detections) -> Detections:
    """The first third of the images once more at the end."""
    rows = np.r_[0:60, 0:20]
    changes = {name: getattr(found, name)[:, rows] for name in ("corners", "sigma", "steps")}
    return replace(found, **changes, numbers=np.arange(80))


MISTAKES = [  # what is done -> kinds, rows and words
    (lambda d: sinking(d, 0.2), {"drift"}, 0, "camera 2 down drifts over poses, by 0.00"),
    (lambda d: sinking(d, 1.0), {"drift"}, 0, "fasten it"),
    (twice, {"duplicates"}, 20, "images of rows 0 to 19 and rows 60 to 79 hold the same values"),
    (lambda d: replace(d, sigma=0.2 * d.sigma), {"noise larger"}, 0, "image points is"),
    (lambda d: replace(d, sigma=5 * d.sigma), {"noise smaller"}, 0, "image points is only 0."),
]


@pytest.mark.parametrize(("mistake", "kinds", "rows", "words"), MISTAKES)
def test_a_mistake_is_told_by_its_kind(mistake, kinds, rows, words):
    found = reconstruct(mistake(images()), BOTH)
    assert {f.kind for f in found.findings} == kinds == {f.kind for f in found.diagnostics.facts}
    assert len(found.findings[0].rows) == rows
    assert any(words in f.message for f in found.findings)


@pytest.mark.parametrize("seed", first_of(range(20)))
def test_sound_images_are_told_nothing(seed):
    found = reconstruct(images(seed), BOTH)
    assert found.findings == ()
    # 60 poses by 13 corners of two cameras: deviation of a ratio 1 / sqrt(2 freedom), five of these
    assert found.diagnostics.ratio["image points"] == pytest.approx(1, abs=5 / np.sqrt(2 * 60 * (52 - 3)))
    if seed:
        r, q = lines(seed, count=5)
        assert reconstruct(seen(r, pair(), seed=seed), BOTH, spacing=q, intrinsics="estimate").findings == ()
        assert reconstruct(seen(r, pair(), noise=0.0), BOTH).findings == ()
        assert reconstruct(images(seed), BOTH, corners="free").findings == ()
        assert reconstruct(images(seed), BOTH, orientation="free").findings == ()
