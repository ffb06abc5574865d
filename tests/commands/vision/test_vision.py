"""`gantrytau vision`: from images to measurements, and what is wrong with files."""

import json

import numpy as np
import pytest

from gantrytau_optimica import Measurements
from gantrytau_optimica.vision import Camera
from tests.optimica.vision.camera_rig import LENS, TYPICAL, lines, pair, seen


@pytest.fixture
def files(tmp_path, monkeypatch):
    """Corners of two cameras, lenses, carts and a laser, in the working folder."""
    monkeypatch.chdir(tmp_path)
    r, q = lines(1, count=6)
    seen(r, pair(TYPICAL)).save("corners.npz")
    LENS.write("lens.toml")
    numbers = np.arange(len(r))
    Measurements(q, r, numbers=numbers).write("laser.csv")
    rows = np.column_stack([numbers, q])[::-1]  # known by number, in any order
    np.savetxt("carts.csv", rows, delimiter=",", header="number,q1,q2,q3", comments="")
    return tmp_path


RECONSTRUCT = ("vision", "reconstruct", "corners.npz", "--camera", "lens.toml", "--camera", "lens.toml")


def test_corners_become_measurements_that_calibrate_takes(run, files):
    done = run(
        *RECONSTRUCT, "--carts", "carts.csv", "--estimate", "--output", "places.csv", "--report", "page.html"
    )
    assert done.exit_code == 0, done.output
    assert "72 of 72 poses by 2 cameras" in done.output
    assert "foretold error of a place: 0." in done.output
    measured = Measurements.read(files / "places.csv")
    assert measured.q.shape == (72, 3)
    assert measured.covariance is not None
    assert "Poses and cameras" in (files / "page.html").read_text(encoding="utf-8")
    done = run("vision", "compare", "places.csv", "laser.csv", "--to", "error.png", "--json")
    told = json.loads(done.stdout)
    assert told["mean_m"] < 0.3e-3
    assert len(told["error_m"]) == 72
    assert (files / "error.png").stat().st_size > 20_000
    done = run("calibrate", "places.csv", "--robot", "SixLinkGantryTau(GT_A)", "--model", "1")
    assert "21 numbers identified from" in done.output


def test_cameras_are_told_to_programs(run, files):
    done = run(*RECONSTRUCT, "--carts", "carts.csv", "--estimate", "--json")
    told = json.loads(done.stdout)
    assert told["poses"] == 72
    assert told["cameras"][0]["focal"][0] == pytest.approx(1296, abs=2)
    assert told["cameras"][1]["r"] == pytest.approx(told["cameras"][1]["r"])
    assert np.linalg.norm(told["cameras"][1]["r"]) == pytest.approx(1.2, abs=2e-3)


def test_images_become_corners_and_a_page(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = run("vision", "example", "try", "--each", "2")
    assert done.exit_code == 0, done.output
    assert "gantrytau vision detect camera1 camera2 --side 0.06" in done.output
    monkeypatch.chdir(tmp_path / "try")
    (tmp_path / "try" / "camera2" / "0003.png").write_bytes(b"")
    done = run("vision", "detect", "camera1", "camera2", "--side", "0.06", "--report", "images.html")
    assert done.exit_code == 0, done.output
    assert "9 of 10 poses seen by all of 2 cameras" in done.output
    page = (tmp_path / "try" / "images.html").read_text(encoding="utf-8")
    assert "90.0 % of the poses" in page
    assert page.count("data:image/jpeg;base64") == 4  # two that were found, of each camera
    assert Camera.read("left.toml").K[0, 0] == 1290
    done = run("vision", "example", ".")
    assert "found a folder that is not empty, expected a new one" in done.output


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("vision", "detect", "nowhere", "--side", "0.06"), "nowhere: there is no such folder"),
        (("vision", "detect", ".", "--side", "60"), "a number above 0 and of at most 1"),
        ((*RECONSTRUCT, "--place", "1,2"), "--place 1,2: found no three numbers"),
        ((*RECONSTRUCT, "--carts", "lens.toml"), "lens.toml: line 2 has 5 cells"),
        (("vision", "compare", "laser.csv", "few.csv"), "few.csv: found 2 rows, expected 72 as in laser.csv"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told_with_its_place(run, files, words, told):
    (files / "few.csv").write_text("x,y,z\n1,2,3\n4,5,6\n")
    (files / "other.csv").write_text("number,x,y,z\n900,2,3,4\n901,5,6,7\n")
    done = run(*words)
    assert done.exit_code != 0
    assert told in " ".join(done.output.split())
