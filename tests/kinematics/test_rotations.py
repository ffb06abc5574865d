"""Rotation vectors and matrices: there and back, against SciPy, and from one direction to another."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gantrytau.kinematics.rotations import of_vector, of_vectors, rotation_vector, told_vector, turning


def test_rotation_vectors_come_back():
    vectors = np.array([[0.0, 0.0, 0.0], [1e-9, 0.0, 0.0], [0.3, -0.2, 0.1], [2.0, 1.0, -1.5]])
    np.testing.assert_allclose(rotation_vector(of_vectors(vectors)), vectors, atol=1e-14)
    np.testing.assert_allclose(of_vectors(vectors), Rotation.from_rotvec(vectors).as_matrix(), atol=1e-15)


def test_rotation_vectors_go_back_and_forth():
    w = np.array([[0.3, -0.2, 0.9], [1e-9, 0, 0], [0, np.pi, 0], [0, 0, 0], [2.0, 1.0, -2.0]])
    R = of_vectors(w)
    assert rotation_vector(R) == pytest.approx(w, abs=1e-14)
    near = (np.pi - 10.0 ** -np.arange(1, 15)[:, None]) * [0.6, 0.0, -0.8]
    near[:, 2:] *= [[1.0], [-1.0]] * 7
    assert rotation_vector(of_vectors(near)) == pytest.approx(near, abs=1e-14)
    assert R[0] == pytest.approx(of_vector(w[0]))


def test_a_vector_that_is_told_has_one_sign_near_half_a_turn():
    for w in (
        [0.0, -np.pi + 1e-3, 2e-3],
        [0.0, np.pi + 1e-3, 2e-3],
        [1.0, -2.0, 0.5],
        [0.0, 0.0, 0.0],
        [-3.0, 0.1, 0.9],
    ):
        told = told_vector(of_vector(np.array(w)))
        assert of_vector(told) == pytest.approx(of_vector(np.array(w)), abs=1e-9)
        # either side of half a turn
        assert np.linalg.norm(told) < np.pi - 0.05 or told[np.argmax(np.abs(told))] > 0


def test_one_direction_is_turned_into_another():
    for a, b in np.random.default_rng(0).normal(size=(5, 2, 3)):
        assert turning(a, b) @ a / np.linalg.norm(a) == pytest.approx(b / np.linalg.norm(b))
    a = np.array([1.0, 2.0, 3.0])
    assert turning(a, -a) @ a == pytest.approx(-a)
