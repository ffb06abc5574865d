"""Multiple shooting: its order, its agreement with collocation, and what it refuses."""

from functools import partial

import numpy as np
import pytest

from gantrytau import Fixed, Input, Model, ModelError, Parameter, Real, SolveError, der, exp, sqrt, time
from gantrytau_optimica import Optimization, at, optimize, prepare
from gantrytau_optimica.answers.archive.optimum_files import load_optimum, save_optimum
from tests.optimica.answers.test_saving import ThereAndOn
from tests.optimica.problems import BoundedOscillator, FastestMass, LinearQuadratic, Mass

shoot = partial(optimize, scheme="shooting")


class Tank(Model):
    """Outflow by a square root, and an algebraic loop: y + y^3 = u - level."""

    level = Real(start=1.0, fixed=True, description="level")
    y = Real(start=0.1, description="root of the loop")
    u = Input(min=0.0, max=2.0, description="inflow")

    def equations(self):
        yield self.y + self.y**3 == self.u - self.level
        yield der(self.level) == (self.u - sqrt(self.level + 0.5)) / self.second

    second = Parameter(1.0, unit="s", description="one second")


class Filled(Optimization):
    """Level and loop near one half of their ranges."""

    tank = Tank()
    final_time = 2.0

    def integrand(self):
        return (self.tank.level - 1.5) ** 2 + self.tank.y**2 + 0.1 * self.tank.u


def orders(errors) -> np.ndarray:
    return np.log2(np.abs(errors[:-1]) / np.abs(errors[1:]))


@pytest.mark.parametrize("problem", [BoundedOscillator, Filled])
def test_the_objective_converges_with_order_four(problem):
    name = "oscillator.u" if problem is BoundedOscillator else "tank.u"
    elements = 40 if problem is BoundedOscillator else 4
    exact = optimize(problem, elements=elements, points=9, controls={name: "constant"}).objective
    errors = np.array([shoot(problem, elements=elements, points=k).objective - exact for k in (1, 2, 4)])
    np.testing.assert_allclose(orders(errors), 4.0, atol=0.35)  # on the way to its limit


def test_values_between_the_steps_converge_with_order_four():
    # a motion that is known: no freedom but a weightless input
    class Known(Optimization):
        class Decay(Model):
            x = Real(start=1.0, fixed=True, description="decays")
            u = Input(description="idle")

            def equations(self):
                yield der(self.x) == -self.x * time / self.one**2

            one = Parameter(1.0, unit="s", description="one second")

        decay = Decay()
        final_time = 2.0

        def integrand(self):
            return self.decay.u**2

    errors, times = [], np.linspace(0.0, 2.0, 401)
    for elements in (4, 8, 16):
        found = shoot(Known, elements=elements, points=1).signal("decay.x")(times)
        errors.append(np.max(np.abs(found - np.exp(-(times**2) / 2))))
    # the extension of third order is wrong by h^4 in a step
    np.testing.assert_allclose(orders(np.array(errors)), 4.0, atol=0.35)


def test_van_der_pol_with_a_blocked_control():
    # the published number belongs to three Radau points, 5e-6 below the limit of fine steps
    optimum = shoot(BoundedOscillator, elements=40, points=9)
    fine = optimize(BoundedOscillator, elements=40, points=9, controls={"oscillator.u": "constant"})
    assert optimum.objective == pytest.approx(3.31090705, abs=6e-6)
    assert optimum.objective == pytest.approx(fine.objective, abs=3e-7)
    values = optimum["oscillator.u"][1:].reshape(40, 9)
    assert np.all(values == values[:, :1])
    assert np.max(values) <= 0.75 + 1e-7


def test_linear_inputs_reach_the_unbounded_optimum():
    optimum = shoot(LinearQuadratic, elements=50, points=1, controls={"mass.u": "linear"})
    assert optimum.objective == pytest.approx(50.9836626, abs=2e-5)  # straight pieces of 0.06 s
    np.testing.assert_allclose(
        np.diff(optimum.signal("mass.u")(np.array([0.601, 0.62, 0.639])), 2), 0, atol=1e-10
    )


def test_the_fastest_mass_switches_on_a_border():
    optimum = shoot(FastestMass, elements=50, points=1)
    assert optimum.final_time == pytest.approx(2.0, abs=1e-6)
    assert optimum.time.size == 51
    np.testing.assert_allclose(optimum["mass.x"][[0, 25, 50]], [0.0, 0.5, 1.0], atol=1e-7)


def test_limits_along_the_path_hold_at_all_steps_and_at_the_end():
    class Limited(Filled):
        def constraints(self):
            yield self.tank.level + 0.1 * self.tank.y <= 1.3
            yield self.tank.y >= -0.05

    optimum = shoot(Limited, elements=6, points=3)
    # inputs jump between elements: what holds at the start of a step is its own value, just after the border
    after = np.minimum(optimum.time + 1e-8, 2.0)
    level, y = (optimum.signal(f"tank.{n}")(after) for n in ("level", "y"))
    assert np.max(level + 0.1 * y) == pytest.approx(1.3, abs=1e-6)
    assert np.min(y) > -0.05 - 1e-6
    starts = [g for g in optimum.program.groups if g.kind == "path"]
    assert [g.rows.size for g in starts] == [19]
    # the equations hold at every stage
    u, y, level = (optimum[f"tank.{n}"] for n in ("u", "y", "level"))
    np.testing.assert_allclose((y + y**3 - u + level)[1:], 0.0, atol=1e-3)  # third order at ends of steps


def test_values_at_times_integrals_and_time_itself():
    class Timed(LinearQuadratic):
        def constraints(self):
            yield from super().constraints()
            yield at(1.03, self.mass.x) == 2.5

        def integrand(self):
            return super().integrand() + exp(-time / self.one_s) * 0.1

        one_s = Parameter(1.0, unit="s", description="one second")

    found = shoot(Timed, elements=60, points=2)
    assert found.signal("mass.x")(1.03) == pytest.approx(2.5, abs=1e-8)
    assert found.objective == pytest.approx(optimize(Timed, elements=60).objective, abs=2e-2)
    assert found.integral("mass.v") == pytest.approx(found.final("mass.x") - 1.0, abs=1e-9)


def test_phases():
    assert shoot(ThereAndOn, elements=6, points=2).final_time == pytest.approx(4.0, abs=1e-6)


def test_it_is_saved_and_starts_another(tmp_path):
    original = shoot(Filled, elements=5, points=2)
    save_optimum(original, tmp_path / "a.optimum")
    copy = load_optimum(tmp_path / "a.optimum")
    times = np.linspace(0.0, 2.0, 123)
    for name in ("tank.level", "tank.y", "tank.u"):
        np.testing.assert_allclose(copy.signal(name)(times), original.signal(name)(times), atol=1e-10)
    again = optimize(Filled, elements=9, guess=copy)
    assert again.objective == pytest.approx(original.objective, abs=1e-2)
    assert shoot(Filled, elements=5, points=2, guess=again).objective == pytest.approx(
        original.objective, abs=1e-8
    )


def test_parameters_may_change_between_solves():
    prepared = prepare(LinearQuadratic, scheme="shooting", elements=10, parameters=["one_m"])
    one, other = (prepared.solve({"one_m": x}).objective for x in (1.0, 2.0))
    assert other < one


def test_moving_times_are_refused():
    class Moving(FastestMass):
        def constraints(self):
            yield from super().constraints()
            yield at(0.5, self.mass.x) <= 0.5

    with pytest.raises(ModelError, match=r"Moving: at\(0\.5, \.\.\.\): this share of the horizon changes"):
        shoot(Moving)


def test_a_stiff_motion_needs_steps_or_an_implicit_scheme():
    class Stiff(Optimization):
        class Fast(Model):
            x = Real(start=0.0, fixed=True, description="follows the input within 5 ms")
            u = Input(min=-1.0, max=1.0, description="input")

            def equations(self):
                yield der(self.x) == (self.u - self.x) / self.T

            T = Parameter(0.005, unit="s", description="time constant")

        fast = Fast()
        final_time = 1.0

        def integrand(self):
            return (self.fast.x - 0.5) ** 2

    # the input 0.5 throughout, which all may choose, costs the integral of (0.5 exp(-t / T))^2
    bound = 0.25 * 0.005 / 2
    assert optimize(Stiff, elements=20).objective < 1.05 * bound
    assert shoot(Stiff, elements=100, points=4).objective < 1.05 * bound  # h = T / 2
    try:
        unstable = shoot(Stiff, elements=20, points=1).objective  # h = 10 T: far beyond stability
    except SolveError:
        unstable = np.inf
    assert unstable > 10 * bound  # 25 times were found


def test_a_failure_is_told_as_with_other_schemes():
    class Short(LinearQuadratic):
        mass = Mass(x=Fixed(1.0), v=Fixed(2.0), u=dict(min=-1.0, max=1.0))
        final_time = 1.0

    with pytest.raises(SolveError, match="no solution") as caught:
        shoot(Short, elements=6, points=2)
    # the force of 1 m/s2 changes the speed of 2 m/s to 1 m/s at best, not to -2
    assert "could be solved" in str(caught.value)
    assert "`final(mass.v) == -2`" in str(caught.value)
