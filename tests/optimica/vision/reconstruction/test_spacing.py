"""Which poses lie on a line along the guideways, and how far apart."""

import numpy as np
import pytest

from gantrytau_optimica.vision.reconstruction.spacing import spacing_of


def test_lines_are_poses_whose_carts_differ_by_one_shift():
    q = np.array([[0.0, 0.1, 0.2], [0.5, 0.1, 0.2], [0.3, 0.4, 0.5], [1.0, 0.6, 0.7], [9.0, 1.0, 1.0]])
    found = spacing_of(q, 5)
    assert found.line.tolist() == [0, 1, 0, 1, -1]  # the last is alone
    assert found.lines == 2
    assert np.isnan(found.x[4])
    assert found.x[2] - found.x[0] == pytest.approx(0.3)
    assert found.x[3] - found.x[1] == pytest.approx(0.5)


def test_distances_are_one_line_and_unknown_ones_are_left_out():
    found = spacing_of([0.0, 0.1, np.nan, 0.3], 4)
    assert found.line.tolist() == [0, 0, -1, 0]


def test_places_that_move_along_a_line_move_a_metre_for_each():
    random = np.random.default_rng(1)
    x = random.uniform(0, 1, 12)
    along = np.array([0.6, 0.0, 0.8])
    r = x[:, None] * along * 1.25 + np.repeat(random.standard_normal((2, 3)), 6, axis=0)
    q = x[:, None] + np.repeat(random.standard_normal((2, 3)), 6, axis=0)
    spacing = spacing_of(q, 12)
    assert spacing.displaced(r) == pytest.approx(1.25 * along)
    assert spacing.shares @ r == pytest.approx(1.25 * along)


def test_rows_that_are_left_out_leave_lines_of_two_or_more():
    q = np.arange(6.0)[:, None] + np.repeat([[0, 0.5], [0, 1.0], [0, 2.0]], 2, axis=0)
    spacing = spacing_of(q, 6).select(np.array([0, 1, 2, 4, 5]))
    assert spacing.line.tolist() == [0, 0, -1, 1, 1]
    assert np.isnan(spacing.x[2])


def test_errors_have_the_derivatives_that_are_told():
    random = np.random.default_rng(2)
    x = random.uniform(0, 1, 8)
    r = x[:, None] * [1.0, 0.1, 0.0] + 1e-3 * random.standard_normal((8, 3))
    spacing = spacing_of(x, 8)
    middles, offsets = spacing.middles(r), np.array([-x.mean()])
    missed, by_place, by_offset = spacing.rows(r, middles, offsets)
    step = 1e-7
    along = np.array([1.0, 0.1, 0.0]) / np.hypot(1, 0.1)
    moved, _, _ = spacing.rows(r + step * along, middles, offsets)
    assert (moved - missed) / step == pytest.approx(by_place @ along, rel=1e-3)
    moved, _, _ = spacing.rows(r, middles, offsets + step)
    assert (moved - missed) / step == pytest.approx(by_offset[:, 0], rel=1e-6)
