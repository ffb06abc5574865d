"""Collocation schemes: exact on polynomials, and converging with the order that theory gives."""

from typing import get_args

import numpy as np
import pytest

from gantrytau import Fixed, Input, Model, Parameter, Real, der
from gantrytau_optimica import Optimization, optimize
from gantrytau_optimica.answers.archive.optimum_files import load_optimum
from gantrytau_optimica.studies.sensitivities import sensitivities
from gantrytau_optimica.transcription.scheme import Collocation
from gantrytau_optimica.transcription.transcribe import METHODS, Scheme
from tests.optimica.problems import FastestMass
from tests.optimica.studies.test_sensitivities import Carried

# of the order 2 k, by an end or two that are given
LOST: dict[Scheme, int] = {"gauss": 0, "radau": 1, "lobatto": 2}
CASES = [(scheme, k) for scheme in LOST for k in range(METHODS[scheme].least, 6)]


def collocation(scheme: str, points: int) -> Collocation:
    return METHODS[scheme].scheme(points)


def test_each_word_names_a_method():
    assert tuple(METHODS) == get_args(Scheme)
    assert [word for word in METHODS if not collocation(word, 2).refinable] == ["shooting"]


@pytest.mark.parametrize(("scheme", "points"), CASES)
def test_quadrature_is_exact_up_to_its_degree(scheme, points):
    found = collocation(scheme, points)
    highest = 2 * points - 1 - LOST[scheme]
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


def test_points_of_the_literature():
    assert collocation("radau", 3).points[-1] == 1.0
    np.testing.assert_allclose(collocation("radau", 2).points, [1 / 3, 1], rtol=1e-12)
    np.testing.assert_allclose(
        collocation("gauss", 2).points, 0.5 + np.array([-1, 1]) / np.sqrt(12), rtol=1e-12
    )
    np.testing.assert_allclose(collocation("lobatto", 3).weights, np.array([1, 4, 1]) / 6)  # Simpson's rule
    outer = np.sqrt(3 / 7) / 2
    np.testing.assert_allclose(collocation("lobatto", 5).points, [0, 0.5 - outer, 0.5, 0.5 + outer, 1])


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
    """Hairer and Wanner, Solving ODEs II, table 5.13: order 2 k of Gauss, 2 k - 1 of Radau, 2 k - 2 of Lobatto."""
    fine = {1: 128, 2: 32, 3: 16, 4: 8}[points]
    errors = []
    for elements in (fine // 2, fine):
        optimum = optimize(Decaying, elements=elements, points=points, scheme=scheme, tolerance=1e-13)
        errors.append(abs(optimum.final("decay.x") - np.exp(-2.0)))
    order = np.log2(errors[0] / errors[1])
    assert order == pytest.approx(2 * points - LOST[scheme], abs=0.2)


def test_five_points_reach_rounding():
    for scheme in LOST:
        optimum = optimize(Decaying, elements=20, points=5, scheme=scheme, tolerance=1e-13)
        assert optimum.final("decay.x") == pytest.approx(np.exp(-2.0), abs=1e-12)


class Regulator(Optimization):
    """x' = u from 1, least integral of x^2 + u^2 over 2 s: x = cosh(2 - t) / cosh(2), costs tanh(2)."""

    class Integrator(Model):
        x = Real(start=1.0, fixed=True)
        u = Input()
        second = Parameter(1.0, unit="s")

        def equations(self):
            yield der(self.x) == self.u / self.second

    plant = Integrator()
    final_time = 2.0

    def integrand(self):
        return self.plant.x**2 + self.plant.u**2


@pytest.mark.parametrize("points", [2, 3])  # trapezoidal rule, Hermite and Simpson
def test_by_lobatto_costs_converge_with_its_order_and_inputs_with_half_of_it(points):
    costs, inputs = [], []
    for elements in (8, 16, 32):
        found = optimize(Regulator, scheme="lobatto", points=points, elements=elements, tolerance=1e-12)
        costs.append(found.objective - np.tanh(2.0))
        inputs.append(found["plant.u"][0] + np.tanh(2.0))
    for errors, order in ((costs, 2 * points - 2), (inputs, points - 1)):
        orders = np.log2(np.abs(np.array(errors[:-1]) / errors[1:]))
        np.testing.assert_allclose(orders, order, atol=0.2)


def test_an_optimum_by_lobatto_is_read_refined_and_saved(tmp_path):
    found = optimize(FastestMass, scheme="lobatto", elements=11)
    assert np.all(np.diff(found.time) > 0)  # a border between elements is one time, though inputs jump there
    assert found.time.size == 1 + 2 * 11
    assert np.max(np.abs(found["mass.u"])) < 1 + 1e-6
    fine = optimize(FastestMass, scheme="lobatto", elements=11, refine=1e-6, guess=found)
    assert fine.refinement.reached
    assert fine.final_time == pytest.approx(2.0, abs=1e-6)
    copy = load_optimum(fine.save(tmp_path / "a.optimum"))
    times = np.linspace(0.0, fine.final_time, 33)
    for name in ("mass.x", "mass.u"):
        np.testing.assert_allclose(copy.signal(name)(times), fine.signal(name)(times), atol=1e-9)
    moving = optimize(FastestMass, scheme="lobatto", elements=4, lengths="free")
    assert moving.final_time == pytest.approx(2.0, abs=1e-6)


def test_multipliers_of_conditions_by_lobatto_are_sensitivities():
    found = optimize(Carried, scheme="lobatto", elements=20, tolerance=1e-12)
    by = sensitivities(found, ["way", "mass", "force"])
    # T = 2 sqrt(way mass / force)
    assert by.objective["way"] == pytest.approx(found.final_time / (2 * 3.0), rel=1e-6)
