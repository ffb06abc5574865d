"""Pictures of studies: lines that say which case they are, bands that hold as many as they say."""

from typing import Any

import matplotlib
import numpy as np
import pytest

from gantrytau import ModelError, Result, study
from gantrytau.ensembles.cases import Case
from gantrytau.ensembles.ensemble_plot import draw_fan
from gantrytau_models import Pendulum

matplotlib.use("Agg")


def courses(count):
    """Constant courses 0, 1, ..., by the seeds of a study."""
    return [
        (Case(k, (k,), {}, k), Result([0.0, 1.0], {"x": [k, k]}, units={"x": "m"}, title="Level"))
        for k in range(count)
    ]


def test_few_cases_are_lines_with_their_names():
    axis: Any = draw_fan(courses(3), ["x"], None, "Level").axes[0]
    assert [line.get_ydata()[0] for line in axis.lines] == [0, 1, 2]
    assert [text.get_text() for text in axis.get_legend().get_texts()] == ["seed=0", "seed=1", "seed=2"]
    assert axis.get_ylabel() == "x [m]"


def test_many_cases_are_a_median_and_bands_that_hold_their_share():
    axis: Any = draw_fan(courses(101), ["x"], None, "Level").axes[0]
    (median,) = axis.lines
    assert np.all(median.get_ydata() == 50)
    wide, narrow = (band.get_paths()[0].get_extents() for band in axis.collections)
    assert (wide.y0, wide.y1, narrow.y0, narrow.y1) == pytest.approx((5, 95, 25, 75))  # of 0 to 100


def test_many_lines_are_coloured_by_what_was_named_first(tmp_path):
    found = study(Pendulum(), stop=0.2, over={"m": [1.0, 2.0], "x": [0.1, 0.2, 0.3, 0.4, 0.5]}, points=5)
    axis: Any = found.plot("x", file=tmp_path / "swings.png").axes[0]
    assert len({line.get_color().tobytes() for line in axis.lines}) == 2
    assert {text.get_text() for text in axis.get_legend().get_texts()} == {"m=1", "m=2"}
    assert (tmp_path / "swings.png").stat().st_size > 1000


def test_names_that_cannot_be_drawn_are_told():
    found = study(Pendulum(), stop=0.2, over={"m": [1.0, 2.0]}, points=5)
    with pytest.raises(ModelError, match=r"plot\(\) found no names, expected those of variables"):
        found.plot()
    with pytest.raises(ModelError, match=r"no variable 'tensoin'; did you mean 'tension'"):
        found.plot("tensoin")
    with pytest.raises(ModelError, match=r"found no result to draw, expected those of a model over time"):
        study(lambda a: a, over={"a": [1, 2]}).plot("a")
