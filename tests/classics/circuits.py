"""Circuits of the test set for IVP solvers (Mazzia and Magherini, Bari)."""

import numpy as np

from gantrytau import Model, Real, der, exp, sin, time


class Amplifier(Model):
    """Rentrop (1989): two transistors, eight equations of index one, with a singular mass matrix."""

    y = Real(8, start=[0.0, 3.0, 3.0, 6.0, 3.0, 3.0, 6.0, 0.0])

    def equations(self):
        y, r = [None, *(self.y[i] for i in range(8))], 9000.0
        c1, c2, c3, c4, c5 = (k * 1e-6 for k in range(1, 6))
        rate = [None, *(der(self.y)[i] for i in range(8))]
        one, two = (1e-6 * (exp((y[i] - y[i + 1]) / 0.026) - 1) for i in (2, 5))
        yield -c1 * (rate[1] - rate[2]) == (y[1] - 0.1 * sin(200 * np.pi * time)) / 1000
        yield c1 * (rate[1] - rate[2]) == y[2] / r + (y[2] - 6) / r + 0.01 * one
        yield -c2 * rate[3] == y[3] / r - one
        yield -c3 * (rate[4] - rate[5]) == (y[4] - 6) / r + 0.99 * one
        yield c3 * (rate[4] - rate[5]) == y[5] / r + (y[5] - 6) / r + 0.01 * two
        yield -c4 * rate[6] == y[6] / r - two
        yield -c5 * (rate[7] - rate[8]) == (y[7] - 6) / r + 0.99 * two
        yield c5 * (rate[7] - rate[8]) == y[8] / r


class RingModulator(Model):
    """Horneber (1976): a low frequency mixed with a high one by four diodes, with small parasitic capacitances."""

    u = Real(7, start=0.0, fixed=True, description="voltages of capacitors")
    i = Real(8, start=0.0, fixed=True, nominal=1e-3, description="currents of inductors")

    def equations(self):
        u, i = [None, *(self.u[k] for k in range(7))], [None, *(self.i[k] for k in range(8))]
        low, high = 0.5 * sin(2e3 * np.pi * time), 2 * sin(2e4 * np.pi * time)
        across = (u[3] - u[5] - u[7] - high, -u[4] + u[6] - u[7] - high)
        across += (u[4] + u[5] + u[7] + high, -u[3] - u[6] + u[7] + high)
        a, b, c, d = (40.67286402e-9 * (exp(17.7493332 * one) - 1) for one in across)
        charged = (
            (1.6e-8, i[1] - 0.5 * i[3] + 0.5 * i[4] + i[7] - u[1] / 25e3),
            (1.6e-8, i[2] - 0.5 * i[5] + 0.5 * i[6] + i[8] - u[2] / 25e3),
            (2e-12, i[3] - a + d), (2e-12, -i[4] + b - c), (2e-12, i[5] + a - c), (2e-12, -i[6] - b + d),
            (1e-8, -u[7] / 50 + a + b - c - d),
        )  # fmt: skip
        driven = (
            (4.45, -u[1]), (4.45, -u[2]),
            (5e-4, 0.5 * u[1] - u[3] - 17.3 * i[3]), (5e-4, -0.5 * u[1] + u[4] - 17.3 * i[4]),
            (5e-4, 0.5 * u[2] - u[5] - 17.3 * i[5]), (5e-4, -0.5 * u[2] + u[6] - 17.3 * i[6]),
            (2e-3, -u[1] + low - 86.3 * i[7]), (2e-3, -u[2] - 636.3 * i[8]),
        )  # fmt: skip
        yield from (C * der(self.u)[k] == current for k, (C, current) in enumerate(charged))
        yield from (L * der(self.i)[k] == voltage for k, (L, voltage) in enumerate(driven))
