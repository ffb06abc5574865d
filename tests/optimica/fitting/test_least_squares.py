"""Truncated Gauss-Newton: against minima known in closed form."""

import numpy as np
import pytest

from gantrytau_optimica.fitting.least_squares import Prior, least_squares

START = np.array([1.0, 0.0])
J = np.array([[1.0, 1.0], [2.0, 2.0], [1e-6, -1e-6]])


def residuals(x):
    """x0 + x1 is 3; x0 - x1 is hardly told."""
    return J @ x - [3.0, 6.0, 0.0]


def fitted(**policy):
    return least_squares(residuals, lambda x: J, START, **policy)


def test_directions_that_data_do_not_determine_are_left_alone():
    truncated = fitted(smallest=1e-3)
    assert truncated.x == pytest.approx([2.0, 1.0])  # the shortest way to x0 + x1 = 3
    assert truncated.rank == 1
    assert truncated.undetermined(["a", "b"]) == ("a", "b")
    assert fitted().x == pytest.approx([1.5, 1.5])
    assert fitted(scale=np.array([0.0, 1.0])).x == pytest.approx([1.0, 2.0], abs=1e-9)
    assert fitted(along=np.array([[0.0, 1.0]])).x == pytest.approx([1.0, 2.0], abs=1e-9)


def test_a_prior_counts_as_rows_and_the_inverse_is_that_of_all_rows():
    wide, scale = 1e-2, np.array([1.0, 5.0])
    found = fitted(scale=scale, priors=[Prior([0], [7.0], [wide])])
    rows = np.vstack([J, [[wide, 0.0]]])
    right = np.array([3.0, 6.0, 0.0, 7.0 * wide])
    assert found.x == pytest.approx(np.linalg.lstsq(rows, right, rcond=None)[0], rel=1e-9)
    assert found.inverse == pytest.approx(np.linalg.inv(rows.T @ rows), rel=1e-6)
    assert found.residuals == pytest.approx(rows @ found.x - right, abs=1e-12)


def test_another_solvers_minimum_is_recorded_where_it_is():
    found = least_squares(residuals, lambda x: J, np.array([2.0, 1.0]), smallest=1e-3, steps=0)
    assert found.x == pytest.approx([2.0, 1.0], abs=0)
    assert (found.rank, found.iterations) == (1, 0)


def test_steps_are_shortened_where_the_whole_overshoots():
    # arctan: Newton from 3 diverges, as its first step leads to -9.5
    found = least_squares(np.arctan, lambda x: np.diag(1 / (1 + x * x)), np.array([3.0]))
    assert found.success
    assert found.x[0] == pytest.approx(0.0, abs=1e-10)


def test_residuals_that_are_not_finite_end_without_success():
    assert not least_squares(lambda x: x * np.nan, lambda x: np.eye(1), np.array([1.0])).success
