"""Closure equations: their Jacobians, and a few rows that stand for all poses."""

import numpy as np
import pytest

from gantrytau.kinematics.rotations import of_vector, of_vectors
from gantrytau_optimica.calibration.links.closure import Chain, condense
from gantrytau_optimica.calibration.links.guideway_points import between, slope, straight
from gantrytau_optimica.calibration.links.linear_start import linear_start

RNG = np.random.default_rng(0)
N = 5000  # three blocks of rows
TURNS = of_vectors(RNG.normal(0, 0.5, (N, 3)))


def chain(kind):
    q, r = RNG.uniform(0, 1, N), RNG.uniform(-1, 1, (N, 3)) + np.array([2.0, 0.0, 1.0])
    R = TURNS if "plate" in kind else None
    points = RNG.uniform(-1, 1, (N, 3)) if "points" in kind else None
    turned = of_vector(np.array([0.3, -0.2, 0.9])) if "points" in kind else None
    return Chain(kind, 0, q, r, R, points, turned=turned)


KINDS = ["line", "line plate", "points", "points plate"]


@pytest.mark.parametrize("kind", KINDS)
def test_jacobians_are_the_derivatives(kind):
    one = chain(kind)
    p = RNG.normal(size=one.size)
    step = 1e-6
    difference = [(one.error(p + step * e) - one.error(p - step * e)) / (2 * step) for e in np.eye(one.size)]
    # central differences of a polynomial of the fourth degree: step^2 and rounding / step
    assert one.jacobian(p) == pytest.approx(np.transpose(difference), abs=1e-7)


@pytest.mark.parametrize("kind", ["line", "line plate"])
@pytest.mark.parametrize("weighted", [False, True])
def test_few_rows_have_the_squares_of_all_poses(kind, weighted):
    one = chain(kind)
    weights = RNG.uniform(0, 1, N) if weighted else None
    few = condense(one, weights)
    p = RNG.normal(size=one.size)
    w = 1.0 if weights is None else weights
    e, J = w * one.error(p), one.jacobian(p) * (1.0 if weights is None else weights[:, None])
    f, K = few.error(p), few.jacobian(p)
    assert len(f) <= 31
    assert f @ f == pytest.approx(e @ e, rel=1e-12)
    assert K.T @ K == pytest.approx(J.T @ J, rel=1e-10, abs=1e-8 * np.abs(J.T @ J).max())
    assert K.T @ f == pytest.approx(J.T @ e, rel=1e-10, abs=1e-10 * np.abs(J.T @ e).max())


@pytest.mark.parametrize("kind", ["line", "line plate"])
def test_the_linear_start_is_exact_without_noise(kind):
    one = chain(kind)
    true = np.array([2.05, -1.8, 3.5, 0.2, 0.999, -0.03, 0.01, 0.1, -0.05, 0.12])[: one.size]
    # positions at the end of a link of this length, whatever its direction
    u = RNG.normal(size=(N, 3))
    u *= true[0] / np.linalg.norm(u, axis=1, keepdims=True)
    r = true[1:4] + one.q[:, None] * true[4:7] + u
    r -= 0.0 if one.R is None else one.R @ true[7:10]
    assert linear_start(Chain(kind, 0, one.q, r, one.R)) == pytest.approx(true, abs=1e-9)


def test_between_measured_points_the_way_is_straight():
    q = np.array([0.0, 0.5, 1.0])
    rail = np.column_stack([q, 2 * q, q**2, 0 * q])
    at = np.array([0.25, 0.5, 0.75, 1.5, -0.5])
    assert between(rail, at)[:, 0] == pytest.approx(2 * at)
    assert between(rail, at)[:, 1] == pytest.approx([0.125, 0.25, 0.625, 1.75, -0.25])
    assert slope(rail, at)[:, 1] == pytest.approx([0.5, 0.5, 1.5, 1.5, 0.5])
    place, along = straight(rail)
    assert along == pytest.approx([2.0, 1.0, 0.0])
    assert place == pytest.approx([0.0, -1 / 12, 0.0])
