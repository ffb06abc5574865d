"""The first plan of an `Mpc`: by Gauss-Newton's method, and by Ipopt where its full steps do not converge."""

import numpy as np
import pytest

from gantrytau import Input, Model, Real, between, cos, der, sin, time
from gantrytau_optimica import Mpc, Optimization, final
from tests.optimica.predictive.test_mpc import Upright

LEFT = 1e-4  # Gauss-Newton's method ends by changes of 1e-6, which shrink slowly


class Hanging(Model):
    """A pole on a cart, upright at 0, whose cart is too weak to lift it at once."""

    p, v, phi, w = Real(start=0.0), Real(start=0.0), Real(start=np.pi), Real(start=0.0)
    f = Input(min=-10.0, max=10.0)

    def equations(self):
        s, c = sin(self.phi), cos(self.phi)
        yield der(self.p) == self.v
        yield der(self.phi) == self.w
        yield der(self.v) * (1.0 + 0.1 * s**2) == self.f + 0.1 * s * (0.5 * self.w**2 - 9.81 * c)
        yield 0.5 * der(self.w) == 9.81 * s - der(self.v) * c


class SwingUp(Optimization):
    """Stand upright in the middle of a rail of 2 m."""

    pole = Hanging()

    def integrand(self):
        o = self.pole
        return o.p**2 + 10 * (1 - cos(o.phi)) + 0.1 * o.v**2 + 0.05 * o.w**2 + 0.005 * o.f**2

    def constraints(self):
        yield between(-1.0, self.pole.p, 1.0)


class Moving(Upright):
    """All that a horizon may have: a reference that moves, and a cost of the end."""

    def integrand(self):
        return super().integrand() + 5 * (self.pole.p - sin(time)) ** 2

    def objective(self):
        return 100 * final(self.pole.th) ** 2


@pytest.mark.parametrize(
    ("problem", "p", "keywords"),
    [
        (Upright, 0.3, {"terminal": "lqr"}),
        (Moving, 1.9, {"rates": {"pole.f": 100.0}, "step_penalty": {"pole.f": 0.01}, "blocks": 2}),
        (Moving, 0.3, {"disturbance": ["pole.f"], "hard": "all"}),
    ],
)
def test_ipopt_and_gauss_newton_find_the_same_plan(problem, p, keywords):
    mpc = Mpc(problem, period=0.05, elements=20, **keywords)
    first = mpc._first(np.array([p, 0.2, 0.0, 0.0]), 0.5)
    newton = mpc._newton.improved(first, mpc._newton.load(first), first.x[0], 50)
    whole = mpc._newton.globalised(first, first.x[0])
    assert newton.stands
    assert whole.stands
    for one, other in (
        (whole.plan.u, newton.plan.u),
        (whole.plan.w, newton.plan.w),
        (whole.slack, newton.slack),
    ):
        np.testing.assert_allclose(one, other, atol=LEFT)


def test_a_swing_up_is_planned_from_starts_everywhere():
    # 1 s: Gauss-Newton's full steps first, which do not converge from most of these
    mpc, rng = Mpc(SwingUp, period=0.05, elements=40, terminal="lqr"), np.random.default_rng(0)
    for _ in range(3):
        start = rng.uniform(-1.0, 1.0, 4) * [0.5, 1.0, np.pi, 3.0]
        mpc.reset()
        mpc.step(dict(zip(("pole.p", "pole.v", "pole.phi", "pole.w"), start.tolist(), strict=True)))
        assert mpc.status == "solved"
        assert (plan := mpc._plan)
        assert (loaded := mpc._newton.load(plan))
        assert loaded.missed < 1e-6  # a motion of the model
