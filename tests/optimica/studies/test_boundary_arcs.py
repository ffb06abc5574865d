"""Sensitivities of the objective where limits on states bind, against formulas."""

import pytest

from gantrytau import Fixed, Parameter, between
from gantrytau_optimica import Free, Optimization, final, initial, optimize, sensitivities
from tests.optimica.problems import Mass


class SpeedLimit(Optimization):
    """Rest to rest over 1 with |u| <= push and v <= most in v / u + 1 / v."""

    mass = Mass()
    most, push = Parameter(0.5), Parameter(1.0)
    final_time = Free(2.0, min=0.1, max=10.0)

    def objective(self):
        return self.final_time

    def constraints(self):
        yield between(-self.push, self.mass.u, self.push)
        yield self.mass.v <= self.most
        yield initial(self.mass.x) == 0
        yield initial(self.mass.v) == 0
        yield final(self.mass.x) == 1
        yield final(self.mass.v) == 0


@pytest.mark.parametrize("policy", [{}, {"elements": 47}, {"refine": 1e-6}, {"elements": 30, "refine": 1e-6}])
def test_the_least_time_under_a_limit_on_the_speed(policy, capfd):
    optimum = optimize(SpeedLimit, **policy)
    slopes = sensitivities(optimum, ["most", "push"]).objective
    assert slopes["most"] == pytest.approx(1 / 1 - 1 / 0.5**2, rel=1e-6)
    assert slopes["push"] == pytest.approx(-0.5, rel=1e-6)
    assert capfd.readouterr() == ("", "")  # linear algebra says nothing by itself


def test_a_boundary_arc_of_second_order():
    """Bryson and Denham (1963): 4 / (9 l), whose ends at 3 l and 1 - 3 l lie within elements."""

    class Bounce(Optimization):
        mass = Mass(x=Fixed(0.0), v=Fixed(1.0))
        limit = Parameter(1 / 9)
        final_time = 1.0

        def integrand(self):
            return self.mass.u**2 / 2

        def constraints(self):
            yield self.mass.x <= self.limit
            yield final(self.mass.x) == 0
            yield final(self.mass.v) == -1

    slopes = sensitivities(optimize(Bounce, elements=50), ["limit"]).objective
    assert slopes["limit"] == pytest.approx(-36.0, rel=1e-4)
