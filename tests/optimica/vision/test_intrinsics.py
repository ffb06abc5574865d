import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau_optimica.vision import Camera
from tests.optimica.vision.camera_rig import TYPICAL

cv2 = pytest.importorskip("cv2")


def test_a_camera_projects_as_opencv_does():
    camera = Camera([[1300.0, 0, 500.0], [0, 1280.0, 380.0], [0, 0, 1]], [-0.2, 0.05, 1e-3, -2e-3, 0.01])
    points = np.random.default_rng(0).uniform([-0.6, -0.4, 1.5], [0.6, 0.4, 3.0], (50, 3))
    theirs = cv2.projectPoints(points, np.zeros(3), np.zeros(3), camera.K, camera.distortion)[0][:, 0]
    assert np.abs(camera.placed(np.zeros(3), np.eye(3)).project(points) - theirs).max() < 1e-9  # rounding


def test_directions_are_the_inverse_of_the_projection():
    flat = np.random.default_rng(1).uniform(-0.35, 0.35, (4, 30, 2))
    points = np.concatenate([flat, np.ones((4, 30, 1))], axis=2)
    pixels = TYPICAL.placed(np.zeros(3), np.eye(3)).project(points)
    assert np.abs(TYPICAL.directions(pixels) - flat).max() < 1e-12  # where Newton's method ends


def test_a_camera_is_read_as_it_was_written(tmp_path):
    TYPICAL.write(tmp_path / "left.toml")
    read = Camera.read(tmp_path / "left.toml")
    assert np.array_equal(read.K, TYPICAL.K)
    assert np.array_equal(read.distortion, TYPICAL.distortion)
    assert read.size == TYPICAL.size


def test_a_guess_has_its_centre_in_the_middle():
    camera = Camera.guess((640, 480), 800.0)
    assert camera.K.tolist() == [[800.0, 0, 319.5], [0, 800.0, 239.5], [0, 0, 1]]
    assert np.all(camera.distortion == 0)


K = [[1290.0, 0, 511.5], [0, 1290.0, 383.5], [0, 0, 1]]


@pytest.mark.parametrize(
    ("make", "argument"),
    [
        (lambda: Camera(K, size=(1024.5, 768)), "size"),
        (lambda: Camera(np.diag([1290.0, np.nan, 1])), "K"),
        (lambda: Camera(np.add(K, [[0, 0.1, 0], [0, 0, 0], [0, 0, 0]])), "K"),
        (lambda: Camera(np.array(K).T), "K"),
        (lambda: Camera.guess((1024, 768), -1290.0), "K"),
        (lambda: Camera.guess(1024, 1290.0), "size"),
        (lambda: Camera(K, size=(320, 240)), "K"),
        (lambda: Camera(K, [-0.1]), "distortion"),
    ],
)
def test_cameras_that_are_none_are_refused(make, argument):
    with pytest.raises(ModelError) as refusal:
        make()
    assert refusal.value.argument == argument


def test_a_wrong_key_in_a_file_is_named(tmp_path):
    for text, words in (
        ("Q = 3", "Q: there is no such key"),
        ("size = [640, 480]", "K: found nothing, expected .*numb"),
    ):
        (tmp_path / "left.toml").write_text(text)
        with pytest.raises(ModelError, match=f"left.toml: {words}"):
            Camera.read(tmp_path / "left.toml")
