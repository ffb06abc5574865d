"""Collocation schemes: exact on polynomials, and converging with the order that theory gives."""

import numpy as np
import pytest

from gantrytau import Fixed, Model, ModelError, Parameter, Real, der
from gantrytau_optimica import Optimization, optimize
from gantrytau_optimica.transcription.scheme import collocation

CASES = [(scheme, points) for scheme in ("radau", "gauss") for points in range(1, 6)]


@pytest.mark.parametrize(("scheme", "points"), CASES)
def test_quadrature_is_exact_up_to_its_degree(scheme, points):
    found = collocation(scheme, points)
    highest = 2 * points - (2 if scheme == "radau" else 1)
    for degree in range(highest + 1):
        assert found.weights @ found.points**degree == pytest.approx(1 / (degree + 1), rel=1e-12)
    beyond = highest + 1
    assert abs(found.weights @ found.points**beyond - 1 / (beyond + 1)) > 1e-8


@pytest.mark.parametrize(("scheme", "points"), CASES)
def test_differentiation_and_end_value_are_exact_on_polynomials(scheme, points):
    found = collocation(scheme, points)
    for degree in range(points + 1):
        slopes = degree * found.points ** max(degree - 1, 0)
        np.testing.assert_allclose(found.nodes**degree @ found.differentiation, slopes, atol=1e-11)
        assert found.nodes**degree @ found.end == pytest.approx(1.0, abs=1e-11)


def test_radau_points_end_with_the_element():
    assert collocation("radau", 3).points[-1] == 1.0
    np.testing.assert_allclose(collocation("radau", 2).points, [1 / 3, 1], rtol=1e-12)
    np.testing.assert_allclose(
        collocation("gauss", 2).points, 0.5 + np.array([-1, 1]) / np.sqrt(12), rtol=1e-12
    )


class Decay(Model):
    """x' = -x, x = exp(-t)."""

    rate = Parameter(1.0, unit="1/s", description="rate of decay")
    x = Real(unit="1", description="amount", start=1.0, fixed=True)

    def equations(self):
        yield der(self.x) == -self.rate * self.x


class Decaying(Optimization):
    """Nothing to choose but the trajectory itself: the transcription acts as an integrator."""

    decay = Decay(x=Fixed(1.0))
    final_time = 2.0


@pytest.mark.parametrize(("scheme", "points"), [case for case in CASES if case[1] <= 4])
def test_the_end_value_converges_with_the_order_of_the_scheme(scheme, points):
    """Hairer and Wanner, Solving ODEs II, table 5.13: order 2 k of Gauss, 2 k - 1 of Radau at the borders."""
    fine = {1: 128, 2: 32, 3: 16, 4: 8}[points]
    errors = []
    for elements in (fine // 2, fine):
        optimum = optimize(Decaying, elements=elements, points=points, scheme=scheme, tolerance=1e-13)
        errors.append(abs(optimum.final("decay.x") - np.exp(-2.0)))
    order = np.log2(errors[0] / errors[1])
    assert order == pytest.approx(2 * points - (scheme == "radau"), abs=0.2)


def test_five_points_reach_rounding():
    for scheme in ("radau", "gauss"):
        optimum = optimize(Decaying, elements=20, points=5, scheme=scheme, tolerance=1e-13)
        assert optimum.final("decay.x") == pytest.approx(np.exp(-2.0), abs=1e-12)


@pytest.mark.parametrize(
    ("policy", "words"),
    [
        (dict(scheme="foo"), "scheme='foo': expected one of radau, gauss"),
        (dict(points=99), "points=99: expected a whole number from 1 to 9"),
        (dict(points=2.5), "points=2.5"),
        (dict(points=True), "points=True"),
        (dict(elements=0), "elements=0: expected a whole number of at least 1"),
        (dict(elements=10.0), "elements=10.0"),
        (dict(tolerance=0.0), "tolerance=0.0: expected a number between 0 and 1"),
        (dict(max_iterations=0), "max_iterations=0: expected a whole number of at least 1"),
        (dict(max_time=-1.0), "max_time=-1.0: expected seconds above 0"),
        (dict(progress=3), "progress=3: expected a function of (iteration, objective)"),
    ],
)
def test_a_policy_that_cannot_be_is_refused(policy, words):
    with pytest.raises(ModelError) as caught:
        optimize(Decaying, **policy)
    assert words in str(caught.value)
