import sys

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau.kinematics.rotations import about
from gantrytau_optimica.calibration.devices.sight import Bars
from gantrytau_optimica.vision import Light, Pattern, Scene, VisionError, read_poses, render, true_corners
from gantrytau_optimica.vision.opencv import opencv
from tests.optimica.vision.camera_rig import LENS, MIDDLE, SIDE, TYPICAL, pair, places, scene, views

cv2 = pytest.importorskip("cv2")
EVEN = Light(tilt=0.0, lamp=0.0, vignetting=0.0, blur=0.0, noise=0.0, bits=16)
BARE = Scene(Pattern.quincunx(SIDE), clutter=0, decoys=0)


@pytest.mark.parametrize("lens", [LENS, TYPICAL])
@pytest.mark.parametrize("angle", [0.0, 0.3, np.pi / 4, np.pi / 2, np.pi])
def test_the_centre_of_the_ink_is_where_the_pattern_is(lens, angle):
    """Of an even light the centroid of what is missing to white is that of the five squares."""
    board = Scene(
        Pattern.quincunx(SIDE),
        clutter=0,
        decoys=0,
        R=BARE.R @ about(np.array([0, 0, 1.0]), np.array([angle]))[0],
    )
    camera = lens.looking(np.add(MIDDLE, [3.5, 0.3, 0.2]), MIDDLE)
    image = render(board, MIDDLE, [camera], light=EVEN).frames[0][0] / 257.0
    points = true_corners(board, [camera], MIDDLE)[0, 0]
    hull = points[[0, 5, 18, 15]]  # outer corners; the white border is half a cell wide
    mask = np.zeros(image.shape, np.uint8)
    cv2.fillConvexPoly(mask, np.round(hull.mean(axis=0) + 1.17 * (hull - hull.mean(axis=0))).astype(int), 1)
    ink = mask * (215.0 - image)
    x, y = np.meshgrid(np.arange(image.shape[1]), np.arange(image.shape[0]))
    centre = np.array([np.sum(ink * x), np.sum(ink * y)]) / ink.sum()
    squares = points.reshape(5, 4, 2)
    area = np.array([cv2.contourArea(square.astype(np.float32)) for square in squares])
    middle = np.array([centroid(square) for square in squares])
    missed = np.abs(centre - area @ middle / area.sum()).max()
    along = angle == np.pi / 4  # rows of samples are along its edges: some edges are in steps of a sample
    assert missed < (0.015 if along else 1.5e-3)  # of 0.025 that are asked of detection
    assert ink.sum() == pytest.approx((215 - 22) * area.sum(), rel=2e-3)


def centroid(polygon):
    """Of a triangle's halves, weighted by their areas."""
    a, b, c, d = polygon
    first, second = np.linalg.det([b - a, c - a]), np.linalg.det([c - a, d - a])
    return (first * (a + b + c) + second * (a + c + d)) / 3 / (first + second)


def test_the_same_seed_makes_the_same_images():
    one, again, other = (views(1, 0) for _ in range(2)), views(2, 0), views(1, 1)
    first, second = one
    assert np.array_equal(first.frames[0], second.frames[0])
    assert np.array_equal(first.frames[1][0], again.frames[1][0])  # whatever other images there are
    assert not np.array_equal(first.frames[0], other.frames[0])


def test_folders_hold_the_same_images_and_poses(tmp_path):
    r, R = places(2, 3), np.eye(3)
    kept = render(scene(), (r, R), pair(), seed=3)
    filed = render(scene(), (r, R), pair(), seed=3, folder=tmp_path)
    for c, folder in enumerate(filed.frames):
        files = sorted(folder.iterdir())
        assert [file.name for file in files] == ["0000.png", "0001.png"]
        for k, file in enumerate(files):
            assert np.array_equal(cv2.imread(str(file), cv2.IMREAD_UNCHANGED), kept.frames[c][k])
    read_r, read_R = read_poses(tmp_path / "poses.csv")
    assert np.array_equal(read_r, r)
    assert np.allclose(read_R, R, atol=1e-15)


def test_noise_and_gain_are_those_of_the_light():
    quiet = Light(tilt=0.0, lamp=0.0, vignetting=0.0, noise=0.0)
    noisy = Light(tilt=0.0, lamp=0.0, vignetting=0.0, noise=8.0)
    dim = Light(0.25, tilt=0.0, lamp=0.0, vignetting=0.0, noise=0.0)
    camera = pair()[:1]
    still, noise, dark = (
        render(BARE, MIDDLE, camera, light=light).frames[0].astype(float) for light in (quiet, noisy, dim)
    )
    assert np.std(noise - still) == pytest.approx(8.0, rel=0.01)  # 786 thousand samples: 0.1 %
    assert np.abs(dark - 0.25 * still).max() <= 0.5 + 0.125  # both are rounded


def test_a_link_before_the_pattern_hides_it():
    r = np.add(MIDDLE, [0.15, 0.0, 0.0])
    across = Bars([np.add(r, [0.5, -1.0, 0.02])], [np.add(r, [0.5, 1.0, 0.02])], 0.02)
    behind = Bars([np.add(r, [-0.5, -1.0, 0.02])], [np.add(r, [-0.5, 1.0, 0.02])], 0.02)
    camera = [LENS.looking(np.add(MIDDLE, [3.5, 0.0, 0.0]), MIDDLE)]
    x, y = camera[0].project(np.add(r, [0.5, 0.0, 0.02])).round().astype(int)
    seen = {}
    for name, bars in (("before", across), ("behind", behind)):
        board = Scene(Pattern.quincunx(SIDE), clutter=0, decoys=0, bars=[bars])
        seen[name] = render(board, MIDDLE, camera, light=EVEN).frames[0][0][y, x] / 257
    assert seen["before"] == pytest.approx(60, abs=1)  # the grey of a bar
    assert seen["behind"] == pytest.approx(22, abs=1)  # ink of the middle square


def test_a_pattern_from_behind_or_behind_the_camera_is_not_seen():
    camera = pair()[:1]
    bare = render(BARE, np.add(MIDDLE, [9.0, 0, 0]), camera, light=EVEN).frames[0]
    turned = render(BARE, (MIDDLE, np.diag([-1.0, -1.0, 1.0])), camera, light=EVEN).frames[0]
    assert bare.max() == 120 * 257  # the wall
    assert turned.max() == 120 * 257


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: render(scene(), MIDDLE, [LENS]), "place them by PlacedCamera.looking"),  # pyright: ignore[reportArgumentType]
        (lambda: render(scene(), MIDDLE, []), "place them by PlacedCamera.looking"),
        (lambda: render(scene(), MIDDLE, pair(), light=[Light()] * 2), "found 2 lights for 1 poses"),
        (lambda: render(scene(), [9.0, 9.0, 9.0], pair()), "does not reach 1 of 1 poses"),
        (lambda: render(scene(), [np.nan, 3.0, -0.6], pair()), "not finite"),
        (lambda: Scene(0.06), "as Pattern.quincunx(0.06)"),  # pyright: ignore[reportArgumentType]
    ],
)
def test_what_cannot_be_rendered_is_refused(call, words):
    with pytest.raises(ModelError) as told:
        call()
    assert words in str(told.value)


@pytest.mark.parametrize(
    ("make", "argument"),
    [
        (lambda: Light(-1.0), "gain"),
        (lambda: Scene(Pattern.quincunx(0.06), place=[0.1]), "place"),
        (lambda: Pattern.quincunx(60.0), "side"),  # in mm
        (lambda: Pattern.charuco(2, 7, 0.03), "columns"),
    ],
)
def test_numbers_of_a_scene_keep_their_limits(make, argument):
    with pytest.raises(ModelError) as refusal:
        make()
    assert refusal.value.argument == argument


def test_poses_on_file_are_checked(tmp_path):
    (tmp_path / "poses.csv").write_text("a,b\n1,2\n")
    with pytest.raises(ModelError, match="found no column 'x'"):
        read_poses(tmp_path / "poses.csv")


def test_a_missing_opencv_is_told_with_its_remedy(monkeypatch):
    monkeypatch.setitem(sys.modules, "cv2", None)
    with pytest.raises(VisionError, match=r"pip install 'gantrytau\[vision\]'"):
        opencv()
