import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau.kinematics.rotations import about
from gantrytau_optimica.calibration.devices.sight import Bars
from gantrytau_optimica.vision import Light, Pattern, Scene, detect, render, true_corners
from tests.optimica.vision.camera_rig import LENS, MIDDLE, SIDE, TYPICAL, pair, places, scene, views

cv2 = pytest.importorskip("cv2")
QUINCUNX = Pattern.quincunx(SIDE)
WRONG = 3.0  # pixels: a corner that is another one


def turned(degrees, **more):
    """A pattern without a robot, turned counter-clockwise as the camera sees it."""
    turn = about(np.array([0.0, 0.0, 1.0]), np.radians([degrees]))[0]
    return Scene(QUINCUNX, R=Scene(QUINCUNX).R @ turn, **more)


def missed(found, true):
    """Distances of corners from where they are, (C, N, P) in pixels."""
    return np.linalg.norm(found.corners - true, axis=-1)


@pytest.mark.parametrize(
    ("light", "lens", "least", "centre"),
    [
        (Light(), LENS, 1.0, 0.01),
        (Light(), TYPICAL, 1.0, 0.015),  # the mean of images of corners, bent by the lens alike
        (Light(0.15), LENS, 0.95, 0.03),  # 0.025 in the mean of many
        (Light(noise=8.0), LENS, 0.95, 0.025),
        (Light(blur=2.5), LENS, 0.95, 0.025),
        (Light(bits=16), LENS, 1.0, 0.01),
    ],
)
def test_a_pattern_is_found_where_it_is(light, lens, least, centre):
    images = views(8, 11, light, lens)
    true = true_corners(scene(), pair(lens), images.r)
    found = detect(images, QUINCUNX)
    assert found.pairs.mean() >= least
    distance = missed(found, true)
    assert np.nanmax(distance) < WRONG
    error = (found.centres - true.mean(axis=2))[found.found]
    assert np.sqrt(np.mean(error**2)) < centre
    told, real = np.sqrt(np.nanmean(found.sigma**2)), np.sqrt(np.nanmean(distance**2) / 2)
    assert 0.4 * real < told < 2 * real  # the scatter of lines does not see what blur brings to their ends


def test_dim_images_are_lost_without_normalisation_and_the_step_is_told():
    images = views(3, 2, Light(0.1))
    lost, found = detect(images, QUINCUNX, normalise=False), detect(images, QUINCUNX)
    assert found.pairs.all()
    assert set(lost.steps.ravel()) <= {"corners", "squares", "edges"}
    told = [finding for finding in lost.findings if finding.kind == lost.steps[0, 0]]
    assert told[0].rows.tolist() == np.flatnonzero(lost.steps[0] == lost.steps[0, 0]).tolist()
    assert str(told[0]).startswith(f"{lost.steps[0, 0]}: camera 1: ")


@pytest.mark.parametrize("degrees", [0.0, 30.0, 90.0, 180.0, 270.0])
def test_a_turned_pattern_is_the_nearest_to_up(degrees):
    board, r = turned(degrees), places(2, 4)
    like = turned((degrees + 45) % 90 - 45)  # after quarters of a turn it looks the same
    found = detect(render(board, r, pair(), seed=4), QUINCUNX, background=0)
    assert found.pairs.all()
    assert missed(found, true_corners(like, pair(), r)).max() < 0.3
    assert not found.findings
    upright = detect(render(board, r, pair(), seed=4), QUINCUNX, background=0, up=-np.radians(degrees))
    assert missed(upright, true_corners(board, pair(), r)).max() < 0.3


@pytest.mark.parametrize("degrees", [44.9, 45.0, 45.1, 135.0])
def test_at_45_degrees_all_images_have_one_numbering_and_doubt_is_told(degrees):
    board, r = turned(degrees), places(5, 5)
    found = detect(render(board, r, pair(), seed=5), QUINCUNX, background=0)
    fits = [
        missed(found, true_corners(turned(degrees + quarter), pair(), r)).max()
        for quarter in (0, 90, 180, 270)
    ]
    assert min(fits) < 0.4
    assert [finding.kind for finding in found.findings] == ["orientation", "orientation"]
    assert "looks the same after 90" in found.findings[0].message


def test_a_plate_that_turns_is_numbered_from_up_and_images_near_45_degrees_are_named():
    angles = np.radians([-30.0, -10.0, 15.0, 38.0, 42.5])
    R = about(np.array([1.0, 0.0, 0.0]), angles)
    r = np.repeat(MIDDLE[None], 5, axis=0)
    found = detect(render(turned(0.0), (r, R), pair(), seed=2), QUINCUNX, background=0)
    assert missed(found, true_corners(turned(0.0), pair(), r, R)).max() < 0.3
    assert [finding.rows.tolist() for finding in found.findings] == [[4], [4]]


@pytest.mark.parametrize("z", [-0.12, -0.09, -0.05, 0.0, 0.06, 0.09])
@pytest.mark.parametrize("radius", [0.004, 0.02])
def test_what_a_bar_hides_is_missing_and_never_wrong(z, radius):
    r = np.add(MIDDLE, [0.15, 0.0, 0.0])
    bar = Bars([r + np.array([0.1, -1.0, z])], [r + np.array([0.1, 1.0, z + 0.03])], radius)
    board, camera = turned(0.0, bars=[bar], clutter=20), [LENS.looking(np.add(MIDDLE, [3.5, 0, 0]), MIDDLE)]
    found = detect(render(board, MIDDLE, camera), QUINCUNX, background=0)
    true = true_corners(board, camera, MIDDLE)
    if found.found.all():
        assert np.nanmax(missed(found, true)) < 1.0  # a wire of three pixels along an edge moves it
        assert np.abs(found.centres - true.mean(axis=2)).max() < 0.1
    else:
        assert found.steps.tolist() == [["edges"]]
        assert np.isnan(found.corners).all()


def test_a_pattern_partly_outside_is_found_by_what_is_left_or_lost():
    camera = LENS.looking(np.add(MIDDLE, [3.5, 0, 0]), MIDDLE)
    for y in np.linspace(1.2, 1.6, 9):
        at = np.add(MIDDLE, [0, y, 0])
        found = detect(render(turned(0.0), at, [camera]), QUINCUNX, background=0)
        distance = missed(found, true_corners(turned(0.0), [camera], at))
        assert not found.found.all() or np.nanmax(distance) < 0.3


@pytest.mark.parametrize("tilt", [20, 40, 60, 75, 85, 90])
def test_a_pattern_seen_aslant_is_found_or_lost_and_never_wrong(tilt):
    board, at = turned(0.0), MIDDLE[None]
    for direction in (0.0, 1.0, 2.0, 4.0):
        axis = np.array([0.0, np.cos(direction), np.sin(direction)])
        R = about(axis, np.radians([tilt]))[0]
        found = detect(render(board, (at, R), pair()), QUINCUNX, background=0)
        distance = missed(found, true_corners(board, pair(), at, R))
        assert found.pairs.all() or tilt > 40
        assert np.all(np.nan_to_num(distance) < 1.0)


def test_clutter_alone_is_no_pattern():
    away = np.array([[0, 0, -1.0], [-1.0, 0, 0], [0, 1.0, 0]])
    for seed in range(1, 5):
        turned_away = Scene(QUINCUNX, scene().robot, R=away, seed=seed)
        images = render(turned_away, places(1, seed), pair(), light=Light((1.0, 0.15)[seed % 2]), seed=seed)
        assert not detect(images, QUINCUNX, background=0).found.any()


def with_a_second(images, step):
    """The images with a copy of the first pattern, `step` pixels further in each image of the first camera."""
    corners = true_corners(scene(), pair(), images.r)[0, 0]
    (x, y), (width, height) = corners.min(axis=0).astype(int) - 15, np.ptp(corners, axis=0).astype(int) + 30
    frames = [frame.copy() for frame in images.frames]
    for k, frame in enumerate(frames[0]):
        left = 20 + step * k
        frame[650 : 650 + height, left : left + width] = images.frames[0][0][y : y + height, x : x + width]
    return frames


def test_a_second_pattern_that_stands_still_is_the_background_and_one_that_moves_is_refused():
    images = views(10, 5)
    true = true_corners(scene(), pair(), images.r)
    still = detect(with_a_second(images, 0), QUINCUNX)
    assert still.pairs.all()
    assert missed(still, true).max() < WRONG
    for frames, background in ((with_a_second(images, 0), 0), (with_a_second(images, 60), 10)):
        found = detect(frames, QUINCUNX, background=background)
        assert set(found.steps[0]) == {"ambiguous"}
        assert found.found[1].all()
        assert "two patterns are seen; cover one" in str(found)


def test_images_alike_have_the_pattern_in_their_background():
    alike = [np.repeat(frame, 10, axis=0) for frame in views(1, 6).frames]
    found = detect(alike, QUINCUNX)
    assert set(found.steps.ravel()) == {"background"}
    assert "leave out images that are alike, or background=0" in found.findings[0].message
    assert detect(alike, QUINCUNX, background=0).pairs.all()


def test_dark_white_noisy_and_empty_images_are_told_apart():
    random = np.random.default_rng(0)
    kinds = {
        "dark": np.zeros((480, 640), np.uint8),
        "saturated": np.full((480, 640), 255, np.uint8),
        "corners": np.tile(np.linspace(20, 200, 640).astype(np.uint8), (480, 1)),
    }
    found = detect([np.stack(list(kinds.values()))], QUINCUNX, background=0)
    assert found.steps[0].tolist() == list(kinds)
    noise = random.integers(0, 255, (2, 480, 640)).astype(np.uint8)
    assert not detect([noise], QUINCUNX, background=0).found.any()
    bright = np.clip(views(1, 7).frames[0].astype(float) * 4, 0, 255).astype(np.uint8)
    assert detect([bright], QUINCUNX, background=0).steps.tolist() == [["saturated"]]


def test_colour_and_16_bits_are_the_same_image():
    frames = views(2, 8).frames
    grey = detect(frames, QUINCUNX, background=0)
    colour = detect([np.stack([frame] * 3, axis=-1) for frame in frames], QUINCUNX, background=0)
    opaque = detect(
        [np.stack([*[frame[0]] * 3, frame[0] * 0 + 255], axis=-1) for frame in frames], QUINCUNX, background=0
    )
    wide = detect([frame.astype(np.uint16) * 257 for frame in frames], QUINCUNX, background=0)
    for other in (colour, wide):
        assert np.abs(other.corners - grey.corners).max() < 1e-3  # rounding of single precision
    assert np.abs(opaque.corners[:, 0] - grey.corners[:, 0]).max() < 1e-3


def test_one_image_has_no_background_and_says_so():
    frames = views(1, 9).frames
    found = detect([frame[0] for frame in frames], QUINCUNX)
    assert found.found.tolist() == [[True], [True]]
    assert [finding.kind for finding in found.findings] == ["few images", "few images"]
    assert "found 1 images for a background of 10" in found.findings[0].message


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_images_of_another_size_are_no_other_case(factor):
    lens = type(LENS).guess((int(1024 * factor), int(768 * factor)), 1290.0 * factor)
    images = render(scene(), places(1, 10), pair(lens), seed=10)
    found = detect(images, QUINCUNX, background=0)
    assert found.size.tolist() == [list(lens.size)] * 2
    assert missed(found, true_corners(scene(), pair(lens), images.r)).max() < 0.5


def test_a_charuco_board_is_numbered_however_it_is_turned():
    board = Pattern.charuco(5, 4, 0.09)
    for degrees in (0.0, 45.0, 180.0):
        turn = about(np.array([0.0, 0.0, 1.0]), np.radians([degrees]))[0]
        carried = Scene(board, R=Scene(board).R @ turn)
        images = render(carried, MIDDLE, pair(), seed=1)
        found = detect(images, board)
        distance = missed(found, true_corners(carried, pair(), MIDDLE))
        assert found.pairs.all()
        assert np.isfinite(distance).sum() >= 20  # of 24
        assert np.nanmax(distance) < 1.0
    dim = render(carried, MIDDLE, pair(), light=Light(0.15), seed=1)
    assert detect(dim, board).pairs.all()
    assert not detect(render(scene(), MIDDLE, pair()), board).found.any()


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: detect("left", QUINCUNX), "expected a list with a folder or an array for each camera"),
        (lambda: detect([], QUINCUNX), "expected a list with a folder or an array for each camera"),
        (lambda: detect([3.0], QUINCUNX), "camera 1: found float, expected a folder of images or an array"),
        (lambda: detect([np.zeros((2, 64, 64), np.uint8)], 0.06), "as Pattern.quincunx(0.06)"),  # pyright: ignore[reportArgumentType]
        (lambda: detect([np.zeros((2, 64, 64))], QUINCUNX), "type float64, expected images of 8 or 16 bits"),
        (lambda: detect([np.zeros((2, 8, 8), np.uint8)], QUINCUNX), "at least 16 x 16"),
        (lambda: detect([np.zeros((2, 64, 64, 7), np.uint8)], QUINCUNX), "expected (height, width) or"),
        (lambda: detect([np.zeros((0, 64, 64), np.uint8)], QUINCUNX), "found no images"),
        (
            lambda: detect([np.zeros((2, 64, 64), np.uint8), np.zeros((3, 64, 64), np.uint8)], QUINCUNX),
            "found 2 and 3 images, expected as many of each camera",
        ),
        (
            lambda: detect([[np.zeros((64, 64), np.uint8), np.zeros((64, 32), np.uint8)]], QUINCUNX),
            "found 32 x 64 pixels, expected 64 x 64",
        ),
    ],
)
def test_images_that_cannot_be_used_are_refused(call, words):
    with pytest.raises(ModelError) as told:
        call()
    assert words in str(told.value)
