import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau_optimica.vision import Pattern, detect, render
from tests.optimica.vision.camera_rig import SIDE, pair, places, scene

cv2 = pytest.importorskip("cv2")
QUINCUNX = Pattern.quincunx(SIDE)


@pytest.fixture
def folders(tmp_path):
    """Four images of each of two cameras on file."""
    return render(scene(), places(4, 1), pair(), seed=1, folder=tmp_path).frames


def test_a_file_that_is_missing_moves_no_other(folders):
    whole = detect(folders, QUINCUNX, background=0)
    (folders[0] / "0001.png").unlink()
    (folders[1] / "0002.png").write_bytes(b"no image")
    found = detect(folders, QUINCUNX, background=0)
    assert found.numbers.tolist() == [0, 1, 2, 3]
    assert found.steps.tolist() == [["", "file", "", ""], ["", "", "file", ""]]
    assert np.array_equal(found.corners[found.found], whole.corners[found.found])
    assert "file: camera 1: 1 of 4 images, row 1: there is no image, or it cannot be read" in str(found)


def test_a_number_that_all_cameras_lack_keeps_its_row(folders):
    for folder in folders:
        (folder / "0001.png").unlink()
    found = detect([str(folder) for folder in folders], QUINCUNX, background=0)
    assert found.pairs.tolist() == [True, False, True, True]


def test_files_without_numbers_are_paired_in_order_if_they_are_as_many(folders):
    for folder in folders:
        for file, letter in zip(sorted(folder.iterdir()), "abcd", strict=True):
            file.rename(folder / f"{letter}.png")
    assert detect(folders, QUINCUNX, background=0).pairs.all()
    (folders[0] / "b.png").unlink()
    with pytest.raises(ModelError, match="found 3 and 4 images, expected as many of each camera"):
        detect(folders, QUINCUNX)
    (folders[0] / "7.png").write_bytes((folders[0] / "a.png").read_bytes())
    with pytest.raises(ModelError, match=r"a.png: found no number in its name, others have one"):
        detect(folders, QUINCUNX)


def test_two_files_of_one_number_are_refused(folders):
    (folders[0] / "again1.png").write_bytes((folders[0] / "0001.png").read_bytes())
    with pytest.raises(ModelError, match=r"again1.png: has the number 1, as 0001.png"):
        detect(folders, QUINCUNX)


def test_folders_that_hold_nothing_are_refused(tmp_path):
    with pytest.raises(ModelError, match="there is no such folder"):
        detect([tmp_path / "left"], QUINCUNX)
    with pytest.raises(ModelError, match="found no images, expected files ending in"):
        detect([tmp_path], QUINCUNX)
    (tmp_path / "1.png").write_bytes(b"")
    with pytest.raises(ModelError, match="none of 1 images can be read"):
        detect([tmp_path], QUINCUNX)
