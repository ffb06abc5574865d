"""One rule of shapes: what is given for a quantity has its shape, as NumPy writes it."""

import casadi as ca
import numpy as np
import pytest

from gantrytau import Input, Model, ModelError, Parameter, Real, Start, der, simulate, sin, translate

WIDE = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])


class Shapes(Model):
    """y is what is given for U, whatever the way."""

    U = Input((2, 3), start=0.0)
    u = Input(2, start=0.0)
    P = Parameter(np.zeros((2, 3)))
    X = Real((2, 3), start=np.zeros((2, 3)), fixed=True)
    y = Real((2, 3))
    z = Real(2)

    def equations(self):
        yield der(self.X) == 1.0 * self.U
        yield self.y == self.U + self.P
        yield self.z == 1.0 * self.u


def final(name="y", **given):
    return simulate(Shapes(), stop=1.0, points=2, **given).final(name)


@pytest.mark.parametrize(
    "value",
    [
        WIDE,
        WIDE.tolist(),
        ca.DM(WIDE),
        lambda t: WIDE.tolist(),
        lambda t: ca.DM(WIDE),
        lambda t: np.array([[1.0, 2.0, 3.0 + 0 * t], [4.0, 5.0, 6.0]], dtype=object),
        lambda t: [[t / t, 2.0, 3.0], [4.0, 5.0, 6.0]],
        ([0.0, 1.0], [WIDE, WIDE]),
    ],
)
def test_a_matrix_input_keeps_its_rows(value):
    np.testing.assert_allclose(final(inputs={"U": value}), WIDE, rtol=1e-14)


def test_all_ways_agree_on_rows_and_columns():
    np.testing.assert_array_equal(final(parameters={"P": WIDE}), WIDE)
    np.testing.assert_array_equal(simulate(Shapes(X=Start(WIDE)), stop=1.0, points=2)["X"][0], WIDE)
    dae = translate(Shapes())
    np.testing.assert_array_equal(dae.evaluate({"U": WIDE})["y"], WIDE)
    np.testing.assert_array_equal(dae.evaluate({"der(X)": WIDE})["U"], WIDE)
    np.testing.assert_array_equal(dae.evaluate({"X": WIDE.tolist(), "P": ca.DM(WIDE)})["X"], WIDE)
    by_columns = dae.function(["U"], ["y"])(WIDE.ravel(order="F"))
    np.testing.assert_array_equal(np.array(by_columns).reshape(2, 3, order="F"), WIDE)
    np.testing.assert_allclose(final(inputs={"U": lambda t: [[sin(t), 0, 0], [0, 0, t]]})[1, 2], 1.0)


def test_a_column_of_casadi_is_a_vector():
    column = translate(Shapes()).function(["u"], ["z"])([1.0, 2.0])
    np.testing.assert_array_equal(final("z", inputs={"u": column}), [1.0, 2.0])
    np.testing.assert_array_equal(translate(Shapes()).evaluate({"u": column})["z"], [1.0, 2.0])


@pytest.mark.parametrize("value", [[[1.0], [2.0], [3.0]], [1.0, 2.0, 3.0], lambda t: [[t / t], [2.0], [3.0]]])
def test_a_column_that_is_a_matrix(value):
    class Tall(Model):
        U = Input((3, 1), start=0.0)
        y = Real((3, 1))

        def equations(self):
            yield self.y == 1.0 * self.U

    found = simulate(Tall(), stop=1.0, points=2, inputs={"U": value}).final("y")
    np.testing.assert_array_equal(found, [[1.0], [2.0], [3.0]])


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("U", WIDE.T, r"found shape \(3, 2\), expected \(2, 3\); give rows of columns"),
        ("U", WIDE.ravel(), r"found shape \(6,\), expected \(2, 3\)"),
        ("U", WIDE[:, :2], r"found 4 values, expected 6: shape \(2, 2\) for \(2, 3\)"),
        ("U", 1.0, r"found 1 values, expected 6: shape \(\) for \(2, 3\)"),
        ("u", [[1.0, 2.0]], r"found shape \(1, 2\), expected \(2,\)"),
        ("U[0,1]", [1.0, 2.0], r"found 2 values, expected 1: shape \(2,\) for \(\)"),
    ],
)
def test_another_shape_is_refused_everywhere(name, value, words):
    with pytest.raises(ModelError, match=rf"^input {name.partition('[')[0]}.*: {words}"):
        final(inputs={name: value})
    with pytest.raises(ModelError, match=rf"^input {name.partition('[')[0]}.*: {words}"):
        final(inputs={name: lambda t: value})
    with pytest.raises(ModelError, match=rf"{words}"):
        translate(Shapes()).evaluate({name: value})


def test_another_shape_of_samples_parameters_and_starts_is_refused():
    with pytest.raises(ModelError, match=r"input U: found samples of shape \(6,\), expected \(2, 3\)"):
        final(inputs={"U": ([0.0, 1.0], [WIDE.ravel(), WIDE.ravel()])})
    with pytest.raises(ModelError, match=r"input u: found 4 values, expected 2.*; samples are a tuple"):
        final(inputs={"u": [[0.0, 1.0], [5.0, 7.0]]})
    with pytest.raises(ModelError, match=r"P: found shape \(3, 2\), expected \(2, 3\)"):
        final(parameters={"P": WIDE.T})
    with pytest.raises(ModelError, match=r"X: start has shape \(3, 2\), expected \(2, 3\)"):
        translate(Shapes(X=Start(WIDE.T)))


def test_a_vector_and_an_element_of_it_are_not_both_given():
    twice = "found u and u\\[1\\], which both give u\\[1\\], expected one value for it; leave one of them out"
    with pytest.raises(ModelError, match=f"inputs: {twice}"):
        final(inputs={"u": [1.0, 2.0], "u[1]": 2.0})
    with pytest.raises(ModelError, match=f"given: {twice}"):
        translate(Shapes()).evaluate({"u": [1.0, 2.0], "u[1]": 2.0})
    with pytest.raises(ModelError, match=r"parameters: found P\[0,1\] and P, which both give P\[0,1\]"):
        final(parameters={"P[0,1]": 1.0, "P": WIDE})
    with pytest.raises(ModelError, match=r"starts: found X and X\[0,1\], which both give X\[0,1\]"):
        final(starts={"X": WIDE, "X[0,1]": 1.0})
