"""Least squares by Schur complements against dense ones."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from gantrytau_optimica.fitting.blocks import BlockRows, minimised, reduced

BLOCKS, OWN, SHARED, ROWS = 6, 2, 3, 5


def curves(seed=1):
    """Exponentials of own amplitude and offset, and shared rates, as errors of x = (shared, own...)."""
    random = np.random.default_rng(seed)
    t = np.linspace(0.1, 1.0, ROWS)
    true = random.uniform(0.5, 1.5, (BLOCKS, OWN))
    rates = np.array([0.7, 1.3, 0.4])

    def model(shared, own):
        curve = np.exp(-shared[0] * t) + shared[1] * t**2 + np.sin(shared[2] * t)
        return own[:, :1] * curve + own[:, 1:]

    data = model(rates, true) + 1e-3 * random.standard_normal((BLOCKS, ROWS))

    def rows(state):
        shared, own = state
        error = model(shared, own) - data
        curve = np.exp(-shared[0] * t) + shared[1] * t**2 + np.sin(shared[2] * t)
        by_own = np.stack([np.tile(curve, (BLOCKS, 1)), np.ones((BLOCKS, ROWS))], axis=-1)
        slopes = np.stack([-t * np.exp(-shared[0] * t), t**2, t * np.cos(shared[2] * t)], axis=-1)
        by_shared = own[:, :1, None] * slopes
        prior = np.array([0.01 * (shared[0] - 0.7)])
        return BlockRows(error, by_own, by_shared, prior, 0.01 * np.eye(3)[:1])

    return rows


def moved(state, shared, own):
    return state[0] + shared, state[1] + own


START = (np.array([1.0, 1.0, 0.8]), np.ones((BLOCKS, OWN)))


def test_the_minimum_is_that_of_dense_least_squares():
    rows = curves()
    (shared, own), at, steps = minimised(START, rows, moved)

    def errors(x):
        found = rows((x[:SHARED], x[SHARED:].reshape(BLOCKS, OWN)))
        return np.concatenate([found.error.ravel(), found.error_0])

    start = np.concatenate([START[0], START[1].ravel()])
    dense = least_squares(errors, start, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    assert 2 * dense.cost == pytest.approx(at.cost, rel=1e-8)
    assert np.allclose(dense.x[:SHARED], shared, atol=1e-5)
    assert np.allclose(dense.x[SHARED:], own.ravel(), atol=1e-5)
    assert steps < 20


def test_covariances_are_those_of_the_whole_normal_equations():
    rows = curves()
    _, at, _ = minimised(START, rows, moved)
    whole = np.zeros((BLOCKS * ROWS + 1, SHARED + BLOCKS * OWN))
    for b in range(BLOCKS):
        part = slice(b * ROWS, (b + 1) * ROWS)
        whole[part, :SHARED] = at.by_shared[b]
        whole[part, SHARED + b * OWN : SHARED + (b + 1) * OWN] = at.by_own[b]
    whole[-1, :SHARED] = at.by_shared_0
    covariance = np.linalg.inv(whole.T @ whole)
    found = reduced(at)
    shared = np.linalg.inv(found.complement)
    assert np.allclose(shared, covariance[:SHARED, :SHARED], rtol=1e-6)
    last = found.own[-1] + found.coupling[-1] @ shared @ found.coupling[-1].T
    assert np.allclose(last, covariance[-OWN:, -OWN:], rtol=1e-6)


def test_a_block_that_does_not_tell_its_own_ends_where_it_began():
    rows = curves()

    def blind(state):
        found = rows(state)
        return BlockRows(found.error, 0 * found.by_own, found.by_shared, found.error_0, found.by_shared_0)

    state, _, _ = minimised(START, blind, moved)
    assert np.array_equal(state[1], START[1])
