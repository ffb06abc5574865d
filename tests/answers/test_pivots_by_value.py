"""Linear blocks at angles where the pivots that are good around the start vanish: 0, 90, 180 degrees and beside them."""

import math

import casadi as ca
import numpy as np
import pytest

from gantrytau import Input, Model, Real, c_source, cos, sin, translate
from gantrytau_models import FourBar
from tests.answers.test_c_code import ROUNDING, compiled_only, error, load
from tests.answers.test_many_points import Sliding

ANGLES = [n * math.pi / 2 + e for n in (-1, 0, 1, 2) for e in (0.0, 1e-15, -1e-12, 1e-9, 1e-6, 1e-3)]
FOUND = ["der(crank.w)", "loops[0].f"]


@pytest.fixture(scope="module")
def linkage():
    return translate(FourBar())


@pytest.fixture(scope="module")
def falls(linkage):
    return linkage.function(["crank.phi", "crank.w", "torque"], FOUND)


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize("unit", [1.0, 1e9, 1e-6])
def test_a_turned_vector_has_its_length(angle, unit):
    y, z = translate(Sliding(unit=unit)).function(["x"], ["y", "z"])(angle)
    # the inverse of a rotation is its transpose
    expected = [2 * math.cos(angle) - math.sin(angle), 2 * math.sin(angle) + math.cos(angle)]
    np.testing.assert_allclose([float(y) * unit, float(z)], expected, atol=1e-12)


@pytest.mark.parametrize("angle", ANGLES)
def test_a_four_bar_linkage_falls_as_evaluated(linkage, falls, angle):
    expected = linkage.evaluate({"crank.phi": angle, "crank.w": 1.0, "torque": 2.0})
    w, f = falls(angle, 1.0, 2.0)
    assert float(w) == pytest.approx(expected["der(crank.w)"], rel=1e-9)
    np.testing.assert_allclose(np.ravel(f), expected["loops[0].f"], atol=1e-9 * np.abs(f).max())


def test_derivatives_are_those_of_the_branch_that_is_taken(falls):
    for angle in (0.0, 0.3, math.pi):
        jacobian = [float(j) for j in falls.jacobian()(angle, 1.0, 2.0, 0.0, ca.DM.zeros(3))[:3]]
        for place, step in enumerate(np.eye(3) * 1e-5):
            at = np.array([angle, 1.0, 2.0])
            slope = (float(falls(*(at + step))[0]) - float(falls(*(at - step))[0])) / 2e-5
            assert jacobian[place] == pytest.approx(slope, rel=1e-6)  # differences of second order
    many = falls.map(3)(ca.DM([[0.0, 0.3, math.pi]]), ca.DM([[1.0] * 3]), ca.DM([[2.0] * 3]))[0]
    np.testing.assert_array_equal(np.ravel(many), [float(falls(a, 1.0, 2.0)[0]) for a in (0.0, 0.3, math.pi)])


@compiled_only
def test_c_code_chooses_as_well(falls, tmp_path):
    (compiled,) = load(c_source(falls, name="falls", jacobian=True), tmp_path, "falls")
    for angle in (0.0, 0.3, math.pi):
        assert error(compiled(angle, 1.0, 2.0), falls(angle, 1.0, 2.0)) <= ROUNDING


def test_where_nothing_is_determined_there_is_no_number():
    class Lost(Model):
        a = Input(start=0.3)
        x = Real()
        y = Real()

        def equations(self):
            yield cos(self.a) * self.x + sin(self.a) * self.y == 1
            yield sin(self.a) * self.x + cos(self.a) * self.y == 2

    function = translate(Lost()).function(["a"], ["x", "y"])
    assert np.all(np.isnan(function(math.pi / 4)))
    assert np.all(np.isnan(np.array(function.jacobian()(math.pi / 4, 0, 0))))
    np.testing.assert_allclose(np.ravel(function(math.pi / 2)), [2.0, 1.0], atol=1e-12)
