"""Two axes whose masses and friction are known, driven on sums of sines: forces in closed form."""

from functools import cache

import numpy as np

from gantrytau import Input, Model, Parameter, Real, connect, der, tanh, translate
from gantrytau.dae import Dae
from gantrytau.mechanics.translational import Force, Mass
from gantrytau_optimica import MotionLog

TRUE = {
    "x.mass.m": 25.0,
    "y.mass.m": 18.0,
    "coulomb[0]": 12.0,
    "coulomb[1]": 8.0,
    "viscous[0]": 30.0,
    "viscous[1]": 45.0,
}
ROWS = 5000
T = 0.004 * np.arange(ROWS)


class Slide(Model):
    """A mass on a guideway, with its drive."""

    mass, drive = Mass(m=20.0), Force()
    f, s, v = Input(unit="N", start=0.0), Real(unit="m"), Real(unit="m/s")

    def equations(self):
        yield connect(self.drive.flange, self.mass.flange)
        yield self.drive.f == self.f
        yield self.s == self.mass.s
        yield self.v == self.mass.v


class Two(Model):
    """Two axes beside each other."""

    x, y = Slide(), Slide()


class Rubbed(Model):
    """An axis with friction of its own, smoothed near rest."""

    m = Parameter(20.0, unit="kg", min=0.0)
    f_c, f_v = Parameter(25.0, unit="N", min=0.0), Parameter(60.0, unit="kg/s", min=0.0)
    v_0 = Parameter(1e-3, unit="m/s")
    s, v, f = Real(unit="m"), Real(unit="m/s"), Input(unit="N", start=0.0)

    def equations(self):
        yield self.v == der(self.s)
        yield self.m * der(self.v) + self.f_c * tanh(self.v / self.v_0) + self.f_v * self.v == self.f


class Lone(Model):
    """One such axis."""

    x = Rubbed()


@cache
def two() -> Dae:
    """Two axes, translated once."""
    return translate(Two())


@cache
def motion() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """q, q', q'' (N, 2)."""
    random = np.random.default_rng(0)
    q, v, a = (np.zeros((ROWS, 2)) for _ in range(3))
    for i in (0, 1):
        for hertz in (0.23, 0.61, 1.13, 1.7):
            w, p = 2 * np.pi * hertz * random.uniform(0.9, 1.1), random.uniform(0, 6)
            A = 0.3 * random.uniform(0.3, 1) / hertz / 4
            q[:, i] += A * np.sin(w * T + p)
            v[:, i] += A * w * np.cos(w * T + p)
            a[:, i] -= A * w * w * np.sin(w * T + p)
    return q, v, a


def log(seed: int, force: float = 1.0, encoder: float = 0.0, extra: np.ndarray | float = 0.0) -> MotionLog:
    """A log with white noise of forces (N) and encoders (m), and forces that the model does not know."""
    q, v, a = motion()
    m, c, d = (np.array(list(TRUE.values()))[k : k + 2] for k in (0, 2, 4))
    noise = np.random.default_rng(seed).normal(size=(2, *q.shape))
    return MotionLog(T, q + encoder * noise[0], m * a + c * np.sign(v) + d * v + extra + force * noise[1])
