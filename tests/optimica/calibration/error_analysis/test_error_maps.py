"""Error maps: principal axes that are known, what is systematic, figures."""

import matplotlib
import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau.kinematics.rotations import turned
from gantrytau_optimica.calibration.data.findings import CalibrationError
from gantrytau_optimica.calibration.error_analysis.error_maps import error_map
from tests.optimica.refusals import refused

matplotlib.use("Agg")

DEVIATIONS = np.array([90e-6, 40e-6, 15e-6])  # m
AXES = turned(np.eye(3)[None], np.array([[0.4, -0.7, 0.2]]))[0]


def places(count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-0.5, 0.5, (count, 3))


def ellipsoid(seed: int, count: int = 500) -> np.ndarray:
    return (np.random.default_rng(seed).standard_normal((count, 3)) * DEVIATIONS) @ AXES.T


def test_the_axes_are_eigenvectors_of_the_sum_of_squares():
    errors = ellipsoid(0)
    found = error_map(places(500), errors)
    square = errors.T @ errors  # the sum, not divided by the number of poses
    assert square @ found.axes == pytest.approx(found.axes * found.eigenvalues, abs=1e-18)
    assert found.axes.T @ found.axes == pytest.approx(
        np.eye(3), abs=1e-12
    )  # the printed W is not: up to 0.096
    assert np.linalg.det(found.axes) == pytest.approx(1.0)
    assert np.all(np.diff(found.eigenvalues) < 0)
    assert found.eigenvalues.sum() == pytest.approx(np.sum(found.size**2))


def test_deviations_are_found_within_their_standard_errors():
    maps = [error_map(places(500), ellipsoid(seed)) for seed in range(200)]
    ratio = np.array([m.deviations / DEVIATIONS for m in maps])
    assert (
        np.abs(ratio.mean(axis=0) - 1).max() < 5 / np.sqrt(2 * 500 * 200) + 2 / 500
    )  # and the bias of order 1 / N


def test_lengths_and_bias():
    errors = np.tile([3e-5, 4e-5, 0.0], (10, 1))
    found = error_map(places(10), errors)
    assert found.mean == pytest.approx(5e-5)
    assert found.quantile(0.95) == pytest.approx(5e-5)
    assert found.bias == pytest.approx([3e-5, 4e-5, 0.0])
    assert found.axes[:, 0] == pytest.approx([0.6, 0.8, 0.0])


@pytest.mark.parametrize("noise", [0.0, 20e-6, 100e-6])
def test_the_systematic_part_is_that_of_the_smooth_field(noise):
    r = places(4000)
    field = 1e-4 * np.stack([r[:, 0], r[:, 1] * r[:, 2], np.sin(2 * r[:, 0])], axis=1)
    errors = field + noise * np.random.default_rng(1).standard_normal(r.shape)
    true = np.sum(field**2) / np.sum(errors**2)
    assert error_map(r, errors).systematic == pytest.approx(true, abs=0.03)  # neighbours are some 4 cm away


def test_noise_is_not_systematic():
    assert error_map(places(4000), ellipsoid(0, 4000)).systematic < 0.03


def test_poses_that_were_measured_many_times_at_one_place():
    assert error_map(np.zeros((20, 3)), np.tile([1e-5, 0, 0], (20, 1))).systematic == pytest.approx(1.0)


def test_figures_are_written(tmp_path):
    found = error_map(places(200), ellipsoid(0, 200))
    found.plot(layers=3, file=tmp_path / "map.png")
    found.plot("xz", file=tmp_path / "one.png")
    found.plot_sizes(file=tmp_path / "sizes.png")
    assert all(file.stat().st_size > 5000 for file in tmp_path.iterdir())
    assert len(list(tmp_path.iterdir())) == 3
    assert "% systematic" in str(found)


def test_no_errors_can_be_drawn(tmp_path):
    still = error_map(places(20), np.zeros((20, 3)))
    assert still.systematic == 0.0
    still.plot(file=tmp_path / "still.png")


def test_what_is_wrong_is_refused():
    found = error_map(places(10), places(10))
    with refused("axes"):
        found.plot("xx")
    with refused("layers"):
        found.plot(layers=0)
    with pytest.raises(ModelError, match="10 positions and 9 errors"):
        error_map(places(10), places(9))
    with pytest.raises(ModelError, match=r"r of 10 x 2"):
        error_map(places(10)[:, :2], places(10))
    with pytest.raises(CalibrationError) as caught:
        error_map(places(5), places(5))
    assert caught.value.kind == "too few poses"


def test_rows_that_are_not_finite_are_named():
    errors = places(10)
    errors[[2, 7], 0] = np.nan
    with pytest.raises(CalibrationError, match="found 2 rows that are not finite, the first 2") as caught:
        error_map(places(10), errors)
    assert caught.value.rows.tolist() == [2, 7]
