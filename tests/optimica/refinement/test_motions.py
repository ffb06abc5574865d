"""Answers on meshes on which they are no motion of the model, solved again on finer ones."""

import numpy as np
from scipy.linalg import expm

from gantrytau_optimica import optimize
from gantrytau_optimica.refinement.motions import exponentials
from tests.optimica.answers.test_playback import Caught


class LongCaught(Caught):
    """What is off by 1e-3 on 20 elements runs away by exp(40) until the end."""

    final_time = 5.0


def test_what_a_plant_runs_away_from_is_solved_on_finer_elements():
    optimum = optimize(LongCaught, elements=20)
    assert optimum.breaks.size + 1 > 20
    # 2 a / (1 - exp(-2 a T)) is 16; on 20 elements 15.93 as the optimiser gains by what these miss
    assert abs(optimum.objective - 16.0) < 1e-5


class ShortCaught(Caught):
    """Errors grow by exp(8) only."""

    final_time = 1.0


def test_a_coarse_mesh_that_leads_to_the_end_is_kept():
    assert optimize(ShortCaught, elements=20).breaks.size == 19


def test_exponentials_of_many_matrices_are_those_of_each():
    matrices = np.random.default_rng(0).normal(size=(4, 3, 5, 5))
    matrices[0], matrices[1], matrices[2] = 0.0, 1e-9 * matrices[1], 10.0 * matrices[2]
    for one, found in zip(matrices.reshape(-1, 5, 5), exponentials(matrices).reshape(-1, 5, 5), strict=True):
        expected = expm(one)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11 * np.abs(expected).max())
