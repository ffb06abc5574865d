"""Figures of results: which files they can be."""

import matplotlib
import matplotlib.pyplot as plt
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from gantrytau import ModelError, Result
from gantrytau.results.figures import finished

matplotlib.use("Agg")


@pytest.mark.parametrize("name", ["x.xyz", "x"])
def test_a_suffix_that_is_no_picture_is_refused(tmp_path, name):
    result = Result([0.0, 1.0], {"x": [0.0, 1.0]})
    with pytest.raises(ModelError, match=r"plot: found file=.* one of .*\.png.*; name the file x\.png"):
        result.plot("x", file=tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_the_suffix_may_be_in_capitals(tmp_path):
    Result([0.0, 1.0], {"x": [0.0, 1.0]}).plot("x", file=tmp_path / "x.PNG")
    assert (tmp_path / "x.PNG").stat().st_size > 0


def test_titles_of_axes_with_equal_scales_are_whole():
    figure, axes = plt.subplots(figsize=(6.0, 3.5), layout="constrained")
    axes.plot([-0.8, 0.8], [0.0, 0.8], label="a line")
    axes.set_aspect("equal")
    axes.set_title("a title")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.set(xlim=(-0.8, 0.8), ylim=(0.0, 0.8))
    figure.legend(loc="outside lower center")
    canvas = FigureCanvasAgg(finished(figure, None))
    canvas.draw()
    assert axes.title.get_window_extent(canvas.get_renderer()).y1 <= figure.bbox.height
