"""Study's coordinates, the tracker and the stored start system."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gantrytau import SolveError
from gantrytau.kinematics.modes import study_start
from gantrytau.kinematics.modes.study_coordinates import STUDY, orthonormal, pose, quadrics
from gantrytau.kinematics.modes.study_start import distinct, solve_by_monodromy, start_system
from gantrytau.kinematics.modes.study_tracking import Homotopy, inverted, regularity, solved, track

RNG = np.random.default_rng(0)
ROUNDING = 1e-13  # of sums of some fifty products of size 1 to 10


def coordinates(r: np.ndarray, R: Rotation) -> np.ndarray:
    """z = (x, y) with y = r x."""
    x = R.as_quat(scalar_first=True)
    y = np.concatenate([[-r @ x[1:]], x[0] * r + np.cross(r, x[1:])])
    return np.concatenate([x, y])


def test_pose_undoes_study_coordinates_whatever_their_factor():
    r, R = RNG.normal(size=(5, 3)), Rotation.random(5, rng=RNG)
    z = np.array([coordinates(*one) for one in zip(r, R, strict=True)])
    assert np.abs(np.einsum("ki,ij,kj->k", z, STUDY, z)).max() < ROUNDING
    found_r, found_R = pose((2.0 - 3.0j) * z)
    np.testing.assert_allclose(found_r, r, atol=ROUNDING)
    np.testing.assert_allclose(found_R, R.as_matrix(), atol=ROUNDING)


def test_quadrics_are_squares_of_lengths():
    base, platform, lengths = RNG.normal(size=(6, 3)), RNG.normal(size=(6, 3)), RNG.uniform(1, 2, 6)
    r, R = RNG.normal(size=3), Rotation.random(rng=RNG)
    z = coordinates(r, R)
    expected = ((r + R.apply(platform) - base) ** 2).sum(1) - lengths**2
    np.testing.assert_allclose(z @ quadrics(base, platform, lengths) @ z, expected, atol=ROUNDING)


def test_quadrics_hold_for_complex_poses():
    base, platform = RNG.normal(size=(6, 3)), RNG.normal(size=(6, 3))
    z = RNG.normal(size=8) + 1j * RNG.normal(size=8)
    x, y = z[:4], z[4:]
    z[4:] = y - (x @ y) / (x @ x) * x  # onto Study's quadric
    (r,), (R,) = pose(z[None])
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-11)  # entries are of size 1 to 10
    expected = ((r + platform @ R.T - base) ** 2).sum(1) * (x @ x)
    np.testing.assert_allclose(z @ quadrics(base, platform, np.zeros(6)) @ z, expected, atol=1e-11)


def test_orthonormal_quadrics_have_the_same_roots():
    start = start_system()
    mixed = (RNG.normal(size=(6, 6)) @ start.forms[:6].reshape(6, 64)).reshape(6, 8, 8)
    found = orthonormal(mixed)
    rows = found.reshape(6, 64)
    np.testing.assert_allclose(rows @ rows.conj().T, np.eye(6), atol=ROUNDING)
    assert np.abs(np.einsum("ki,rij,kj->kr", start.roots, found, start.roots)).max() < 1e-11


def test_stored_roots_are_forty_regular_ones():
    forms, roots = start_system()
    assert roots.shape == (40, 8)
    assert distinct(roots).all()
    assert np.abs(np.einsum("ki,rij,kj->kr", roots, forms, roots)).max() < ROUNDING
    assert regularity(forms, roots).min() > 1e-7
    np.testing.assert_array_equal(forms[6], STUDY)


def test_monodromy_finds_the_stored_roots_again():
    stored, found = start_system(), solve_by_monodromy()
    np.testing.assert_allclose(found.forms, stored.forms, atol=1e-10)
    assert len(found.roots) == 40
    assert not distinct(np.concatenate([stored.roots, found.roots]), 1e-5)[40:].any()


def test_monodromy_that_finds_too_few_says_so(monkeypatch):
    monkeypatch.setattr(study_start, "MOST_LOOPS", 1)
    with pytest.raises(SolveError, match=r"found 2 modes in 1 loops, expected 40; take another seed"):
        solve_by_monodromy()


def test_another_hexapod_for_a_start_has_forty_modes_too():
    assert len(solve_by_monodromy(seed=5).roots) == 40


def test_there_and_back_again_is_where_it_began():
    start, other = start_system(), study_start._somewhere(np.random.default_rng(8))
    there = track(Homotopy(start.forms, other), start.roots)
    back = track(Homotopy(other, start.forms), there.z)
    assert (there.t == 1).all()
    assert (back.t == 1).all()
    alike = np.abs(np.einsum("kc,kc->k", back.z.conj(), start.roots))
    assert np.abs(alike - 1).max() < 1e-10  # the correction is quadratic: below 1e-6 before the last step


def test_systems_with_singular_ones_among_them_are_solved_by_least_squares():
    matrices = np.stack([np.diag([1.0, 2.0]), np.diag([1.0, 0.0])])
    np.testing.assert_allclose(inverted(matrices), [np.diag([1, 0.5]), np.diag([1, 0])], atol=1e-15)
    np.testing.assert_allclose(solved(matrices, np.ones((2, 2, 1)))[:, :, 0], [[1, 0.5], [1, 0]], atol=1e-15)
