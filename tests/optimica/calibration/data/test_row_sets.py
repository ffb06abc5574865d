import numpy as np

from gantrytau_optimica.calibration.data.row_sets import rows_of


def test_rows_are_each_once_and_in_order():
    random = np.random.default_rng(0)
    parts, without = random.integers(0, 50, (2, 30)), random.integers(0, 80, 10)
    np.testing.assert_array_equal(rows_of(*parts, without=without), np.setdiff1d(np.union1d(*parts), without))


def test_nothing_is_left_of_nothing():
    assert rows_of().size == rows_of([], without=[]).size == rows_of([3], without=[3]).size == 0
