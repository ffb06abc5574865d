"""Optima played back: what the inputs do to the model between the nodes and at the end."""

from typing import Any

import numpy as np
import pytest

from gantrytau import Fixed, Input, Model, ModelError, Parameter, Real, SolveError, Start, der, simulate, sin
from gantrytau_optimica import Free, Optimization, final, initial, optimize
from tests.optimica.known_answers.known_problems import zero
from tests.optimica.problems import FastestMass, Mass


class Uneven(FastestMass):
    """Its switch lies at 2/3 of the time, inside of an element of a mesh of 7."""

    mass = Mass(u=dict(min=-1.0, max=0.5))


def test_an_input_that_overshoots_is_told():
    optimum = optimize(Uneven, elements=7)
    t = np.linspace(0.0, optimum.final_time, 20001)
    force = optimum.signal("mass.u")(t)
    passed = max(np.max(force) - 0.5, -1.0 - np.min(force))
    assert passed > 0.05
    worst = optimum.playback.violations[0]
    assert worst.name == "limits of mass.u"
    assert worst.amount == pytest.approx(passed, rel=0.02)  # of the largest of 17 places per element
    assert worst.range == pytest.approx(1.5)
    assert worst.relative == optimum.playback.violation == pytest.approx(passed / 1.5, rel=0.02)
    index = np.argmax(np.maximum(force - 0.5, -1.0 - force))
    width = optimum.final_time / 7
    assert abs(worst.time - t[index]) < width
    assert f"`limits of mass.u` is passed by {worst.amount:.3g}" in optimum.report()


def test_inputs_that_hold_are_told_to():
    optimum = optimize(Uneven, elements=9, controls={"mass.u": "constant"})
    assert optimum.playback.violation < 1e-7
    optimum = optimize(Mover, elements=3)
    assert optimum.playback.violations == ()
    assert "all limits hold between the nodes as well" in optimum.report()


class Mover(Optimization):
    """Least effort without any limit: the exact motion is a polynomial."""

    mass: Any = Mass(x=Fixed(0.0), v=Fixed(0.0))

    def integrand(self):
        return self.mass.u**2

    def constraints(self):
        yield final(self.mass.x) == 1
        yield final(self.mass.v) == 0


@pytest.mark.parametrize("scheme", ["radau", "gauss"])
def test_a_polynomial_motion_is_played_back_exactly(scheme):
    optimum = optimize(Mover, elements=4, scheme=scheme)
    played = optimum.playback
    assert played.complete
    assert played.defect < 1e-8
    assert played.objective == pytest.approx(12.0, abs=1e-6)
    t = played.result.time
    np.testing.assert_allclose(played["mass.x"], 3 * t**2 - 2 * t**3, atol=1e-7)
    np.testing.assert_allclose(played["mass.u"], 6 - 12 * t, atol=1e-6)
    assert np.all(np.diff(t) > 0)
    assert t[-1] == 1.0
    with pytest.raises(ModelError, match=r"mass\.z"):
        played["mass.z"]


class Decay(Model):
    """x' = -x."""

    x = Real(description="what decays")
    rate = Parameter(1.0, unit="1/s", description="rate")

    def equations(self):
        yield der(self.x) == -self.rate * self.x


class Least(Optimization):
    """The least start from which 1 is left."""

    decay = Decay()
    final_time: Any = 0.1

    def objective(self):
        return initial(self.decay.x)

    def constraints(self):
        yield final(self.decay.x) == 1


def test_the_defect_of_implicit_euler():
    optimum = optimize(Least, elements=1, points=1)
    # one point: x(h) = x(0) / (1 + h), so that the start is 1 + h
    assert optimum.objective == pytest.approx(1.1, abs=1e-8)
    (defect,) = optimum.playback.defects
    assert defect.name == "final(decay.x) == 1"
    assert defect.amount == pytest.approx(1.1 * np.exp(-0.1) - 1, abs=1e-8)
    assert optimum.playback["decay.x"][-1] == pytest.approx(1.1 * np.exp(-0.1), abs=1e-8)
    assert f"`final(decay.x) == 1` is missed by {abs(defect.amount):.3g}" in optimum.report()


@pytest.mark.parametrize(
    ("elements", "points", "scheme"), [(1, 1, "radau"), (4, 1, "radau"), (2, 1, "gauss")]
)
def test_the_estimated_error_of_the_objective(elements, points, scheme):
    optimum = optimize(Least, elements=elements, points=points, scheme=scheme)
    error = np.exp(0.1) - optimum.objective
    assert abs(error) > 1e-5
    # first order in the defect: its square is left over
    assert optimum.playback.objective_error == pytest.approx(error, rel=0.15)


class Swing(Model):
    """A pendulum without friction, of length 1 m where g is 9.81 m/s2."""

    phi = Real(description="angle")
    w = Real(description="rate")
    energy = Real(description="energy per square of the length")

    def equations(self):
        yield der(self.phi) == self.w
        yield der(self.w) == -9.81 * sin(self.phi)
        yield self.energy == self.w**2 / 2 + 2 * 9.81 * sin(self.phi / 2) ** 2


class Thrown(Optimization):
    """The initial rate that reaches 1 rad after 2 s, on a coarse mesh."""

    swing = Swing(phi=Fixed(0.0), w=Start(Free(1.0, min=-4.0, max=4.0)))
    final_time = 2.0

    def objective(self):
        return (final(self.swing.phi) - 1) ** 2


def test_the_energy_is_kept_when_played_back_though_the_mesh_is_coarse():
    optimum = optimize(Thrown, elements=4)
    energy, played = optimum["swing.energy"], optimum.playback["swing.energy"]
    assert np.ptp(energy) > 1e-4 * energy[0]
    assert np.ptp(played) < 1e-7 * played[0]  # a thousand times the tolerance of the integrator
    found = simulate(Swing(phi=Fixed(0.0), w=Fixed(optimum["swing.w"][0])), stop=2.0, tolerance=1e-11)
    assert optimum.playback["swing.phi"][-1] == pytest.approx(found.final("phi"), abs=1e-7)
    objective = (found.final("phi") - 1) ** 2
    assert optimum.playback.objective == pytest.approx(objective, abs=1e-7)


class Kepler(Model):
    """An algebraic loop without closed form."""

    m = Real(start=0.0, fixed=True, description="mean anomaly")
    e = Real(start=0.0, description="eccentric anomaly", max=1.5)
    u = Input(unit="1/s", description="rate")

    def equations(self):
        yield der(self.m) == self.u
        yield self.e - 0.5 * sin(self.e) == self.m


def test_algebraic_loops_are_played_back():
    class Reach(Optimization):
        orbit = Kepler()

        def integrand(self):
            return (self.orbit.u - 1) ** 2

        def constraints(self):
            yield final(self.orbit.e) >= 1

    optimum = optimize(Reach, elements=3)
    e = optimum.playback["orbit.e"]
    np.testing.assert_allclose(e - 0.5 * np.sin(e), optimum.playback["orbit.m"], atol=1e-8)
    assert optimum.playback.objective == pytest.approx(optimum.objective, abs=1e-7)


class OnACircle(Optimization):
    """A pendulum of index three, one algebraic variable of which has a closed form."""

    x = Real(start=0.0, fixed=True)
    y = Real(start=-1.0)
    v = Real(start=1.0, fixed=True)
    w = Real()
    force = Real()
    u = Input(min=-2.0, max=2.0)

    def equations(self):
        yield der(self.x) == self.v
        yield der(self.y) == self.w
        yield der(self.v) == -self.force * self.x + self.u
        yield der(self.w) == -self.force * self.y - 9.81
        yield self.x**2 + self.y**2 == 1

    def integrand(self):
        return self.u**2 + self.x**2


def test_a_single_algebraic_in_closed_form_is_played_back():
    optimum = optimize(OnACircle, elements=8)
    assert optimum.playback.objective == pytest.approx(0.04992519914, rel=1e-8)  # of 40 elements


class Begun(Optimization):
    """Begin where the eccentric anomaly is 0.2, at a speed near 1."""

    orbit = Kepler(m=dict(fixed=False))

    def integrand(self):
        return (self.orbit.u - 1) ** 2

    def constraints(self):
        yield initial(self.orbit.e) == 0.2


def begin(optimum) -> float:
    """The eccentric anomaly that belongs to the initial mean anomaly."""
    return zero(lambda e: e - 0.5 * np.sin(e) - optimum["orbit.m"][0], -1.0, 2.0)


def test_a_condition_on_an_initial_algebraic_holds():
    # from 0.2 the mean anomaly goes as far as the eccentric one may, in 1 s at a constant rate
    optimum = optimize(Begun, elements=20)
    assert begin(optimum) == pytest.approx(0.2, abs=1e-6)
    rate = (1.5 - 0.5 * np.sin(1.5)) - (0.2 - 0.5 * np.sin(0.2))
    assert optimum.objective == pytest.approx((rate - 1) ** 2, abs=1e-6)


def test_the_defect_of_an_initial_algebraic_is_the_true_one():
    optimum = optimize(Begun, elements=3)
    (defect,) = optimum.playback.defects
    assert defect.amount == pytest.approx(begin(optimum) - 0.2, abs=1e-8)


class Path(FastestMass):
    """A limit on an expression, which is passed between the nodes."""

    def constraints(self):
        yield from super().constraints()
        yield self.mass.v * self.second <= 0.3 * self.meter + self.mass.x

    second = Parameter(1.0, unit="s", description="one second")
    meter = Parameter(1.0, unit="m", description="one metre")


def test_limits_on_expressions_between_the_nodes():
    optimum = optimize(Path, elements=5)
    played = optimum.playback
    passed = np.max(played["mass.v"] - 0.3 - played["mass.x"])
    found = next(v for v in played.violations if "mass.v" in v.name and "limits" not in v.name)
    assert found.amount == pytest.approx(max(passed, 0.0), abs=1e-9)
    assert passed > 1e-6


class Unstable(Model):
    """x' = a x + u."""

    x = Real(start=1.0, fixed=True, description="deviation")
    u = Input(unit="1/s", description="control")
    a = Parameter(8.0, unit="1/s", description="growth")

    def equations(self):
        yield der(self.x) == self.a * self.x + self.u


class Caught(Optimization):
    """To zero with the least effort: 2 a / (1 - exp(-2 a T)), which is 16."""

    plant: Any = Unstable()
    final_time = 2.0

    def integrand(self):
        return self.plant.u**2

    def constraints(self):
        yield final(self.plant.x) == 0


def test_an_unstable_plant_runs_away_without_feedback():
    optimum = optimize(Caught, elements=20)
    assert optimum.objective == pytest.approx(16.0, rel=1e-3)
    # every error grows by up to exp(16), 9e6
    amount = optimum.playback["plant.x"][-1]
    assert abs(amount) > 1e-3
    assert optimum.playback.defect == pytest.approx(abs(amount), rel=1e-6)
    assert "`final(plant.x) == 0` is missed by" in optimum.report()
    assert optimum["plant.x"][-1] == pytest.approx(0.0, abs=1e-8)


class Looped(Unstable):
    """The same with an algebraic unknown that has no closed form."""

    e = Real(start=8.0, description="a x, but for sin(e) / 10")
    b = Parameter(1.0, unit="1/s")

    def equations(self):
        yield (self.e + 0.1 * sin(self.e)) * self.b == self.a * self.x
        yield der(self.x) == (self.e + 0.1 * sin(self.e)) * self.b + self.u


@pytest.mark.parametrize("plant", [Unstable, Looped])
def test_a_playback_errs_no_more_on_many_elements(plant):
    optimum = optimize(Caught(plant=plant()), elements=200)
    borders = np.linspace(0.0, 2.0, 201)[:, None]
    nodes, weights = np.polynomial.legendre.leggauss(8)
    spans = np.diff(borders, axis=0) / 2
    t = borders[:-1] + spans * (1 + nodes)
    pushes = np.exp(8 * (2 - t)) * optimum.signal("plant.u")(t.ravel()).reshape(t.shape)
    # x(T) = exp(a T) x(0) + int exp(a (T - t)) u dt: terms of exp(16), which is 9e6, to rounding
    exact = np.exp(16.0) + np.sum(pushes * weights * spans)
    assert optimum.playback["plant.x"][-1] == pytest.approx(exact, abs=1e-8)


class Explosive(Model):
    """x' = 10 x^2 + u has a pole where u fails to hold it."""

    x = Real(start=1.0, fixed=True, description="deviation")
    u = Input(unit="1/s", description="control")
    k = Parameter(10.0, unit="1/s", description="growth")

    def equations(self):
        yield der(self.x) == self.k * self.x**2 + self.u


class Tamed(Optimization):
    """On a mesh that is far too coarse."""

    plant = Explosive()
    final_time = 4.0

    def integrand(self):
        return self.plant.u**2 + self.plant.x**2

    def constraints(self):
        yield final(self.plant.x) == 1


def test_a_motion_that_cannot_be_integrated_is_no_solution():
    with pytest.raises(SolveError, match="no motion: played back, it cannot be integrated beyond") as caught:
        optimize(Tamed, elements=1)
    assert not caught.value.optimum.playback.complete


def test_conditions_are_named_with_their_defects():
    optimum = optimize(Uneven, elements=6)
    names = [d.name for d in optimum.playback.defects]
    assert names == [
        "initial(mass.x) == 0",
        "initial(mass.v) == 0",
        "final(mass.x) == 1",
        "final(mass.v) == 0",
    ]
    assert optimum.playback.defect < 1e-7  # quadratic forces are collocated exactly


def test_a_failed_solve_is_not_played_back_in_its_report():
    with pytest.raises(SolveError) as caught:
        optimize(Uneven, max_iterations=2)
    assert "Played back" not in str(caught.value)


def test_an_objective_of_a_difference_depends_on_what_is_free():
    class Matched(Optimization):
        mass = Mass(x=Fixed(0.0), v=Fixed(0.0), u=1.0)
        k = Free(1.0, unit="m/s", description="to be the final speed")
        final_time = 2.0

        def objective(self):
            return (self.k - final(self.mass.v)) ** 2

    optimum = optimize(Matched, elements=4)
    assert optimum["k"] == pytest.approx(2.0, abs=1e-6)
    assert "depends on nothing that is free" not in optimum.report()
