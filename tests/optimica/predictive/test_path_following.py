"""`Way` as the reference of an `Mpc`: its progress is a state that the controller chooses."""

from typing import Any

import casadi as ca
import numpy as np

from gantrytau import Bounds, Input, Model, Parameter, Real, der
from gantrytau_optimica import Mpc, Optimization, Path, Way

LIMIT = 0.5  # m/s


class Point(Model):
    """A mass without friction."""

    m = Parameter(1.0, unit="kg")
    r = Real(3, start=[0.0, 0.1, 0.0], unit="m")
    v = Real(3, start=0.0, unit="m/s")
    f = Input(3, unit="N", min=-5.0, max=5.0)

    def equations(self):
        yield der(self.r) == self.v
        yield self.m * der(self.v) == self.f


class Contouring(Optimization):
    """Along a line of 5 m as fast as 0.5 m/s allow."""

    point = Point()
    way: Any = Way(Path.line([0.0, 0.0, 0.0], [3.0, 4.0, 0.0]), s=dict(start=0.0), v=Bounds(0.0, LIMIT))
    given = ("point.f", "way.a")

    def integrand(self):
        contour, lag = self.way.errors(self.point.r)
        away = ca.sumsqr(contour) + lag**2
        return 1e2 * away - self.way.v + 1e-3 * (ca.sumsqr(self.point.f) + self.way.a**2)


def test_progress_along_a_line_runs_at_its_limit_without_errors():
    loop = Mpc(Contouring, period=0.05, elements=20).run(stop=3.0)
    assert set(loop.statuses) == {"solved"}
    line = np.array([0.6, 0.8, 0.0])
    across = loop["point.r"] - np.outer(loop["point.r"] @ line, line)
    lag = loop["way.s"] - loop["point.r"] @ line
    at_last = loop.time > 2.0
    # what is left of 0.1 m decays at a rate of several 1/s
    np.testing.assert_allclose(loop["way.v"][at_last], LIMIT, atol=1e-4)
    np.testing.assert_allclose(across[at_last], 0.0, atol=1e-4)
    np.testing.assert_allclose(lag[at_last], 0.0, atol=1e-4)
