"""Models and data for the tests of estimation."""

import numpy as np

from gantrytau import Input, Model, Parameter, Real, der, sqrt
from gantrytau_optimica import Samples
from gantrytau_optimica.estimation.experiments import Experiment

HOLES = {"a1": 0.02656702e-4, "a2": 0.02713898e-4}  # benchmarks, problem 7
NOISE = 1e-4  # m, of a level

# Bates and Watts (1988), Nonlinear Regression Analysis and Its Applications, table A1.3, treated enzyme: ppm, counts/min^2
PUROMYCIN = (
    [0.02, 0.02, 0.06, 0.06, 0.11, 0.11, 0.22, 0.22, 0.56, 0.56, 1.10, 1.10],
    [76.0, 47.0, 97.0, 107.0, 123.0, 139.0, 159.0, 152.0, 191.0, 201.0, 207.0, 200.0],
)

# Bates and Watts (1988), table A1.4: biochemical oxygen demand, d and mg/l
OXYGEN = ([1.0, 2.0, 3.0, 4.0, 5.0, 7.0], [8.3, 10.3, 19.0, 16.0, 15.6, 19.8])


class QuadrupleTank(Model):
    """Four tanks, two pumps; problem 7 of the benchmarks."""

    a1 = Parameter(0.03e-4, unit="m2", description="hole of the first tank")
    a2 = Parameter(0.03e-4, unit="m2", description="hole of the second tank")
    a3 = Parameter(0.03e-4, unit="m2", description="holes of the upper tanks")
    area = Parameter(4.9e-4, unit="m2", description="cross section of a tank")
    k = Parameter(0.56e-6, unit="m3/(s.V)", description="flow of a pump")
    g = Parameter(9.81, unit="m/s2")
    x = Real(4, unit="m", start=[0.06255, 0.06045, 0.02395, 0.02325], fixed=True, min=1e-6)
    u1 = Input(unit="V", start=5.0)
    u2 = Input(unit="V", start=5.0)
    gamma = 0.3

    def equations(self):
        x, holes = self.x, (self.a1, self.a2, self.a3, self.a3)
        out = [hole * sqrt(2 * self.g * x[j]) for j, hole in enumerate(holes)]
        yield self.area * der(x[0]) == -out[0] + out[2] + self.gamma * self.k * self.u1
        yield self.area * der(x[1]) == -out[1] + out[3] + self.gamma * self.k * self.u2
        yield self.area * der(x[2]) == -out[2] + (1 - self.gamma) * self.k * self.u2
        yield self.area * der(x[3]) == -out[3] + (1 - self.gamma) * self.k * self.u1


class Decay(Model):
    """A quantity that fades: y = y0 exp(-k t)."""

    k = Parameter(1.0, unit="1/s", min=0.0, description="rate")
    y = Real(start=2.0, fixed=True)

    def equations(self):
        yield der(self.y) == -self.k * self.y


class Trend(Model):
    """A straight line as a differential equation: linear in both numbers."""

    slope = Parameter(0.0, unit="1/s")
    y = Real()

    def equations(self):
        yield der(self.y) == self.slope


class Enzyme(Model):
    """Michaelis and Menten, without time."""

    top = Parameter(200.0)
    half = Parameter(0.1)
    concentration = Input()
    rate = Real()

    def equations(self):
        yield self.rate == self.top * self.concentration / (self.half + self.concentration)


class Oxygen(Model):
    """Biochemical oxygen demand, by the time in d taken for s."""

    top = Parameter(20.0)
    rate = Parameter(0.3, unit="1/s")
    demand = Real(start=0.0, fixed=True)

    def equations(self):
        yield der(self.demand) == self.rate * (self.top - self.demand)


def toggling(period: float) -> Samples:
    """5 and 6 V in turns, over 60 s."""
    times = np.arange(0.0, 61.0, 1.0)
    return Samples(times, 5.0 + (np.floor(times / period) % 2), kind="constant")


def tank_levels(holes=None, u=(10.0, 15.0)) -> np.ndarray:
    """Levels (61, 4) at 1 Hz without noise, by RK4 with steps that end at every jump of the pumps."""
    p = {"a1": 0.03e-4, "a2": 0.03e-4, "a3": 0.03e-4, **(HOLES if holes is None else holes)}
    hole = np.array([p["a1"], p["a2"], p["a3"], p["a3"]])
    volts = [toggling(period).values[:, 0] for period in u]
    level = np.array(p.get("start", [0.06255, 0.06045, 0.02395, 0.02325]))
    found = [level]
    for k in range(60):
        u1, u2 = volts[0][k], volts[1][k]
        inflow = 0.56e-6 * np.array([0.3 * u1, 0.3 * u2, 0.7 * u2, 0.7 * u1])

        def slope(x, inflow=inflow):
            out = hole * np.sqrt(2 * 9.81 * x)
            return (-out + np.array([out[2], out[3], 0, 0]) + inflow) / 4.9e-4

        h = 0.1
        for _ in range(10):
            k1 = slope(level)
            k2 = slope(level + h / 2 * k1)
            k3 = slope(level + h / 2 * k2)
            level = level + h / 6 * (k1 + 2 * k2 + 2 * k3 + slope(level + h * k3))
        found.append(level)
    return np.array(found)


def tank_experiment(
    seed: int, *, deviation=NOISE, measured=("x[0]", "x[1]"), u=(10.0, 15.0), **more
) -> Experiment:
    """Noisy levels of the tanks with the true holes."""
    levels = tank_levels(u=u) + np.random.default_rng(seed).normal(0.0, NOISE, (61, 4))
    return Experiment(
        measured={n: Samples(np.arange(61.0), levels[:, int(n[2])], deviation=deviation) for n in measured},
        inputs={"u1": toggling(u[0]), "u2": toggling(u[1])},
        **more,
    )
