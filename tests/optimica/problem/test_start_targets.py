"""Models without a consistent start of their own: conditions at the start and guesses serve it."""

import numpy as np
import pytest

from gantrytau import InitializationError, Input, Model, Real, der, sqrt
from gantrytau_optimica import Optimization, initial, optimize


class Pole(Model):
    """Divides by zero at the default start."""

    x, y, u = Real(), Real(), Input(min=-1.0, max=1.0)

    def equations(self):
        yield der(self.x) == self.u
        yield self.y * self.x == 1


class Away(Optimization):
    pole = Pole()
    final_time = 1.0

    def integrand(self):
        return self.pole.u**2

    def constraints(self):
        yield initial(self.pole.x) == 2.0


def test_a_condition_at_the_start_serves_the_consistent_start():
    optimum = optimize(Away, elements=5)
    assert optimum.objective == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(optimum["pole.y"], 0.5, atol=1e-9)


@pytest.mark.parametrize("guess", [2.0, lambda t: 2.0 + t])
def test_a_guess_serves_the_consistent_start(guess):
    class Open(Away):
        def integrand(self):
            return (self.pole.y - 0.5) ** 2 + self.pole.u**2

        def constraints(self):
            yield self.pole.x >= 0.1

    optimum = optimize(Open, elements=5, guess={"pole.x": guess})
    np.testing.assert_allclose(optimum["pole.x"], 2.0, atol=1e-5)
    with pytest.raises(InitializationError):
        optimize(Open, elements=5)


def test_an_implicit_flow_from_where_its_root_exists():
    class Tank(Optimization):
        h, q, u = Real(), Real(), Input(min=-1.0, max=1.0)
        final_time = 1.0

        def equations(self):
            yield der(self.h) == -self.q
            yield self.q + 0.1 * self.q**3 == sqrt(self.h - 1) + self.u

        def integrand(self):
            return self.u**2

        def constraints(self):
            yield initial(self.h) == 2.0

    optimum = optimize(Tank, elements=10)
    q = optimum["q"]
    np.testing.assert_allclose((q + 0.1 * q**3)[1:], np.sqrt(optimum["h"] - 1)[1:], atol=1e-7)
