"""Initial value problems of chemistry and vibration: test set for IVP solvers (Mazzia and Magherini, Bari)."""

from gantrytau import Model, Real, der


class Hires(Model):
    """High irradiance response of plants, Schaefer (1975): eight concentrations."""

    y = Real(8, start=[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0057], fixed=True, nominal=1e-3)

    def equations(self):
        a, b, c, d, e, f, g, h = (self.y[i] for i in range(8))
        together = 280 * f * h
        rates = (
            -1.71 * a + 0.43 * b + 8.32 * c + 0.0007,
            1.71 * a - 8.75 * b,
            -10.03 * c + 0.43 * d + 0.035 * e,
            8.32 * b + 1.71 * c - 1.12 * d,
            -1.745 * e + 0.43 * (f + g),
            -together + 0.69 * d + 1.71 * e - 0.43 * f + 0.69 * g,
            together - 1.81 * g,
            -together + 1.81 * g,
        )
        yield from (der(self.y)[i] == rate for i, rate in enumerate(rates))


class Robertson(Model):
    """Three reactions whose rates lie nine powers of ten apart, Robertson (1966)."""

    a, b = Real(start=1.0, fixed=True), Real(start=0.0, fixed=True, nominal=1e-5)
    c = Real(start=0.0, fixed=True)

    def equations(self):
        first, second, third = 0.04 * self.a, 3e7 * self.b**2, 1e4 * self.b * self.c
        yield der(self.a) == third - first
        yield der(self.b) == first - second - third
        yield der(self.c) == second


class Oregonator(Model):
    """The Belousov-Zhabotinskii reaction, Field and Noyes (1974): a limit cycle in sharp bursts."""

    a, b, c = Real(start=1.0, fixed=True), Real(start=2.0, fixed=True), Real(start=3.0, fixed=True)

    def equations(self):
        a, b, c = self.a, self.b, self.c
        yield der(a) == 77.27 * (b + a * (1 - 8.375e-6 * a - b))
        yield der(b) == (c - (1 + a) * b) / 77.27
        yield der(c) == 0.161 * (a - c)


class StiffVanDerPol(Model):
    """Van der Pol's oscillator with mu = 1000: slow slides and jumps."""

    x, v = Real(start=2.0, fixed=True), Real(start=0.0, fixed=True)

    def equations(self):
        yield der(self.x) == self.v
        yield der(self.v) == 1000 * (1 - self.x**2) * self.v - self.x


class Pollution(Model):
    """Air pollution at Delft, Verwer (1994): 25 reactions of 20 substances."""

    y = Real(20, start=[0, 0.2, 0, 0.04, 0, 0, 0.1, 0.3, 0.01, *(0.0,) * 7, 0.007, 0, 0, 0], fixed=True)

    def equations(self):
        y = [None, *(self.y[i] for i in range(20))]
        reactions = (  # rate, what reacts, what comes out of it
            (0.35, (1,), (2, 3)), (26.6, (2, 4), (1,)), (1.23e4, (5, 2), (6, 1)), (8.6e-4, (7,), (5, 5, 8)),
            (8.2e-4, (7,), (8,)), (1.5e4, (7, 6), (5, 8)), (1.3e-4, (9,), (5, 8, 10)), (2.4e4, (9, 6), (11,)),
            (1.65e4, (11, 2), (1, 10, 12)), (9e3, (11, 1), (13,)), (0.022, (13,), (11, 1)), (1.2e4, (10, 2), (14, 1)),
            (1.88, (14,), (7, 5)), (1.63e4, (1, 6), (15,)), (4.8e6, (3,), (4,)), (3.5e-4, (4,), (16,)),
            (0.0175, (4,), (3,)), (1e8, (16,), (6, 6)), (4.44e11, (16,), (3,)), (1240.0, (17, 6), (5, 18)),
            (2.1, (19,), (2,)), (5.78, (19,), (1, 3)), (0.0474, (1, 4), (19,)), (1780.0, (19, 1), (20,)),
            (3.12, (20,), (1, 19)),
        )  # fmt: skip
        rates = [0.0] * 21
        for constant, reactants, products in reactions:
            speed = constant
            for one in reactants:
                speed = speed * y[one]
            for one in reactants:
                rates[one] = rates[one] - speed
            for one in products:
                rates[one] = rates[one] + speed
        yield from (der(self.y)[i] == rates[i + 1] for i in range(20))
