"""Places beside those of a reference."""

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau.kinematics.rotations import of_vector
from gantrytau_optimica.vision import compare, plot_comparison

REFERENCE = np.random.default_rng(1).uniform([0, -0.5, -0.5], [1.7, 0.5, 0.5], (60, 3))
TURN = of_vector(np.array([0.3, -1.2, 2.0]))


def test_a_motion_is_no_error_and_a_scale_is_if_it_is_not_fitted():
    r = (REFERENCE - [1.0, 2.0, 3.0]) @ TURN.T
    found = compare(r, REFERENCE)
    assert found.mean < 1e-14
    assert found.R == pytest.approx(TURN.T)
    assert found.t == pytest.approx([1.0, 2.0, 3.0])
    larger = compare(1.002 * r, REFERENCE)
    assert larger.mean > 5e-4
    scaled = compare(1.002 * r, REFERENCE, scale=True)
    assert scaled.mean < 1e-14
    assert scaled.scale == pytest.approx(1 / 1.002)


def test_axes_and_border_are_those_of_the_reference():
    away = REFERENCE - REFERENCE.mean(axis=0)
    random = np.random.default_rng(2)
    error = random.standard_normal((60, 3)) * [1e-3, 2e-3, 0.0] * np.linalg.norm(away, axis=1)[:, None]
    found = compare((REFERENCE + error) @ TURN.T, REFERENCE)
    assert found.axes[1] > 1.5 * found.axes[0]
    assert found.axes[2] < 0.3 * found.axes[0]
    assert found.border_ratio < 0.8
    assert found.mean == pytest.approx(np.linalg.norm(error, axis=1).mean(), rel=0.1)


def test_rows_that_are_missing_stay_missing():
    r = REFERENCE.copy()
    r[3] = np.nan
    found = compare(r, REFERENCE)
    assert np.isnan(found.error[3]).all()
    assert np.isfinite(found.error[[2, 4]]).all()
    assert str(found).startswith("59 places: mean")


def test_a_picture_shows_errors_over_places(tmp_path):
    r = REFERENCE + 1e-3 * np.random.default_rng(3).standard_normal((60, 3))
    plot_comparison(compare(r, REFERENCE), file=tmp_path / "error.png")
    assert (tmp_path / "error.png").stat().st_size > 20_000


@pytest.mark.parametrize(
    ("r", "reference", "words"),
    [
        (REFERENCE[:4], REFERENCE[:5], "found reference of 5 x 3, expected 4 x 3 numbers"),
        (REFERENCE[:3], REFERENCE[:3], "found 3 places that both measured, expected at least 4"),
        (np.outer(np.arange(9), [1.0, 2, 3]), np.outer(np.arange(9), [1.0, 2, 3]), "places on one line"),
        (1000 * REFERENCE, REFERENCE, "1e\\+03 times as large as reference, expected both in m; divide mm"),
    ],
)
def test_what_does_not_fit_is_refused_by_name(r, reference, words):
    with pytest.raises(ModelError, match=words):
        compare(r, reference)
