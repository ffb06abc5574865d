"""Steps of the start: elimination of large sparse systems beside singular values."""

import numpy as np
import pytest
import scipy.sparse as sp

from gantrytau.compiler.start.newton import _Steps


@pytest.mark.parametrize("redundant", [False, True])
@pytest.mark.parametrize("damping", [0.0, 1e-8, 1.0])
@pytest.mark.parametrize("shape", [(90, 60), (60, 90), (60, 60)])
def test_sparse_steps_are_those_of_singular_values(shape, damping, redundant):
    random = np.random.default_rng(0)
    matrix = sp.random_array(shape, density=0.05, rng=random).toarray()
    matrix[range(60), range(60)] += 1.0
    matrix[40:, :40] = matrix[:40, 40:] = 0.0  # two parts that share no unknown
    if redundant:
        matrix[3] = matrix[4]
    target = matrix @ random.normal(size=shape[1])
    left, sizes, right = np.linalg.svd(matrix, full_matrices=False)
    shares = np.where(sizes > 1e-11 * sizes[0], sizes / (sizes**2 + damping + 1e-300), 0.0)
    expected = right.T @ (shares * (left.T @ target))
    found = _Steps(sp.csr_array(matrix), target).damped(damping)
    assert found == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())
