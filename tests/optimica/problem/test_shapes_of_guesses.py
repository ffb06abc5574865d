"""Guesses, samples and known inputs of a problem have the shape of what they are given for."""

import numpy as np
import pytest

from gantrytau import Input, Model, ModelError, Parameter, Real, der
from gantrytau_optimica import Free, Optimization, Samples, optimize, prepare, sum_of_squares

WIDE = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
TIMES = np.linspace(0.0, 1.0, 5)


class Slide(Model):
    X = Real((2, 3), start=np.zeros((2, 3)), fixed=True)
    U = Input((2, 3))

    def equations(self):
        yield der(self.X) == 1.0 * self.U


class Follow(Optimization):
    m = Slide()
    final_time = 1.0
    samples = Samples(TIMES, TIMES[:, None, None] * WIDE)

    def objective(self):
        return sum_of_squares(self.m.X, self.samples)


def test_samples_of_a_matrix_keep_its_rows():
    optimum = optimize(Follow, elements=4)
    np.testing.assert_allclose(optimum.final("m.X"), WIDE, atol=1e-6)
    with pytest.raises(ModelError, match=r"sum_of_squares: found samples of shape .*, expected \(2, 3\)"):
        optimize(type("Flat", (Follow,), {"samples": Samples(TIMES, TIMES[:, None] * WIDE.ravel())}))


SIGNS = np.array([[1.0, 1.0, -1.0], [1.0, -1.0, -1.0]])


@pytest.mark.parametrize("guess", [SIGNS, SIGNS.tolist(), lambda t: SIGNS])
def test_a_guess_of_a_matrix_keeps_its_rows(guess):
    """Each element has two best values; the signs of the guess decide."""

    class Free(Optimization):
        m = Slide()
        final_time = 1.0

        def integrand(self):
            return sum((self.m.U[i, j] ** 2 - 1) ** 2 for i in range(2) for j in range(3))

    found = optimize(Free, elements=2, guess={"m.U": guess})
    np.testing.assert_allclose(found.final("m.X"), SIGNS, atol=1e-6)
    for wrong in (WIDE.T, WIDE.ravel(), lambda t: WIDE.T):
        with pytest.raises(ModelError, match=r"guess m\.U: found shape \((3, 2|6,)\), expected \(2, 3\)"):
            optimize(Free, elements=2, guess={"m.U": wrong})


def test_known_inputs_of_a_matrix_keep_its_rows():
    class Known(Optimization):
        m = Slide()
        final_time = 1.0
        inputs = {"m.U": (TIMES, np.broadcast_to(WIDE, (5, 2, 3)))}

    assert np.allclose(optimize(Known, elements=2).final("m.X"), WIDE, atol=1e-9)
    flat = {"m.U": (TIMES, np.broadcast_to(WIDE.ravel(), (5, 6)))}
    with pytest.raises(ModelError, match=r"input m\.U: found samples of shape .*, expected \(2, 3\); give"):
        optimize(type("Flat", (Known,), {"inputs": flat}), elements=2)


class Numbers(Optimization):
    """Each of the numbers has two best values; the guesses decide."""

    m = Slide(U=np.zeros((2, 3)))
    p = Free(np.zeros((2, 3)), min=-2.0, max=2.0)
    final_time = 1.0

    def objective(self):
        return sum((self.p[i, j] ** 2 - 1) ** 2 for i in range(2) for j in range(3))


@pytest.mark.parametrize("guess", [SIGNS, SIGNS.tolist()])
def test_guesses_of_free_numbers_by_the_name_of_their_matrix(guess):
    found = optimize(Numbers, elements=2, guess={"p": guess})
    np.testing.assert_allclose(found["p"], SIGNS, atol=1e-6)
    with pytest.raises(ModelError, match=r"guess p: found shape \(3, 2\), expected \(2, 3\)"):
        optimize(Numbers, elements=2, guess={"p": SIGNS.T})


def test_parameters_of_a_prepared_problem_keep_their_rows():
    class Driven(Model):
        p = Parameter(np.zeros((2, 3)))
        X = Real((2, 3), start=np.zeros((2, 3)), fixed=True)

        def equations(self):
            yield der(self.X) == self.p

    prepared = prepare(
        type("Drive", (Optimization,), {"m": Driven(), "final_time": 1.0}), parameters=["m.p"], elements=2
    )
    np.testing.assert_allclose(prepared.solve({"m.p": WIDE}).final("m.X"), WIDE, atol=1e-9)
    for wrong in (WIDE.T, WIDE.ravel()):
        with pytest.raises(ModelError, match=r"m\.p: found shape \((3, 2|6,)\), expected \(2, 3\)"):
            prepared.solve({"m.p": wrong})
