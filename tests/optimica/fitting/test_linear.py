"""Linear least squares in columns of unit length: units of parameters change nothing."""

import numpy as np
import pytest

from gantrytau_optimica.fitting.linear import inverse_root, linear_least_squares

UNITS = np.array([1e-9, 1.0, 1e9])


@pytest.fixture
def columns():
    return np.random.default_rng(0).standard_normal((20, 3))


def test_units_of_parameters_change_nothing(columns):
    p = np.array([1.0, -2.0, 3.0])
    # the condition of the columns is below 3, so that rounding leaves 1e-15
    np.testing.assert_allclose(linear_least_squares(columns * UNITS, columns @ p) * UNITS, p, rtol=1e-13)
    W = inverse_root(columns * UNITS) * UNITS[:, None]
    np.testing.assert_allclose(W @ W.T, np.linalg.inv(columns.T @ columns), rtol=1e-12, atol=1e-16)


def test_a_column_without_influence_stays_at_zero(columns):
    columns[:, 1] = 0.0
    found = linear_least_squares(columns, columns @ np.ones(3))
    np.testing.assert_allclose(found, [1.0, 0.0, 1.0], rtol=1e-13, atol=0)


def test_dependent_columns_share_by_least_norm(columns):
    columns[:, 2] = 10 * columns[:, 0]
    found = linear_least_squares(columns, columns[:, 0])
    # scaled columns are alike, so that each takes a half
    np.testing.assert_allclose(found, [0.5, 0.0, 0.05], rtol=1e-12, atol=1e-14)
