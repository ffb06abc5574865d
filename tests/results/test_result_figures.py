"""Figures of results: which files they can be."""

import matplotlib
import pytest

from gantrytau import ModelError, Result

matplotlib.use("Agg")


@pytest.mark.parametrize("name", ["x.xyz", "x"])
def test_a_suffix_that_is_no_picture_is_refused(tmp_path, name):
    result = Result([0.0, 1.0], {"x": [0.0, 1.0]})
    with pytest.raises(
        ModelError, match=r"plot: found the file .* expected one of .*\.png.*; name the file x\.png"
    ):
        result.plot("x", file=tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_the_suffix_may_be_in_capitals(tmp_path):
    Result([0.0, 1.0], {"x": [0.0, 1.0]}).plot("x", file=tmp_path / "x.PNG")
    assert (tmp_path / "x.PNG").stat().st_size > 0
