"""Estimation from published or simulated data, as a sum of squares over `at(t_k, x)`.

Data of alpha-pinene and gas oil: Dolan, More and Munson, Benchmarking optimization software with COPS 3.0
(Argonne ANL/MCS-TM-273, 2004), problems 2 to 4, from Box and others (1973) and Tjoa and Biegler (1991).
"""

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import least_squares

from gantrytau import Input, Model, Parameter, Real, der, simulate, sin, sqrt, time
from gantrytau_optimica import Free, Optimization, at, final, initial, optimize

PINENE_TIMES = [1230.0, 3060.0, 4920.0, 7800.0, 10680.0, 15030.0, 22620.0, 36420.0]
PINENE = [
    [88.35, 7.3, 2.3, 0.4, 1.75],
    [76.4, 15.6, 4.5, 0.7, 2.8],
    [65.1, 23.1, 5.3, 1.1, 5.8],
    [50.4, 32.9, 6.0, 1.5, 9.3],
    [37.5, 42.7, 6.0, 1.9, 12.0],
    [25.9, 49.1, 5.9, 2.2, 17.0],
    [14.0, 57.4, 5.1, 2.6, 21.0],
    [4.5, 63.1, 3.8, 2.9, 25.7],
]


class Pinene(Model):
    """Isomerization of alpha-pinene; time in 10000 min, so that the rates are of order one."""

    k = Free([0.5, 0.5, 0.5, 0.5, 0.5], min=0.0, description="rates")
    y = Real(5, description="percentages")

    def equations(self):
        k, y = self.k, self.y
        yield der(y[0]) == -(k[0] + k[1]) * y[0]
        yield der(y[1]) == k[0] * y[0]
        yield der(y[2]) == k[1] * y[0] - (k[2] + k[3]) * y[2] + k[4] * y[4]
        yield der(y[3]) == k[2] * y[2]
        yield der(y[4]) == k[3] * y[2] - k[4] * y[4]


class PineneFit(Optimization):
    """COPS 3, problem 4: 19.8721."""

    reaction = Pinene()
    final_time = 3.642

    def objective(self):
        total = 0.0
        for t, row in zip(PINENE_TIMES, PINENE, strict=True):
            seen = at(t / 1e4, self.reaction.y)
            total = total + sum((seen[j] - row[j]) ** 2 for j in range(5))
        return total

    def constraints(self):
        yield initial(self.reaction.y) == [100, 0, 0, 0, 0]


def pinene_by_exponentials() -> tuple[float, np.ndarray]:
    """Sum of squares and rates by the matrix exponential and a search of its own."""

    def residuals(k):
        a = np.zeros((5, 5))
        a[0, 0] = -(k[0] + k[1])
        a[1, 0] = k[0]
        a[2, [0, 2, 4]] = k[1], -(k[2] + k[3]), k[4]
        a[3, 2] = k[2]
        a[4, [2, 4]] = k[3], -k[4]
        start = np.array([100.0, 0, 0, 0, 0])
        return np.concatenate(
            [expm(a * t / 1e4) @ start - row for t, row in zip(PINENE_TIMES, PINENE, strict=True)]
        )

    found: Any = least_squares(residuals, np.full(5, 0.5), xtol=1e-14, ftol=1e-14, gtol=1e-14)
    return 2 * float(found.cost), np.asarray(found.x)


def test_alpha_pinene():
    value, rates = pinene_by_exponentials()
    assert value == pytest.approx(19.8721, abs=1e-4)
    # the data lie inside of elements, in which values of three points err with the fourth power of the element
    assert optimize(PineneFit, elements=20).objective == pytest.approx(value, abs=1e-2)
    assert optimize(PineneFit, elements=40).objective == pytest.approx(value, abs=1e-3)
    optimum = optimize(PineneFit, elements=20, points=8)
    assert optimum.objective == pytest.approx(value, abs=1e-6)
    found = [optimum[f"reaction.k[{j}]"] for j in range(5)]
    np.testing.assert_allclose(found, rates, rtol=1e-4)


GAS_OIL = np.array(
    [
        [0.0, 1.0, 0.0],
        [0.025, 0.8105, 0.2],
        [0.05, 0.6208, 0.2886],
        [0.075, 0.5258, 0.3010],
        [0.1, 0.4345, 0.3215],
        [0.125, 0.3903, 0.3123],
        [0.15, 0.3342, 0.2716],
        [0.175, 0.3034, 0.2551],
        [0.2, 0.2735, 0.2258],
        [0.225, 0.2405, 0.1959],
        [0.25, 0.2283, 0.1789],
        [0.3, 0.2071, 0.1457],
        [0.35, 0.1669, 0.1198],
        [0.4, 0.1530, 0.0909],
        [0.45, 0.1339, 0.0719],
        [0.5, 0.1265, 0.0561],
        [0.55, 0.1200, 0.0460],
        [0.65, 0.0990, 0.0280],
        [0.75, 0.0870, 0.0190],
        [0.85, 0.0770, 0.0140],
        [0.95, 0.0690, 0.0100],
    ]
)


class GasOil(Model):
    """Catalytic cracking of gas oil to gasoline and by-products."""

    k1 = Parameter(1.0)
    k2 = Parameter(1.0)
    k3 = Parameter(1.0)
    oil = Real(start=1.0, fixed=True)
    gasoline = Real(start=0.0, fixed=True)

    def equations(self):
        yield der(self.oil) == -(self.k1 + self.k3) * self.oil**2
        yield der(self.gasoline) == self.k1 * self.oil**2 - self.k2 * self.gasoline


class GasOilFit(Optimization):
    """COPS 3, problem 3: 5.23664e-3."""

    plant = GasOil(k1=Free(1.0, min=0.0), k2=Free(1.0, min=0.0), k3=Free(1.0, min=0.0))
    final_time = 0.95

    def objective(self):
        p = self.plant
        return sum(
            (at(float(t), p.oil) - a) ** 2 + (at(float(t), p.gasoline) - b) ** 2 for t, a, b in GAS_OIL
        )


def test_gas_oil():
    def residuals(k):
        def rates(t, z):
            return [-(k[0] + k[2]) * z[0] ** 2, k[0] * z[0] ** 2 - k[1] * z[1]]

        found = solve_ivp(rates, (0, 0.95), [1, 0], t_eval=GAS_OIL[:, 0], rtol=1e-11, atol=1e-12)
        return (found.y.T - GAS_OIL[:, 1:]).ravel()

    fitted: Any = least_squares(residuals, [10.0, 8.0, 1.0], xtol=1e-13, ftol=1e-13, gtol=1e-13)
    value = 2 * float(fitted.cost)
    assert value == pytest.approx(5.23664e-3, abs=5e-8)
    # values at ends of elements converge with the fifth power of the element, inside of them with the fourth
    assert optimize(GasOilFit, elements=30).objective == pytest.approx(value, abs=2e-5)
    optimum = optimize(GasOilFit, elements=38)  # 0.95 / 38: all times of measurement are ends of elements
    assert optimum.objective == pytest.approx(value, abs=1e-8)
    np.testing.assert_allclose([optimum[f"plant.k{j}"] for j in (1, 2, 3)], fitted.x, rtol=1e-3)


class Predators(Model):
    """Lotka and Volterra with rates to be found."""

    a = Parameter(1.0)
    b = Parameter(1.0)
    hares = Real(start=1.0, fixed=True)
    lynx = Real(start=0.5, fixed=True)

    def equations(self):
        yield der(self.hares) == self.a * self.hares - self.hares * self.lynx
        yield der(self.lynx) == self.b * self.hares * self.lynx - self.lynx


def predators(a: float, b: float, times: np.ndarray) -> np.ndarray:
    """Hares and lynx at times, (times, 2), integrated by scipy."""

    def rates(t, z):
        return [a * z[0] - z[0] * z[1], b * z[0] * z[1] - z[1]]

    return solve_ivp(rates, (0, times[-1]), [1, 0.5], t_eval=times, rtol=1e-11, atol=1e-12).y.T


def test_predators_and_prey_with_noise():
    times = np.linspace(0.0, 6.0, 21)
    noise = np.random.default_rng(7).normal(0.0, 0.02, (21, 2))
    data = predators(1.2, 0.8, times) + noise

    class Fit(Optimization):
        field = Predators(a=Free(1.0, min=0.1, max=5.0), b=Free(1.0, min=0.1, max=5.0))
        final_time = 6.0

        def objective(self):
            f = self.field
            return sum(
                (at(float(t), f.hares) - h) ** 2 + (at(float(t), f.lynx) - y) ** 2
                for t, (h, y) in zip(times, data, strict=True)
            )

    fitted: Any = least_squares(
        lambda p: (predators(p[0], p[1], times) - data).ravel(), [1.0, 1.0], xtol=1e-13, ftol=1e-13
    )
    optimum = optimize(Fit, elements=40)
    assert optimum.objective == pytest.approx(2 * fitted.cost, abs=1e-7)
    np.testing.assert_allclose([optimum["field.a"], optimum["field.b"]], fitted.x, atol=1e-5)


def test_michaelis_menten_with_a_free_start():
    """Exact data, and the initial substrate unknown as well: everything is found again."""

    class Enzyme(Model):
        vmax = Parameter(1.0)
        km = Parameter(1.0)
        s = Real(start=1.0, min=0.0)

        def equations(self):
            yield der(self.s) == -self.vmax * self.s / (self.km + self.s)

    times = np.linspace(0.1, 3.9, 9)
    found = solve_ivp(lambda t, z: -1.5 * z / (0.7 + z), (0, 4), [2.0], t_eval=times, rtol=1e-12, atol=1e-13)

    class Fit(Optimization):
        enzyme = Enzyme(vmax=Free(1.0, min=0.1, max=9.0), km=Free(1.0, min=0.01, max=9.0))
        final_time = 4.0

        def objective(self):
            s = self.enzyme.s
            return sum((at(float(t), s) - x) ** 2 for t, x in zip(times, found.y[0], strict=True))

    optimum = optimize(Fit, elements=20)
    assert optimum.objective == pytest.approx(0.0, abs=1e-10)
    assert optimum["enzyme.s"][0] == pytest.approx(2.0, abs=1e-4)
    assert optimum["enzyme.vmax"] == pytest.approx(1.5, abs=1e-3)
    assert optimum["enzyme.km"] == pytest.approx(0.7, abs=1e-3)


class QuadrupleTank(Model):
    """Problem 7 of benchmarks; levels in m, flows in SI."""

    a1 = Parameter(0.03e-4, unit="m2", description="hole of the first lower tank")
    a2 = Parameter(0.03e-4, unit="m2", description="hole of the second lower tank")
    x = Real(4, unit="m", start=[0.06255, 0.06045, 0.02395, 0.02325], fixed=True, min=1e-6)
    u1 = Input(unit="V", start=5.0)
    u2 = Input(unit="V", start=5.0)
    area = Parameter(4.9e-4, unit="m2")
    a3 = Parameter(0.03e-4, unit="m2")
    k = Parameter(0.56e-6, unit="m3/(s.V)")
    g = Parameter(9.81, unit="m/s2")
    gamma = 0.3

    def equations(self):
        x, gamma, a = self.x, self.gamma, self.area
        out = [hole * sqrt(2 * self.g * x[j]) for j, hole in enumerate((self.a1, self.a2, self.a3, self.a3))]
        yield a * der(x[0]) == -out[0] + out[2] + gamma * self.k * self.u1
        yield a * der(x[1]) == -out[1] + out[3] + gamma * self.k * self.u2
        yield a * der(x[2]) == -out[2] + (1 - gamma) * self.k * self.u2
        yield a * der(x[3]) == -out[3] + (1 - gamma) * self.k * self.u1


def voltage(period: float):
    """A smooth wave between 5 and 6 V."""
    return lambda t: 5.5 + 0.5 * np.sin(2 * np.pi * np.asarray(t) / period)


def test_holes_of_a_quadruple_tank():
    true = dict(a1=0.02656702e-4, a2=0.02713898e-4)
    times = np.arange(61.0)
    inputs = {"u1": (np.arange(0, 60.01, 0.1), voltage(20.0)(np.arange(0, 60.01, 0.1)))}
    inputs["u2"] = (inputs["u1"][0], voltage(31.0)(inputs["u1"][0]))
    levels = simulate(QuadrupleTank(**true), stop=60.0, points=61, inputs=inputs, tolerance=1e-10)["x"]
    data = levels + np.random.default_rng(1).normal(0.0, 1e-4, levels.shape)

    class Fit(Optimization):
        tank = QuadrupleTank(
            a1=Free(0.03e-4, unit="m2", min=0.0, max=1e-5), a2=Free(0.03e-4, unit="m2", min=0.0, max=1e-5)
        )
        final_time = 60.0
        one = Parameter(1.0, unit="m", description="typical level")
        volt = Parameter(1.0, unit="V", description="one volt")
        turn = Parameter(2 * np.pi, unit="rad/s", description="one turn per second")

        def objective(self):
            return 1e4 * sum(
                (at(float(t), self.tank.x[j]) / self.one - data[i, j]) ** 2
                for i, t in enumerate(times)
                for j in range(2)
            )

        def constraints(self):
            yield self.tank.u1 == self.volt * (5.5 + 0.5 * sin(self.turn * time / 20.0))
            yield self.tank.u2 == self.volt * (5.5 + 0.5 * sin(self.turn * time / 31.0))

    def residuals(p):
        found = simulate(
            QuadrupleTank(a1=p[0] * 1e-6, a2=p[1] * 1e-6),
            stop=60.0,
            points=61,
            inputs=inputs,
            tolerance=1e-10,
        )
        return (found["x"][:, :2] - data[:, :2]).ravel()

    optimum = optimize(Fit, elements=60)
    assert optimum["tank.a1"] == pytest.approx(true["a1"], rel=5e-3)  # noise of 0.1 mm on 61 samples
    assert optimum["tank.a2"] == pytest.approx(true["a2"], rel=5e-3)
    # no nearby pair of holes fits better, when simulated
    best = np.array([optimum["tank.a1"], optimum["tank.a2"]]) * 1e6
    least = np.sum(residuals(best) ** 2)
    assert optimum.objective == pytest.approx(1e4 * least, rel=1e-4)
    for step in ([1e-3, 0], [-1e-3, 0], [0, 1e-3], [0, -1e-3]):
        assert np.sum(residuals(best + step) ** 2) > least


def test_a_fit_at_the_first_and_last_instant():
    """Two data, at the very ends: a line through both."""

    class Line(Model):
        x = Real()
        slope = Parameter(0.0)

        def equations(self):
            yield der(self.x) == self.slope

    class Fit(Optimization):
        line = Line(slope=Free(0.0))
        final_time = 2.0

        def objective(self):
            x = self.line.x
            return (at(0.0, x) - 1) ** 2 + (at(2.0, x) - 5) ** 2 + (initial(x) - 1) ** 2 + (final(x) - 5) ** 2

    optimum = optimize(Fit, elements=3)
    assert optimum["line.slope"] == pytest.approx(2.0, abs=1e-6)
    assert optimum.objective == pytest.approx(0.0, abs=1e-10)
