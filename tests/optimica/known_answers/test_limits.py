"""What the language says about starts, ends and limits, on problems with exact answers."""

import numpy as np
import pytest

from gantrytau import Input, Model, Parameter, Real, der, exp, sin, tanh, time
from gantrytau_optimica import Free, Optimization, final, initial, optimize
from tests.optimica.problems import FastestMass, Mass


def test_a_free_start_time():
    """Wait before a window that opens at 3: as late a start as possible, and not after the end."""

    class Window(FastestMass):
        start_time = Free(0.0, min=0.0, max=10.0, unit="s")
        final_time = Free(5.0, min=0.1, max=10.0, unit="s")

        def objective(self):
            return (self.final_time - 7) ** 2 + (self.final_time - self.start_time)

    # duration 2; the least of (T - 7)^2 + duration is at T = 7
    optimum = optimize(Window)
    assert optimum.objective == pytest.approx(2.0, abs=1e-6)
    assert optimum["start_time"] == pytest.approx(5.0, abs=1e-3)
    assert optimum.final_time == pytest.approx(7.0, abs=1e-3)
    assert optimum.time[0] == pytest.approx(optimum["start_time"])


def test_time_in_a_force_with_a_free_start():
    class Pushed(Model):
        v = Real(start=0.0, fixed=True)
        rate = Parameter(1.0, unit="rad/s", description="rate of the wave")

        def equations(self):
            yield der(self.v) == sin(self.rate * time)

    class Best(Optimization):
        mass = Pushed()
        start_time = Free(0.5, min=-1.0, max=2.0)
        final_time = Free(2.0, min=2.5, max=5.0)

        def objective(self):
            return -final(self.mass.v)

    # the whole positive half wave: from 0 to pi
    optimum = optimize(Best, elements=10)
    assert optimum.objective == pytest.approx(-2.0, abs=1e-7)
    assert optimum["start_time"] == pytest.approx(0.0, abs=1e-3)
    assert optimum.final_time == pytest.approx(np.pi, abs=1e-3)


def test_an_implicit_initial_equation():
    class Loop(Model):
        """The start is where x e^x = 1, the omega constant."""

        x = Real(start=0.4)
        u = Input()

        def equations(self):
            yield der(self.x) == self.u

        def initial_equations(self):
            yield self.x * exp(self.x) == 1

    class Away(Optimization):
        loop = Loop()

        def integrand(self):
            return self.loop.u**2

        def constraints(self):
            yield final(self.loop.x) == 2

    omega = 0.567143290409784
    assert optimize(Away, elements=3).objective == pytest.approx((2 - omega) ** 2, abs=1e-7)


def test_limits_of_variables_that_the_model_eliminates():
    class Copied(Mass):
        speed = Real(unit="m/s", max=0.5, description="another name of the speed")
        back = Real(unit="m/s", min=-0.4, description="the opposite of the speed")

        def equations(self):
            yield from super().equations()
            yield self.speed == self.v
            yield self.back == -self.v

    class Slow(FastestMass):
        mass = Copied(u=dict(min=-1.0, max=1.0))

    # v <= 0.4: 0.4 s to speed up and to brake, 0.84 m at 0.4 m/s; both switches off the mesh (2.9 s / 50)
    optimum = optimize(Slow)
    assert np.max(optimum["mass.v"]) <= 0.4 + 1e-6
    assert optimum.final_time == pytest.approx(0.8 + 0.84 / 0.4, abs=1e-3)


def test_a_limit_of_a_derived_quantity():
    class Powered(Mass):
        power = Real(unit="m2/s3", max=0.25, description="power per mass")

        def equations(self):
            yield from super().equations()
            yield self.power == self.u * self.v

    class Strong(FastestMass):
        mass = Powered(u=dict(min=-1.0, max=1.0))

        def constraints(self):
            yield initial(self.mass.x) == 0
            yield initial(self.mass.v) == 0
            yield final(self.mass.v) == 1

    # full force until v = 1/4, then v^2/2 grows at 1/4 to 1/2
    optimum = optimize(Strong)
    assert optimum.final_time == pytest.approx(0.25 + (0.5 - 1 / 32) / 0.25, abs=1e-3)


def test_coulomb_friction_with_a_smooth_sign():
    """Problem 8 of benchmarks: q' = v, v' = u - sign(v), 2.09716754 exactly, with tanh(v / 0.001)."""

    class Rough(Model):
        q = Real(start=0.0, fixed=True)
        v = Real(start=1.0, fixed=True)
        u = Input(min=-2.0, max=2.0)

        def equations(self):
            yield der(self.q) == self.v
            yield der(self.v) == self.u - tanh(self.v / 0.01)

    class Back(Optimization):
        block = Rough()
        final_time = Free(2.0, min=0.5, max=20.0)

        def objective(self):
            return self.final_time

        def constraints(self):
            yield final(self.block.q) == -1
            yield final(self.block.v) == 0

    stop, way = 1 / 3, 1 + 1 / 6
    top = np.sqrt(2 * way * 1 * 3 / (1 + 3))
    exact = stop + top / 1 + top / 3
    assert exact == pytest.approx(2.09716754, abs=1e-8)
    assert optimize(Back, elements=100).final_time == pytest.approx(exact, abs=5e-3)
